"""Smooth body with two bending modes and equal friction in all directions: which gait is best?

A point of the body is at rest at nearly every instant, which takes more panels than a body has at
first; they are doubled until they no longer matter.
"""

from colloc import Friction, Harmonic, ModalBody, Problem

PROBLEM = Problem(
    name="smooth_isotropic",
    body=ModalBody(modes=2),
    friction=Friction(mu_t=1.0, mu_f=1.0, mu_b=1.0),
    gait=Harmonic(1, "antipodal"),
)
