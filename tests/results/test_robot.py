"""On a robot, in metres, kilograms and seconds: forces on dense points, braking, pace, slopes, arcs."""

import math
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pandas
import pytest

import colloc
from colloc import Fourier, Friction, Harmonic, Objective, Problem, ProblemError, evaluate, solve
from colloc.gaits.objective import DRIVEN
from colloc.results.motion import arc
from colloc.results.robot import RobotSheet, in_si, limit_shares
from colloc.studies.families import ParetoFront
from colloc.verification.trajectory import plan_trajectory
from tests.shared.mechanics import with_inertia

SIZE = {"length": 1.2, "mass": 3.0, "period": 5.0}
SLOW = SIZE | {"period": 5000.0}  # where inertia does nothing
QUANTITIES = {"torque": "N·m", "speed": "rad/s", "power": "W"}
POINTS = 400  # a link
LENGTH, MASS, FROUDE = 1.2, 3.0, 1.0
PERIOD = (LENGTH / 9.81 / FROUDE) ** 0.5
SKEW = Fourier([0.3, -0.2], [[1.2], [0.3]], [[0.2], [1.0]])


@pytest.fixture(scope="module")
def robot(three_link):
    return three_link.robot(**SIZE)


def test_torques_and_power_are_those_of_the_forces_on_dense_points(three_link):
    """In metres, newtons and seconds."""
    robot, period, delta = three_link.robot(**SLOW), SLOW["period"], three_link.answer.delta
    lengths, along = SIZE["length"] * np.array((1 / 3,) * 3), (np.arange(POINTS) + 0.5) / POINTS
    for phase in (0.14, 0.26, 0.5, 0.8):
        angles, rates = three_link.gait(np.array([phase]))
        z = colloc.solve_balance(colloc.Chain(), Friction(), angles, rates, delta).z[:, 0] / period
        rates, turn = rates[:, 0] / period, np.exp(1j * np.cumsum([0.0, *angles[:, 0]]))[:, None]
        spin = (z[2] + np.cumsum([0.0, *rates]))[:, None]
        links = lengths[:, None] * turn
        ends, moves = (
            np.cumsum(np.vstack([[0.0], each]))[:-1, None] for each in (links, 1j * spin * links)
        )
        tail = SIZE["length"] * complex(*z[:2])
        points, velocity = ends + links * along, tail + moves + 1j * spin * links * along
        speed = np.sqrt(np.abs(velocity) ** 2 + (delta * SIZE["length"] / period) ** 2)
        force = -SIZE["mass"] * 9.81 / 3 / POINTS * velocity / speed
        torques = robot.torques(np.array([phase]))[:, 0]
        for joint, torque in enumerate(torques, 1):
            arm = points[joint:] - ends[joint]
            assert torque == pytest.approx(-(arm.conj() * force[joint:]).imag.sum(), rel=2e-3)
        assert torques @ rates == pytest.approx(-(force.conj() * velocity).real.sum(), rel=1e-3)


def test_work_over_a_period_is_the_mean_power_and_moves_the_body_its_way(three_link, robot):
    facts, columns = robot.facts, robot.columns
    seconds, powers = columns["t"].values, columns["joint_powers"].values.sum(axis=0)
    assert powers[:-1].mean() * 5 == pytest.approx(facts["work_per_period_J"], rel=1e-4)
    assert facts["mean_power_W"] == pytest.approx(facts["work_per_period_J"] / 5)
    centre, tail = (columns[name].values for name in ("centre", "tail"))
    way = centre[0, -1] - centre[0, 0]  # along +x
    arms = np.hypot(*three_link.sample(0.0).tail[:, 0]), np.hypot(*(tail - centre)[:, 0])
    assert arms[1] == pytest.approx(1.2 * arms[0])
    assert facts["speed_m_per_s"] * 5 == pytest.approx(way, rel=1e-4)
    cost = facts["work_per_period_J"] / (3 * 9.81 * way)
    assert facts["cost_of_transport"] == pytest.approx(cost, rel=1e-4)
    speeds = np.diff(columns["joint_angles"].values) / np.diff(seconds)
    assert facts["peak_speed_rad_per_s"] == pytest.approx(np.abs(speeds).max(axis=1), rel=1e-4)
    data = robot.to_xarray()
    assert (data.joint_powers.attrs["units"], data.attrs["mass_kg"]) == ("W", 3)


