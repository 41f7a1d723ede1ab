"""Sweeps over ellipse gaits: the paper's features, agreement of the routes, and with the
independent replay."""

import numpy as np
import pytest

from colloc import Chain, Friction, ellipse, replay
from scripts.models.ellipses import gait_grid, largest_amplitude
from scripts.models.sweep import Route, distinct_maxima, performance, refined_maximum
from scripts.models.velocity_map import velocity_map

BODY, ISOTROPIC, DELTA = Chain(), Friction(), 1e-4
BEST = np.array([[0.0], [2.859], [1.3018]])


@pytest.fixture(scope="module")
def known():
    return velocity_map(BODY, ISOTROPIC, 1e-5, n_angle=32, n_ratio=33)


@pytest.fixture(scope="module")
def direct(known):
    return Route(BODY, ISOTROPIC, DELTA, known)


def _random_gaits(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    A0, angle = rng.uniform(0, 2.6, count), rng.uniform(0.1, 1.5, count)
    amplitude = rng.uniform(0.3, 1.0, count) * largest_amplitude(BODY, A0, angle)
    return np.stack([A0, amplitude * np.cos(angle), amplitude * np.sin(angle)])


def test_half_a_period_gives_what_a_replay_of_the_whole_period_gives(direct):
    """Independent: full period, Simpson's rule, displacement of the centre of mass."""
    gaits = _random_gaits(4, 21)
    found = performance(direct, gaits, instants=1600)
    for i, gait in enumerate(gaits.T):
        path = ellipse(*gait)
        exact = replay(
            BODY, ISOTROPIC, lambda t, p=path: (p.angles(t), p.rates(t)), DELTA, tolerance=1e-5
        )
        # the balance's residual, 1e-11, over its stiffness, of order delta
        assert abs(exact.rotation) < 1e-7
        assert found.distance[i] == pytest.approx(exact.distance, abs=5e-6)
        assert found.work[i] == pytest.approx(exact.work, rel=1e-5)


def test_map_route_converges_to_the_direct_route(known, direct):
    gaits = _random_gaits(150, 23)
    exact = performance(direct, gaits).efficiency
    errors = []
    for made in (velocity_map(BODY, ISOTROPIC, 1e-5, n_angle=16, n_ratio=17), known):
        mapped = performance(Route(BODY, ISOTROPIC, DELTA, made, direct=False), gaits).efficiency
        errors.append(np.abs(mapped - exact).max())
    assert errors[1] < 5e-3
    assert errors[0] / errors[1] > 1.5


def test_no_motion_on_the_axes_and_little_on_the_diagonal(direct):
    side = np.linspace(0.2, 1.4, 7)
    zero = np.zeros_like(side)
    assert performance(direct, np.stack([zero, zero, side])).distance.max() < 1e-6
    assert performance(direct, np.stack([zero, side, zero])).distance.max() < 1e-6
    diagonal = performance(direct, np.stack([zero, side, side])).distance.max()
    assert diagonal < 0.05 * performance(direct, BEST).distance[0]


def test_second_maximum_is_interior_and_matches_the_paper(direct):
    found = refined_maximum(direct, np.array([1.1, 0.7, 1.1]), instants=200)
    assert found.replay.efficiency == pytest.approx(0.2076, abs=3e-4)
    assert pytest.approx(1.11, abs=0.03) == found.A0
    assert not found.at_contact


def test_first_maximum_is_at_the_limit_of_contact(direct):
    found = refined_maximum(direct, BEST[:, 0] * 0.97, instants=200)
    assert found.at_contact
    assert found.replay.efficiency == pytest.approx(0.2600, abs=2e-4)
    assert abs(found.A0) < 0.01
    assert np.hypot(found.A1, found.B1) == pytest.approx(np.pi, abs=1e-3)


@pytest.mark.slow
def test_three_printed_maxima_come_out_of_the_sweep(known, direct):
    grid = gait_grid(BODY, np.pi / 40)
    mapped = performance(Route(BODY, ISOTROPIC, DELTA, known, direct=False), grid.gaits)
    gaits = np.stack(np.meshgrid(grid.A0, grid.A1, grid.B1, indexing="ij"))
    maxima = distinct_maxima(direct, grid.unflattened(mapped.efficiency), gaits, instants=400)
    found = [(m.replay.efficiency, abs(m.A0)) for m in maxima]
    for efficiency, A0 in ((0.2600, 0.0), (0.2076, 1.11), (0.1030, 2.59)):
        assert any(abs(e - efficiency) < 5e-4 and abs(a - A0) < 0.03 for e, a in found)
    first, second = (
        next(m for m in maxima if abs(m.replay.efficiency - e) < 5e-4) for e in (0.2600, 0.2076)
    )
    assert second.replay.distance / first.replay.distance == pytest.approx(0.37, abs=0.012)
    assert second.replay.work / first.replay.work == pytest.approx(0.47, abs=0.012)
