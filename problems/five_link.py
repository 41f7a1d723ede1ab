"""The isotropic five-link crawler, one harmonic, bilateral: angle_j(-t) = -angle_(5-j)(t).

    angle 1 =  a0 + a1 cos(2 pi t) + b1 sin(2 pi t)
    angle 2 =  c0 + c1 cos(2 pi t) + d1 sin(2 pi t)
    angle 3 = -c0 - c1 cos(2 pi t) + d1 sin(2 pi t)
    angle 4 = -a0 - a1 cos(2 pi t) + b1 sin(2 pi t)

Maximise d/W.
"""

from colloc import Chain, Fourier, Friction, Harmonic, Problem

PROBLEM = Problem(
    name="five_link",
    body=Chain((1 / 5,) * 5),
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
    guess=Fourier([0.0] * 4, [[1.0], [0.5], [-0.5], [-1.0]], [[0.3], [0.8], [0.8], [0.3]]),
    delta=1e-4,
    intervals=24,
)
