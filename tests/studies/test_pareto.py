"""A front of two objectives: no gait of it is better in both, and its ends are the best by one
alone."""

from dataclasses import replace

import numpy as np
import pytest

from colloc import (
    Chain,
    Fourier,
    Friction,
    Harmonic,
    Objective,
    Problem,
    evaluate,
    pareto_front,
    replay,
)
from colloc.pictures.figure import plot_front
from colloc.search.solve import solve
from colloc.studies.families import Gap, ParetoFront

USUAL = {"gait": Harmonic(1, "bilateral"), "mesh_tolerance": 1e-4}
PROBLEM = Problem("wide", friction=Friction(mu_t=10, mu_f=1, mu_b=1), delta=1e-2, **USUAL)


@pytest.fixture(scope="module")
def front():
    return pareto_front(PROBLEM, points=4, starts=1)


def test_the_front_is_monotone_and_every_point_is_certified(front):
    assert all(point.success for point in front.points)
    speed, efficiency = front.values.T
    assert (np.diff(speed) < 0).all()
    assert (np.diff(efficiency) > 0).all()


def apart(front):
    """How far neighbours are apart in both objectives, as shares of the front, ``(n - 1, 2)``."""
    return np.abs(np.diff(front.values, axis=0)) / np.ptp(front.values, axis=0)


def test_neighbours_lie_no_farther_apart_than_twice_the_even_spacing(front):
    """Also where the front is so steep that even steps in one objective are large ones in the
    other."""
    assert not front.gaps
    assert apart(front).max() <= 2 / 3


@pytest.mark.slow
def test_points_differ_and_what_lies_empty_is_listed():
    """The farthest gait goes 0.286 with an efficiency of 1.4; the next ones 0.269, with 2.1."""
    hole = Problem("hole", None, Chain(feet=1), Friction(0.3, 0.3, 0.3), delta=2e-3, **USUAL)
    front = pareto_front(hole, "distance", "efficiency", 5, starts=2)
    assert front.certified
    assert (np.diff(front.values, axis=0) * [-1, 1] > 1e-6).all()
    shares = apart(front).max(axis=1)
    assert shares.min() > 0.02
    assert [gap.after for gap in front.gaps] == [0] == np.flatnonzero(shares > 0.5).tolist()


def test_the_figure_draws_no_line_over_a_gap(front):
    axes = plot_front(replace(front, gaps=(Gap(1, "nothing is better", True),))).axes[0]
    drawn = axes.lines[0].get_xydata()
    assert np.isnan(drawn[2]).all()
    np.testing.assert_array_equal(np.delete(drawn, 2, axis=0), front.values[:, ::-1])
    np.testing.assert_array_equal(axes.lines[1].get_xydata(), front.values[1:3, ::-1])
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["nothing found between"]


def test_where_one_gait_is_best_in_both_it_is_the_only_point():
    front = pareto_front(PROBLEM, "distance", "distance * 2", 4, starts=1)
    assert len(front.points) == 1
    assert not front.gaps


def test_its_ends_are_the_best_by_one_objective_alone(front):
    for k, (name, at) in enumerate((("speed", 0), ("efficiency", -1))):
        alone = solve(PROBLEM.with_(objective=name), 1)
        assert front.values[at, k] == pytest.approx(alone.certificate.value, rel=1e-9)


@pytest.mark.parametrize("signs", [(1, 1, 1, 1, 1), (-1, 1, -1, 1, 1), (1, -1, -1, -1, -1)])
def test_the_figure_draws_every_value_and_mirror_images_alike(front, signs):
    points = [
        replace(point, answer=replace(point.answer, gait=point.gait.scaled(sign)))
        for sign, point in zip(signs, front.points, strict=True)
    ]
    values, plane = plot_front(replace(front, points=tuple(points))).axes
    np.testing.assert_array_equal(values.lines[0].get_xydata(), front.values[:, ::-1])
    *others, last = (line.get_xydata() for line in plane.lines)
    angles = points[-1].gait.angles(np.linspace(0.0, 1.0, len(last)))
    np.testing.assert_allclose(last.T, angles, atol=1e-12)
    assert len(others) == len(signs) - 1
    assert all(np.abs(path - last).sum() < np.abs(path + last).sum() for path in others)


def test_an_objective_that_certificates_do_not_know_is_measured():
    ends = pareto_front(PROBLEM, "speed", "driven efficiency", 2, starts=1)
    for end, (_, value) in zip(ends.points, ends.values, strict=True):
        at = PROBLEM.body, PROBLEM.law, end.gait, end.delta_per_period
        assert value == pytest.approx(replay(*at, objective=ends.objectives[1]).value, rel=1e-5)


def test_a_gait_that_turns_is_as_far_whether_its_certificate_knows_the_objective_or_not():
    bent = Fourier([1.0, 1.1], [[-1.0], [0.7]], [[1.0], [0.9]])
    point = evaluate(Problem("bent", delta=1e-2), bent)
    assert abs(point.rotation) > 0.3
    aims = Objective("distance"), Objective("distance * driven_work / driven_work")
    ((known, measured),) = ParetoFront(point.problem, aims, (point,)).values
    assert measured == pytest.approx(known, rel=1e-4)
