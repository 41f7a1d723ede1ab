"""The isotropic four-link crawler with a weak motor in its middle joint.

The gait of problems/four_link.py needs a torque of 0.0655 weight x length there; this motor has
0.045. The limit is kept at all instants, also between the nodes, and checked by the replay
(docs/howto/motors.md).
"""

from colloc import Chain, Fourier, Friction, Harmonic, Problem

PROBLEM = Problem(
    name="four_link_weak_joint",
    body=Chain((1 / 4,) * 4),
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
    guess=Fourier([1.0, 0.0, -1.0], [[0.2], [0.0], [-0.2]], [[1.2], [-0.4], [1.2]]),
    torque_limit=(0.1, 0.045, 0.1),
)
STARTS = 1  # the optimum that this guess leads to
