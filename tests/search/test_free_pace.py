"""The pace of a gait sought with it, against fixed paces; gaits with inertia on a slope."""

from dataclasses import replace

import numpy as np
import pytest

import colloc
from colloc.commands.solve import summary_lines
from colloc.gaits.regime import Regime
from colloc.pictures.export import mjcf
from colloc.reduced.motion import ReducedMotion
from colloc.reduced.program import ReducedProgram
from colloc.results.robot import joint_torques
from colloc.search.iterate import space_near
from colloc.search.optimise import optimise, project_to_zero_rotation
from colloc.search.options import FINE
from tests.shared.mechanics import with_inertia

ROUND, STANDING_POWER = colloc.ellipse(A0=0, A1=2.2, B1=1.3), "distance / (work + 0.1 * period)"
SKATING = colloc.Fourier(mean=[2.7, -2.7], cos=[[0.4], [0.0]], sin=[[0.0], [0.3]])
LEANING = colloc.Fourier(mean=[0.3, -0.5], cos=[[1.17], [0.12]], sin=[[0.0], [-0.91]], theta=0.7)
BODY, FRICTION = colloc.Chain((0.3, 0.45, 0.25)), colloc.Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
DELTA = 1e-2


def problem(froude, **fields):
    usual = {"gait": colloc.Harmonic(1, "antipodal"), "objective": STANDING_POWER}
    usual |= {"guess": ROUND, "delta": 1e-2}
    return colloc.Problem("free", froude=froude, **usual | fields)


def played(found):
    """The Froude number of a gait that is found."""
    return np.exp(-2 * found.gait.log_period)


def best(stated):
    """On the first mesh."""
    return optimise(*space_near(stated, stated.guess), stated.delta, FINE)


def test_the_best_pace_is_that_of_the_best_fixed_one():
    """Between slow, where standing takes most, and fast; there the value is stationary in it."""
    found = best(problem(colloc.Free(0.01, 1.0)))
    froude = played(found)
    assert found.optimal
    assert 0.011 < froude < 0.9
    values = [
        best(problem(froude * factor, guess=found.gait)).value
        for factor in (0.8, 1 / 1.01, 1.0, 1.01, 1.25)
    ]
    assert values[2] == pytest.approx(found.value, rel=1e-9)
    assert values[2] > max(values) - 1e-12
    assert abs(values[3] - values[1]) / (2e-2 * values[2]) < 1e-3


def test_a_start_of_a_robot_whose_period_is_sought_turns_no_longer():
    robot = colloc.Robot(length=0.6, mass=1.0, period=(1.0, 5.0), max_speed=4.0, idle_power=1.0)
    how = {"gait": colloc.Harmonic(1, "none"), "robot": robot}
    stated = colloc.Problem("robot", body=BODY, friction=FRICTION, **how)

    def turned(gait):
        path, law = colloc.Fourier(gait.mean, gait.cos, gait.sin), BODY.law(stated.friction)
        return abs(colloc.replay(BODY, law, path, 0.1, froude=stated.regime.froude).rotation)

    closed = project_to_zero_rotation(stated, LEANING, 0.1)
    assert turned(closed) < 1e-3 < turned(LEANING)


def test_inertia_alone_decides_the_pace_of_the_efficiency_where_sideways_friction_is_small():
    """Slower and faster the same gait does less for its work; so time needs no price."""
    law, free = colloc.Friction(mu_t=0.1), {"gait": colloc.Harmonic(1), "rotation": None}
    stated = problem(colloc.Free(0.02, 3.0), objective="efficiency", guess=SKATING, friction=law)
    found = best(stated.with_(intervals=20, **free))
    froude = played(found)
    assert found.optimal
    assert 0.03 < froude < 2.5
    at = colloc.Chain(), law, found.gait, 1e-2
    slower, own, faster = (with_inertia(*at, froude * by) for by in (0.7, 1, 1.4))
    assert own.efficiency > max(slower.efficiency, faster.efficiency)


@pytest.mark.slow
def test_it_is_certified_kept_and_told(tmp_path):
    found = colloc.solve(problem(colloc.Free(0.01, 1.0), mesh_tolerance=2e-4), starts=1)
    assert found.status == "solved", found.message
    # IPOPT confirms it, with the pace among its variables
    assert found.answer.program == found.problem.formulation
    # and played slowly its period costs as much
    stated, gait = found.problem, replace(found.gait, log_period=None)
    slow = colloc.replay(stated.body, stated.law, gait, found.delta_per_period)
    standing = 0.1 * np.exp(found.gait.log_period)
    value = slow.distance / (slow.work + standing)
    assert found.played_slowly == pytest.approx(value, rel=1e-5)
    kept = colloc.load(colloc.save(found, tmp_path / "free.h5"))
    assert kept.problem.froude == colloc.Free(0.01, 1.0)
    assert (kept.froude, kept.problem.hash) == (found.froude, found.problem.hash)
    assert f"  pace            Froude number {found.froude:.4g}" in summary_lines(kept, None)
    assert "best Froude number from 0.01 to 1" in "\n".join(summary_lines(kept, None, verbose=True))


