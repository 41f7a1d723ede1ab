"""Gaits that steer: certified at every turn, and between two of them a controller can
interpolate."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from colloc import Chain, Coupled, Fourier, Friction, Harmonic, Problem, replay, steer
from colloc.gaits.fitted_gait import fitted_gait
from colloc.pictures.figure import plot_steering
from colloc.studies.families import Steering

USUAL = {"gait": Harmonic(1, "bilateral"), "friction": Friction(mu_t=4, mu_f=1, mu_b=1)}
PROBLEM = Problem("p", delta=1e-2, mesh_tolerance=1e-4, **USUAL)
TURNS = np.radians([-10, 0, 10])


@pytest.fixture(scope="module")
def family():
    return steer(PROBLEM, TURNS, starts=1)


def test_every_gait_turns_by_what_is_asked_and_the_sharper_the_dearer(family):
    assert family.certified
    turned = [point.rotation for point in family.points]
    np.testing.assert_allclose(turned, TURNS, atol=PROBLEM.mesh_tolerance)
    assert family.efficiency.argmax() == 1
    np.testing.assert_allclose(family.efficiency, [point.efficiency for point in family.points])
    assert family.points[1].problem.gait == PROBLEM.gait


def test_half_way_between_two_turns_lies_about_half_of_the_turn(family):
    straight, left = np.array(family.table()["joint_angles_rad"][1:]).transpose(0, 2, 1)
    between = fitted_gait((straight + left) / 2, PROBLEM.body.n_joint, harmonics=1).gait
    found = replay(PROBLEM.body, PROBLEM.law, between, PROBLEM.delta)
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


@pytest.mark.slow
def test_a_body_that_is_not_its_mirror_image_turns_to_both_sides():
    body, friction = Chain((0.2,) * 5), Friction(mu_t=2, mu_f=1, mu_b=1)
    bent = Coupled(Harmonic(1), stuck={1: 0.5})
    problem = Problem("stuck", body=body, friction=friction, gait=bent, delta=1e-2)
    assert steer(problem.with_(mesh_tolerance=1e-3), [-0.2, 0.2], starts=1).certified


@pytest.mark.slow
def test_with_one_sided_limits_both_sides_are_sought_from_the_straight_gait_and_keep_them():
    """The mirror image of a gait within (-1.5, 2.6) need not be within it."""
    straight, limits, turns = [], ((-1.5, 2.6), (-1.5, 2.6)), [-0.15, 0.15]
    problem = PROBLEM.with_(joint_limit=limits, gait=Harmonic(1), mesh_tolerance=1e-3)
    family = steer(problem, turns, starts=2, progress=lambda *news: straight.append(news))
    assert family.certified
    assert straight[0][0] == 0
    begun = straight[0][1].gait.angles(np.linspace(0, 1, 40))
    for point, turn in zip(family.points, turns, strict=True):
        guess = point.problem.guess.angles(np.linspace(0, 1, 40))
        np.testing.assert_allclose(guess, begun, atol=1e-12)
        angles = point.gait.angles(np.linspace(0, 1, 400))
        assert -1.5 - 1e-6 < angles.min() < angles.max() < 2.6 + 1e-6
        assert point.rotation == pytest.approx(turn, abs=0.01)


def test_the_table_holds_the_joint_angles_of_every_gait(family):
    table = family.table(phases=8)
    phases = [np.arange(8) / 8 + begin for begin in family.begins]
    known = [point.gait.angles(t).T for point, t in zip(family.points, phases, strict=True)]
    np.testing.assert_array_equal(table["joint_angles_rad"], known)
    assert family.begins[1] == 0
    assert table["radius_body_lengths"][1] is None


def test_gaits_begin_where_they_are_nearest_to_their_neighbours():
    """Those that differ in phase alone begin alike."""
    later, turns = np.array([0.3, 0.07, 0.55, 0.9, 0.62]), (-0.4, -0.2, 0.1, 0.3, 0.5)
    a = np.array([[1.0], [0.5]]) * np.exp(2j * np.pi * np.add.outer([0.0, 0.3], later))
    gaits = [Fourier([0.2, 0.1], a.real[:, [k]], -a.imag[:, [k]]) for k in range(5)]
    family = Steering(PROBLEM, turns, tuple(SimpleNamespace(gait=gait) for gait in gaits))
    np.testing.assert_allclose(family.begins, (later[2] - later) % 1, atol=1e-12)


def test_on_the_spot_a_turn_takes_the_least_work_and_leads_nowhere():
    on_the_way = steer(PROBLEM.with_(mesh_tolerance=1e-3), [0.2], spot=[0.2], starts=1)
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
    for points, crossed in ((family.points, []), ((*family.points[:2], bad), [2])):
        cost = plot_steering(replace(family, points=points)).axes[0]
        line, *crosses = (each.get_xydata() for each in cost.lines)
        np.testing.assert_allclose(line, known)
        np.testing.assert_allclose(np.concatenate([*crosses, np.empty((0, 2))]), known[crossed])