def test_how_numbers_grow_with_size_mass_gravity_and_pace(three_link, robot):
    """At one Froude number the pace is in speeds and powers alone."""
    other = three_link.robot(length=2.4, mass=6, period=10, gravity=9.81 / 2).facts
    growth = {"work_per_period_J": 2, "mean_power_W": 1, "speed_m_per_s": 1, "froude_number": 1}
    growth |= {"peak_torque_N_m": 2, "rms_speed_rad_per_s": 0.5, "slow_enough_period_s": 2}
    for name, factor in growth.items():
        assert other[name] == pytest.approx(factor * np.array(robot.facts[name])), name
    slow = three_link.robot(**SLOW).facts["cost_of_transport"]
    assert slow == pytest.approx(1 / three_link.efficiency, rel=1e-4)


@pytest.fixture(scope="module")
def hurried(three_link):
    """A robot whose motors are too slow for its pace, and one at the pace that they allow."""
    robot = three_link.robot(**SIZE, max_speed=[2.0, 3.0])
    return robot, three_link.robot(1.2, 3, robot.facts["shortest_period_s"]).facts


@pytest.mark.slow
def test_the_shortest_period_is_one_at_which_a_joint_is_as_fast_as_it_may_be(
    three_link, hurried, tmp_path
):
    facts, at_it = hurried[0].facts, hurried[1]
    assert max(np.array(at_it["peak_speed_rad_per_s"]) / [2, 3]) == pytest.approx(1, rel=1e-4)
    exported = three_link.export(tmp_path / "x.csv", max_speed=[2, 3], rate=1000)
    paced = facts["shortest_period_paced_by_speed_s"]
    assert paced == pytest.approx(exported["period_s"], abs=2e-3)
    assert paced < facts["shortest_period_s"]


@pytest.mark.slow
def test_the_sheet_is_that_of_the_motion_with_inertia_at_its_pace(three_link):
    """As of the same gait collocated for that pace, and of one followed through time."""
    size = {"length": 1.0, "mass": 2.0, "period": 1.5}
    robot = three_link.robot(**size)
    paced = {"froude": robot.froude, "gait": Harmonic(1), "delta": 1e-3, "mesh_tolerance": 1e-3}
    problem = three_link.problem.with_(name="paced", **paced)
    paced = evaluate(problem, three_link.gait).robot(**size).facts
    names = "speed_m_per_s work_per_period_J mean_power_W cost_of_transport peak_torque_N_m"
    for name in [*names.split(), "peak_power_W"]:
        assert robot.facts[name] == pytest.approx(paced[name], rel=0.01), name
    at = problem.body, problem.friction, three_link.gait, 1e-4, robot.froude
    played = with_inertia(*at, tolerance=1e-4)
    assert robot.facts["body_lengths_per_period"] == pytest.approx(played.distance, rel=1e-3)
    assert played.distance < 0.7 * three_link.distance
    assert f"Without inertia it would move at {three_link.distance / 1.5:.4g} m/s" in str(robot)
    end = robot.columns["centre"].values[:, -1]
    np.testing.assert_allclose(end, [played.distance, 0.0], atol=2e-3)


@pytest.mark.slow
def test_motors_too_slow_for_the_pace_are_told_how_fast_the_robot_is_as_they_allow(
    three_link, hurried
):
    """No limit to solve with is advised: such a gait may be slower."""
    robot, slower = hurried[0], hurried[1]["speed_m_per_s"]
    sheet = str(robot)
    assert robot.facts["speed_at_shortest_period_m_per_s"] == pytest.approx(slower, rel=1e-6)
    assert f"with the gait's own timing ({slower:.4g} m/s)" in sheet
    assert "is too short for the joints" in sheet
    assert "speed_limit" not in sheet
    assert "too short" not in str(three_link.robot(1.2, 3, 50, max_speed=[2, 3]))


