"""Which ellipse gaits are admissible: closed form against geometry that knows nothing of it."""

import numpy as np

from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth
from scripts.models.ellipses import admissible, contact_reach, ellipse_angles, largest_amplitude

T = np.linspace(0, 1, 4001)


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


def test_largest_amplitude_is_on_the_boundary():
    body = Chain()
    A0, angle = np.meshgrid([0.0, 0.6, 1.8, 2.9], np.linspace(0.01, 1.55, 9), indexing="ij")
    r = largest_amplitude(A0, angle)
    for factor, expected in ((0.999, True), (1.001, False)):
        gaits = np.stack([A0, factor * r * np.cos(angle), factor * r * np.sin(angle)]).reshape(
            3, -1
        )
        assert (admissible(body, gaits) == expected).all()
