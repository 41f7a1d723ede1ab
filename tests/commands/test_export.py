"""Whatever the pacing, exported samples do what the result does, within joint speed limits."""

import json

import h5py
import numpy as np
import pandas
import pytest
from scipy.interpolate import CubicHermiteSpline, CubicSpline

import colloc
from colloc import Chain, Fourier, Friction, Harmonic, Problem, ProblemError, Viscous, ellipse, save
from colloc.commands.results import export as main
from colloc.commands.solve import summary_lines
from colloc.pictures.report_page import report_page
from colloc.verification.differential_motion import GaitWithInertia
from colloc.verification.replay import replay
from colloc.verification.trajectory import plan_trajectory, shortest_period

WAVE = Fourier(
    np.array([0.2, 0.0, -0.3]),
    np.array([[0.9], [0.2], [0.1]]),
    np.array([[0.1, 0.2], [0.8, 0.1], [0.3, 0.4]])[:, :1],
)


def path_of(gait):
    return lambda t: (gait.angles(t), gait.rates(t))


def path_through(angles):
    """Periodic spline through samples at equal times."""
    closed = np.concatenate([angles, angles[:, :1]], axis=1)
    spline = CubicSpline(np.linspace(0.0, 1.0, closed.shape[1]), closed, axis=1, bc_type="periodic")
    return lambda t: (spline(t), spline(t, 1))


@pytest.mark.parametrize("limits", [0.7, np.array([0.5, 2.0, 1.0])])
@pytest.mark.parametrize("slower", [1.0, 1.2, 5.0])
def test_joint_speed_limits_hold_at_the_samples_and_between_them(limits, slower):
    allowed = np.broadcast_to(limits, 3)[:, None]
    wanted = slower * shortest_period(path_of(WAVE), allowed[:, 0])
    made = plan_trajectory(path_of(WAVE), 100.0, wanted, limits)
    assert wanted <= made.period < wanted + 0.01
    rounded = plan_trajectory(path_of(WAVE), 100.0, made.period * (1 + 1e-8), limits)
    assert rounded.time.size == made.time.size
    assert (np.abs(made.speeds) <= allowed * (1 + 1e-9)).all()
    steps = np.diff(np.concatenate([made.angles, made.angles[:, :1]], axis=1), axis=1) * 100.0
    assert (np.abs(steps) <= allowed * (1 + 1e-9)).all()


def written(path):
    """Times, angles and speeds of a file."""
    columns = pandas.read_csv(path, comment="#")
    return columns["time_s"].to_numpy(), *(
        columns[[name for name in columns if name.endswith(end)]].to_numpy().T
        for end in ("_rad", "_rad_per_s")
    )


@pytest.mark.parametrize(
    "how",
    [{"period": 4.0}, {"max_speed": [2.0, 1.5]}, {"max_speed": 1.0, "period": 20.0, "periods": 2}],
    ids=["even", "fast", "slower"],
)
def test_an_export_leads_from_straight_at_rest_into_the_gait_within_speed_limits(
    three_link, how, tmp_path
):
    stated = three_link.export(tmp_path / "x.csv", rate=200, **how)
    time, angles, speeds = written(tmp_path / "x.csv")
    np.testing.assert_allclose(np.diff(time), 1 / 200, atol=1e-8)
    first = np.flatnonzero(time >= 0)[0]
    assert time[first] == 0
    assert time[0] == pytest.approx(-stated["ramp_s"])
    assert np.abs(angles[:, 0]).max() < 1e-4
    assert np.abs(speeds[:, 0]).max() < 0.05
    limits = np.broadcast_to(how.get("max_speed", np.abs(speeds[:, first:]).max()), 2)[:, None]
    assert (np.abs(speeds) <= limits * (1 + 1e-6)).all()
    steps = np.diff(angles) * 200
    assert (np.abs(steps) <= limits * (1 + 1e-5)).all()  # angles have 9 digits
    # no jump anywhere
    np.testing.assert_allclose(
        steps, 0.5 * (speeds[:, 1:] + speeds[:, :-1]), atol=0.02 * limits.max()
    )
    assert np.abs(angles).max() <= np.abs(angles[:, first:]).max() + 1e-6


def test_the_way_into_a_gait_keeps_the_speed_limit_of_its_problem(unsolved, tmp_path):
    """Stated in rad a period, and so a quarter of that in rad/s at 4 s."""
    bent = Fourier([1.0, -1.0], [[0.3], [0.0]], [[0.0], [0.3]])
    stated = Problem("limited", bent, gait=Harmonic(1), delta=1e-2, speed_limit=2.1)
    unsolved(stated).export(tmp_path / "x.csv", period=4.0, rate=100.0)
    time, _, speeds = written(tmp_path / "x.csv")
    assert np.abs(speeds[:, time >= 0]).max() < 0.95 * 2.1 / 4.0
    assert np.abs(speeds).max() == pytest.approx(2.1 / 4.0, rel=1e-3)