def test_weak_motors_are_told_of_where_the_motion_with_inertia_is_not_found(
    three_link, monkeypatch
):
    monkeypatch.setattr(RobotSheet, "_with_inertia", None)
    sheet = str(three_link.robot(**SIZE, max_torque=1.5))
    assert "Motors are too weak in slow motion as well" in sheet
    assert "the effect of inertia at this pace" in sheet


def test_where_torques_depend_on_the_pace_no_other_pace_is_promised(unsolved):
    friction = colloc.Viscous(normal=2, tangential=1)
    gait, drag = colloc.ellipse(0.0, 1.2, 0.8), {"friction": friction, "objective": "towing"}
    swimmer = unsolved(colloc.Problem("paced", gait, gait=colloc.Harmonic(1), delta=1e-2, **drag))
    sheet = str(swimmer.robot(**SIZE))
    assert "coefficients are taken to be those in units of this period" in sheet
    for name in ("max_speed", "max_torque"):
        said = f"{name} needs another pace, and torques depend on it"
        with pytest.raises(ProblemError, match=said):
            swimmer.robot(**SIZE, **{name: 1.0})


def test_at_the_pace_that_is_slow_enough_inertia_takes_one_percent(three_link, robot):
    slow = three_link.robot(1.2, 3, robot.facts["slow_enough_period_s"]).facts
    assert slow["inertia_takes"] == pytest.approx(0.01, abs=2e-3)
    assert robot.facts["inertia_takes"] > 0.02
    assert "inertia, which costs 2.5 % of the efficiency at this pace" in str(robot)
    assert f"would move at {three_link.distance * 1.2 / 5:.4g} m/s" in str(robot)


def test_of_a_gait_that_turns_so_slowly_that_inertia_does_nothing_no_rotation_is_its_doing():
    gait = Fourier([1.0, 1.1], [[-1.0], [0.7]], [[1.0], [0.9]])
    turns = evaluate(Problem("turns", delta=3e-2, mesh_tolerance=1e-2), gait)
    robot, facts = (slow := turns.robot(**SLOW)).columns, slow.facts
    assert abs(turns.rotation) > 0.3
    motion = turns.sample(robot["t"].values / SLOW["period"])
    np.testing.assert_allclose(robot["centre"].values, 1.2 * motion.centre, atol=1e-4)
    assert facts["rotation_by_inertia_rad"] == pytest.approx(0.0, abs=1e-4)
    assert facts["inertia_takes"] == pytest.approx(0.0, abs=1e-4)


@pytest.fixture(scope="module")
def braking(once):
    """At this pace links swing on, and joint 1 brakes harder than it drives."""
    gait = Fourier([0.1, 0.2], [[0.0, 0.0], [0.5, 0.0]], [[1.0, 0.25], [0.4, 0.0]])
    problem = Problem("brakes", gait=Harmonic(2), delta=1e-2, froude=FROUDE, mesh_tolerance=1e-3)
    return once("braking", lambda: evaluate(problem, gait))


def test_peak_power_of_a_joint_is_the_most_it_drives_with_not_the_most_it_brakes_with(braking):
    robot = braking.robot(LENGTH, MASS, PERIOD)
    torques, speeds = (robot.columns[f"joint_{name}"].values for name in ("torques", "speeds"))
    powers = torques * speeds
    assert -powers[0].min() > 1.2 * powers[0].max()  # what this gait is here for
    assert robot.facts["peak_joint_power_W"] == pytest.approx(powers.max(axis=1))
    assert robot.facts["peak_power_W"] == pytest.approx(powers.sum(axis=0).max())
    for name, values in (("rms_torque_N_m", torques), ("rms_speed_rad_per_s", speeds)):
        assert robot.facts[name] == pytest.approx(np.sqrt((values[:, :-1] ** 2).mean(axis=1)))
    limited = replace(braking, problem=braking.problem.with_(torque_limit=0.5))
    most = max(robot.facts["peak_torque_N_m"]) / robot.torque_unit
    assert limit_shares(limited)["torque"] == pytest.approx(most / 0.5, rel=1e-3)


