"""Relaxed gaits as a program: exact slopes, and a mixture of one direction is a polygon."""

import numpy as np
import pytest

from colloc import Chain, Friction, Problem, Relaxed, replay
from colloc.gaits.control_problem import control_problem
from colloc.mechanics.densities import LENGTH
from colloc.motion.kinds import SlowOnLevel
from colloc.reduced.mixture_space import MixtureSpace
from colloc.reduced.motion import ReducedMotion
from colloc.reduced.program import ReducedProgram

DELTA = 0.05


def begun(symmetry, links=3, directions=3, pieces=5, far=()):
    """A program near a wave, moved a little."""
    problem = Problem(
        "relaxed",
        body=Chain((1 / links,) * links),
        friction=Friction(mu_t=1.5, mu_f=1, mu_b=1.2),
        gait=Relaxed(directions, symmetry),
        joint_limit=2.0,
    )
    space = MixtureSpace(control_problem(problem), pieces, far)
    v = space.parameters(problem.guess) + 0.1 * np.random.default_rng(1).standard_normal(space.n)
    v[space.time] = np.abs(v[space.time])
    return space, v


@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal", "both"])
@pytest.mark.parametrize(("links", "far"), [(3, ()), (4, ((0, 3),))])
def test_slopes_of_what_a_period_comes_to_and_of_rows_are_those_of_differences(symmetry, links, far):
    space, v = begun(symmetry, links, far=far)
    program, h = ReducedProgram(space, DELTA), 1e-6
    kind = SlowOnLevel(*space.control.dynamics[:2], symmetry)
    program.motion = ReducedMotion(kind, space.mesh, space, [LENGTH])
    asked = space.constraints(v)
    slopes, rows = program.motion.gradients(v, DELTA), asked.slopes(v)
    for k in np.random.default_rng(2).choice(space.n, 8, replace=False):
        step = np.zeros(space.n)
        step[k] = h
        up, down = (program.motion.values(v + side * step, DELTA) for side in (1, -1))
        assert list(slopes) == list(up) == ["distance", "work", "rotation", "length"]
        for name, slope in slopes.items():
            assert np.allclose(slope[k], (up[name] - down[name]) / (2 * h), atol=1e-7), name
        assert np.allclose(rows[:, k], (asked.values(v + step) - asked.values(v - step)) / (2 * h), atol=2e-8)


@pytest.mark.parametrize("symmetry", ["bilateral", "both"])
def test_a_mixture_of_one_direction_is_a_polygon(symmetry):
    space, v = begun(symmetry, directions=1, pieces=8)
    # close the path: the last piece goes where the symmetry wants it to end
    gait = space.member(v)
    start, end = 0.5 * (gait.start - gait.start[::-1]), gait.shapes[:, -2]
    wanted = 0.5 * (end - end[::-1]) if symmetry == "bilateral" else 0.5 * (end + end[::-1])
    step = wanted - end - (start - gait.start)
    v[:2], v[space.time.stop - 1], v[-1] = start, np.linalg.norm(step), np.arctan2(step[1], step[0])
    end = space.member(v).shapes[:, -1]
    assert np.allclose(end, -end[::-1] if symmetry == "bilateral" else end[::-1], atol=1e-12)
    polygon, problem = space.member(v).realised(1), space.control.problem
    replayed = replay(
        problem.body, problem.friction, lambda t: (polygon.angles(t), polygon.rates(t)), DELTA * polygon.length,
        breaks=np.setdiff1d(np.concatenate([polygon.phases, 1 - polygon.phases]), [0.0, 1.0]),
    )  # fmt: skip
    fine = MixtureSpace(control_problem(problem), 60)  # the same gait on a finer mesh
    v = fine.parameters(space.member(v).split(60))
    program = ReducedProgram(fine, DELTA)
    assert -program.objective(v) == pytest.approx(replayed.efficiency, rel=1e-5)
    assert program.motion.values(v, DELTA)["distance"] == pytest.approx(replayed.distance, rel=1e-5)


def test_a_gait_beyond_its_limits_is_seen_between_the_pieces_too():
    space, v = begun("bilateral")
    v[:2] = 1.9, -1.9
    excess = space.constraints(v).excess
    angles = space.member(v).angles(np.linspace(0, 1, 4001))
    assert excess == pytest.approx(np.abs(angles).max() - 2.0, abs=1e-3)
