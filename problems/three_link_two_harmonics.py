"""The isotropic three-link crawler, two harmonics, symmetric about angle 1 = -angle 2: past the
paper's best gait.

The paper's ellipses (one harmonic) end at 0.260; a second harmonic gives 0.351 in a small loop
about (1.87, -1.87). A large loop, next to the paper's, ends at 0.301.
"""

import numpy as np

from colloc import Fourier, Friction, Harmonic, Problem, Reference

PROBLEM = Problem(
    name="three_link_two_harmonics",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=2, symmetry="bilateral"),
    guess=Fourier(
        np.array([1.8, -1.8]),
        np.array([[0.3, -0.1], [-0.3, 0.1]]),
        np.array([[-0.4, -0.1], [-0.4, -0.1]]),
    ),
    delta=4e-4,
)

REFERENCE = Reference(0.3506, 0.001, "solved, and replayed on 3200 nodes")
