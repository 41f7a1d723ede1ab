"""On a robot: metres, kilograms and seconds, held against the forces of dense points that know of
no other units."""

import json

import numpy as np
import pandas
import pytest
from scipy.optimize import minimize

import colloc
from colloc.commands.main import main
from colloc.pictures.report_page import report_page
from colloc.results.robot import Robot, joint_torques

SIZE = {"length": 1.2, "mass": 3.0, "period": 5.0}
SLOW = SIZE | {"period": 5000.0}
"""Where inertia does nothing."""
POINTS = 400
"""A link."""


@pytest.fixture(scope="module")
def robot(three_link):
    return three_link.robot(**SIZE)


def in_metres(solution, seconds):
    """Points ``(n_link, POINTS)`` of the body [m], complex, with its tail link at rest on the x
    axis, and the ends of links."""
    angles = solution.gait.angles(np.array([seconds / SLOW["period"]]))[:, 0]
    heading = np.concatenate([[0.0], np.cumsum(angles)])
    links = SIZE["length"] * np.array(solution.problem.body.lengths) * np.exp(1j * heading)
    ends = np.concatenate([[0.0], np.cumsum(links)])
    return ends[:-1, None] + links[:, None] * (np.arange(POINTS) + 0.5) / POINTS, ends


def friction_of_points(solution, seconds, gravity=9.81):
    """Force [N] and velocity [m/s] of every point where all of them balance, and the points."""
    step = 1e-5 * SLOW["period"]
    bending = (in_metres(solution, seconds + step)[0] - in_metres(solution, seconds - step)[0]) / (
        2 * step
    )
    points = in_metres(solution, seconds)[0]
    slow = solution.answer.delta * SIZE["length"] / SLOW["period"]
    weight = SIZE["mass"] * gravity * np.array(solution.problem.body.lengths)[:, None] / POINTS

    def moved(z):
        velocity = z[0] + 1j * z[1] + 1j * z[2] * points + bending
        return -weight * velocity / np.sqrt(abs(velocity) ** 2 + slow**2), velocity

    def dissipated(z):
        """Whose least value is the balance; its slopes are the forces and the moment that are left
        over."""
        force, velocity = moved(z)
        left_over = -np.array(
            [force.sum().real, force.sum().imag, (points.conj() * force).imag.sum()]
        )
        return (weight * np.sqrt(abs(velocity) ** 2 + slow**2)).sum(), left_over

    how = {"method": "BFGS", "options": {"gtol": 1e-4 * SIZE["mass"] * gravity}}
    found = minimize(dissipated, np.zeros(3), jac=True, **how)
    assert found.success
    return *moved(found.x), points


def test_torques_and_power_are_those_of_the_forces_on_dense_points(three_link):
    robot = three_link.robot(**SLOW)
    for seconds in (700.0, 1300.0, 2500.0, 4000.0):
        force, velocity, points = friction_of_points(three_link, seconds)
        ends = in_metres(three_link, seconds)[1]
        torques = robot.torques(np.array([seconds / SLOW["period"]]))[:, 0]
        for joint, torque in enumerate(torques, 1):
            arm = points[joint:] - ends[joint]
            assert torque == pytest.approx(-(arm.conj() * force[joint:]).imag.sum(), rel=2e-3)
        power = -(force.conj() * velocity).real.sum()
        speeds = three_link.gait.rates(np.array([seconds / SLOW["period"]]))[:, 0] / SLOW["period"]
        assert torques @ speeds == pytest.approx(power, rel=1e-3)


def test_work_over_a_period_is_the_mean_power_and_moves_the_body_its_way(three_link, robot):
    facts, columns = robot.facts, robot.columns
    seconds, powers = columns["t"].values, columns["joint_powers"].values.sum(axis=0)
    assert powers[:-1].mean() * 5 == pytest.approx(facts["work_per_period_J"], rel=1e-4)
    assert facts["mean_power_W"] == pytest.approx(facts["work_per_period_J"] / 5)
    way = np.linalg.norm(columns["centre"].values[:, -1] - columns["centre"].values[:, 0])
    assert facts["speed_m_per_s"] * 5 == pytest.approx(way, rel=1e-4)
    assert facts["cost_of_transport"] == pytest.approx(
        facts["work_per_period_J"] / (3 * 9.81 * way), rel=1e-4
    )
    speeds = np.diff(columns["joint_angles"].values) / np.diff(seconds)
    assert facts["peak_speed_rad_per_s"] == pytest.approx(np.abs(speeds).max(axis=1), rel=1e-4)


