"""The isotropic four-link crawler, one harmonic, bilateral: angle_j(-t) = -angle_(4-j)(t).

    angle 1 =  a0 + a1 cos(2 pi t) + b1 sin(2 pi t)
    angle 2 =                        b2 sin(2 pi t)
    angle 3 = -a0 - a1 cos(2 pi t) + b1 sin(2 pi t)

Maximise d/W. Links 1 and 4 are kept from crossing once a gait is found in which they do
(`search.optimise`). There are many local optima (0.160 from a guess that waves both ends up); from
this guess, one of six random starts, the best one known.
"""

from colloc import Chain, Fourier, Friction, Harmonic, Problem

PROBLEM = Problem(
    name="four_link",
    body=Chain((1 / 4,) * 4),
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
    guess=Fourier([1.0, 0.0, -1.0], [[0.2], [0.0], [-0.2]], [[1.2], [-0.4], [1.2]]),
    delta=1e-4,
    intervals=24,
)
