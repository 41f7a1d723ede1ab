"""An inchworm: four links, of which the ends stand on a pair of feet each that slide forwards more
easily than backwards.

The links between are carried. Bending draws the hind feet up while the front ones hold; stretching
drives the front ones on.
"""

from colloc import Chain, Foot, Friction, Harmonic, Problem

PROBLEM = Problem(
    name="inchworm",
    body=Chain(
        (0.25, 0.25, 0.25, 0.25),
        feet=tuple(Foot(link, 0.5, 0.25, y) for link in (0, 3) for y in (-0.05, 0.05)),
    ),
    friction=Friction(mu_t=1, mu_f=1, mu_b=3),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
    joint_limit=1.5,
)
