"""Families of gaits: fronts of two objectives, none better in both, their ends the best by one alone;
gaits that steer, certified at every turn, between which a controller can interpolate."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

import colloc
from colloc import Chain, Friction, Harmonic, Objective, Problem, load, pareto_front, replay, steer
from colloc.commands.main import main
from colloc.gaits.fitted_gait import fitted_gait
from colloc.pictures.figure import plot_front, plot_steering
from colloc.results.robot import in_si
from colloc.search.solve import solve
from colloc.studies import families
from colloc.studies.families import Gap, ParetoFront, Steering
from colloc.system.errors import NotConvergedError

USUAL = {"gait": Harmonic(1, "bilateral"), "mesh_tolerance": 1e-4}
PROBLEM = Problem("wide", friction=Friction(mu_t=10, mu_f=1, mu_b=1), delta=1e-2, **USUAL)

LONG = PROBLEM.with_(at_least={"length": 9.0})  # without it 7.3 to 8.3
ONE_FLOOR = """
from colloc import *
PROBLEM = Problem("floor", friction=Friction(mu_t=10, mu_f=1, mu_b=1), gait=Harmonic(1, "bilateral"), delta=1e-2, mesh_tolerance=1e-4)
"""


EASY = {"gait": Harmonic(1, "bilateral"), "friction": Friction(mu_t=4, mu_f=1, mu_b=1)}
STRAIGHT = Problem("p", delta=1e-2, mesh_tolerance=1e-4, **EASY)
TURNS = np.radians([-10, 0, 10])
STUCK = {"gait": colloc.Coupled(Harmonic(1), stuck={1: 0.5}), "guess": None}
STUCK |= {"body": Chain((0.2,) * 5), "friction": Friction(mu_t=2, mu_f=1, mu_b=1)}
ASIDE = {"gait": Harmonic(1), "joint_limit": ((-1.5, 2.6),) * 2}


@pytest.fixture(scope="module")
def front():
    return pareto_front(LONG, "speed", "efficiency", points=4, starts=1)


def test_a_front_is_monotone_and_even_and_every_point_is_certified_and_as_its_problem_asks(front):
    """Even also where it is so steep that even steps in one objective are large in the other."""
    assert not front.gaps
    assert apart(front).max() <= 2 / 3
    assert all(point.success for point in front.points)
    assert min(point.certificate.values["length"] for point in front.points) > 9 - 1e-3
    speed, efficiency = front.values.T
    assert (np.diff(speed) < 0).all()
    assert (np.diff(efficiency) > 0).all()
    # ends that differ in one objective are enough
    assert not replace(front, objectives=(front.objectives[0], Objective("length"))).narrow


def apart(front):
    """How far neighbours are apart in both objectives, as shares of the front, ``(n - 1, 2)``."""
    return np.abs(np.diff(front.values, axis=0)) / np.ptp(front.values, axis=0)


@pytest.mark.slow
def test_points_differ_and_what_lies_empty_is_listed():
    """The farthest gait goes 0.286 with an efficiency of 1.4; the next ones 0.269, with 2.1."""
    hole = Problem("hole", None, Chain(feet=1), Friction(0.3, 0.3, 0.3), delta=2e-3, **USUAL)
    front = pareto_front(hole, "distance", "efficiency", 5, starts=2)
    assert front.certified
    assert (np.diff(front.values, axis=0) * [-1, 1] > 1e-6).all()
    shares = apart(front).max(axis=1)
    assert shares.min() > 0.02
    (empty,) = np.flatnonzero(shares > 0.5)
    assert [gap.after for gap in front.gaps] == [empty]


def test_a_gap_says_why_its_gait_failed(monkeypatch):
    def fail_between(problem, starts):
        if len(problem.at_least) > len(LONG.at_least):
            raise NotConvergedError("nobody knows")
        return alone(problem, starts)

    alone = families.solve_member
    monkeypatch.setattr(families, "solve_member", fail_between)
    front = pareto_front(LONG, "speed", "efficiency", points=4, starts=1)
    assert [gap.why for gap in front.gaps] == ["nobody knows"]
    assert not front.certified


def test_the_figure_draws_no_line_over_a_gap(front):
    axes = plot_front(replace(front, gaps=(Gap(1, "nothing is better", True),))).axes[0]
    drawn = axes.lines[0].get_xydata()
    assert np.isnan(drawn[2]).all()
    np.testing.assert_array_equal(np.delete(drawn, 2, axis=0), front.values[:, ::-1])
    np.testing.assert_array_equal(axes.lines[1].get_xydata(), front.values[1:3, ::-1])
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["no gait found between"]


@pytest.mark.slow
def test_where_one_gait_is_best_in_both_it_is_the_only_point():
    front = pareto_front(PROBLEM, "distance", "distance * 2", 4, starts=1)
    assert len(front.points) == 1
    assert not front.gaps


def test_its_ends_are_the_best_by_one_objective_alone(front):
    for k, (name, at) in enumerate((("speed", 0), ("efficiency", -1))):
        alone = solve(LONG.with_(objective=name), 1)
        assert front.values[at, k] == pytest.approx(alone.certificate.value, rel=1e-9)


@pytest.mark.parametrize("signs", [(1, 1, 1, 1), (-1, 1, -1, 1), (1, -1, -1, -1)])
def test_the_figure_draws_every_value_and_mirror_images_alike(front, signs):
    points = [
        replace(point, answer=replace(point.answer, gait=point.gait.scaled(sign)))
        for sign, point in zip(np.resize(signs, len(front.points)), front.points, strict=True)
    ]
    values, plane = plot_front(replace(front, points=tuple(points))).axes
    np.testing.assert_array_equal(values.lines[0].get_xydata(), front.values[:, ::-1])
    *others, last = (line.get_xydata() for line in plane.lines)
    angles = points[-1].gait.angles(np.linspace(0.0, 1.0, len(last)))
    np.testing.assert_allclose(last.T, angles, atol=1e-12)
    assert len(others) == len(front.points) - 1
    assert all(np.abs(path - last).sum() < np.abs(path + last).sum() for path in others)


def test_an_objective_that_certificates_do_not_know_is_measured():
    ends = pareto_front(PROBLEM, "speed", "driven efficiency", 2, starts=1)
    for end, (_, value) in zip(ends.points, ends.values, strict=True):
        at = PROBLEM.body, PROBLEM.law, end.gait, end.delta_per_period
        assert value == pytest.approx(replay(*at, objective=ends.objectives[1]).value, rel=1e-5)


def test_a_gait_that_turns_is_as_far_whether_its_certificate_knows_the_objective_or_not():
    bent = colloc.Fourier([1.0, 1.1], [[-1.0], [0.7]], [[1.0], [0.9]])
    point = colloc.evaluate(Problem("bent", delta=1e-2), bent)
    assert abs(point.rotation) > 0.3
    aims = Objective("distance"), Objective("distance * driven_work / driven_work")
    ((known, measured),) = ParetoFront(point.problem, aims, (point,)).values
    assert measured == pytest.approx(known, rel=1e-4)


@pytest.mark.slow
def test_from_the_answer_to_the_farthest_none_is_dominated_and_all_differ():
    """One foot on each of three links, as `colloc solve --front` does it."""
    feet = Problem("feet", body=Chain(feet=1), gait=Harmonic(1, "bilateral"), delta=1e-3)
    best, farthest = solve(feet), solve(feet.with_(objective="distance"))
    front = pareto_front(feet, best=best)
    assert front.points[-1] is best
    assert front.values[0, 0] == pytest.approx(farthest.distance, rel=1e-4)
    assert 4 <= len(front.points) <= 8
    assert (np.diff(front.values, axis=0) * [-1, 1] > 1e-3 * np.abs(front.values[1:])).any(1).all()
    assert (np.diff(front.values, axis=0) * [-1, 1] > 0).all()
    wide = np.flatnonzero(apart(front).max(axis=1) > 2 / 4)
    assert [gap.after for gap in front.gaps] == wide.tolist()


def test_a_robots_front_is_in_centimetres_a_second_and_joules_a_metre():
    robot = colloc.Robot(length=0.5, mass=2, period=40, idle_power=0.02)
    problem = Problem("robot", friction=Friction(0.3, 0.3, 0.3), robot=robot, delta=1e-2, **USUAL)
    front = pareto_front(problem, points=2, starts=1)
    names, numbers = front.in_units
    assert names == ("speed [cm/s]", "energy [J/m]")
    for point, (speed, energy) in zip(front.points, numbers, strict=True):
        at = problem.body, problem.law, point.gait, point.delta_per_period
        measured = replay(*at, quantities=["driven_work"])
        way, unit = 0.5 * measured.distance, 2 * 9.81 * 0.5
        assert speed == pytest.approx(100 * way / 40, rel=1e-5)
        battery = unit * measured.values["driven_work"] + 0.02 * 40
        assert energy == pytest.approx(battery / way, rel=1e-4)
        assert in_si(point)["mean_battery_power_W"] == pytest.approx(battery / 40, rel=1e-4)


def test_where_the_period_is_sought_a_front_is_of_the_speed_unless_another_objective_is_stated():
    robot = colloc.Robot(length=0.5, mass=2, period=(1, 20), idle_power=1)
    with pytest.raises(colloc.ProblemError, match="two objectives, not speed twice"):
        pareto_front(Problem("sought", robot=robot), None, "distance / period")


def test_of_a_quantity_that_is_asked_for_twice_the_larger_value_counts():
    twice = PROBLEM.with_(at_least=[("distance", x) for x in (0.1, 0.2, 0.15)] + [("work", 0.1)])
    assert [least for _, least in twice.at_least] == [0.2, 0.1]


@pytest.mark.slow
def test_solve_leaves_a_front_that_the_report_shows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "floor.py").write_text(ONE_FLOOR, encoding="utf-8")
    assert main(["solve", "floor.py", "--front", "--starts", "2", "--json"]) == 0
    front = json.loads(capsys.readouterr().out)["front"]
    points = [load(row["file"]) for row in front["points"]]
    assert points[-1].value == load("results/floor.h5").value
    assert main(["report", "results/floor.h5"]) == 0
    page = (tmp_path / "results/floor.html").read_text(encoding="utf-8")
    assert all(f"<td>{point.distance:.5g}</td>" in page for point in points)
    # a front of another problem is none of this one
    (tmp_path / "floor.py").write_text(ONE_FLOOR.replace("mu_t=10", "mu_t=9"), encoding="utf-8")
    assert main(["solve", "floor.py", "--starts", "1", "--no-figure"]) == 0
    assert main(["report", "results/floor.h5"]) == 0
    assert "another problem, and left out" in capsys.readouterr().err


@pytest.fixture(scope="module")
def family():
    return steer(STRAIGHT, TURNS, starts=1)


def test_every_gait_turns_by_what_is_asked_and_the_sharper_the_dearer(family):
    assert family.certified
    turned = [point.rotation for point in family.points]
    np.testing.assert_allclose(turned, TURNS, atol=STRAIGHT.mesh_tolerance)
    assert family.efficiency.argmax() == 1
    np.testing.assert_allclose(family.efficiency, [point.efficiency for point in family.points])
    assert family.points[1].problem.gait == STRAIGHT.gait


def test_half_way_between_two_turns_lies_about_half_of_the_turn(family):
    straight, left = np.array(family.table()["joint_angles_rad"][1:]).transpose(0, 2, 1)
    between = fitted_gait((straight + left) / 2, STRAIGHT.body.n_joint, harmonics=1).gait
    found = replay(STRAIGHT.body, STRAIGHT.law, between, STRAIGHT.delta)
    assert found.rotation == pytest.approx(TURNS[1:].mean(), rel=0.1)


def test_a_turn_to_the_right_is_the_mirror_image_of_that_to_the_left(family):
    right, _, left = family.points
    t = np.linspace(0, 1, 50)
    np.testing.assert_allclose(right.problem.guess.angles(t), -left.gait.angles(t), atol=1e-12)
    # the mirror image is found at one of two phases, half a period apart
    sums = [right.gait.angles(t) + left.gait.angles(t + later) for later in (0, 0.5)]
    assert min(np.abs(each).max() for each in sums) < 2e-4
    for name in ("value", "distance"):
        assert getattr(right, name) == pytest.approx(getattr(left, name), rel=1e-4)


@pytest.mark.parametrize(("changes", "sign"), [({}, -1), (ASIDE, 1), (STUCK, 1)])
def test_a_turn_is_sought_from_the_mirror_image_of_the_other_where_that_is_a_gait(
    changes, sign, monkeypatch
):
    begun = []

    def member(problem, starts):
        begun.append(problem.guess.angles(np.arange(9) / 9))
        return SimpleNamespace(success=True, gait=problem.guess)

    monkeypatch.setattr(families, "solve_member", member)
    steer(STRAIGHT.with_(**changes), [-0.2, 0.2])
    np.testing.assert_allclose(begun[2], sign * begun[1], atol=1e-12)
    bad = SimpleNamespace(success=False, message="It failed.")
    monkeypatch.setattr(families, "solve_member", lambda *at: bad)
    for find, what in ((steer, "the straight gait"), (pareto_front, "the gait of best efficiency")):
        with pytest.raises(colloc.ProblemError, match=f"{what} is not verified, .* It failed"):
            find(STRAIGHT, *([0.2],) * (find is steer))


@pytest.mark.slow
@pytest.mark.parametrize("changes", [ASIDE, STUCK])
def test_a_body_that_its_mirror_image_is_not_turns_to_both_sides_within_its_limits(changes):
    turns = [-0.15, 0.15]
    family = steer(STRAIGHT.with_(**changes, mesh_tolerance=1e-3), turns, starts=2)
    assert family.certified
    for point, turn in zip(family.points, turns, strict=True):
        angles = point.gait.angles(np.linspace(0, 1, 400))
        assert changes is not ASIDE or -1.5 - 1e-6 < angles.min() < angles.max() < 2.6 + 1e-6
        assert point.rotation == pytest.approx(turn, abs=0.01)


def test_the_table_holds_the_joint_angles_of_every_gait(family):
    table = family.table(phases=8)
    phases = [np.arange(8) / 8 + begin for begin in family.begins]
    known = [point.gait.angles(t).T for point, t in zip(family.points, phases, strict=True)]
    np.testing.assert_array_equal(table["joint_angles_rad"], known)
    assert family.begins[1] == 0
    assert table["radius_body_lengths"][1] is None
    assert table["work_per_period_weight_times_length"] == [point.work for point in family.points]


def test_gaits_begin_where_they_are_nearest_to_their_neighbours():
    later, turns = np.array([0.3, 0.07, 0.55, 0.9, 0.62]), (-0.4, -0.2, 0.1, 0.3, 0.5)
    a = np.array([[1.0], [0.5]]) * np.exp(2j * np.pi * np.add.outer([0.0, 0.3], later))
    gaits = [colloc.Fourier([0.2, 0.1], a.real[:, [k]], -a.imag[:, [k]]) for k in range(5)]
    family = Steering(STRAIGHT, turns, tuple(SimpleNamespace(gait=gait) for gait in gaits))
    np.testing.assert_allclose(family.begins, (later[2] - later) % 1, atol=1e-12)


def test_on_the_spot_a_turn_takes_the_least_work_and_leads_nowhere():
    on_the_way = steer(STRAIGHT.with_(mesh_tolerance=1e-3), [0.2], spot=[0.2], starts=1)
    spot = on_the_way.on_the_spot
    assert on_the_way.certified
    assert spot.points[0].rotation == pytest.approx(0.2, abs=1e-3)
    assert spot.points[0].work < 0.8 * on_the_way.points[0].work
    assert spot.points[0].arc.radius < 0.3 * on_the_way.points[0].arc.radius
    assert on_the_way.table(4)["on_the_spot"]["turn_rad"] == [0.2]
    marks = {line.get_marker() for line in plot_steering(on_the_way).axes[1].lines}
    assert marks == {"None", "o", "s"}


def test_all_tracks_set_out_along_x_and_have_a_dot_a_period(family):
    """So the chord of a period points to where half of its turn, and all those before, lead."""
    axes = family.plot(ax=Figure().add_subplot(), panel="tracks")
    dots = np.array([line.get_xydata() for line in axes.lines if line.get_marker() == "o"])
    chords = np.diff(dots @ [1, 1j])
    assert chords.shape == (3, 6)
    np.testing.assert_allclose(np.angle(chords), np.outer(TURNS, np.arange(6) + 0.5), atol=0.02)
    np.testing.assert_allclose(np.abs(chords), np.abs(chords[:, :1]) * np.ones(6))
    chord = family.table()["chord_body_lengths"]
    np.testing.assert_allclose(np.abs(chords[:, 0]), chord, rtol=0.02)


def test_the_figure_shows_every_efficiency_at_its_turn_and_crosses_what_is_not_certified(family):
    bad = family.points[2]
    bad = replace(bad, answer=replace(bad.answer, optimal=False))
    known = np.array([np.degrees(TURNS), family.efficiency]).T
    assert not replace(family, on_the_spot=replace(family, points=(bad,) * 3)).certified
    for points, crossed in ((family.points, []), ((*family.points[:2], bad), [2])):
        cost = plot_steering(replace(family, points=points)).axes[0]
        line, *crosses = (each.get_xydata() for each in cost.lines)
        np.testing.assert_allclose(line, known)
        np.testing.assert_allclose(np.concatenate([*crosses, np.empty((0, 2))]), known[crossed])