def test_how_numbers_grow_with_size_mass_gravity_and_pace(three_link, robot):
    """Friction is proportional to the weight, torques to the length too; at one Froude number the
    pace is in speeds and powers alone."""
    other = three_link.robot(length=2.4, mass=6, period=10, gravity=9.81 / 2).facts
    assert other["work_per_period_J"] == pytest.approx(2 * robot.facts["work_per_period_J"])
    for name in ("mean_power_W", "speed_m_per_s", "froude_number"):
        assert other[name] == pytest.approx(robot.facts[name]), name
    assert other["peak_torque_N_m"] == pytest.approx(2 * np.array(robot.facts["peak_torque_N_m"]))
    assert other["rms_speed_rad_per_s"] == pytest.approx(
        np.array(robot.facts["rms_speed_rad_per_s"]) / 2
    )
    assert three_link.robot(**SLOW).facts["cost_of_transport"] == pytest.approx(
        1 / three_link.efficiency, rel=1e-4
    )


def test_the_shortest_period_is_one_at_which_a_joint_is_as_fast_as_it_may_be(three_link, tmp_path):
    facts = three_link.robot(**SIZE, max_speed=[2.0, 3.0]).facts
    at_it = three_link.robot(1.2, 3, facts["shortest_period_s"]).facts
    assert max(np.array(at_it["peak_speed_rad_per_s"]) / [2, 3]) == pytest.approx(1, rel=1e-4)
    exported = three_link.export(tmp_path / "x.csv", max_speed=[2, 3], rate=1000)
    assert facts["shortest_period_paced_by_speed_s"] == pytest.approx(
        exported["period_s"], abs=2e-3
    )
    assert facts["shortest_period_paced_by_speed_s"] < facts["shortest_period_s"]


def test_the_sheet_is_that_of_the_motion_with_inertia_at_its_pace(three_link):
    """As of the same gait in a problem for that pace, whose motion is collocated, and of one
    followed through time."""
    size = {"length": 1.0, "mass": 2.0, "period": 1.5}
    robot = three_link.robot(**size)
    problem = three_link.problem.with_(
        froude=robot.froude, gait=colloc.Harmonic(1), delta=1e-3, name="paced"
    )
    paced = colloc.evaluate(problem, three_link.gait).robot(**size).facts
    names = "speed_m_per_s work_per_period_J mean_power_W cost_of_transport peak_torque_N_m"
    for name in [*names.split(), "peak_power_W"]:
        assert robot.facts[name] == pytest.approx(paced[name], rel=0.01), name
    played = colloc.inertial_motion(
        problem.body, problem.friction, three_link.gait, 1e-4, robot.froude, tolerance=1e-4
    )
    assert robot.facts["body_lengths_per_period"] == pytest.approx(played.distance, rel=1e-3)
    assert played.distance < 0.7 * three_link.distance
    assert f"Without inertia it would move at {three_link.distance / 1.5:.4g} m/s" in str(robot)
    np.testing.assert_allclose(
        robot.columns["centre"].values[:, -1], [played.distance, 0.0], atol=2e-3
    )


def test_motors_too_slow_for_the_pace_are_told_how_fast_the_robot_is_at_the_period_that_they_allow(
    three_link,
):
    """No limit to solve with is advised: such a gait may be slower."""
    robot = three_link.robot(1.2, 3, 5, max_speed=[2, 3])
    sheet, facts = str(robot), robot.facts
    slower = three_link.robot(1.2, 3, facts["shortest_period_s"]).facts["speed_m_per_s"]
    assert facts["speed_at_shortest_period_m_per_s"] == pytest.approx(slower, rel=1e-6)
    assert f"with the gait's own timing ({slower:.4g} m/s)" in sheet
    assert "is too short for the joints" in sheet
    assert "speed_limit" not in sheet
    assert "too short" not in str(three_link.robot(1.2, 3, 50, max_speed=[2, 3]))


def test_weak_motors_are_told_whether_a_longer_period_helps(three_link):
    """At 5 s joints need 2.36 N m, slowly 1.96."""
    assert "Torque limits are met at this pace" in str(three_link.robot(**SIZE, max_torque=4))
    assert "take a longer period" in str(three_link.robot(**SIZE, max_torque=2.2))
    weak = three_link.robot(**SIZE, max_torque=[4, 1.5])
    assert "Joint 2 needs 2.36 N m and has 1.5. Motors are too weak in slow motion as well" in str(
        weak
    )
    assert f"torque_limit=({4 / weak.torque_unit:.4g}, {1.5 / weak.torque_unit:.4g})" in str(weak)


def test_weak_motors_are_told_of_where_the_motion_with_inertia_is_not_found(
    three_link, monkeypatch
):
    monkeypatch.setattr(Robot, "_with_inertia", None)
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
        with pytest.raises(
            colloc.ProblemError, match=f"{name} asks for another pace, and torques depend on it"
        ):
            swimmer.robot(**SIZE, **{name: 1.0})


