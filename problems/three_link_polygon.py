"""The isotropic three-link crawler on a polygon of free corners, symmetric about angle 1 = -angle
2.

The joints move at constant rates from corner to corner in the plane of the two joint angles. delta
is measured at unit shape speed. Small triangles reach 2/5 in the limit of no size
(docs/gait_classes.md): the lower bound on the path length, 2 pi smallest_shape_speed, is part of
the answer.
"""

import numpy as np

from colloc import Corners, Friction, Polygon, Problem

PROBLEM = Problem(
    name="three_link_polygon",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Polygon(corners=3, symmetry="bilateral"),
    guess=Corners(np.array([[2.0, 2.9, 2.0], [-2.0, -2.0, -2.9]])),
    delta=1e-4,
    intervals=24,
)
