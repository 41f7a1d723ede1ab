"""The gait by which three equal links climb a slope of one in ten at the least work of their
joints.

Distance is the climb along the slope, work that of the joints, against friction and the weight;
where the body points at the start is sought with the gait. The most efficient gait of the level,
put there, gets 0.087.
"""

from colloc import Harmonic, Problem, ellipse

PROBLEM = Problem(
    name="three_link_uphill",
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
    guess=ellipse(A0=0, A1=2.8, B1=1.3),
    grade=0.1,
)