def test_torques_on_the_way_into_a_gait_come_to_be_those_of_the_gait(unsolved, tmp_path):
    """Also where they depend on speeds: in a medium that drags."""
    drag = {"friction": Viscous(normal=2, tangential=1), "objective": "towing", "delta": 1e-2}
    solution = unsolved(Problem("drag", ellipse(0.0, 1.2, 0.8), gait=Harmonic(1), **drag))
    solution.export(tmp_path / "x.csv", period=4.0, rate=50.0, length=1.2, mass=3.0)
    columns = pandas.read_csv(tmp_path / "x.csv", comment="#")
    torques = columns[["joint_1_N_m", "joint_2_N_m"]].to_numpy().T
    first = np.flatnonzero(columns["time_s"] >= 0)[0]
    jump = 2 * torques[:, first - 1] - torques[:, first - 2] - torques[:, first]
    assert np.abs(jump).max() < 0.1 * np.abs(torques[:, first]).max()


@pytest.mark.parametrize("how", ["crossing", "passing"])  # at samples, or between them
def test_a_way_on_which_the_body_crosses_itself_is_refused(how, three_link, tmp_path, monkeypatch):
    monkeypatch.setattr(f"colloc.pictures.export.{how}_depth", lambda body, angles: np.array(0.01))
    with pytest.raises(ProblemError, match="crosses itself on the way from straight"):
        three_link.export(tmp_path / "x.csv", period=4)
    three_link.export(tmp_path / "x.csv", period=4, ramp=False)


def test_the_body_ends_where_the_samples_take_it(three_link, tmp_path):
    """Balanced from each to the next; seen from where it lay straight along +x."""
    stated = three_link.export(tmp_path / "x.csv", period=4.0, periods=2, rate=250)
    _, angles, _ = written(tmp_path / "x.csv")
    angles = np.append(angles, angles[:, [-2000]], axis=1)  # the end of the second period
    problem, middle, step = three_link.problem, 0.5 * (angles[:, 1:] + angles[:, :-1]), 1 / 1000
    z = problem.body.solve(problem.law, middle, np.diff(angles) / step, 1e-4).z
    theta = np.append(0.0, np.cumsum(z[2] * step))
    tail = (np.exp(0.5j * (theta[1:] + theta[:-1])) * (z[0] + 1j * z[1]) * step).sum()
    start, end = (complex(*place) for place in problem.body.centre(angles[:, [0, -1]]).T)
    way = tail + np.exp(1j * theta[-1]) * end - start
    np.testing.assert_allclose(stated["end_body_lengths"], [way.real, way.imag], atol=2e-3)
    assert stated["end_turned_deg"] == pytest.approx(np.degrees(theta[-1]), abs=0.3)


def test_with_inertia_the_body_ends_where_one_run_through_all_samples_takes_it(unsolved, tmp_path):
    """From rest, through more periods than are followed until all are alike."""
    bent, body = Fourier([1.0, -1.0], [[0.1], [0.0]], [[0.0], [0.1]]), Chain()
    solution = unsolved(Problem("bent", bent, gait=Harmonic(1), delta=1e-2))
    how = {"period": 1.0, "rate": 400.0, "periods": 12, "length": 9.81, "mass": 1.0}
    stated = solution.export(tmp_path / "x.csv", **how)
    assert stated["end_includes_inertia"]
    assert stated["ramp_s"] > 2  # of a period, at a Froude number of 1
    time, *rows = written(tmp_path / "x.csv")
    first, long = np.flatnonzero(time >= 0)[0], 12.0 + stated["ramp_s"]
    angles, speeds = (np.append(row, row[:, [first]], axis=1) for row in rows)
    phases = np.linspace(0.0, 1.0, time.size + 1)
    path = CubicHermiteSpline(phases, angles, long * speeds, axis=1)
    at = body, Friction(), lambda t: (path(t), path(t, 1)), 1e-2 * long
    whole = GaitWithInertia(*at, froude=1 / long**2).run(np.zeros(3), 1e-5).states[3:6, -1]
    assert stated["end_turned_deg"] == pytest.approx(np.degrees(whole[0]), abs=0.05)
    assert stated["end_body_lengths"] == pytest.approx(whole[1:], abs=1e-3)


