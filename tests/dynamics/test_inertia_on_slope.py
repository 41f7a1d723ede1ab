"""Gaits with inertia on a slope: against differences, the limits slow and level, and from rest."""

import numpy as np
import pytest

import colloc
from colloc.dynamics.control_problem import control_problem
from colloc.gaits.regime import Regime
from colloc.pictures.export import mjcf
from colloc.reduced.motion import ReducedMotion
from colloc.results.robot import joint_torques
from colloc.search.iterate import space_near
from tests.shared.inertia import played as with_inertia

LEANING = colloc.Fourier(mean=[0.3, -0.5], cos=[[1.17], [0.12]], sin=[[0.0], [-0.91]], theta=0.7)
BODY, FRICTION = colloc.Chain((0.3, 0.45, 0.25)), colloc.Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
DELTA = 1e-2


def problem(**fields):
    usual = {"gait": colloc.Harmonic(1), "grade": 0.2, "froude": 0.1, "delta": DELTA}
    usual |= {"body": BODY, "friction": FRICTION}
    return colloc.Problem("gliding", LEANING, **(usual | fields))


def motion_of(stated):
    space, v = space_near(stated, LEANING)
    return ReducedMotion(control_problem(stated).dynamics, space.mesh, space), v


def played(**slope):
    regime = Regime(**slope)
    return with_inertia(BODY, FRICTION, LEANING, DELTA, 0.1, tolerance=1e-6, regime=regime)


def test_a_collocated_period_is_the_one_that_is_followed_from_instant_to_instant():
    motion, v = motion_of(problem(towards=0.4, intervals=120))
    collocated, followed = motion.values(v, DELTA), played(grade=0.2, towards=0.4)
    for name in ("distance", "work", "rotation"):
        assert collocated[name] == pytest.approx(followed.values[name], abs=2e-5)


def test_slower_and_slower_it_is_the_slow_motion_on_a_slope_to_first_order():
    slow, off = motion_of(problem(froude=0.0)), []
    for froude in (4e-4, 2e-4):
        motion, v = motion_of(problem(froude=froude))
        off.append(motion.values(v, DELTA)["distance"] - slow[0].values(v, DELTA)["distance"])
    assert off[0] / off[1] == pytest.approx(2.0, abs=0.1)


def test_the_flatter_the_slope_the_nearer_it_is_to_the_level():
    level, flat = played(), played(grade=1e-9)
    assert flat.work == pytest.approx(level.work, rel=1e-5)
    assert np.hypot(*flat.states[4:6, -1]) == pytest.approx(level.distance, rel=1e-5)
    assert flat.states[3, -1] - flat.states[3, 0] == pytest.approx(level.rotation, abs=1e-5)


@pytest.fixture(scope="module")
def found():
    stated = problem(body=colloc.Chain(), friction=colloc.Friction(), grade=0.05, froude=0.03)
    return colloc.solve(stated, starts=1)


def test_a_gait_is_found_and_certified_and_kept(found, tmp_path):
    assert found.status == "solved", found.message
    assert {check.name for check in found.certificate.checks} >= {"stability", "net rotation"}
    read = colloc.load(colloc.save(found, tmp_path / "gliding.h5"))
    assert read.problem.regime == Regime(grade=0.05, froude=0.03)
    assert (read.certificate, read.gait.theta) == (found.certificate, found.gait.theta)


def test_from_rest_a_body_comes_to_the_same_periods(found):
    far = found.from_rest(np.linspace(0.0, 4.0, 400))
    last = far.centre[0, -1] - np.interp(3.0, far.t, far.centre[0])
    first = np.interp(1.0, far.t, far.centre[0])
    assert last == pytest.approx(found.distance, rel=0.05)
    assert abs(first - found.distance) > 2 * abs(last - found.distance)


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
