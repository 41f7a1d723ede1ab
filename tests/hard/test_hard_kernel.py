"""The compiled kernel gives the answers of the NumPy solvers, the reference, at instants that are hard for both."""

import numpy as np
import pytest
from cases import COEFFICIENTS, DELTAS, HARD

from colloc import Chain, Friction, solve_balance
from colloc.bounds.loaded_balance import loaded_balance
from colloc.mechanics.native_kernel import native_kernel, numpy_instead

ANGLES = np.array([angles for angles, _ in HARD.values()]).T
RATES = np.array([rates for _, rates in HARD.values()]).T
SPEED = np.abs(RATES).max(axis=0)
LAWS = [(1.0, 1.0, 1.0), (1.7, 1.0, 1.3), (10.0, 1.0, 1.0), (0.5, 1.0, 5.0)]

pytestmark = pytest.mark.skipif(native_kernel() is None, reason="no C compiler")


def by_both(*arguments, **named):
    """Two solutions of one balance: compiled, and by NumPy."""
    compiled = solve_balance(*arguments, **named)
    with numpy_instead():
        return compiled, solve_balance(*arguments, **named)


@pytest.mark.parametrize("delta", DELTAS)
@pytest.mark.parametrize("coefficients", COEFFICIENTS, ids=str)
def test_every_hard_instant_moves_as_numpy_says(coefficients, delta):
    """A residual leaves the velocity uncertain by max(mu)/min(mu) times as much, so a small one is asked for."""
    compiled, reference = by_both(Chain(), Friction(*coefficients), ANGLES, RATES, delta, tolerance=1e-13)
    np.testing.assert_allclose(compiled.z / SPEED, reference.z / SPEED, rtol=0, atol=1e-9)


@pytest.mark.parametrize("lengths", [(0.4, 0.6), (0.3, 0.2, 0.15, 0.35), (0.05, 0.3, 0.1, 0.25, 0.2, 0.1)], ids=len)
def test_chains_of_any_number_of_links_take_the_same_steps(lengths):
    """At (1, 0.01, 100) many links have several balanced velocities, and rounding chooses: both are roots to 1e-16."""
    rng = np.random.default_rng(5)
    angles, rates = rng.uniform(-3, 3, (len(lengths) - 1, 60)), rng.normal(size=(len(lengths) - 1, 60))
    start = rng.normal(size=(3, 60))
    for coefficients in LAWS:
        for delta in (1e-2, 1e-6):
            for near in (None, start):
                args = Chain(lengths), Friction(*coefficients), angles, rates, delta
                compiled, reference = by_both(*args, start=near, tolerance=1e-13)
                assert compiled.converged.all()
                np.testing.assert_allclose(compiled.z, reference.z, rtol=0, atol=1e-9)
                # rounding decides now and then whether one step more is taken
                assert np.mean(compiled.iterations == reference.iterations) > 0.75


@pytest.mark.parametrize("method", ["newton", "fixed_point"])
def test_the_methods_for_comparison_are_the_same_as_well(method):
    compiled, reference = by_both(Chain(), Friction(), ANGLES, RATES, 1e-2, method=method, max_iterations=60)
    np.testing.assert_array_equal(compiled.converged, reference.converged)
    np.testing.assert_allclose(compiled.z / SPEED, reference.z / SPEED, rtol=0, atol=1e-9)


@pytest.mark.parametrize("delta", [1e-3, 1e-7])
@pytest.mark.parametrize("lengths", [(1 / 3,) * 3, (0.3, 0.2, 0.15, 0.35)], ids=len)
def test_bodies_under_load_come_to_the_same_state(lengths, delta):
    """Where friction holds the load; where it cannot, neither solver finds a balance."""
    rng, body = np.random.default_rng(6), Chain(lengths)
    angles, rates = rng.uniform(-3, 3, (body.n_joint, 400)), rng.uniform(-1, 1, (body.n_joint, 400))
    load = rng.normal(size=(3, 400)) * [[0.4], [0.4], [0.1]]
    compiled = loaded_balance(body, angles, rates, load, np.zeros((3, 400)), delta)
    with numpy_instead(), np.errstate(all="ignore"):
        reference = loaded_balance(body, angles, rates, load, np.zeros((3, 400)), delta)
    held = compiled.residual.max(axis=0) < 1e-9
    assert 0.4 < held.mean() < 0.95
    np.testing.assert_array_equal(held, reference.residual.max(axis=0) < 1e-9)
    for ours, theirs in zip(compiled, reference, strict=True):
        np.testing.assert_allclose(ours[..., held], theirs[..., held], rtol=0, atol=1e-8)
