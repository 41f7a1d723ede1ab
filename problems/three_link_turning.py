"""The gait of a three-link crawler that turns it by 30 degrees a period with the least work.

No symmetry closes the rotation here; the certificate compares the rotation of an independent replay
with what is asked for.
"""

import numpy as np

from colloc import Fourier, Friction, Harmonic, Problem

PROBLEM = Problem(
    name="three_link_turning",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=1, symmetry="none"),
    guess=Fourier(np.array([0.5, 0.5]), np.array([[1.0], [0.2]]), np.array([[0.0], [1.0]])),
    objective="turning",
    rotation=np.pi / 6,
)
