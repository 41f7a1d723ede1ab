"""Which ellipse gaits are admissible: closed form against geometry that knows nothing of it."""

import numpy as np

from colloc.gaits.harmonic import ellipse
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth
from scripts.models.ellipses import (
    admissible,
    contact_reach,
    ellipse_angles,
    gait_grid,
    largest_amplitude,
)

T = np.linspace(0, 1, 4001)


def test_same_gait_as_the_harmonic_class():
    angles, rates = ellipse_angles(np.array([[0.4], [0.7], [-0.3]]), T)
    gait = ellipse(0.4, 0.7, -0.3)
    np.testing.assert_allclose(angles[:, 0], gait.angles(T), atol=1e-14)
    np.testing.assert_allclose(rates[:, 0], gait.rates(T), atol=1e-13)


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
    body = Chain()
    inside = admissible(body, gaits)
    near = np.abs(contact_reach(gaits) - 2 * np.pi) < 2e-2
    for gait in np.flatnonzero(~near):
        angles = ellipse_angles(gaits[:, gait : gait + 1], T[::4])[0][:, 0]
        bent = np.abs(angles).max() <= np.pi + 1e-5
        touches = crossing_depth(body, angles).max() > 1e-9
        # segments that fold back beyond pi are refused by the limit on the angles, not by crossing
        assert inside[gait] == (bent and not touches) or (not bent and not inside[gait])
    assert 0.2 < inside.mean() < 0.9


def test_unequal_links_use_the_geometry():
    body = Chain((0.3, 0.4, 0.3))
    assert admissible(body, np.array([[0.0], [1.0], [0.5]]))[0]
    assert not admissible(body, np.array([[0.0], [0.2], [2.6]]))[0]


def test_largest_amplitude_is_on_the_boundary():
    body = Chain()
    A0, angle = np.meshgrid([0.0, 0.6, 1.8, 2.9], np.linspace(0.01, 1.55, 9), indexing="ij")
    r = largest_amplitude(body, A0, angle)
    for factor, expected in ((0.999, True), (1.001, False)):
        gaits = np.stack([A0, factor * r * np.cos(angle), factor * r * np.sin(angle)]).reshape(
            3, -1
        )
        assert (admissible(body, gaits) == expected).all()


def test_grid_keeps_values_in_place():
    grid = gait_grid(Chain(), 0.5)
    values = grid.gaits[0] + 10 * grid.gaits[1] + 100 * grid.gaits[2]
    full = grid.unflattened(values)
    assert np.isnan(full[~grid.inside]).all()
    i, j, k = np.argwhere(grid.inside)[7]
    assert full[i, j, k] == grid.A0[i] + 10 * grid.A1[j] + 100 * grid.B1[k]
