"""The smallest crawler: two links and one joint, which moves because backward sliding is harder
than forward sliding.

    angle = B1 sin(2 pi t)

One joint can only retrace its path. If reversed rates reverse the motion (mu_f = mu_b) it goes
nowhere, for any pacing and any delta: the scallop theorem (E. M. Purcell, Life at low Reynolds
number, 1977), and the problem is refused. With mu_b > mu_f opening and closing differ. The gait is
antipodal (angle(t + 1/2) = -angle(t)), so the second half cycle is the mirror image of the first
and net rotation vanishes.
"""

from colloc import Chain, Fourier, Friction, Harmonic, Problem

PROBLEM = Problem(
    name="two_link",
    body=Chain((0.5, 0.5)),
    friction=Friction(mu_t=1, mu_f=1, mu_b=5),
    gait=Harmonic(harmonics=1, symmetry="antipodal"),
    guess=Fourier([0.0], [[0.7]], [[0.0]]),
    delta=1e-4,
    intervals=24,
)
