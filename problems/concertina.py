"""The isotropic concertina crawler of the paper's figure 13, A to D (section VI); its motion is
prescribed.

A straight body forms a bump of arc length epsilon behind its middle (stage 1), passes it on to the
front (stage 2) and flattens it there (stage 3); the second half period is the mirror image,
Theta(s, t + 1/2) = -Theta(s, t). The paper states the shape in words; here it is

    Theta = a(t) odd(2 (s - c(t)) / epsilon),    odd(x) = -k x (1 - x^2)^3 on [-1, 1],  max odd = 1,

with a linear in time between 0 and `amplitude` in stages 1 and 3, and c linear from 1/2 - epsilon/2
to 1/2 + epsilon/2 in stage 2 (colloc.smooth.prescribed_body). As epsilon -> 0: d ~ epsilon,
W_inner ~ epsilon^2, W_outer/d -> 1, efficiency -> 1.

    python -m scripts.continue_epsilon
"""

from colloc import Concertina, Problem, Reference

PROBLEM = Problem("concertina", body=Concertina(epsilon=0.1, amplitude=1.3), delta=2.5e-5)
REFERENCE = Reference(
    0.862892,
    2e-6,
    "python -m scripts.continue_epsilon; as epsilon -> 0 it tends to the paper's bound, 1",
)
EPSILONS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
