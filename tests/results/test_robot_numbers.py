"""Numbers of a robot whose joints also brake, at the pace of its gait alone, on a slope; and what
an arc is."""

import math
from xml.etree import ElementTree

import numpy as np
import pandas
import pytest

from colloc import Fourier, Friction, Harmonic, Problem, ProblemError, evaluate, slope_motion, solve
from colloc.results.motion import Arc, arc

LENGTH, MASS, FROUDE = 1.2, 3.0, 1.0
PERIOD = (LENGTH / 9.81 / FROUDE) ** 0.5


@pytest.fixture(scope="module")
def braking(once):
    """At this pace links swing on, and joint 1 brakes harder than it drives."""
    gait = Fourier([0.1, 0.2], [[0.0, 0.0], [0.5, 0.0]], [[1.0, 0.25], [0.4, 0.0]])
    problem = Problem("brakes", gait=Harmonic(2), delta=1e-2, froude=FROUDE, mesh_tolerance=1e-3)
    return once("braking", lambda: evaluate(problem, gait))


def test_peak_power_of_a_joint_is_the_most_it_drives_with_not_the_most_it_brakes_with(braking):
    robot = braking.robot(LENGTH, MASS, PERIOD)
    powers = robot.columns["joint_torques"].values * robot.columns["joint_speeds"].values
    assert -powers[0].min() > 1.2 * powers[0].max()  # what this gait is here for
    assert robot.facts["peak_joint_power_W"] == pytest.approx(powers.max(axis=1))
    assert robot.facts["peak_power_W"] == pytest.approx(powers.sum(axis=0).max())
    torques, speeds = (
        robot.columns[f"joint_{name}"].values[:, :-1] for name in ("torques", "speeds")
    )
    assert robot.facts["rms_torque_N_m"] == pytest.approx(
        np.linalg.norm(torques, axis=1) / torques.shape[1] ** 0.5
    )
    assert robot.facts["rms_speed_rad_per_s"] == pytest.approx(
        np.linalg.norm(speeds, axis=1) / speeds.shape[1] ** 0.5
    )


def test_powers_of_an_exported_motion_are_negative_where_a_joint_brakes(braking, tmp_path):
    braking.export(tmp_path / "brakes.csv", period=PERIOD, rate=400.0, length=LENGTH, mass=MASS)
    table = pandas.read_csv(tmp_path / "brakes.csv", comment="#")
    for joint in (1, 2):
        torque, speed, power = (
            table[f"joint_{joint}_{unit}"].to_numpy() for unit in ("N_m", "rad_per_s", "W")
        )
        np.testing.assert_allclose(
            power, torque * speed, rtol=1e-6, atol=1e-6 * np.abs(power).max()
        )
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
    said = f"best gait for the Froude number 1: a robot of 1.2 m has to take {PERIOD:.4g} s"
    for factor in (0.95, 1.05):
        with pytest.raises(ProblemError, match=said):
            braking.robot(LENGTH, MASS, factor * PERIOD)
    assert braking.robot(LENGTH, MASS, 1.004 * PERIOD).froude == pytest.approx(FROUDE, rel=1e-2)


@pytest.fixture(scope="module")
def towards_left(once):
    """A gait asked to go half a radian to the left of straight uphill."""
    friction, slope = Friction(mu_t=2, mu_f=1, mu_b=1), {"grade": 0.1, "towards": 0.5}
    problem = Problem("aside", friction=friction, gait=Harmonic(1), delta=1e-2, **slope)
    return once("aside", lambda: solve(problem.with_(intervals=24, mesh_tolerance=1e-3), 1))


def test_a_gait_goes_the_way_it_is_asked_to_on_a_slope_and_its_distance_is_that_way(towards_left):
    assert towards_left.success, towards_left.message
    motion = towards_left.sample(np.array([0.0, 1.0]))
    ahead, aside = motion.centre[:, 1] - motion.centre[:, 0]
    assert np.arctan2(aside, ahead) == pytest.approx(0.5, abs=1e-6)
    assert towards_left.distance == pytest.approx(np.hypot(ahead, aside), rel=1e-3)
    problem, gait = towards_left.problem, towards_left.gait
    followed = slope_motion(
        problem.body, problem.friction, gait, problem.delta, problem.grade, theta=gait.theta
    )
    assert followed.climb[0] == pytest.approx(towards_left.distance * np.cos(0.5), rel=1e-3)
    assert followed.aside[0] == pytest.approx(towards_left.distance * np.sin(0.5), rel=1e-3)


def test_gravity_of_an_exported_model_leans_downhill_as_seen_from_its_tail(towards_left, tmp_path):
    """Its size is that on earth, its part across the ground the grade; the tail link lies along
    +x."""
    model = tmp_path / "model.xml"
    towards_left.export(model, length=LENGTH, mass=MASS, period=20.0)
    gravity = np.array(
        [float(part) for part in ElementTree.parse(model).find("option").get("gravity").split()]
    )
    assert np.linalg.norm(gravity) == pytest.approx(9.81)
    across = complex(*gravity[:2])
    assert abs(across) / -gravity[2] == pytest.approx(towards_left.problem.grade)
    assert across / abs(across) == pytest.approx(-np.exp(-1j * towards_left.gait.theta))


@pytest.mark.parametrize("angle", [4.0, -4.0, 1.0, 3.5])
def test_an_arc_of_any_angle_has_the_radius_of_its_circle_and_goes_the_shorter_way(angle):
    radius = 2.0
    t = np.linspace(0, 1, 2001)
    path = radius * np.exp(1j * angle * t)
    measured = arc(angle, np.array([path.real, path.imag]))
    assert measured.radius == pytest.approx(radius)
    assert measured.chord == pytest.approx(2 * radius * abs(math.sin(angle / 2)))
    assert measured.length == pytest.approx(radius * min(abs(angle), 2 * math.pi - abs(angle)))
    assert Arc(0.0, 0.3).length == 0.3


def test_on_a_slope_less_than_the_weight_presses_and_transport_is_paid_by_the_whole_of_it(
    towards_left,
):
    """Played slowly."""
    robot, presses = towards_left.robot(LENGTH, MASS, 2000.0), 9.81 * math.cos(math.atan(0.1))
    facts, way = robot.facts, LENGTH * towards_left.distance
    assert facts["work_per_period_J"] == pytest.approx(
        MASS * presses * LENGTH * towards_left.work, rel=1e-4
    )
    assert facts["cost_of_transport"] == pytest.approx(
        facts["work_per_period_J"] / (MASS * 9.81 * way), rel=1e-4
    )
    assert facts["froude_number"] == pytest.approx(LENGTH / (presses * 2000.0**2))


def test_an_export_with_inertia_on_a_slope_is_of_the_robot_that_is_pressed_down_as_much(
    unsolved, tmp_path
):
    """By the cosine of the inclination: a shorter robot than on the level has that pace."""
    leaning = Fourier([0.0, 0.0], [[1.2], [0.0]], [[0.0], [0.8]], theta=0.3)
    stated = Problem("steep", leaning, gait=Harmonic(1), delta=1e-2, froude=0.05, grade=0.75)
    solution, length = unsolved(stated), 0.05 * 0.8 * 9.81 * 2.0**2
    facts = solution.export(tmp_path / "x.csv", period=2.0, ramp=False)
    assert f"of a robot of {length:.3g} m in this period" in facts["pace"]
    assert solution.robot(length, MASS, 2.0).froude == pytest.approx(0.05)
