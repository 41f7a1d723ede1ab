"""Gaits that climb: on the level the most efficient one, on a slope one that none beside it betters by the replay."""

import numpy as np
import pytest

from colloc import (
    Chain,
    Fourier,
    FreePath,
    Friction,
    Harmonic,
    NotConvergedError,
    Problem,
    ProblemError,
    climbing_gait,
    ellipse,
)
from colloc.verification.slope import slope_motion

PROBLEM = Problem("climber", gait=Harmonic(1, "bilateral"), delta=1e-2, guess=ellipse(0, 2.8, 1.3))


def test_on_the_level_it_is_the_most_efficient_gait(three_link):
    found = climbing_gait(three_link.problem.with_(guess=three_link.gait), 0.0, starts=1)
    assert found.passed, str(found)
    assert found.value == pytest.approx(three_link.efficiency, rel=1e-4)
    assert abs(found.heading) < 1e-3


def test_no_gait_and_no_heading_beside_it_climbs_better():
    found = climbing_gait(PROBLEM, 0.1, starts=1)
    assert found.passed, str(found)
    gait, theta, rng = found.gait, found.heading - found.motion.course, np.random.default_rng(2)
    own = PROBLEM.gait
    for size in (0.03, 0.1):
        for _ in range(2):
            v = own.parameters(gait)
            moved = own.fourier(v - size * np.abs(rng.normal(size=v.size)) * np.sign(v), 2)  # folded links may not cross
            ran = slope_motion(Chain(), Friction(), moved, 1e-2, 0.1, theta=theta + size * rng.normal(), tolerance=1e-3)
            assert ran.climb[0] / ran.joint_work[0] < found.value
    level = slope_motion(Chain(), Friction(), PROBLEM.guess, 1e-2, 0.1, tolerance=1e-4)
    assert found.value > 1.05 * level.climb[0] / level.joint_work[0]


@pytest.mark.slow
def test_a_gait_without_symmetry_does_not_turn_in_a_period():
    free = PROBLEM.with_(
        gait=Harmonic(1), guess=Fourier([0.2, 0.3], [[1.3], [0.1]], [[0.1], [1.2]]), friction=Friction(3, 1, 2), delta=1e-3
    )
    found = climbing_gait(free, 0.1, starts=1)
    assert found.passed, str(found)
    assert abs(found.motion.turn) < 1e-5


def test_a_gait_goes_across_the_slope_if_it_is_asked_to():
    across = climbing_gait(PROBLEM.with_(gait=Harmonic(2, "bilateral")), 0.1, towards=np.pi / 2, starts=1)
    assert across.passed, str(across)
    assert abs(across.motion.climb[0]) < 1e-3 * across.way
    assert across.way == pytest.approx(across.motion.aside[0], rel=1e-6)
    assert 0 < across.heading < np.pi / 2  # it points uphill of where it goes
    assert across.motion.joint_work[0] == pytest.approx(across.motion.friction_work[0], abs=1e-4)


@pytest.mark.parametrize(
    ("changed", "grade", "said"),
    [
        ({"gait": FreePath()}, 0.1, "in a class Harmonic"),
        ({"objective": "speed"}, 0.1, "climb/work is maximised"),
        ({"torque_limit": 1.0}, 0.1, "climb/work is maximised"),
        ({}, 1.0, "slides down for ever"),
        ({}, -1.0, "grade must be"),
    ],
)
def test_what_cannot_be_asked_is_named(changed, grade, said):
    with pytest.raises(ProblemError, match=said):
        climbing_gait(PROBLEM.with_(**changed), grade)


def test_a_gait_that_shrinks_to_the_bound_says_so():
    small = PROBLEM.with_(smallest_shape_speed=1.5, guess=ellipse(1.0, 0.9, 1.3))
    found = climbing_gait(small, 0.0, starts=1)
    assert found.smallest
    assert "shrank to the bound smallest_shape_speed" in str(found)


def test_a_slope_that_no_start_climbs_is_said_so():
    with pytest.raises(NotConvergedError, match=r"no gait was found that climbs a grade of 0\.9"):
        climbing_gait(PROBLEM, 0.9, starts=1)
