"""Three equal links that stand on a foot each, in its middle: the same friction in all directions,
one harmonic.

What touches the floor matters more than the gait: lying on its links this body gets 0.26, on feet
0.77. One foot holds while the other two are swung ahead.
"""

from colloc import Chain, Friction, Harmonic, Problem

PROBLEM = Problem(
    name="three_link_feet",
    body=Chain((1 / 3, 1 / 3, 1 / 3), feet=1),
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=1),
)
