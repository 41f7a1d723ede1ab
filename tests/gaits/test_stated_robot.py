"""A robot in SI units is a problem without dimensions; what it says follows every change of it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import colloc
from colloc import Chain, Free, Harmonic, Problem, Robot
from colloc.gaits.parameters import parameters
from colloc.mechanics.densities import Instants
from colloc.results.comparison import compare
from colloc.results.robot import in_si, limit_lines
from colloc.studies.families import ParetoFront

SNAKE = Robot(length=0.62, mass=0.9, period=2.5, max_speed=5, max_torque=(1.2, 1.0), idle_power=2)
SLOW = Robot(length=0.62, mass=0.9, period=600, idle_power=0.01, max_speed=0.05)


def test_the_numbers_of_a_problem_follow_from_the_robot():
    problem = Problem("snake", robot=SNAKE)
    weight = 0.9 * 9.81
    assert problem.froude == pytest.approx(0.62 / (9.81 * 2.5**2))
    assert problem.speed_limit == pytest.approx(12.5)
    np.testing.assert_allclose(problem.torque_limit, np.array([1.2, 1.0]) / (weight * 0.62))
    period = {"distance": 0.2, "work": 0.5, "driven_work": 0.6}
    energy = 0.6 * weight * 0.62 + 2 * 2.5  # J, for 0.2 body lengths
    assert problem.objective(period) == pytest.approx(0.2 * 0.62 / energy * weight)


def test_on_a_slope_that_part_of_gravity_counts_which_presses(unsolved):
    level, slope = (Problem("on", robot=SNAKE, grade=grade) for grade in (0.0, 0.75))
    assert slope.froude == pytest.approx(level.froude * 1.25)
    np.testing.assert_allclose(slope.torque_limit, 1.25 * np.array(level.torque_limit))
    sought = replace(SNAKE, period=(1.0, 9.0), max_torque=None)
    level, slope = (Problem("on", robot=sought, grade=grade) for grade in (0.0, 0.75))
    (speed,), (uphill,) = level.path_limits.each, slope.path_limits.each
    assert speed.most == pytest.approx((5 * (0.62 / 9.81) ** 0.5,) * 2)
    assert uphill.most == pytest.approx(np.multiply(speed.most, 1.25**0.5))
    assert slope.without_robot.path_limits == slope.path_limits
    gait = colloc.Fourier([0.0, 0.0], [[1.2], [0.0]], [[0.0], [0.8]], theta=0.3, log_period=2.0)
    found = unsolved(slope.with_(guess=gait, gait=Harmonic(1), delta=1e-2))
    period = np.exp(2.0) * (0.62 / (0.8 * 9.81)) ** 0.5
    assert found.robot().period == pytest.approx(period)
    share = 100 * 1.2 * 2 * np.pi / period / 5
    assert f"joint speed of the robot {share:.0f} % of 5 rad/s" in limit_lines(found)[0]
    rates = gait.rates(np.zeros(1))
    now = Instants(slope.body, slope.law, *gait(np.zeros(1)), 1e-2, froude=found.froude)
    np.testing.assert_allclose(uphill.at(now), rates / period / 5)


def test_what_follows_from_the_robot_is_neither_stated_nor_saved_beside_it():
    problem = Problem("snake", robot=SNAKE, objective="efficiency")
    again = Problem.from_dict(problem.to_dict())
    assert again.hash == problem.hash
    assert again.objective == colloc.Objective("efficiency")
    assert again.robot == SNAKE
    assert not {"froude", "speed_limit", "torque_limit"} & problem.to_dict().keys()
    faster = problem.with_(robot=replace(SNAKE, period=1.25))
    assert faster.froude == pytest.approx(4 * problem.froude)
    numbers = {each.name: each for each in parameters(problem)}
    assert numbers["Froude number"].changed(0.1).froude == pytest.approx(1.1 * problem.froude)
    battery = problem.with_(objective=None, robot=replace(SNAKE, idle_power=0.0))
    assert battery.objective.name == "driven efficiency"


def test_inertia_counts_from_a_thousandth_of_friction_on():
    """A robot of 0.62 m that takes ten minutes is slow (docs/howto/pace.md)."""
    assert Problem("slow", robot=SLOW).froude == 0
    assert Problem("quick", robot=replace(SLOW, period=7.0, max_speed=None)).froude > 0
    free = Problem("free", robot=replace(SLOW, period=(5.0, 10.0), max_speed=None))
    assert free.froude == pytest.approx(Free(0.62 / 9.81 / 100, 0.62 / 9.81 / 25))
    assert "period" in free.objective.uses


def test_electronics_draw_as_much_in_a_period_that_is_sought_as_in_one_that_is_stated():
    times = {"fixed": 7.0, "free": (5.0, 10.0)}
    robots = {name: replace(SLOW, period=time, max_speed=None) for name, time in times.items()}
    fixed, free = (Problem(name, robot=robot).objective for name, robot in robots.items())
    period = {"distance": 0.2, "driven_work": 0.6, "period": 7.0 / (0.62 / 9.81) ** 0.5}
    assert free(period) == pytest.approx(fixed(period), rel=1e-12)


@pytest.fixture(scope="module")
def slow_robot(once):
    body = Chain((0.2, 0.3, 0.3, 0.2))
    problem = Problem("slow", body=body, gait=Harmonic(1, "antipodal"), robot=SLOW, delta=1e-2)
    return once("slow robot", lambda: colloc.solve(problem, starts=1))


def whoever_speaks_of_it_says_the_same(found, tmp_path):
    """How fast a robot is and what it draws, by its sheet and by an export of the same robot."""
    facts, sheet, robot = in_si(found), found.robot().facts, found.problem.robot
    for name, same in (
        ("speed_m_per_s", "speed_m_per_s"),
        ("friction_work_per_cycle_J", "work_per_period_J"),
        ("motor_work_per_cycle_J", "motor_work_per_period_J"),
        ("period_s", "period_s"),
    ):
        assert facts[name] == pytest.approx(sheet[same], rel=2e-3), name
    drawn = facts["motor_work_per_cycle_J"] + robot.idle_power * facts["period_s"]
    assert facts["energy_J_per_m"] == pytest.approx(drawn / facts["distance_per_cycle_m"])
    way = "distance / period" if isinstance(robot.period, tuple) else "distance"
    aims = colloc.Objective(way, name="speed" * ("/" in way)), found.problem.objective
    numbers = 100 * facts["speed_m_per_s"], facts["energy_J_per_m"]
    front = ParetoFront(found.problem, aims, (found,))
    np.testing.assert_allclose(front.in_units[1], [numbers], rtol=1e-6)
    rows = dict(row[:2] for row in compare(found, found)[0])
    assert [rows["speed [cm/s]"], rows["energy [J/m]"]] == [f"{x:.4g}" for x in numbers]
    written = found.export(tmp_path / "x.csv", ramp=False)
    assert (written["length_m"], written["mass_kg"]) == (robot.length, robot.mass)
    assert written["period_s"] == pytest.approx(facts["period_s"], abs=0.02)


@pytest.mark.slow
def test_speed_and_energy_are_those_of_the_period_in_metres_and_joules(slow_robot, tmp_path):
    assert slow_robot.success
    whoever_speaks_of_it_says_the_same(slow_robot, tmp_path)
    facts, unit = in_si(slow_robot), 0.9 * 9.81 * 0.62
    assert facts["speed_m_per_s"] == pytest.approx(slow_robot.distance * 0.62 / 600)
    power = facts["energy_J_per_m"] * facts["speed_m_per_s"]
    assert facts["mean_battery_power_W"] == pytest.approx(power)
    # the best value is the inverse of this cost, in weights
    assert slow_robot.value == pytest.approx(0.9 * 9.81 / facts["energy_J_per_m"], rel=1e-9)
    motors = unit * slow_robot.certificate.values["driven_work"]
    assert facts["motor_work_per_cycle_J"] == pytest.approx(motors)


@pytest.mark.parametrize(("over_swing", "failures"), [(0.99, []), (1.01, ["backlash"])])
def test_a_gait_below_the_play_of_the_joints_is_no_answer(slow_robot, over_swing, failures):
    robot = replace(SLOW, backlash=over_swing * slow_robot.swings.max())
    answer = replace(slow_robot.answer, problem=slow_robot.problem.with_(robot=robot))
    assert [check.name for check in colloc.certify(answer).failures] == failures


def test_a_figure_of_a_robot_has_its_units(slow_robot):
    figure = slow_robot.plot()
    figure.draw_without_rendering()
    strip, lab, angles, speeds, power = figure.axes
    way = 62 * np.ptp(slow_robot.sample(np.array([0.0, 1.0])).centre[0])
    assert strip.texts[-2].get_text() == "600"
    assert strip.texts[-1].get_text() in (f"{way:.1f}", f"−{way:.1f}")
    delta = slow_robot.delta_per_period * 62 / 600
    np.testing.assert_allclose(speeds.lines[-1].get_ydata(), delta)
    assert "[cm]" in lab.get_xlabel()
    assert [axes.get_xlabel() for axes in (angles, speeds, power)] == 3 * ["time  [s]"]
    watt = 0.9 * 9.81 * 0.62 / 600
    of_angles, of_power = (angles.yaxis, np.degrees(1)), (power.yaxis, watt)
    for axis, unit in ((lab.xaxis, 62.0), of_angles, (power.xaxis, 600.0), of_power):
        assert np.ptp(axis.get_ticklocs()) > 0.5 * np.ptp(axis.get_view_interval())
        places = zip(axis.get_ticklocs(), axis.get_ticklabels(), strict=True)
        for place, label in places:
            number = float(label.get_text().replace("−", "-"))
            assert number == pytest.approx(unit * place, abs=1e-6 * unit)


@pytest.mark.slow
def test_a_period_that_is_sought_keeps_the_speed_of_the_motors(tmp_path):
    robot = Robot(length=0.62, mass=0.9, period=(1, 20), max_speed=2.0, idle_power=2)
    problem = Problem("sought", gait=Harmonic(1, "antipodal"), robot=robot, delta=1e-2)
    solution = colloc.solve(problem, starts=2)
    assert solution.success
    period = in_si(solution)["period_s"]
    assert 1 < period < 20
    t = np.linspace(0, 1, 4001)
    fastest = np.abs(solution.gait.rates(t)).max() / period
    assert fastest == pytest.approx(2.0, rel=1e-4)  # idle power hurries
    whoever_speaks_of_it_says_the_same(solution, tmp_path)
    # at that period, stated, the gait is as good
    stated = problem.with_(robot=replace(robot, period=period))
    again = colloc.solve(stated.with_(guess=replace(solution.gait, log_period=None)), starts=1)
    assert again.value == pytest.approx(solution.value, rel=1e-3)


def test_a_film_of_robots_takes_the_time_of_the_slower_one(tmp_path):
    robots = (replace(SLOW, period=period, max_speed=None) for period in (1.5, 1.0))
    at = {"friction": colloc.Friction(99, 99, 99), "delta": 0.1, "mesh_tolerance": 1e-2}
    problems = (Problem("quick", robot=robot, **at) for robot in robots)
    slow, fast = (colloc.evaluate(each, colloc.ellipse(0.0, 1.5, 1.0)) for each in problems)
    path = slow.animate(tmp_path / "a.gif", periods=1, fps=4, width=200, beside=fast)
    with Image.open(path) as film:
        assert film.n_frames * film.info["duration"] == pytest.approx(1500)


@pytest.mark.slow
def test_the_first_line_of_a_page_of_a_robot_is_in_its_units(slow_robot, tmp_path):
    page = slow_robot.report(tmp_path / "robot.html").read_text(encoding="utf-8")
    speed = 100 * in_si(slow_robot)["speed_m_per_s"]
    assert re.search(
        rf'class="headline">{re.escape(f"{speed:.3g}")} cm/s, [\d.e+]+ J per metre', page
    )
