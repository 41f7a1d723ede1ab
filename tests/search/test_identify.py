"""Friction from motion, within the stated errors; what a motion does not tell is said."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

import colloc
from colloc import Chain, Coupled, Foot, Fourier, Friction, Harmonic, Problem, Robot, Wheel
from colloc.commands.main import main
from colloc.search.evaluate import Identification, _Fit

GAIT = colloc.ellipse(A0=0.3, A1=1.6, B1=1.1)
WAVE = Fourier([0.0, 0.0, 0.0], [[0.6], [0.3], [-0.3]], [[0.0], [0.5], [0.5]])
TRUE = Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
GEARED = Coupled(Harmonic(1), gears=((1, 0), (0, 1), (-1, 1)))
FLOOR = Problem("floor", delta=1e-2, mesh_tolerance=1e-3)


@pytest.fixture(scope="module")
def crawled():
    return colloc.evaluate(FLOOR.with_(friction=TRUE), GAIT)


def recorded(
    path, solution, seed=0, noise=2e-3, periods=2.0, per_period=100, point="", length=1.0, lasts=1
):
    """Angles and places of a point, from a camera somewhere; noise lasts for so many samples."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(periods * per_period)) / per_period
    motion = solution.sample(t + 0.325)  # a camera begins anywhere in a period
    angles = motion.angles + noise * rng.normal(size=motion.angles.shape)
    if head := point == "head_":
        ends = np.stack(solution.problem.body.outline(motion.angles))[:, -1]
        c, s = np.cos(motion.theta), np.sin(motion.theta)
        ends = np.stack([c * ends[0] - s * ends[1], s * ends[0] + c * ends[1]])
    at = motion.tail + ends if head else motion.tail if point else motion.centre
    place = np.exp(1j * rng.uniform(0, 6)) * (at[0] + 1j * at[1]) + 3 - 2j
    x, y = (rng.normal(size=t.size // lasts).repeat(lasts) for _ in "xy")
    place = length * (place + noise * (x + 1j * y))
    columns = [4 * t, *angles, place.real, place.imag]
    names = ["time", *(f"joint_{k + 1}" for k in range(len(angles))), f"{point}x", f"{point}y"]
    if point == "tail_":
        columns.append(np.degrees(motion.theta) + 30 + np.degrees(noise) * rng.normal(size=t.size))
        names.append("yaw_deg")
    if head:
        bends = np.degrees(motion.theta + motion.angles.sum(axis=0))
        columns.append(bends + 30 + np.degrees(noise) * rng.normal(size=t.size))
        names.append("head_theta_deg")
    np.savetxt(path, np.column_stack(columns), "%.9g", ",", header=",".join(names), comments="")
    return path


@pytest.mark.slow
def test_known_coefficients_lie_within_the_errors_nineteen_times_in_twenty(crawled, tmp_path):
    off = []
    for seed in range(12):
        lasts = 1 + 4 * (seed % 2)
        path = recorded(tmp_path / "a.csv", crawled, seed, lasts=lasts)
        found = colloc.identify(FLOOR, path).coefficients
        assert found["mu_f"] == (1.0, 0.0)
        assert found["mu_t"][1] < 0.1 * lasts**0.5
        off.append([(found[x][0] - getattr(TRUE, x)) / found[x][1] for x in ("mu_t", "mu_b")])
    # an error is two standard deviations, so these are about a half, and 1 is rare
    assert (np.abs(off) < 1).mean() > 0.8
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 0.6  # of 24 numbers it is known to 15 %


class Line(_Fit):
    """Places that move by a slope times the one number, as they do with the mean of joint 1."""

    def __init__(self, residuals, slope):
        self.residuals, self.slope, self.gait = residuals, slope, GAIT
        self.counts, self.freedom = np.array([residuals.size, 0]), residuals.size - 5.0
        self.prior, self.noise = np.zeros((0, 1)), np.ones((2, 1))

    def off(self, x, motors=None):
        moved = x[0] + (motors or GAIT).mean[0] - GAIT.mean[0]
        return np.array([self.residuals + moved * self.slope, 0 * self.slope])


@pytest.mark.parametrize("lasts", [1, 8])
def test_errors_are_those_of_residuals_that_are_independent_and_of_samples_of_angles(lasts):
    rng, n = np.random.default_rng(0), 400
    slope, noise = rng.normal(size=(3, n)), rng.normal(size=(3, n // lasts)).repeat(lasts, axis=1)
    fit = Line(0.1 * noise, slope)
    x = fit.best(np.zeros(1))
    square = (fit.off(x)[0] ** 2).sum() / fit.freedom
    assert fit.noise[0, 0] == pytest.approx(square**0.5, rel=1e-3)
    alike, covariance = fit.covariance(x, None)
    assert 0.5 * lasts < alike < 2 * lasts
    assert covariance.item() == pytest.approx(alike * square / (slope**2).sum(), rel=1e-3)
    fit.noise, one = np.full((2, 1), square**0.5), np.zeros((1, 2, 3))
    one[0, 0, 0] = 0.05  # two standard deviations of it are in proportion
    _, more = fit.covariance(x, SimpleNamespace(directions=one, richer=None))
    assert (more - covariance).item() == pytest.approx(0.05**2, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("point", ["head_", "tail_"])
def test_any_point_of_the_body_and_its_direction_will_do_in_metres_too(crawled, tmp_path, point):
    path = recorded(tmp_path / "a.csv", crawled, noise=1e-6, point=point, length=0.6)
    found = colloc.identify(FLOOR, path, length=0.6)
    assert found.problem.friction.mu_t == pytest.approx(TRUE.mu_t, rel=1e-3)
    assert found.problem.friction.mu_b == pytest.approx(TRUE.mu_b, rel=1e-3)
    assert found.after < 1e-4 < found.before
    again = colloc.identify(FLOOR.with_(robot=Robot(length=0.6, mass=1, period=90)), path)
    assert again.coefficients == found.coefficients
    head, *_ = path.read_text().split("\n")
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows[:, 3:5] *= 100
    cm = head.replace(f"{point}x,{point}y", f"{point}x_cm,{point}y_cm")
    np.savetxt(tmp_path / "cm.csv", rows, "%.9g", ",", header=cm, comments="")
    measured = colloc.identify(FLOOR, tmp_path / "cm.csv", length=0.6)
    assert measured.problem.friction.mu_t == pytest.approx(TRUE.mu_t, rel=1e-3)
    with pytest.raises(colloc.ProblemError, match="give the length of the body"):
        colloc.identify(FLOOR, tmp_path / "cm.csv")


def test_directions_of_head_and_tail_alone_tell_coefficients_too(crawled, tmp_path):
    columns, path = [], tmp_path / "a.csv"
    for point in ("tail_", "head_"):
        recorded(path, crawled, noise=1e-6, point=point)
        columns.append(np.loadtxt(path, delimiter=",", skiprows=1)[:, [0, 1, 2, -1]])
    head = "time,joint_1,joint_2,yaw_deg,head_theta_deg"  # in no unit: the robot's pace
    both = np.column_stack([columns[0], columns[1][:, -1]])
    np.savetxt(path, both, "%.9g", ",", header=head, comments="")
    stated = FLOOR.with_(robot=Robot(length=0.6, mass=1, period=900))
    found = colloc.identify(stated, path, length=2)
    assert found.problem.friction.mu_t == pytest.approx(TRUE.mu_t, rel=1e-3)
    assert found.problem.friction.mu_b == pytest.approx(TRUE.mu_b, rel=1e-3)
    assert "path of headings in body lengths of 2 m" in found.message


def test_markers_at_ends_and_joints_tell_angles_and_path_of_the_centre_of_mass(tmp_path):
    heavy = FLOOR.with_(body=Chain(masses=(0.6, 0.3, 0.1)))
    motion = colloc.evaluate(heavy.with_(friction=TRUE), GAIT).sample(t := np.arange(200) / 100)
    outline = np.stack(heavy.body.outline(motion.angles))
    points = motion.tail[0] + 1j * motion.tail[1]
    points = points + np.exp(1j * motion.theta) * (outline[0] + 1j * outline[1])
    rows = np.column_stack([t, *np.concatenate([60 * points.real, 60 * points.imag])])
    names = "t," + ",".join(f"{axis}_{k}" for axis in "xy" for k in range(1, 5))
    np.savetxt(tmp_path / "a.csv", rows, "%.9g", ",", header=names, comments="")
    found = colloc.identify(heavy, tmp_path / "a.csv").problem.friction
    assert found.mu_t == pytest.approx(TRUE.mu_t, rel=1e-3)
    assert found.mu_b == pytest.approx(TRUE.mu_b, rel=1e-3)


@pytest.mark.slow
def test_with_inertia_the_coefficients_themselves_are_found(tmp_path):
    true = FLOOR.with_(friction=Friction(mu_t=0.5, mu_f=0.3, mu_b=0.4), froude=0.05, delta=1e-2)
    path = recorded(tmp_path / "a.csv", colloc.evaluate(true, GAIT), noise=1e-4, per_period=50)
    found = colloc.identify(true.with_(friction=Friction(mu_t=0.4, mu_f=0.4, mu_b=0.4)), path)
    for name, (value, error) in found.coefficients.items():
        assert 0 < error < 0.02, name
        assert abs(value - getattr(true.friction, name)) < 1.5 * error, name
    assert not found.remarks


@pytest.mark.slow
def test_wheels_have_one_coefficient_of_rolling(tmp_path):
    def wheeled(rolling):
        body = Chain((0.25,) * 4, feet=[Wheel(k, rolling=rolling) for k in range(4)])
        return Problem("wheels", body=body, delta=1e-2, mesh_tolerance=1e-3)

    path = recorded(tmp_path / "a.csv", colloc.evaluate(wheeled(0.02), WAVE))
    found = colloc.identify(wheeled(0.1), path)
    assert list(found.coefficients) == ["mu_t", "mu_f"]
    value, error = found.coefficients["mu_t"]
    assert abs(value - 5.0) < 1.5 * error < 0.1
    assert "friction=Friction(mu_t=" in found.line


@pytest.mark.slow
@pytest.mark.parametrize("froude", [0.0, 0.02])
def test_axles_tell_what_resists_rolling_and_slip_or_slowly_the_ratio(tmp_path, froude):
    def wheeled(rolling, sideways):
        feet = [Wheel(k, rolling=rolling, sideways=sideways, axle=True) for k in range(3)]
        return Problem("axles", body=Chain((0.3, 0.4, 0.3), feet=feet), delta=1e-3, froude=froude)

    true, stated = {"rolling": 0.02, "sideways": 0.1}, wheeled(0.03, 0.13)
    path = recorded(tmp_path / "a.csv", colloc.evaluate(wheeled(**true), GAIT), per_period=140)
    found, scale = colloc.identify(stated, path).coefficients, 1.0 if froude else 1.5
    for name in found if froude else ("sideways",):
        value, error = found[name]
        assert abs(value - scale * true[name]) < 1.5 * error < 0.1 * value


@pytest.mark.slow
def test_the_ratio_on_axles_is_met_from_far_away_where_the_first_search_ends_short_of_it(tmp_path):
    def wheeled(rolling):
        feet = [Wheel(k, rolling=rolling, sideways=0.1, axle=True) for k in range(4)]
        return Problem("axles", body=Chain((0.25,) * 4, feet=feet), delta=1e-3)

    path = recorded(tmp_path / "a.csv", colloc.evaluate(wheeled(0.02), WAVE))
    found = colloc.identify(wheeled(0.05), path)
    assert found.coefficients["sideways"][0] == pytest.approx(0.25, rel=1e-2)
    assert found.after < 3e-3 < 0.1 < found.before


@pytest.mark.slow
def test_what_the_motion_does_not_tell_stays_as_stated_and_is_said(tmp_path):
    """Driven tail first, on feet that hardly slip sideways, it says nothing of sliding forwards."""

    def standing(back):
        each = Friction(mu_t=1.0, mu_f=0.1, mu_b=back)
        body = Chain((0.25,) * 4, feet=[Foot(k, friction=each) for k in range(4)])
        return Problem("standing", body=body, delta=1e-2, mesh_tolerance=1e-3)

    path = recorded(tmp_path / "a.csv", colloc.evaluate(standing(0.05), WAVE))
    found = colloc.identify(standing(0.08), path)
    assert any("cannot distinguish mu_f from mu_t and mu_b" in each for each in found.remarks)
    assert found.coefficients["mu_b"][1] == np.inf
    assert found.facts()["coefficients"]["mu_b"][1] is None
    value = {name: value for name, (value, _) in found.coefficients.items()}
    assert value["mu_t"] / value["mu_b"] == pytest.approx(20.0, rel=0.05)
    # and a body that hardly waves tells nothing at all
    little = Fourier([0.0, 0.0], [[0.1], [0.05]], [[0.0], [0.1]])
    path = recorded(tmp_path / "a.csv", colloc.evaluate(FLOOR, little), noise=5e-3)
    found = colloc.identify(FLOOR, path)
    for name in ("mu_t", "mu_b"):
        assert found.coefficients[name] == (pytest.approx(1.0, abs=0.1), np.inf)


@pytest.mark.slow
def test_motors_may_share_joints(tmp_path):
    geared = Problem("geared", body=Chain((0.25,) * 4), gait=GEARED, delta=1e-3)
    motors = Fourier([0.2, 0.0], [[0.8], [0.3]], [[0.0], [0.9]])
    motion = colloc.evaluate(geared.with_(friction=TRUE), motors).sample(t := np.arange(200) / 100)
    names = "t,joint_1,joint_2,x,y"
    rows = np.column_stack([t, *motors.angles(t), *motion.centre])
    np.savetxt(tmp_path / "a.csv", rows, "%.9g", ",", header=names, comments="")
    found = colloc.identify(geared, tmp_path / "a.csv")
    assert found.problem.friction.mu_t == pytest.approx(TRUE.mu_t, rel=0.01)
    assert found.problem.friction.mu_b == pytest.approx(TRUE.mu_b, rel=0.01)


@pytest.mark.slow
def test_a_path_of_another_body_is_not_explained(crawled, tmp_path):
    path = recorded(tmp_path / "a.csv", crawled)
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows[:, 3] += 0.3 * np.sin(rows[:, 0])
    np.savetxt(path, rows, "%.9g", ",", header=path.read_text().split("\n")[0], comments="")
    assert "No coefficients reproduce the path" in str(colloc.identify(FLOOR, path))


@pytest.mark.slow
def test_the_command_prints_what_to_write_into_the_problem_file(crawled, tmp_path, capsys):
    recorded(tmp_path / "a.csv", crawled, per_period=40)
    problem = tmp_path / "floor.py"
    problem.write_text(
        "from colloc import *\nPROBLEM = Problem('floor', delta=1e-2, mesh_tolerance=1e-3)\n"
    )
    assert main(["identify", str(problem), str(tmp_path / "a.csv")]) == 0
    said = capsys.readouterr().out
    found = colloc.identify(FLOOR, tmp_path / "a.csv")
    assert str(found) in said
    assert eval(found.line.partition("=")[2], {"Friction": Friction}) == found.problem.friction
    words = ["identify", str(problem), str(tmp_path / "a.csv"), "--json", "--mu-forward", "0.3"]
    assert main(words) == 0
    facts = json.loads(capsys.readouterr().out)
    scaled = {name: 0.3 * np.array(each) for name, each in found.coefficients.items()}
    for name, each in facts["coefficients"].items():
        assert each == pytest.approx(scaled[name], rel=1e-3)
    with pytest.raises(colloc.ProblemError, match="leave mu_forward out"):
        colloc.identify(FLOOR.with_(froude=0.05), tmp_path / "a.csv", mu_forward=0.3)


def test_what_the_motion_does_not_tell_apart_is_named():
    """Slow motion leaves a factor of all open: all but one change as that one does back."""
    stated = SimpleNamespace(names=["mu_t", "mu_f", "mu_b"], free=[0, 2], only_ratios=True)
    for direction, said in (
        ((0.1, 1.0), "mu_b from mu_t and mu_f: it does not change the motion."),
        ((1.0, 1.0), "mu_f from mu_t and mu_b: it does not change the motion."),
        ((1.0, -1.0), "mu_t and mu_b: the motion is the same with mu_t +11 %, mu_b -10 %."),
    ):
        assert _Fit.describe(stated, np.array(direction)) == f"This gait cannot distinguish {said}"


def test_a_record_without_a_path_is_refused(tmp_path):
    t = np.arange(60) / 60
    rows = np.column_stack([t, *GAIT.angles(t)])
    np.savetxt(tmp_path / "a.csv", rows, header="t,joint_1,joint_2", delimiter=",", comments="")
    with pytest.raises(colloc.ProblemError, match="holds no path of the body"):
        colloc.identify(FLOOR, tmp_path / "a.csv")


@pytest.mark.parametrize("weights", [(None, None, None), (0.5, 0.2, 0.3)], ids=["usual", "stated"])
def test_the_line_for_a_problem_file_states_feet_and_their_weights_if_they_differ(weights):
    feet = tuple(Wheel(k, rolling=0.1, weight=each) for k, each in enumerate(weights))
    body = Chain(feet=feet)
    found = Identification(Problem("wheels", body=body), {}, 0.0, 0.0, (), "")
    stated = eval(found.line.removeprefix("feet="), {"Foot": Foot, "Friction": Friction})
    assert Chain(feet=stated).feet == body.feet
    assert ("weight" in found.line) == (weights[0] is not None)
