"""A gait of one's own: however the angles are given, what comes out is what their replay says."""

import re

import numpy as np
import pytest

import colloc
from colloc.commands.main import main
from colloc.gaits.fitted_gait import fitted_gait
from colloc.search.evaluate import with_motors

GAIT = colloc.Fourier([0.2, -0.1], [[0.9, 0.1], [0.3, 0.0]], [[0.0, 0.1], [0.8, -0.1]])
PROBLEM = colloc.Problem("mine", delta=1e-3)
T = np.arange(60) / 60
LINKS = (0.3, 0.45, 0.25)
QUICK = PROBLEM.with_(delta=3e-3, mesh_tolerance=1e-3)
N = 40


@pytest.fixture(scope="module")
def evaluated():
    return colloc.evaluate(PROBLEM, GAIT)


def written(path, time, angles, header="t,joint_1,joint_2"):
    rows = np.column_stack([time, *angles])
    head = f"# measured\n{header}\n" if header else "# measured\n"
    np.savetxt(path, rows, "%.12g", ",", header=head.rstrip(), comments="")
    return path


def test_it_is_what_a_replay_of_the_angles_says(evaluated):
    replayed = colloc.replay(PROBLEM.body, PROBLEM.friction, GAIT, 1e-3, turn=evaluated.rotation)
    assert evaluated.success
    assert evaluated.efficiency == pytest.approx(replayed.efficiency, rel=1e-6)
    assert evaluated.rotation == pytest.approx(replayed.rotation, abs=1e-6)
    assert evaluated.turning  # which is told
    checked = {check.name for check in evaluated.certificate.checks}
    assert {"replay gap", "mesh error", "self-contact"} <= checked
    assert not {"KKT error", "second order"} & checked
    assert evaluated.standing == ["none: the gait was given"]


def test_delta_at_unit_shape_speed_becomes_that_of_the_gait_in_a_period():
    stated, _ = with_motors(PROBLEM.with_(gait=colloc.Polygon(4)), GAIT)
    assert stated.delta == pytest.approx(1e-3 * np.sqrt((GAIT.rates(T) ** 2).sum(axis=0).mean()))


def filmed(path, time, lengths=LINKS, names="x_{} y_{}", sway=0.0):
    """Points of a body of 250 pixels, which goes 0.05 of it a period, but for a sway in two."""
    turns = np.vstack([0 * time, np.cumsum(GAIT.angles(time), axis=0)])[: len(lengths)]
    links = np.array(lengths)[:, None] * np.exp(1j * (turns + 0.4 * np.sin(2 * np.pi * time)))
    points = np.vstack([0 * time, np.cumsum(links, axis=0)])
    points -= np.array(lengths) @ (0.5 * (points[:-1] + points[1:]))
    along = time + sway * np.sin(np.pi * time)
    points = 250 * (points + (0.03 - 0.04j) * along) + 700 + 300j
    rows = np.stack([points.real, points.imag], axis=1).reshape(-1, time.size)
    header = ",".join(names.format(k, k).replace(" ", ",") for k in range(len(points)))
    return written(path, time, rows, f"t,{header}")


@pytest.mark.parametrize("time", [np.arange(121) / 60, np.arange(120) / 120])
def test_points_of_the_body_tell_its_angles_and_how_far_it_went(time, tmp_path):
    body = colloc.Chain(LINKS)
    path = filmed(tmp_path / "film.csv", time)
    fitted = fitted_gait(path, 2, body=body)
    np.testing.assert_allclose(fitted.gait.angles(T), GAIT.angles(T), atol=1e-6)
    assert fitted.went == pytest.approx(0.05, rel=1e-6)  # straight on beyond the last sample
    found = colloc.evaluate(PROBLEM.with_(body=body), path)
    assert "250 of them a body length" in found.message
    went = float(re.search(r"went ([\d.]+) body lengths per cycle", found.message)[1])
    assert went == pytest.approx(0.05, rel=0.01)
    assert f", sideways; predicted {found.distance:.3g} +- " in found.message
    assert found.message.endswith(f"{found.travels}.")


