"""The compiled kernel gives the answers of the NumPy formulas, the reference, at instants that are
hard for both."""

import numpy as np
import pytest
from cases import ANGLES, COEFFICIENTS, DELTAS, RATES, SPEED

from colloc import Chain, Friction, solve_balance
from colloc.mechanics.balance import instant, net_force, total_power
from colloc.mechanics.native_kernel import native_kernel
from research.guarantee.loaded_balance import loaded_balance
from tests.shared.laws import coulomb
from tests.shared.without_kernel import numpy_instead

pytestmark = pytest.mark.skipif(native_kernel() is None, reason="no C compiler")


def by_both(*arguments, **named):
    """Two solutions of one balance: compiled, and by NumPy."""
    compiled = solve_balance(*arguments, **named)
    with numpy_instead():
        return compiled, solve_balance(*arguments, **named)


@pytest.mark.parametrize(
    "delta", [pytest.param(d, marks=[pytest.mark.slow] * (d not in (1e-2, 1e-8))) for d in DELTAS]
)
@pytest.mark.parametrize("coefficients", COEFFICIENTS, ids=str)
def test_every_hard_instant_moves_as_numpy_says(coefficients, delta):
    """A residual leaves the velocity uncertain by max(mu)/min(mu) times as much, so a small one is
    asked for."""
    compiled, reference = by_both(
        Chain(), coulomb(*coefficients), ANGLES, RATES, delta, tolerance=1e-13
    )
    np.testing.assert_allclose(compiled.z / SPEED, reference.z / SPEED, rtol=0, atol=1e-9)


@pytest.mark.parametrize("delta", [1e-3, 1e-7])
@pytest.mark.parametrize("lengths", [(1 / 3,) * 3, (0.3, 0.2, 0.15, 0.35)], ids=len)
def test_bodies_under_load_are_in_the_state_that_they_state(lengths, delta):
    """Force, potential and power at the velocity found, by NumPy; in balance with every load that
    friction holds."""
    rng, body, n = np.random.default_rng(6), Chain(lengths), 400
    angles, rates = rng.uniform(-3, 3, (body.n_joint, n)), rng.uniform(-1, 1, (body.n_joint, n))
    load = rng.normal(size=(3, n)) * [[0.4], [0.4], [0.1]]
    found = loaded_balance(body, Friction(), angles, rates, load, np.zeros((3, n)), delta)
    middle = len(lengths) // 2
    lean, law = np.exp(1j * angles[:middle].sum(axis=0)), Friction()

    def in_body_axes(plane, about):
        turned = (plane[0] + 1j * plane[1]) * lean
        return np.stack([turned.real, turned.imag, about])

    z, given = in_body_axes(found.velocity[:2], found.velocity[2]), in_body_axes(load[:2], load[2])
    now = instant(body, law, angles, rates, z, np.full((1, n), delta), middle)
    left = net_force(now.posture, now.force) + given
    # where nothing holds the load it runs away, and digits are lost
    scale = 1 + np.abs(z).max(axis=0)
    np.testing.assert_allclose(
        found.residual, [np.hypot(*left[:2]), np.abs(left[2])], rtol=0, atol=1e-10
    )
    np.testing.assert_allclose(
        found.leftover_power / scale, (left * z).sum(axis=0) / scale, rtol=0, atol=1e-10
    )
    potential = body.contact.potential(law, now.velocity, np.full((1, n), delta)).sum(axis=0)
    np.testing.assert_allclose(found.potential / scale, potential / scale, rtol=0, atol=1e-10)
    np.testing.assert_allclose(
        found.power / scale, total_power(now.velocity, now.force)[0] / scale, rtol=0, atol=1e-10
    )
    np.testing.assert_allclose(found.forces, -np.stack(now.force, axis=1), rtol=0, atol=1e-10)
    held, push = found.residual.max(axis=0) < 1e-9, np.hypot(*load[:2])
    assert held[push + 8 * np.abs(load[2]) < 0.4].all()
    assert not held[push > 1].any()  # more than friction on the whole body
    assert 0.4 < held.mean() < 0.95