def test_the_command_writes_csv_and_json_that_say_what_they_are(three_link, tmp_path, capsys):
    file = save(three_link, tmp_path / "x.h5")
    assert main([str(file), "--max-speed", "2", "--rate", "100", "--periods", "2"]) == 0
    lines = (tmp_path / "x.csv").read_text().splitlines()
    facts = dict(line[2:].split(": ", 1) for line in lines if line.startswith("#"))
    time, angles, speeds = written(tmp_path / "x.csv")
    assert time[0] == pytest.approx(-float(facts["ramp_s"]))
    n, first = int(facts["samples_per_period"]), np.flatnonzero(time >= 0)[0]
    rows = np.concatenate([angles, speeds])[:, first:]
    assert rows.shape == (4, 2 * n)
    np.testing.assert_allclose(rows[:, :n], rows[:, n:], atol=1e-12)
    np.testing.assert_allclose(np.diff(time), 0.01, atol=1e-7)
    problem = three_link.problem
    replayed = replay(problem.body, problem.friction, path_through(rows[:2, :n]), 1e-4)
    assert replayed.efficiency == pytest.approx(json.loads(facts["efficiency"]), rel=2e-4)
    way = json.loads(facts["distance_per_period_body_lengths"])
    assert replayed.distance == pytest.approx(way, rel=2e-4)
    assert main([str(file), *f"--period 4 --no-ramp --output {tmp_path}/y.json".split()]) == 0
    data = json.loads((tmp_path / "y.json").read_text())
    assert np.shape(data["angles_rad"]) == (2, 200)
    assert data["status"] == "solved"
    capsys.readouterr()
    assert main([str(file)]) == 2
    assert "needs a period in seconds" in capsys.readouterr().err


@pytest.mark.parametrize(
    "changes",
    [{"friction": Viscous(normal=2, tangential=1), "objective": "towing"}, {"power_limit": 10.0}],
    ids=["drag", "power limit"],
)
def test_where_the_pace_matters_it_is_kept_so_that_the_numbers_of_the_result_hold(
    changes, unsolved, tmp_path
):
    stated = {"gait": Harmonic(1), "delta": 1e-2} | changes
    solution = unsolved(Problem("paced", ellipse(0.0, 1.2, 0.8), **stated))
    problem, limits = solution.problem, np.array([2.0, 1.5])
    stated = solution.export(tmp_path / "x.json", max_speed=limits, rate=400, ramp=False)
    written = json.loads((tmp_path / "x.json").read_text())
    path = path_through(np.array(written["angles_rad"]))
    made = replay(problem.body, problem.friction, path, 1e-2)
    assert made.work == pytest.approx(stated["work_per_period_weight_times_length"], rel=2e-4)
    assert made.distance == pytest.approx(stated["distance_per_period_body_lengths"], rel=2e-4)
    speeds = np.abs(written["speeds_rad_per_s"]).max(axis=1) / limits
    assert 0.99 < speeds.max() <= 1 + 1e-9  # the period is the shortest
    assert "the gait's own" in stated["pace"]
    said = r"too short for the joint speed limits at the gait's own pace.*use at least"
    with pytest.raises(ProblemError, match=said):
        solution.export(tmp_path / "x.json", max_speed=limits, period=0.99 * stated["period_s"])


def test_modes_of_a_smooth_body_are_called_modes(unsolved, tmp_path):
    guess, body = (
        Fourier(np.zeros(2), [[0.6], [0.0]], [[0.0], [0.5]]),
        colloc.ModalBody(2, panels=4),
    )
    gait = Harmonic(1, "antipodal")
    solution = unsolved(Problem("soft", guess, body, Friction(mu_t=3), gait, intervals=6))
    assert repr(solution.gait) == "<Fourier of 2 modes>"
    solution.export(tmp_path / "soft.csv", period=4)
    columns = pandas.read_csv(tmp_path / "soft.csv", comment="#").columns
    names = [f"mode_{k}_rad{per}" for per in ("", "_per_s") for k in (1, 2)]
    assert [*columns] == ["time_s", *names]
    data = solution.to_xarray()
    assert data.modes.dims == data.mode_rates.dims == ("mode", "t")
    with h5py.File(save(solution, tmp_path / "soft.h5")) as file:
        held = [*file["motion"], *file["gait"]]
    assert {"modes", "mode_rates", "mode"} <= set(held)
    frame, page = solution.to_dataframe(), report_page(solution)
    told = [*data.variables, *frame, *held, page, *summary_lines(solution, None)]
    # a field, of any body
    assert not [text for text in told if "joint" in str(text).replace("joint_limit", "")]
