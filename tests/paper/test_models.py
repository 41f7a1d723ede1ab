"""The paper's models: ellipse gaits, admissible ones, and smooth bodies in the lab."""

import numpy as np
import pytest

from colloc import Chain, Friction, Wave, ellipse, replay
from colloc.mechanics.contact import crossing_depth
from scripts.models.ellipses import (
    admissible,
    contact_reach,
    distinct_maxima,
    ellipse_angles,
    gait_grid,
    largest_amplitude,
    performance,
    refined_maximum,
)
from scripts.models.period import period, snapshots

BODY, ISOTROPIC, DELTA = Chain(), Friction(), 1e-4
T = np.linspace(0, 1, 4001)
BEST = np.array([[0.0], [2.859], [1.3018]])


def _random_gaits(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    A0, angle = rng.uniform(0, 2.6, count), rng.uniform(0.1, 1.5, count)
    amplitude = rng.uniform(0.3, 1.0, count) * largest_amplitude(A0, angle)
    return np.stack([A0, amplitude * np.cos(angle), amplitude * np.sin(angle)])


def test_half_a_period_gives_what_a_replay_of_the_whole_period_gives():
    """Independent: full period, Simpson's rule, displacement of the centre of mass."""
    gaits = _random_gaits(4, 21)
    found = performance(DELTA, gaits, instants=1600)
    for i, gait in enumerate(gaits.T):
        exact = replay(BODY, ISOTROPIC, ellipse(*gait), DELTA, tolerance=1e-5)
        # the balance's residual, 1e-11, over its stiffness, of order delta
        assert abs(exact.rotation) < 1e-7
        assert found.distance[i] == pytest.approx(exact.distance, abs=5e-6)
        assert found.work[i] == pytest.approx(exact.work, rel=1e-5)


def test_no_motion_on_the_axes_and_little_on_the_diagonal():
    side = np.linspace(0.2, 1.4, 7)
    zero = np.zeros_like(side)
    assert performance(DELTA, np.stack([zero, zero, side])).distance.max() < 1e-6
    assert performance(DELTA, np.stack([zero, side, zero])).distance.max() < 1e-6
    diagonal = performance(DELTA, np.stack([zero, side, side])).distance.max()
    assert diagonal < 0.05 * performance(DELTA, BEST).distance[0]


def test_second_maximum_is_interior_and_matches_the_paper():
    found = refined_maximum(DELTA, np.array([1.1, 0.7, 1.1]), instants=200)
    assert found.replay.efficiency == pytest.approx(0.2076, abs=3e-4)
    assert found.gait[0] == pytest.approx(1.11, abs=0.03)
    assert not found.at_contact


def test_first_maximum_is_at_the_limit_of_contact():
    found = refined_maximum(DELTA, BEST[:, 0] * 0.97, instants=200)
    assert found.at_contact
    assert found.replay.efficiency == pytest.approx(0.2600, abs=2e-4)
    assert abs(found.gait[0]) < 0.01
    assert np.hypot(*found.gait[1:]) == pytest.approx(np.pi, abs=1e-3)


@pytest.mark.slow
def test_three_printed_maxima_come_out_of_the_sweep():
    grid = gait_grid(np.pi / 40)
    efficiency = grid.unflattened(performance(DELTA, grid.gaits).efficiency)
    gaits = np.stack(np.meshgrid(grid.A0, grid.A1, grid.B1, indexing="ij"))
    maxima = distinct_maxima(DELTA, efficiency, gaits, instants=400)
    found = [(m.replay.efficiency, abs(m.gait[0])) for m in maxima]
    for efficiency, A0 in ((0.2600, 0.0), (0.2076, 1.11), (0.1030, 2.59)):
        assert any(abs(e - efficiency) < 5e-4 and abs(a - A0) < 0.03 for e, a in found)
    first, second = (
        next(m for m in maxima if abs(m.replay.efficiency - e) < 5e-4) for e in (0.2600, 0.2076)
    )
    assert second.replay.distance / first.replay.distance == pytest.approx(0.37, abs=0.012)
    assert second.replay.work / first.replay.work == pytest.approx(0.47, abs=0.012)


def test_contact_reach_is_the_maximum_along_the_path():
    rng = np.random.default_rng(11)
    gaits = rng.uniform(0, 1, (3, 400)) * np.array([[3.1], [3.1], [2.2]])
    gaits[0, :40] = 0.0
    a, b = ellipse_angles(gaits, T)[0]
    sampled = np.minimum(2 * a + b, a + 2 * b).max(axis=1)
    exact = contact_reach(gaits)
    assert (sampled <= exact + 1e-12).all()
    np.testing.assert_allclose(sampled, exact, atol=1e-2)


def test_admissible_agrees_with_segment_intersection():
    rng = np.random.default_rng(12)
    gaits = rng.uniform(0, 1, (3, 1500)) * np.array([[1.0], [3.0], [2.4]])
    inside = admissible(BODY, gaits)
    near = np.abs(contact_reach(gaits) - 2 * np.pi) < 2e-2
    for gait in np.flatnonzero(~near):
        angles = ellipse_angles(gaits[:, gait : gait + 1], T[::4])[0][:, 0]
        bent = np.abs(angles).max() <= np.pi + 1e-5
        touches = crossing_depth(BODY, angles).max() > 1e-9
        # segments that fold back beyond pi are refused by the limit on the angles, not by crossing
        assert inside[gait] == (bent and not touches) or (not bent and not inside[gait])
    assert 0.2 < inside.mean() < 0.9


def test_largest_amplitude_is_on_the_boundary():
    A0, angle = np.meshgrid([0.0, 0.6, 1.8, 2.9], np.linspace(0.01, 1.55, 9), indexing="ij")
    r = largest_amplitude(A0, angle)
    for factor, expected in ((0.999, True), (1.001, False)):
        gaits = np.stack([A0, factor * r * np.cos(angle), factor * r * np.sin(angle)])
        assert (admissible(BODY, gaits.reshape(3, -1)) == expected).all()


def test_snapshots_are_inextensible_and_advance_by_the_distance():
    motion, along_easy = Wave().prescribed(), Friction(mu_t=20.0, mu_f=1.0, mu_b=1.0)
    made = snapshots(motion, along_easy, 1e-3, count=2, panels=40)
    steps = np.hypot(np.diff(made.x, axis=0), np.diff(made.y, axis=0))
    np.testing.assert_allclose(steps.sum(axis=0), steps.sum(axis=0)[0], rtol=1e-4)
    # first and last node lie within the body
    assert steps.sum(axis=0)[0] == pytest.approx(1.0, abs=2e-3)
    moved = made.x[:, -1] - made.x[:, 0]
    np.testing.assert_allclose(moved, period(motion, along_easy, 1e-3, intervals=2).d, rtol=1e-4)
    np.testing.assert_allclose(made.y[:, -1], made.y[:, 0], atol=1e-6)
