"""First guesses; how far shapes may be enlarged: to the joint limit, or to where links touch."""

import numpy as np
import pytest

from colloc.gaits.guesses import SAFE, checked_member, largest_factor
from colloc.gaits.harmonic import Fourier, Harmonic, ellipse
from colloc.gaits.problem import Problem
from colloc.gaits.starts import latin_hypercube_gait
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth
from colloc.system.errors import ProblemError


def test_a_guess_on_the_bound_of_the_shape_speed_counts_as_moving():
    """Sampling cuts the corners of an optimum that lies there, and makes it a little slower."""
    guess = ellipse(0.0, 0.3, 0.2)
    for share in (1.01, 0.995, 0.98):
        stated = {"gait": Harmonic(1, "bilateral"), "smallest_shape_speed": guess.shape_speed}
        stated["smallest_shape_speed"] /= share
        if share > 0.99:
            assert Problem("small", guess, **stated).guess is guess
        else:
            with pytest.raises(ProblemError, match="guess hardly moves"):
                Problem("small", guess, **stated)


@pytest.mark.parametrize(
    ("width", "words"), [(0.0, "links cross each other"), (0.02, "links overlap")]
)
def test_it_is_said_when_a_guess_crosses_itself_most(width, words):
    """In the phases of its class, in which the first joint is bent most at 0."""
    body, wave = Chain(width=width), Fourier([1.9, 1.9], [[0.2], [0.2]], [[0.0], [0.8]])
    with pytest.raises(ProblemError, match=f"{words} at phase") as refused:
        Problem("crossed", wave, body, gait=Harmonic(1))
    phase = float(str(refused.value).rstrip(".").split()[-1])
    phases = np.append(phase, np.arange(400) / 400)
    depth = crossing_depth(body, checked_member(Harmonic(1), wave)[0].angles(phases))
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


@pytest.mark.parametrize(
    ("shape", "limit", "factor"),
    [
        ([0.0, 0.0], np.pi, np.inf),
        ([0.5, -0.25], 2.0, SAFE * 4.0),
        ([0.5, 0.5], np.pi, SAFE * 4 * np.pi / 3),  # the ends meet as a triangle, at 2 pi/3
    ],
)
def test_shapes_grow_to_the_joint_limit_or_to_where_links_touch(shape, limit, factor):
    grown = largest_factor(Chain(), limit, np.array(shape)[:, None])
    assert grown == pytest.approx(factor, rel=1e-6)
