"""Rows that follow the worst instants of whatever gait they are asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from colloc import Chain, Friction, Harmonic, Problem
from colloc.gaits.starts import latin_hypercube_gait
from colloc.reduced.program import ReducedProgram
from colloc.search import optimise as converge
from colloc.search.iterate import space_near
from colloc.search.optimise import solve_subproblems
from colloc.search.options import FINE, OPTIONS

BODIES = {
    "none": Chain((0.3, 0.2, 0.15, 0.35)),
    "bilateral": Chain((0.3, 0.2, 0.2, 0.3)),
    "antipodal": Chain(),
}


@pytest.fixture(params=BODIES)
def placed(request):
    """A space with its checks placed for a gait that touches its limit, and a gait near it whose
    worst instants are others."""
    free = Problem("follow", body=BODIES[request.param], gait=Harmonic(3, request.param))
    gait = latin_hypercube_gait(free, 0, 2)
    limit = float(np.abs(gait.angles(np.linspace(0, 1, 1000))).max())
    space, v = space_near(free.with_(joint_limit=limit + 1e-4, guess=gait), gait)
    return space, v, v + 0.01 * np.random.default_rng(1).standard_normal(v.size)


def names(constraints):
    return [(kind, int(cell)) for kind, cells in constraints.kinds.items() for cell in cells]


def test_rows_near_their_bounds_are_those_of_the_worst_instants_of_any_gait(placed):
    """Held rows are off by what is of second order in the step; rows that are far from their bounds
    are not followed."""
    space, v, near = placed
    held, there = space.constraints(v), space.constraints(near)
    moving = dict(zip(names(held), held.following().values(near), strict=True))
    anew = dict(zip(names(there), there.values(near), strict=True))
    before = {
        name: abs(value - anew[name])
        for name, value in zip(names(held), held.values(near), strict=True)
        if name in anew
    }
    after = {name: abs(moving[name] - anew[name]) for name in before}
    assert all(after[name] <= before[name] + 1e-12 for name in after)
    followed = [name for name in after if before[name] - after[name] > 1e-12]  # more than rounding
    assert max(before[name] for name in followed) > 1e-5
    assert max(after[name] for name in followed) < 1e-9


def test_their_slopes_are_those_of_the_rows_that_move(placed):
    space, v, near = placed
    moving = space.constraints(v).following()
    slopes, step = moving.slopes(near), 1e-6
    for direction in np.random.default_rng(2).standard_normal((3, near.size)):
        along = (
            moving.values(near + step * direction) - moving.values(near - step * direction)
        ) / (2 * step)
        np.testing.assert_allclose(
            slopes @ direction, along, atol=2e-6 * np.abs(slopes).max() + 2e-6
        )


@pytest.mark.parametrize("follows", [True, False])
def test_a_gait_comes_to_rest_at_limits_that_it_touches_for_an_instant(follows, monkeypatch):
    """With the instants held it swings: every round is optimal for the instants of the one
    before."""
    if not follows:
        monkeypatch.setattr(ReducedProgram, "follow_worst", lambda held: None)
    monkeypatch.setattr(converge, "OPTIONS", replace(OPTIONS, radius=0.5))
    body, friction = Chain((0.25, 0.25, 0.25, 0.25)), Friction(mu_t=0.4, mu_f=1, mu_b=1)
    problem = Problem(
        "touch", body=body, friction=friction, gait=Harmonic(4), joint_limit=2.5, intervals=20
    )
    space, v = space_near(problem, latin_hypercube_gait(problem, 0, 0))
    conditions = solve_subproblems(ReducedProgram(space, 0.02), v, FINE).conditions
    assert (max(conditions.kkt_error, conditions.violation) < 1e-6) == follows
