"""How far shapes may be enlarged: up to the joint limit, or to where links touch, and no
further."""

import numpy as np
import pytest

from colloc.gaits.guesses import SAFE, checked_member, largest_factor
from colloc.gaits.harmonic import Fourier, Harmonic, ellipse
from colloc.gaits.problem import Problem
from colloc.gaits.starts import latin_hypercube_gait
from colloc.mechanics.chain import Chain
from colloc.system.errors import ProblemError

STRAIGHT = np.zeros((2, 1))


@pytest.mark.parametrize(("share", "moves"), [(1.01, True), (0.995, True), (0.98, False)])
def test_a_guess_on_the_bound_of_the_shape_speed_counts_as_moving(share, moves):
    """Sampling cuts the corners of an optimum that lies there, and makes it a little slower."""
    guess = ellipse(0.0, 0.3, 0.2)
    slowest = guess.shape_speed / share
    if moves:
        assert (
            Problem(
                "small", guess, gait=Harmonic(1, "bilateral"), smallest_shape_speed=slowest
            ).guess
            is guess
        )
    else:
        with pytest.raises(ProblemError, match="guess hardly moves"):
            Problem("small", guess, gait=Harmonic(1, "bilateral"), smallest_shape_speed=slowest)


@pytest.mark.parametrize(
    ("width", "words"), [(0.0, "links cross each other"), (0.02, "links overlap")]
)
def test_it_is_said_when_a_guess_crosses_itself_most(width, words):
    """In the phases of its class, in which the first joint is bent most at 0."""
    body, wave = (
        Chain(width=width),
        Fourier(np.full(2, 1.9), np.array([[0.2], [0.2]]), np.array([[0.0], [0.8]])),
    )
    with pytest.raises(ProblemError, match=f"{words} at phase") as refused:
        Problem("crossed", wave, body, gait=Harmonic(1))
    phase = float(str(refused.value).rstrip(".").split()[-1])
    depth = body.crossing_depth(
        checked_member(Harmonic(1), wave)[0].angles(np.append(phase, np.arange(400) / 400))
    )
    assert 0.05 < phase < 0.4
    assert depth[0] == pytest.approx(depth.max(), rel=1e-3)


@pytest.mark.parametrize(
    "asked",
    [
        {"smallest_shape_speed": 1.6},
        {"joint_limit": (0.1, 1.5)},
        {"joint_limit": ((-0.1, 1.5), 1.5)},
    ],
)
def test_without_a_guess_a_search_begins_where_the_body_moves_enough(asked):
    """Larger than usual, and each joint as far as its own limit lets it."""
    problem = Problem("fast", gait=Harmonic(1), **asked)
    assert problem.guess.shape_speed > problem.smallest_shape_speed
    assert latin_hypercube_gait(problem, 0, 0).shape_speed > problem.smallest_shape_speed


def test_where_no_wave_moves_enough_the_limit_that_is_in_the_way_is_named():
    with pytest.raises(ProblemError, match="with joint_limit the usual first gait"):
        Problem("stiff", gait=Harmonic(1), joint_limit=0.05)


def test_a_straight_body_may_be_enlarged_without_end():
    assert largest_factor(Chain(), np.pi, STRAIGHT) == np.inf


def test_shapes_whose_links_do_not_meet_end_at_the_joint_limit():
    assert largest_factor(Chain(), 2.0, np.array([[0.5], [-0.25]])) == pytest.approx(SAFE * 4.0)


def test_others_end_where_their_links_touch():
    """Equal links bent the same way: the ends meet as a triangle, at 2 pi/3."""
    assert largest_factor(Chain(), np.pi, np.array([[0.5], [0.5]])) == pytest.approx(
        SAFE * 4 * np.pi / 3, rel=1e-6
    )