def test_how_far_it_went_is_the_mean_of_all_cycles_of_a_film(tmp_path):
    path = filmed(tmp_path / "film.csv", np.arange(121) / 60, sway=0.1)
    went = fitted_gait(path, 2, body=colloc.Chain(LINKS)).went
    assert went == pytest.approx(0.05 * (1 - 0.4 / np.pi), rel=1e-2)


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ({"names": "x_{} y_{}", "lengths": (0.5, 0.5)}, "x of 3 points .* of 3 links has 4 points"),
        ({"names": "m{}_x m{}_z"}, "y of 0; a body"),
        ({"lengths": (0.3, 0.3, 0.4)}, "points 2 and 3 are 0.3 of the body apart, .* is 0.45 long"),
    ],
)
def test_points_that_are_not_those_of_the_body_are_refused(how, says, tmp_path):
    path = filmed(tmp_path / "film.csv", T, **how)
    with pytest.raises(colloc.ProblemError, match=says):
        fitted_gait(path, 2, body=colloc.Chain(LINKS))


def test_every_way_to_give_a_gait_gives_the_same_one(tmp_path):
    angles, unequal = GAIT.angles(T), np.sort(np.random.default_rng(0).uniform(0, 3, 200))
    closed = np.concatenate([angles, angles[:, :1]], axis=1)
    names = "time_s,joint_1_deg,joint_2_deg"
    degrees = written(tmp_path / "d.csv", 2 * T, np.degrees(angles), names)
    ways = {
        "array": fitted_gait(angles, 2),
        "closed array": fitted_gait(closed, 2),
        "function": fitted_gait(GAIT.angles, 2),
        "file": fitted_gait(written(tmp_path / "a.csv", 5 * T + 3, angles), 2),
        "file without names": fitted_gait(str(written(tmp_path / "b.csv", 5 * T, angles, "")), 2),
        "degrees by name": fitted_gait(degrees, 2),
        "degrees if said": fitted_gait(np.degrees(angles), 2, degrees=True),
    }
    for way, found in ways.items():
        assert found.gait.n_harmonic == 2, way
        np.testing.assert_allclose(found.gait.angles(T), angles, atol=1e-9, err_msg=way)
        assert found.largest < 1e-9, way
    several = written(tmp_path / "c.csv", unequal * 7, GAIT.angles(unequal - unequal[0]))
    np.testing.assert_allclose(fitted_gait(several, 2, period=7).gait.angles(T), angles, atol=1e-9)


def test_noise_is_smoothed_and_what_is_left_out_is_stated():
    rng = np.random.default_rng(1)
    t = np.arange(400) / 400
    noisy = GAIT.angles(t) + 0.02 * rng.normal(size=(2, 400))
    found, twice = (fitted_gait(np.repeat(noisy, n, axis=1), 2, harmonics=2) for n in (1, 2))
    # samples that are written twice tell no more
    sizes = (np.linalg.norm(each.uncertainty.directions) for each in (twice, found))
    assert next(sizes) == pytest.approx(next(sizes), rel=0.1)
    found = fitted_gait(noisy, 2)
    assert found.gait.n_harmonic == 2
    assert found.rms == pytest.approx(0.02, rel=0.1)
    # least squares averages: the noise times the root of coefficients over samples
    off = found.gait.angles(t) - GAIT.angles(t)
    assert np.sqrt((off**2).mean()) < 2 * 0.02 * np.sqrt(5 / 400)
    assert f"400 samples: residual {found.rms:.1e} rad r.m.s." in found.describe()


