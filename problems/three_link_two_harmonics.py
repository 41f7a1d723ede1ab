"""The isotropic three-link crawler, two harmonics, symmetric about angle 1 = -angle 2: past the paper's best gait.

The paper's ellipses (one harmonic) end at 0.260; a second harmonic gives 0.351.
"""

import numpy as np

from colloc import Fourier, Friction, Harmonic, Problem, Reference

PROBLEM = Problem(
    name="three_link_two_harmonics",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=2, symmetry="bilateral"),
    guess=Fourier(np.array([0.0, 0.0]), np.array([[2.5, 0.3], [-2.5, -0.3]]), np.array([[1.2, 0.2], [1.2, 0.2]])),
    delta=1e-4,
)

REFERENCE = Reference(0.3506, 0.001, "design notes, section 5: solved and replayed on 3200 nodes")
