"""The replay against motions whose distance and work are known exactly."""

import json
from dataclasses import replace

import numpy as np
import pytest

from colloc import Chain, Corners, Fourier, Friction, ellipse, replay
from colloc.mechanics.contact import crossing_depth
from colloc.verification.adaptive_motion import fine_motion
from tests.conftest import ROOT
from tests.shared.laws import coulomb


def test_reciprocal_gaits_go_nowhere():
    result = replay(Chain(), Friction(), ellipse(0.0, 0.0, 1.2), 1e-4, instants=400)
    assert result.distance < 1e-10
    assert result.work > 0.1


def test_a_scallop_with_directional_friction_crawls_and_obeys_the_bound():
    # two links, one joint: mu_b > mu_f makes even a reciprocal motion advance
    body, friction = Chain((0.5, 0.5)), Friction(mu_t=1.0, mu_f=1.0, mu_b=5.0)

    def path(t):
        angle = 1.2 + 0.8 * np.cos(2 * np.pi * t)
        return angle[None], (-1.6 * np.pi * np.sin(2 * np.pi * t))[None]

    result = replay(body, friction, path, 1e-4, instants=400)
    assert 0.01 < result.efficiency < 1.0
    assert abs(result.actuator_work / result.work - 1) < 1e-9


LAWS = [(1.0, 1.0, 1.0), (1.7, 1.0, 1.3), (1.0, 1.0, 3.0), (10.0, 1.0, 1.0)]


def random_path(seed):
    """A wave of two harmonics through three to five links, and a law."""
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
    gait = ellipse(0.0, 2.8, 1.3)
    at = Friction(), gait, 1e-3
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
        result = replay(body, friction, path, 1e-4, instants=800, tolerance=1e-3, breaks=(0.3, 0.7))
        assert result.residual == 3e-8
        assert result.error > 3e-8


def test_an_accuracy_beyond_that_of_the_balance_is_not_claimed():
    body, friction, path = random_path(0)
    assert replay(body, friction, path, 1e-4, tolerance=1e-15).error > 1e-13


def test_another_followed_point_changes_the_distance_by_at_most_rotation_times_lever():
    """The ends of the body against its centre: first order in the rotation."""
    for seed in range(4):
        body, friction, path = random_path(seed)
        result = replay(body, friction, path, 1e-4, tolerance=1e-4)
        assert abs(result.rotation) > 1e-3
        angles, _ = path(np.zeros(1))
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
    """Of three equal links within 2.5 rad, with 1940 corners."""
    file = ROOT / "results/curated/many_corners.json"
    stored = json.loads(file.read_text(encoding="utf-8"))
    gait = Corners(stored["corners"], stored["symmetry"])
    assert len(gait.corner_phases) + 1 == 1940
    assert np.abs(gait.vertices).max() < 2.46
    found = replay(Chain(), Friction(), gait, 1e-5 * gait.length, breaks=gait.corner_phases)
    assert (found.efficiency, found.distance) == pytest.approx((0.448547, 0.677236), abs=2e-6)
    assert crossing_depth(Chain(), gait.angles(np.linspace(0, 1, 20001))).max() == 0