def test_a_gait_is_played_at_the_pace_whose_period_it_says():
    """In units of sqrt(L/g): Fr = 1/T^2."""
    gait, stated = replace(ROUND, log_period=0.8), problem(colloc.Free(0.01, 1.0))
    assert stated.regime.at(gait).froude == pytest.approx(np.exp(-1.6))
    space, v = space_near(stated, gait)
    free = ReducedProgram(space, 1e-2).period(v)
    space, v = space_near(problem(np.exp(-1.6)), ROUND)
    fixed = ReducedProgram(space, 1e-2).period(v)
    assert free["period"] == pytest.approx(np.exp(0.8))
    with pytest.raises(colloc.ProblemError, match="does not say its pace"):
        stated.regime.at(ROUND)
    assert problem(0.3).regime.at(ROUND).froude == pytest.approx(0.3)
    # no slower than is allowed
    assert space_near(stated, replace(ROUND, log_period=9.0))[1][-1] == pytest.approx(np.log(10))
    for name in ("distance", "work"):
        assert free[name] == pytest.approx(fixed[name], rel=1e-9)


def test_speed_under_a_limit_of_power_takes_all_of_it():
    asked = {"objective": "distance / period", "at_least": {"0.1 - work / period": 0.0}}
    limited = best(problem(colloc.Free(0.001, 1.0), **asked))
    period = limited.program().period(limited.v)
    assert limited.optimal
    assert period["work"] / period["period"] == pytest.approx(0.1, rel=1e-6)
    assert 0.001 < played(limited) < 1.0


def uphill(**fields):
    usual = {"gait": colloc.Harmonic(1), "grade": 0.2, "froude": 0.1, "delta": DELTA}
    usual |= {"body": BODY, "friction": FRICTION}
    return colloc.Problem("gliding", LEANING, **(usual | fields))


def replayed(**slope):
    regime = Regime(**slope)
    return with_inertia(BODY, FRICTION, LEANING, DELTA, 0.1, tolerance=1e-6, regime=regime)


def test_a_collocated_period_is_the_one_that_is_followed_from_instant_to_instant():
    space, v = space_near(uphill(towards=0.4, intervals=120), LEANING)
    collocated = ReducedMotion(space.control.dynamics, space.mesh, space).values(v, DELTA)
    followed = replayed(grade=0.2, towards=0.4)
    for name in ("distance", "work", "rotation"):
        assert collocated[name] == pytest.approx(followed.values[name], abs=2e-5)


def test_the_flatter_the_slope_the_nearer_it_is_to_the_level():
    level, flat = replayed(), replayed(grade=1e-9)
    assert flat.work == pytest.approx(level.work, rel=1e-5)
    assert np.hypot(*flat.states[4:6, -1]) == pytest.approx(level.distance, rel=1e-5)
    assert flat.states[3, -1] - flat.states[3, 0] == pytest.approx(level.rotation, abs=1e-5)


@pytest.fixture(scope="module")
def found():
    at = {"grade": 0.05, "froude": 0.03, "mesh_tolerance": 1e-3}
    return colloc.solve(uphill(body=colloc.Chain(), friction=colloc.Friction(), **at), starts=1)


def test_a_gait_is_found_and_certified_and_kept(found, tmp_path):
    assert found.status == "solved", found.message
    assert {check.name for check in found.certificate.checks} >= {"stability", "net rotation"}
    begun = found.from_rest(np.array([0.0, 3.0, 4.0]))
    assert begun.theta[0] == pytest.approx(found.gait.theta)
    assert np.diff(begun.centre[0])[1] == pytest.approx(found.distance, rel=0.02)
    read = colloc.load(colloc.save(found, tmp_path / "gliding.h5"))
    assert read.problem.regime == Regime(grade=0.05, froude=0.03)
    assert (read.certificate, read.gait.theta) == (found.certificate, found.gait.theta)


@pytest.fixture(scope="module")
def slow():
    asked = {"gait": colloc.Harmonic(1, "bilateral"), "grade": 0.1, "mesh_tolerance": 3e-4}
    return colloc.solve(colloc.Problem("uphill", delta=DELTA, **asked), starts=1)


@pytest.mark.parametrize("which", ["found", pytest.param("slow", marks=pytest.mark.slow)])
def test_torques_of_a_robot_lift_its_weight_too(which, request):
    solution, t = request.getfixturevalue(which), np.linspace(0.0, 1.0, 801)[:-1]
    power = (joint_torques(solution, t) * solution.gait(t)[1]).sum(axis=0)
    assert power.mean() == pytest.approx(solution.work, rel=1e-3)
    grade, cosine = solution.problem.grade, np.cos(np.arctan(solution.problem.grade))
    pace = solution.froude or 1e-6  # so slow that inertia takes nothing
    robot = solution.robot(length=1.0, mass=2.0, period=(1.0 / (9.81 * cosine * pace)) ** 0.5)
    work = 2.0 * 9.81 * cosine * solution.work
    assert robot.facts["work_per_period_J"] == pytest.approx(work, rel=1e-4)
    x, y, z = (float(part) for part in mjcf(robot).split('gravity="')[1].split('"')[0].split())
    assert np.hypot(x, y) / abs(z) == pytest.approx(grade)
    assert np.hypot(np.hypot(x, y), z) == pytest.approx(9.81)