def test_powers_of_an_exported_motion_are_negative_where_a_joint_brakes(braking, tmp_path):
    """Where gravity is a quarter, the same motion takes twice as long and a quarter of the torque."""
    size = {"length": LENGTH, "mass": MASS}
    braking.export(tmp_path / "brakes.csv", period=PERIOD, rate=400.0, **size)
    light = {"period": 2 * PERIOD, "rate": 200.0, "gravity": 9.81 / 4}
    braking.export(tmp_path / "light.csv", **light, **size)
    table, less = (pandas.read_csv(tmp_path / f"{x}.csv", comment="#") for x in ("brakes", "light"))
    for joint in (1, 2):
        torques = (each[f"joint_{joint}_N_m"] for each in (4 * less, table))
        np.testing.assert_allclose(*torques, rtol=1e-6, atol=1e-6)
        torque, speed, power = (table[f"joint_{joint}_{u}"] for u in ("N_m", "rad_per_s", "W"))
        atol = 1e-6 * np.abs(power).max()
        np.testing.assert_allclose(power, torque * speed, rtol=1e-6, atol=atol)
        assert power.min() < 0 < power.max()


def test_motors_that_take_no_power_back_work_by_what_they_drive_with_each_for_itself(braking):
    robot = braking.robot(LENGTH, MASS, PERIOD)
    powers, seconds = robot.columns["joint_powers"].values, robot.columns["t"].values
    drive = np.trapezoid(np.maximum(powers, 0.0), seconds, axis=1).sum()
    assert robot.facts["motor_work_per_period_J"] == pytest.approx(drive, rel=1e-4)
    assert robot.facts["motor_work_per_period_J"] > 1.5 * robot.facts["work_per_period_J"]
    # work against friction is what is left of driving and braking
    spent = np.trapezoid(powers.sum(axis=0), seconds)
    assert spent == pytest.approx(robot.facts["work_per_period_J"], rel=2e-3)


def test_the_sheet_of_a_gait_with_inertia_is_of_its_own_pace_alone(braking):
    said = f"best gait for the Froude number 1: a robot of 1.2 m needs {PERIOD:.4g} s"
    for factor in (0.95, 1.05):
        with pytest.raises(ProblemError, match=said):
            braking.robot(LENGTH, MASS, factor * PERIOD)
    with pytest.raises(ProblemError, match="max_torque needs another pace"):
        braking.robot(LENGTH, MASS, PERIOD, max_torque=1.0)
    robot = braking.robot(LENGTH, MASS, 1.004 * PERIOD)
    assert robot.froude == pytest.approx(FROUDE, rel=1e-2)
    work = MASS * 9.81 * LENGTH * braking.work
    assert robot.facts["work_per_period_J"] == pytest.approx(work)
    assert "include inertia" in str(robot)


@pytest.fixture(scope="module")
def towards_left(once):
    """A gait asked to go half a radian to the left of straight uphill."""
    friction, slope = Friction(mu_t=2, mu_f=1, mu_b=1), {"grade": 0.1, "towards": 0.5}
    problem = Problem("aside", friction=friction, gait=Harmonic(1), delta=1e-2, **slope)
    return once("aside", lambda: solve(problem.with_(intervals=24, mesh_tolerance=1e-3), 1))


@pytest.mark.slow
def test_a_gait_goes_the_way_it_is_asked_to_on_a_slope_and_its_distance_is_that_way(towards_left):
    assert towards_left.success, towards_left.message
    motion = towards_left.sample(np.array([0.0, 1.0]))
    ahead, aside = motion.centre[:, 1] - motion.centre[:, 0]
    assert np.arctan2(aside, ahead) == pytest.approx(0.5, abs=1e-6)
    assert towards_left.distance == pytest.approx(np.hypot(ahead, aside), rel=1e-3)
    stated, gait = towards_left.problem, towards_left.gait
    at = stated.body, stated.friction, gait, stated.delta, stated.grade
    followed = colloc.slope_motion(*at, theta=gait.theta)
    way = towards_left.distance * np.array([np.cos(0.5), np.sin(0.5)])
    assert [followed.climb[0], followed.aside[0]] == pytest.approx(way, rel=1e-3)