def test_what_is_missing_at_the_end_of_a_record_is_found_and_a_drift_taken_out(tmp_path):
    unequal = np.sort(np.random.default_rng(0).uniform(0, 1, 60))
    for t in (T[:-3], unequal):
        gait = fitted_gait(written(tmp_path / "a.csv", t, GAIT.angles(t)), 2).gait
        np.testing.assert_allclose(gait.angles(T - t[0]), GAIT.angles(T), atol=1e-6)
    drifts = GAIT.angles(T) + np.array([[0.1], [-0.05]]) * (T - T.mean())
    found = fitted_gait(drifts, 2)
    np.testing.assert_allclose(found.gait.angles(T), GAIT.angles(T), atol=1e-9)
    assert found.drift == pytest.approx(0.1)
    assert found.largest == pytest.approx(0.05, rel=0.02)
    told = fitted_gait(np.degrees(drifts), 2, degrees=True).describe()
    assert "a drift of 5.73° per cycle taken out: residual 1.3e+00° r.m.s." in told
    far = np.degrees(GAIT.angles(T) + np.array([[1.0], [0.0]]) * T)
    with pytest.raises(colloc.ProblemError, match=r"joint 1 is off by 57\.3°, and it moves"):
        fitted_gait(far, 2, degrees=True)


def test_a_retraced_gait_goes_nowhere_and_that_is_said():
    retraced = colloc.Fourier([0.3, 0.1], [[0.8], [0.5]], np.zeros((2, 1)))
    there_and_back = colloc.evaluate(PROBLEM, retraced)
    assert not there_and_back.success
    assert abs(there_and_back.distance) < 1e-6
    assert "no net displacement" in there_and_back.message


def test_kept_and_loaded_it_is_the_same(evaluated, tmp_path):
    loaded = colloc.load(colloc.save(evaluated, tmp_path / "x.h5"))
    assert loaded.message == evaluated.message
    assert loaded.status == "solved"
    assert colloc.certify(loaded.answer).efficiency == pytest.approx(evaluated.efficiency, rel=1e-6)
    cost = loaded.robot(1.2, 3, 5000).facts["cost_of_transport"]
    assert cost == pytest.approx(1 / evaluated.efficiency, rel=1e-4)


def test_the_command_saves_what_compare_takes(tmp_path, monkeypatch, capsys, evaluated):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "p.py").write_text("from colloc import *\nPROBLEM = Problem('p', delta=1e-3)\n")
    own = colloc.Fourier(GAIT.mean, 0.8 * GAIT.cos, 0.8 * GAIT.sin)
    written(tmp_path / "own.csv", T, own.angles(T))
    colloc.save(evaluated, "best.h5")
    assert main(["evaluate", "p.py", "own.csv"]) == 0
    assert "own-evaluated: solved" in capsys.readouterr().out
    assert main(["verify", "results/own-evaluated.h5", "--compare", "best.h5"]) == 1
    amplitude = np.sqrt(0.5 * np.sum(GAIT.cos**2 + GAIT.sin**2))
    assert f"joint angles by {0.2 * amplitude:.3g} rad" in capsys.readouterr().out


@pytest.mark.parametrize(
    "objective", ["speed", "towing", "driven efficiency", "distance / (work + 0.1 * length)"]
)
@pytest.mark.parametrize("mu", [1.0, 0.02])
def test_a_gait_is_certified_in_whatever_is_asked_of_it(objective, mu):
    asked = {"objective": objective, "friction": colloc.Friction(mu, mu, mu)}
    solution = colloc.evaluate(PROBLEM.with_(**asked), GAIT)
    assert solution.status == "solved"
    assert solution.answer.value == pytest.approx(solution.value, rel=1e-4)


@pytest.fixture(scope="module")
def exact():
    return colloc.evaluate(QUICK, GAIT)


