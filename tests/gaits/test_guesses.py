"""How far shapes may be enlarged: up to the joint limit, or to where links touch, and no further."""

import numpy as np
import pytest

from colloc.gaits.guesses import SAFE, largest_factor
from colloc.gaits.harmonic import Harmonic, ellipse
from colloc.gaits.problem import Problem
from colloc.mechanics.chain import Chain
from colloc.system.errors import ProblemError

STRAIGHT = np.zeros((2, 1))


@pytest.mark.parametrize(("share", "moves"), [(1.01, True), (0.995, True), (0.98, False)])
def test_a_guess_on_the_bound_of_the_shape_speed_counts_as_moving(share, moves):
    """Sampling cuts the corners of an optimum that lies there, and makes it a little slower."""
    guess = ellipse(0.0, 0.3, 0.2)
    slowest = guess.shape_speed / share
    if moves:
        assert Problem("small", guess, gait=Harmonic(1, "bilateral"), smallest_shape_speed=slowest).guess is guess
    else:
        with pytest.raises(ProblemError, match="guess hardly moves"):
            Problem("small", guess, gait=Harmonic(1, "bilateral"), smallest_shape_speed=slowest)


def test_a_straight_body_may_be_enlarged_without_end():
    assert largest_factor(Chain(), np.pi, STRAIGHT) == np.inf


def test_shapes_whose_links_do_not_meet_end_at_the_joint_limit():
    assert largest_factor(Chain(), 2.0, np.array([[0.5], [-0.25]])) == pytest.approx(SAFE * 4.0)


def test_others_end_where_their_links_touch():
    """Equal links bent the same way: the ends meet as a triangle, at 2 pi/3."""
    assert largest_factor(Chain(), np.pi, np.array([[0.5], [0.5]])) == pytest.approx(SAFE * 4 * np.pi / 3, rel=1e-6)