def test_gravity_of_an_exported_model_leans_downhill_as_seen_from_its_tail(towards_left, tmp_path):
    """Its part across the ground is the grade; the tail link lies along +x."""
    model = tmp_path / "model.xml"
    towards_left.export(model, length=LENGTH, mass=MASS, period=20.0)
    gravity = np.array(ElementTree.parse(model).find("option").get("gravity").split(), dtype=float)
    assert np.linalg.norm(gravity) == pytest.approx(9.81)
    across = complex(*gravity[:2])
    assert abs(across) / -gravity[2] == pytest.approx(towards_left.problem.grade)
    assert across / abs(across) == pytest.approx(-np.exp(-1j * towards_left.gait.theta))


@pytest.mark.parametrize("angle", [4.0, -4.0, 1.0, 3.5])
def test_an_arc_of_any_angle_has_the_radius_of_its_circle(angle):
    radius = 2.0
    path = radius * np.exp(1j * angle * np.linspace(0, 1, 2001))
    measured = arc(angle, np.array([path.real, path.imag]))
    assert measured.radius == pytest.approx(radius)
    assert measured.chord == pytest.approx(2 * radius * abs(math.sin(angle / 2)))


def test_on_a_slope_less_than_the_weight_presses_and_all_of_it_is_transported(towards_left):
    """Played slowly."""
    facts = towards_left.robot(LENGTH, MASS, 2000.0).facts
    presses, way = 9.81 * math.cos(math.atan(0.1)), LENGTH * towards_left.distance
    work = MASS * presses * LENGTH * towards_left.work
    assert facts["work_per_period_J"] == pytest.approx(work, rel=1e-4)
    assert facts["cost_of_transport"] == pytest.approx(work / (MASS * 9.81 * way), rel=1e-4)
    assert facts["froude_number"] == pytest.approx(LENGTH / (presses * 2000.0**2))
    robot = colloc.Robot(length=LENGTH, mass=MASS, period=2000.0)
    stated = replace(towards_left, problem=towards_left.problem.with_(robot=robot))
    assert in_si(stated)["friction_work_per_cycle_J"] == pytest.approx(work)
    front = ParetoFront(stated.problem, (Objective("distance"), DRIVEN), (stated,))
    assert front.in_units[1][0, 1] == pytest.approx(MASS * presses / front.values[0, 1])


def test_an_export_on_a_slope_is_of_the_shorter_robot_that_has_that_pace_there(unsolved, tmp_path):
    """It is pressed down by the cosine of the inclination."""
    leaning = Fourier([0.0, 0.0], [[1.2], [0.0]], [[0.0], [0.8]], theta=0.3)
    stated = Problem("steep", leaning, gait=Harmonic(1), delta=1e-2, froude=0.05, grade=0.75)
    solution, length = unsolved(stated), 0.05 * 0.8 * 9.81 * 2.0**2
    facts = solution.export(tmp_path / "x.csv", period=2.0, ramp=False)
    assert f"a robot of {length:.3g} m in 2 s" in facts["pace"]
    assert solution.robot(length, MASS, 2.0).froude == pytest.approx(0.05)


@pytest.mark.parametrize("limits", [2.0, (2.0, 1.5)])
def test_at_the_gait_s_own_pace_the_fastest_instant_decides_and_the_clock_is_even(limits):
    even, free = (
        plan_trajectory(SKEW, 400.0, limits=limits, keep_pace=keep) for keep in (True, False)
    )
    most = np.broadcast_to(limits, 2)
    fastest = (np.abs(SKEW.rates(np.linspace(0, 1, 4001))).max(axis=1) / most).max()
    assert even.period == pytest.approx(fastest, abs=1 / 400)
    np.testing.assert_allclose(even.phase, even.time / even.period, atol=1e-9)
    assert free.period < 0.95 * even.period
    for found in (even, free):
        steps = np.diff(found.angles, axis=1, append=found.angles[:, :1]) * 400.0
        assert (np.abs(steps).max(axis=1) <= most * (1 + 1e-6)).all()
    np.testing.assert_allclose(even.speeds, SKEW.rates(even.phase) / even.period, atol=1e-6)
