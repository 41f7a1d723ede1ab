"""A snake of three equal links on a passive wheel each: it rolls along its links, and hardly slips
across them.

The wheels roll at a fiftieth of the friction that they have sideways. As that ratio falls the
motion tends to the kinematics of wheels that do not slip at all
(tests/mechanics/test_floor_contact.py).
"""

from colloc import Chain, Harmonic, Problem, Wheel

PROBLEM = Problem(
    name="wheeled_snake",
    body=Chain(
        (1 / 3, 1 / 3, 1 / 3),
        feet=tuple(Wheel(link, rolling=0.02, sideways=1.0) for link in range(3)),
    ),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
)