def test_a_smooth_body_has_no_torques_to_tell(unsolved):
    guess = colloc.Fourier(np.zeros(2), [[0.6], [0.0]], [[0.0], [0.5]])
    soft = colloc.ModalBody(2, panels=4)
    gait = colloc.Harmonic(1, "antipodal")
    solution = unsolved(
        colloc.Problem("soft", guess, soft, colloc.Friction(mu_t=3), gait, intervals=6)
    )
    with pytest.raises(colloc.ProblemError, match="smooth body: joint torques are not defined"):
        _ = solution.robot(**SIZE).facts


def test_command_file_page_and_figure_say_the_same(three_link, robot, tmp_path, capsys):
    file = colloc.save(three_link, tmp_path / "x.h5")
    words = ["--length", "1.2", "--mass", "3", "--period", "5"]
    assert main(["robot", str(file), *words, "--json", "--figure"]) == 0
    told = json.loads(capsys.readouterr().out)
    for name, value in robot.facts.items():
        assert told[name] == (
            value if isinstance(value, str) else pytest.approx(value, rel=1e-9)
        ), name
    assert (tmp_path / "x.robot.png").stat().st_size > 10_000
    assert main(["export", str(file), *words, "--rate", "100"]) == 0
    columns = pandas.read_csv(tmp_path / "x.csv", comment="#").query("time_s >= 0")
    torques = np.stack([columns["joint_1_N_m"], columns["joint_2_N_m"]])
    np.testing.assert_allclose(torques, robot.torques(np.arange(500) / 500), rtol=1e-4, atol=2e-3)
    np.testing.assert_allclose(
        columns["joint_2_W"], torques[1] * columns["joint_2_rad_per_s"], atol=1e-6
    )
    assert "cost of transport  3.942" in report_page(three_link, robot=robot)
    assert "cost of transport" not in report_page(three_link)


def test_at_the_pace_that_is_slow_enough_inertia_takes_one_percent(three_link, robot):
    slow = three_link.robot(1.2, 3, robot.facts["slow_enough_period_s"]).facts
    assert slow["inertia_takes"] == pytest.approx(0.01, abs=2e-3)
    assert robot.facts["inertia_takes"] > 0.02
    assert "inertia, which costs 2.5 % of the efficiency at this pace" in str(robot)


@pytest.fixture(scope="module")
def fast():
    guess, gait = colloc.ellipse(A0=0, A1=2.3, B1=1.3), colloc.Harmonic(1, "antipodal")
    stated = colloc.Problem("fast", guess, gait=gait, froude=0.05)
    return colloc.solve(stated.with_(delta=1e-2, mesh_tolerance=1e-6), starts=1)


def test_torques_with_inertia_do_the_work_of_friction_and_swing_the_masses(fast):
    """Over a period the first; at every instant of their power what is left goes into kinetic
    energy, here of dense points."""
    step, t = 1e-4, np.linspace(0.0, 1.0, 401)[:-1]
    power = (joint_torques(fast, t) * fast.gait(t)[1]).sum(axis=0)
    assert power.mean() == pytest.approx(fast.work, rel=1e-4)

    def energy(t):
        def points(t):
            moved = fast.sample(t)
            heading = np.cumsum(np.vstack([moved.theta, moved.angles]), axis=0)
            links = np.exp(1j * heading) / 3
            ends = np.cumsum(np.vstack([moved.tail[0] + 1j * moved.tail[1], links]), axis=0)
            return ends[:-1, :, None] + links[:, :, None] * (np.arange(POINTS) + 0.5) / POINTS

        velocity = (points(t + step) - points(t - step)) / (2 * step)
        return 0.5 * (np.abs(velocity) ** 2).mean(axis=(0, 2))

    growth = 0.05 * (energy(t + 2 * step) - energy(t - 2 * step)) / (4 * step)
    spent = fast.power(fast.sample(t))
    np.testing.assert_allclose(power, spent + growth, atol=0.01 * np.abs(power).max())
    assert np.abs(growth).max() > 0.1 * np.abs(power).max()


def test_a_gait_for_a_pace_is_for_robots_of_that_pace(fast):
    period = (1.0 / (9.81 * 0.05)) ** 0.5
    facts = fast.robot(length=1.0, mass=2.0, period=period).facts
    assert facts["work_per_period_J"] == pytest.approx(2.0 * 9.81 * fast.work)
    assert facts["played_slowly"] > fast.efficiency
    assert "include inertia" in str(fast.robot(length=1.0, mass=2.0, period=period))
    with pytest.raises(colloc.ProblemError, match=f"take {period:.4g} s a period, not 5"):
        fast.robot(length=1.0, mass=2.0, period=5.0)
    with pytest.raises(colloc.ProblemError, match="max_torque asks for another pace"):
        fast.robot(length=1.0, mass=2.0, period=period, max_torque=1.0)
