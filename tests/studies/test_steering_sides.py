"""Which side a turn is taken from: right from the mirror image of left, unless limits differ
between the sides."""

import numpy as np

from colloc import Friction, Harmonic, Problem, steer

AT = {"friction": Friction(mu_t=4, mu_f=1, mu_b=1), "delta": 1e-2, "mesh_tolerance": 1e-3}
PROBLEM = Problem("p", gait=Harmonic(1, "bilateral"), **AT)
TURN = 0.15
T = np.linspace(0, 1, 40)


def test_a_turn_to_the_right_is_sought_from_the_mirror_image_of_that_to_the_left():
    family = steer(PROBLEM, [-TURN, TURN], starts=1)
    right, left = family.points
    assert family.certified
    np.testing.assert_allclose(right.problem.guess.angles(T), -left.gait.angles(T), atol=1e-12)
    np.testing.assert_allclose([right.rotation, left.rotation], [-TURN, TURN], atol=1e-4)


def test_with_one_sided_limits_both_sides_are_sought_from_the_straight_gait_and_keep_them():
    """The mirror image of a gait within (-1.5, 2.6) need not be within it."""
    limits = ((-1.5, 2.6), (-1.5, 2.6))
    straight = []
    problem = Problem("p", joint_limit=limits, gait=Harmonic(1), **AT)
    family = steer(
        problem,
        [-TURN, TURN],
        starts=2,
        progress=lambda turn, point: straight.append(point) if turn == 0 else None,
    )
    assert family.certified
    begun = straight[0].gait.angles(T)
    for point in family.points:
        np.testing.assert_allclose(point.problem.guess.angles(T), begun, atol=1e-12)
        angles = point.gait.angles(np.linspace(0, 1, 400))
        assert angles.min() > -1.5 - 1e-6
        assert angles.max() < 2.6 + 1e-6
    right, left = family.points
    assert np.sign([right.rotation, left.rotation]).tolist() == [-1, 1]
