"""The replay against motions that are known exactly; what halving panels says of the error."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.audit import path_of, random_problem
from colloc import Chain, Corners, Fourier, Friction, ellipse, replay
from colloc.mechanics.contact import crossing_depth
from colloc.verification import replay as panelled
from colloc.verification.adaptive_motion import fine_motion
from tests.conftest import ROOT
from tests.shared.mechanics import coulomb

LAWS = [(1.0, 1.0, 1.0), (1.7, 1.0, 1.3), (1.0, 1.0, 3.0), (10.0, 1.0, 1.0)]
WORK = 2
AUDIT = (ROOT / "results/curated/audit.jsonl").read_text(encoding="utf-8")
OPTIMA = {row["number"]: row for row in map(json.loads, AUDIT.splitlines())}


def random_path(seed):
    rng = np.random.default_rng(seed)
    n_joint = int(rng.integers(2, 5))
    waves = rng.normal(0, 0.4, (2, n_joint, 2))
    gait = Fourier(rng.uniform(-1, 1, n_joint), *waves)
    return Chain((1 / (n_joint + 1),) * (n_joint + 1)), coulomb(*LAWS[seed % 4]), gait


@pytest.mark.parametrize("seed", range(8))
def test_the_stated_error_holds_against_another_quadrature(seed):
    """Against Gauss nodes on adaptive panels, from grids with kinks between the instants."""
    body, friction, path = random_path(seed)
    fine = fine_motion(body, friction, path, 1e-4, np.linspace(0, 1, 21), 1e-9)
    exact = abs(fine.path[-1]) / fine.totals[0, -1]
    for instants, tolerance in ((100, 1.0), (200, 1e-3), (328, 1e-3), (1600, 1e-6)):
        result = replay(body, friction, path, 1e-4, instants=instants, tolerance=tolerance)
        assert abs(result.efficiency / exact - 1) <= result.error <= tolerance
        assert result.rotation == pytest.approx(fine.theta[-1], abs=result.error)


class Roughly(Chain):
    """Three links whose balance is known to leave nine tenths of what a replay is allowed."""

    def solve(self, *arguments, **settings):
        solved = super().solve(*arguments, **settings)
        return replace(solved, residual=solved.residual + 0.9e-4)


def test_what_the_balance_leaves_over_is_part_of_the_error_that_is_asked_for():
    at = Friction(), ellipse(0.0, 2.8, 1.3), 1e-3
    found, exact = (replay(b, *at, instants=40, tolerance=1e-4) for b in (Roughly(), Chain()))
    assert 0.9e-4 < found.error <= 1e-4
    assert found.instants > exact.instants


def test_panels_gather_at_kinks():
    body, friction, path = random_path(0)
    loose, tight = (
        replay(body, friction, path, 1e-4, instants=400, tolerance=tol) for tol in (1e-4, 1e-8)
    )
    assert tight.error < 1e-8
    assert tight.instants < 20 * loose.instants


def test_the_largest_residual_of_all_instants_is_reported(monkeypatch):
    """An instant out of balance counts in whichever piece between breaks it is."""
    body, friction, path = random_path(1)
    exact = Chain.solve
    for where in (0.1, 0.5, 0.9):

        def poor(body, friction, angles, *rest, where=where, **settings):
            solved = exact(body, friction, angles, *rest, **settings)
            here = np.abs(angles - path(np.array([where]))[0]).max(axis=0) < 1e-2
            return replace(solved, residual=np.where(here, 3e-8, solved.residual))

        monkeypatch.setattr(Chain, "solve", poor)
        result = replay(body, friction, path, 1e-4, instants=800, tolerance=1e-6, breaks=(0.3, 0.7))
        assert result.residual == 3e-8
        assert result.error > 3e-8


def test_an_accuracy_beyond_that_of_the_balance_is_not_claimed():
    body, friction, path = random_path(0)
    assert replay(body, friction, path, 1e-4, tolerance=1e-15).error > 1e-13


def test_another_followed_point_changes_the_distance_by_at_most_rotation_times_lever():
    for seed in range(4):
        body, friction, path = random_path(seed)
        result = replay(body, friction, path, 1e-4, tolerance=1e-4)
        assert abs(result.rotation) > 1e-3
        angles, _ = path(np.arange(1600) / 1600)
        outline = np.stack(body.outline(angles)) - body.centre(angles)[:, None]
        assert result.lever == pytest.approx(np.hypot(*outline).max(), rel=1e-4)
        angles = angles[:, :1]
        gx, gy = body.centre(angles)
        x, y = body.outline(angles)
        arms = (x - gx + 1j * (y - gy)).ravel()
        assert np.abs(arms).max() <= result.lever <= 1
        # in any direction of travel the centre of mass may have had
        headings = np.exp(1j * np.linspace(0, 2 * np.pi, 60))
        swung = (np.exp(1j * result.rotation) - 1) * arms
        moved = np.abs(result.distance * headings[:, None] + swung)
        change = np.abs(moved / result.distance - 1).max()
        turning = abs(result.rotation) * result.lever / result.distance
        assert 0.3 * turning < change <= turning


def test_the_error_of_the_efficiency_is_made_of_those_of_distance_and_work():
    body, friction, path = random_path(2)
    result = replay(body, friction, path, 1e-4, instants=200, tolerance=1e-3)
    parts = result.errors["distance"] / result.distance + result.errors["work"] / result.work
    assert min(result.errors["distance"], result.errors["work"]) > 0
    assert result.error <= parts <= result.error + 2 * result.residual


def test_the_best_polygon_that_is_known_is_replayed_at_its_value():
    stored = json.loads((ROOT / "results/curated/many_corners.json").read_text(encoding="utf-8"))
    gait = Corners(stored["corners"], stored["symmetry"])
    assert len(gait.corner_phases) + 1 == 1940
    assert np.abs(gait.vertices).max() < 2.46
    found = replay(Chain(), Friction(), gait, 1e-5 * gait.length, breaks=gait.corner_phases)
    assert (found.efficiency, found.distance) == pytest.approx((0.448547, 0.677236), abs=2e-6)
    assert crossing_depth(Chain(), gait.angles(np.linspace(0, 1, 20001))).max() == 0


def at_rest(power):
    """Values at instants of a body that rests and does work: z, rates, power of joints, spread."""
    none = 0.0 * power
    vectors = np.stack([none] * 3, axis=-1)
    return vectors, np.stack([none, none, power], axis=-1).astype(complex), none, vectors


def panels_of(power, n=16, corner=None):
    left, width = np.arange(n) / n, np.full(n, 1 / n)
    t = left[:, None] + width[:, None] * np.linspace(0, 1, 5)
    if corner is not None:
        t[np.isclose(left, corner), 0] += 1e-12
        t[np.isclose(left + width, corner), 4] -= 1e-12
    return panelled.first_panels(left, width, at_rest(power(t)))


def changes(panels):
    return panelled.changes(panels, *panelled.poses(*panelled.increments(panels)[:2]))


def stated_work(panels):
    return panelled.remaining_error(*changes(panels)[1:], panels.wider)[:, WORK].sum()


def slope_jump(x):
    return np.abs(x), x * np.abs(x) / 2


def slipping_through_rest(x):
    """A link slides on with its centre of rotation inside: the kink is x log|x|."""
    logarithm = np.log(np.abs(x) + 1e-300)
    return x * logarithm, x**2 * (logarithm / 2 - 0.25)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.8, 1.0])
def test_stated_errors_cover_a_kink_wherever_it_lies(share):
    """At many places the change of its panel is small by accident."""
    true, stated = [], []
    for at in np.random.default_rng(0).uniform(0.3, 0.7, 200):

        def kink(t, at=at):
            pairs = zip(slope_jump(t - at), slipping_through_rest(t - at), strict=True)
            return [(1 - share) * straight + share * curved for straight, curved in pairs]

        panels = panels_of(lambda t: kink(t)[0])
        exact = kink(1.0)[1] - kink(0.0)[1]
        true.append(abs(panelled.increments(panels)[WORK].sum() - exact))
        stated.append(stated_work(panels))
    assert np.all(np.array(true) <= stated)
    assert np.median(np.array(stated) / true) < 8


def test_corners_are_not_taken_for_kinks():
    """Beside a jump the power is linear: nothing is left, though the instants do not fit."""
    assert stated_work(panels_of(lambda t: np.where(t < 0.5, 1 + t, 3 - t), corner=0.5)) < 1e-14
    assert stated_work(panels_of(lambda t: np.where(t < 0.51, 1 + t, 3 - t))) > 1e-3


def test_changes_that_are_kept_are_those_that_would_be_found_again():
    def power(t):
        return np.abs(np.sin(2 * np.pi * t) - 0.3)

    panels = panels_of(power)
    for chosen in ([3, 4], [4, 5], [6, 9], [0, 10], [21]):
        changed, old = changes(panels)[0], panels.take(np.array(chosen))
        middles = old.left[:, None] + old.width[:, None] * (np.arange(4) + 0.5) / 4
        rest = panels.take(np.setdiff1d(np.arange(panels.left.size), chosen))
        panels = rest.join(old.halves(at_rest(power(middles)), changed[chosen]))
        again = panels._replace(differences=np.full_like(panels.rates, np.nan))
        for known, found in zip(changes(panels), changes(again), strict=True):
            np.testing.assert_allclose(known, found, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("steady", [False, True])
def test_changes_are_those_of_the_distance_when_one_panel_is_halved(steady):
    """The rest of the path turns with the panel, all that changes where that is steady."""
    rng, n = np.random.default_rng(3), 8
    spin, centre = 1e-3 * rng.normal(size=(n, 5)), rng.normal(size=(n, 5, 2)) @ np.array([1, 1j])
    centre[:] = centre[:, :1] if steady else centre
    rates = np.stack([spin, centre, *rng.uniform(1, 2, (3, n, 5))], axis=-1)
    values = rng.normal(size=(n, 5, 3)), rates, spin, np.zeros((n, 5, 5))
    panels = panelled.Panels(
        np.arange(n) / n, np.full(n, 1 / n), *values, np.zeros((n, 5)), values[1] * np.nan
    )
    once, twice = panelled.increments(panels, panelled.HALF), panelled.increments(panels)

    def distance(turn, move):
        return abs(panelled.poses(turn, move)[1][-1])

    for k in range(n):
        turn, move = twice[0].copy(), twice[1].copy()
        turn[k], move[k] = once[0][k], once[1][k]
        change, rel = abs(distance(turn, move) - distance(*twice[:2])), 3e-2 if steady else 1e-3
        assert changes(panels)[0][k, 1] == pytest.approx(change, rel=rel, abs=1e-9)


@pytest.mark.parametrize("number", [35, 94, 162, 209, 558, 893])
def test_stated_errors_cover_optimised_gaits(number):
    """Their kinks repeat by symmetry in several panels: accidents do not average out."""
    problem, _, _ = random_problem(number)
    row = OPTIMA[number]
    result = replay(problem.body, problem.friction, path_of(row["gait"]), row["delta"])
    found = row["played"]  # by another program
    assert abs(result.work - found["work"]) <= result.errors["work"]
    assert abs(result.distance - found["distance"]) <= result.errors["distance"]
    assert abs(result.efficiency - found["efficiency"]) <= result.error * result.efficiency
    assert result.error < 1e-6
