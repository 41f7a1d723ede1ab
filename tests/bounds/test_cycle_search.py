"""The near-global cycle search: its cycles are closed paths that do what it says, by a replay that shares no lattice."""

import numpy as np
import pytest

from colloc.bounds.cycle_search import STEPS, best_cycle, polygon_gait, polygon_path
from colloc.mechanics.body import Chain
from colloc.mechanics.contact import crossing_depth
from colloc.mechanics.friction import Friction
from colloc.system.errors import ProblemError
from colloc.verification.replay import replay


@pytest.fixture(scope="module")
def cycle():
    return best_cycle(Chain(), Friction(), intervals=16, headings=16, turning=7, sweeps=60, rounds=4, starts=60)


def test_steps_are_in_order_of_their_direction():
    turn = np.unwrap(np.arctan2(STEPS[:, 1], STEPS[:, 0]))
    assert np.all(np.diff(turn) > 0)
    assert turn[-1] - turn[0] < 2 * np.pi


def test_a_cycle_does_what_the_lattice_says(cycle):
    """Ratio and rotation against the replay of the polygon; three motions a step leave an error of a few percent."""
    again = replay(Chain(), Friction(), polygon_path(cycle.shapes), 1e-6, tolerance=1e-4, most_instants=6400)
    assert cycle.ratio > 0.3
    assert again.efficiency == pytest.approx(cycle.ratio, rel=0.06)
    assert again.rotation == pytest.approx(cycle.rotation, abs=0.05)


def test_a_cycle_is_closed_admissible_and_made_of_steps(cycle):
    sides = (np.roll(cycle.shapes, -1, axis=1) - cycle.shapes) * 16 / (2 * np.pi)
    allowed = {tuple(s) for s in STEPS}
    assert all(tuple(s) in allowed for s in np.rint(sides).astype(int).T)
    np.testing.assert_allclose(sides, np.rint(sides), atol=1e-9)
    assert crossing_depth(Chain(), cycle.shapes).max() < 1e-9


def test_less_turning_is_less_efficient(cycle):
    smooth = best_cycle(Chain(), Friction(), intervals=16, headings=16, turning=2, sweeps=60, rounds=4, starts=60)
    assert 0.1 < smooth.ratio < cycle.ratio


def test_polygon_runs_at_constant_speed_and_its_series_stays_within_the_limit():
    corners = np.array([[3.0, 3.0, -1.0], [-1.0, 2.0, 0.5]])
    path = polygon_path(corners)
    t = np.linspace(0, 1, 400, endpoint=False)
    angles, rates = path(t)
    np.testing.assert_allclose(np.hypot(*rates), np.hypot(*rates)[0], rtol=1e-12)
    np.testing.assert_allclose(path(t + 1e-7)[0], angles + 1e-7 * rates, atol=1e-5)
    assert np.abs(polygon_gait(corners, 3, 3.0).angles(t)).max() <= 3.0
    many = polygon_gait(corners, 60, 4.0).angles(t)
    assert np.abs(many - angles).max() < 0.05


def test_impossible_searches_are_refused():
    with pytest.raises(ProblemError, match="three links"):
        best_cycle(Chain((0.5, 0.5)), Friction())
    with pytest.raises(ProblemError, match="turning"):
        best_cycle(Chain(), Friction(), turning=8)
