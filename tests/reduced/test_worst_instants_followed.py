"""Rows that follow the worst instants of whatever gait they are asked for."""

from __future__ import annotations

import numpy as np
import pytest

from colloc import Chain, FreePath, Friction, Harmonic, Polygon, Problem
from colloc.gaits.starts import latin_hypercube_gait
from colloc.reduced.harmonic_space import HarmonicSpace
from colloc.reduced.program import ReducedProgram
from colloc.reduced.spaces import space_near
from colloc.search.reduced_search import FINE, at_rest

CLASSES = [Harmonic(3), FreePath(4.0), Polygon(6)]
PROBLEMS = [Problem("follow", body=Chain((0.3, 0.2, 0.15, 0.35)), gait=gait, joint_limit=1.2) for gait in CLASSES]


@pytest.fixture(params=PROBLEMS, ids=lambda p: type(p.gait).__name__)
def placed(request):
    """A space with its checks placed for a gait, and a gait near it whose worst instants are others."""
    space, v = space_near(request.param, latin_hypercube_gait(request.param, 0, 2))
    space.move_checks(v)
    step = 0.02 * np.random.default_rng(1).standard_normal(v.size)
    return space, v, v + step


def worst(space, v):
    """Rows as they are when the checks are placed anew, by name."""
    space.move_checks(v)
    return names(space), space.rows(v)


def names(space):
    return [(kind, int(cell)) for kind, cells in space.watched.items() for cell in cells]


def test_rows_are_those_of_the_worst_instants_of_any_gait(placed):
    """Where these are not on the edge of a cell; held rows are lower there by what is of second order in the step."""
    space, _, near = placed
    here, held = names(space), space.rows(near)
    space.follow_worst()
    moving = dict(zip(here, space.rows(near), strict=True))
    anew = dict(zip(*worst(space, near), strict=True))
    common = [name for name in here if name in anew]
    off = np.array([abs(moving[name] - anew[name]) for name in common])
    before = np.array([abs(value - anew[name]) for name, value in zip(here, held, strict=True) if name in anew])
    moved = before > 1e-6
    assert (off <= before + 1e-12).all()
    if isinstance(space.problem.gait, Harmonic):
        assert moved.any()
        assert np.median(off[moved]) < 1e-9


def test_their_slopes_are_those_of_the_rows_that_move(placed):
    space, _, near = placed
    space.follow_worst()
    slopes, step = space.row_slopes(near), 1e-6
    for direction in np.random.default_rng(2).standard_normal((3, near.size)):
        along = (space.rows(near + step * direction) - space.rows(near - step * direction)) / (2 * step)
        np.testing.assert_allclose(slopes @ direction, along, atol=2e-6 * np.abs(slopes).max() + 2e-6)


def test_placing_the_checks_anew_ends_it(placed):
    space, v, near = placed
    held = space.rows(near)
    space.follow_worst()
    space.rows(near)
    space.move_checks(v)
    np.testing.assert_array_equal(space.rows(near), held)


@pytest.mark.parametrize("follows", [True, False])
def test_a_gait_comes_to_rest_at_limits_that_it_touches_for_an_instant(follows, monkeypatch):
    """With the instants held it swings: every round is optimal for the instants of the one before."""
    if not follows:
        monkeypatch.setattr(HarmonicSpace, "follow_worst", lambda space: None)
    body, friction = Chain((0.25, 0.25, 0.25, 0.25)), Friction(0.4, 1, 1)
    problem = Problem("touch", body=body, friction=friction, gait=Harmonic(4), joint_limit=2.5, intervals=20)
    space, v = space_near(problem, latin_hypercube_gait(problem, 0, 0))
    conditions = at_rest(ReducedProgram(space, 0.02), v, 0.5, FINE).conditions
    assert (max(conditions.kkt_error, conditions.violation) < 1e-6) == follows