@pytest.mark.parametrize("degrees", [pytest.param(0.1, marks=pytest.mark.slow), 1.0])
def test_stated_errors_hold_for_gaits_through_noisy_samples_and_grow_with_the_noise(exact, degrees):
    rng, off = np.random.default_rng(3), []
    for _ in range(10):
        noise = np.radians(degrees) * rng.normal(size=(2, N))
        noisy = colloc.evaluate(QUICK, GAIT.angles(np.arange(N) / N) + noise)
        stated = noisy.certificate
        assert 1e-4 * degrees < stated.value_error < 2e-2 * degrees
        assert stated.value_error == stated.efficiency_error
        told = f"leaves d/W uncertain by {stated.of_samples[0]:.1e} (two standard deviations"
        assert told in noisy.message
        wrong = (
            (noisy.efficiency - exact.efficiency) / stated.efficiency_error,
            (noisy.distance - exact.distance) / stated.errors["distance"],
            (noisy.work - exact.work) / stated.errors["work"],
        )
        off.append(np.abs(wrong))
    assert np.sum(np.array(off) <= 1) >= 27  # of 30, 95 % each
    # stated are two standard deviations; of the work by no more than that
    assert 0.25 < np.sqrt(np.mean(np.square(off), axis=0))[2] < 0.6


@pytest.mark.parametrize("samples", [9, 12, 40])
def test_19_of_20_records_are_within_what_a_series_says_its_coefficients_are_off_by(samples):
    """However few their samples are."""
    rng, inside = np.random.default_rng(2), []
    true = GAIT.angles(np.arange(samples) / samples)
    for _ in range(300):
        noise = 0.02 * rng.normal(size=true.shape)
        fitted = fitted_gait(true + noise, 2, period=samples, harmonics=2)
        off = fitted.gait.table - GAIT.resize(2).table
        stated, few = fitted.uncertainty, fitted.gait.n_harmonic * 2 + 1
        deviation = np.linalg.norm(stated.directions[:, :, :few], axis=0)
        inside.append(np.abs(off) <= stated.factor * deviation)
    assert 0.93 < np.mean(inside) < 0.995


def test_noise_about_an_optimum_is_stated_though_its_gradient_vanishes():
    stated = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    best = colloc.solve(stated, starts=1)
    noise = np.radians(3) * np.random.default_rng(0).normal(size=(2, N))
    noisy = colloc.evaluate(QUICK.with_(delta=1e-2), best.gait.angles(np.arange(N) / N) + noise)
    assert 0 < best.value - noisy.value <= noisy.certificate.value_error


def test_a_series_that_misses_its_samples_states_its_lack_of_fit():
    cos, sin = [[1.2, 0.0, 0.4], [0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0], [1.2, 0.0, -0.4]]
    corners = colloc.Fourier([0, 0], cos, sin)
    true, t = colloc.evaluate(QUICK, corners), np.arange(8) / 8
    found = colloc.evaluate(QUICK, corners.angles(t), harmonics=1)
    assert "4.0e-01 rad at most" in found.message
    assert abs(found.efficiency - true.efficiency) > 1e-2
    assert abs(found.efficiency - true.efficiency) <= found.certificate.efficiency_error
    assert "lack of fit: 3 harmonics would change it by" in found.message
    enough = colloc.evaluate(QUICK, corners.angles(np.arange(60) / 60))
    assert enough.certificate.efficiency_error < 1e-6 < 1e3 * enough.certificate.efficiency_error


def test_errors_of_samples_are_in_units_of_friction_and_kept_and_no_disagreement(tmp_path, capsys):
    noisy = GAIT.angles(np.arange(N) / N) + 0.01 * np.random.default_rng(0).normal(size=(2, N))
    path = colloc.save(colloc.evaluate(QUICK, noisy), tmp_path / "x.h5")
    loaded = colloc.load(path)
    assert loaded.certificate.value_error > loaded.certificate.of_samples[0] > 1e-4
    assert loaded.certificate.facts()["errors_of_samples"] == list(loaded.certificate.of_samples)
    rough = colloc.evaluate(QUICK.with_(friction=colloc.Friction(100, 100, 100)), noisy)
    by_friction = loaded.certificate.of_samples * np.array([0.01, 0.01, 1.0, 100.0])
    np.testing.assert_allclose(rough.certificate.of_samples, by_friction, rtol=1e-3)
    assert main(["verify", str(path), "--quiet"]) == 0
    assert f"+- {loaded.certificate.value_error:.0e} by replay" in capsys.readouterr().out
    # of motors, too, whatever turn of theirs is one of a joint, but for what is tried at random
    geared = QUICK.with_(gait=colloc.Coupled(colloc.Harmonic(1), gears=((0, -2), (1, 0))))
    driven = colloc.evaluate(geared, noisy[::-1] * [[1.0], [-0.5]]).certificate.of_samples
    np.testing.assert_allclose(driven, loaded.certificate.of_samples, rtol=0.1)


def test_a_robot_is_played_at_the_pace_of_a_record_whose_unit_of_time_is_known(tmp_path):
    robot = colloc.Robot(length=0.6, mass=1, period=(1, 5))
    stated, angles = colloc.Problem("r", robot=robot), GAIT.angles(T)
    for name, unit in (("t_ms", 1e-3), ("t [s]", 1.0)):
        path = written(tmp_path / "x.csv", 2 / unit * T, angles, f"{name},q1,q2")
        assert "; at its 2 s a cycle." in (played := colloc.evaluate(stated, path)).message
        assert played.problem.robot.period == pytest.approx(2, 1e-3)


def test_an_exported_gait_states_no_error_of_its_samples_whatever_its_columns(exact, tmp_path):
    for periods in (1, 3):
        exact.export(tmp_path / "x.csv", period=4, length=1, mass=2, periods=periods)
        fitted = fitted_gait(tmp_path / "x.csv", 2)
        np.testing.assert_allclose(fitted.gait.angles(T), GAIT.angles(T), atol=1e-8)
        assert "ignored: joint_1_rad_per_s" in fitted.describe()
    again = colloc.evaluate(QUICK, tmp_path / "x.csv")
    assert again.certificate.of_samples[0] < 1e-8
    assert "uncertain" not in again.message


def test_servos_about_90_degrees_are_refused_before_the_replay_where_links_cross(tmp_path):
    five = colloc.Problem("five", body=colloc.Chain((0.2,) * 5))
    wave = np.degrees(0.7 * np.sin(2 * np.pi * T - np.arange(4)[:, None]))
    path = written(tmp_path / "servo.csv", T, 90 + wave, "t_s,s1_deg,s2_deg,s3_deg,s4_deg")
    said = r"all joints move about 90°, where links cross: .* subtract it"
    with pytest.raises(colloc.ProblemError, match=said):
        colloc.evaluate(five, path)


def test_a_gait_that_turns_goes_as_far_as_its_mirror_image_which_turns_the_other_way():
    bent = colloc.Fourier([1.0, 1.1], [[-1.0], [0.7]], [[1.0], [0.9]])
    one, other = (colloc.evaluate(QUICK, gait) for gait in (bent, bent.mirrored))
    assert one.success
    assert other.success
    assert other.rotation == pytest.approx(-one.rotation, rel=1e-6)
    assert abs(one.rotation) > 0.3
    assert one.answer.distance == pytest.approx(one.certificate.distance, rel=1e-3)
    little = colloc.evaluate(QUICK, colloc.Fourier([0.2003, -0.2], [[0.9], [-0.9]], [[0.5]] * 2))
    assert little.success  # as one that turns, by 1e-3 of its way
    assert 0 < abs(little.problem.rotation) < 1e-4
    errors = (each.certificate.errors["distance"] for each in (one, other))
    assert other.distance == pytest.approx(one.distance, abs=sum(errors))
    assert other.arc.radius == pytest.approx(one.arc.radius, rel=1e-4)
