"""Instants at stick, at folds, frozen, straight, with extreme coefficients and delta: the answer,
or a clear refusal.

The reference is a 40-digit Newton iteration on textbook antiderivatives (`benchmarks.reference`),
which shares nothing with the solver. A residual of 1e-11 of the largest coefficient leaves the
velocity of a body whose smallest coefficient is c times less uncertain by c times as much, so that
is the accuracy asked for.
"""

import itertools

import mpmath as mp
import numpy as np
import pytest
from cases import ANGLES, COEFFICIENTS, DELTAS, HARD, RATES, SPEED

from benchmarks.reference import balanced_velocity
from colloc import Chain, Friction, solve_balance
from colloc.mechanics.balance import instant, net_force, total_power
from colloc.mechanics.native_kernel import native_kernel
from research.guarantee.loaded_balance import loaded_balance
from tests.shared.cases import slow_but
from tests.shared.mechanics import coulomb, numpy_instead

BODY = Chain()
NAMES = list(HARD)


def errors(coefficients, delta, solved):
    """Distance of the anchor's velocity from the reference, over the largest rate."""
    result = {}
    for k in range(len(NAMES)):
        anchor, velocity = int(solved.anchor[k]), solved.anchor_velocity[:, k]
        exact = balanced_velocity(
            BODY.lengths, coefficients, ANGLES[:, k], RATES[:, k], delta, anchor, velocity
        )
        off = (abs(float(e - mp.mpf(v))) for e, v in zip(exact, velocity, strict=True))
        result[NAMES[k]] = max(off) / SPEED[k]
    return result


@pytest.mark.parametrize("delta", DELTAS)
@pytest.mark.parametrize("coefficients", COEFFICIENTS, ids=str)
def test_every_hard_instant_converges(coefficients, delta):
    solved = solve_balance(BODY, coulomb(*coefficients), ANGLES, RATES, delta)
    assert solved.converged.all(), [NAMES[k] for k in np.flatnonzero(~solved.converged)]
    assert np.isfinite(solved.z).all()
    assert solved.residual.max() <= 1e-11


QUICK = [((1.0, 1.0, 1.0), delta) for delta in (1.0, 1e-4, 1e-12)] + [((1.7, 1.0, 1.3), 1e-4)]
QUICK += [((100.0, 0.01, 1.0), 1e-12), ((0.01, 100.0, 1.0), 1e-4)]


@pytest.mark.parametrize(
    ("coefficients", "delta"), slow_but(QUICK, itertools.product(COEFFICIENTS, DELTAS))
)
def test_every_hard_instant_against_the_reference(coefficients, delta):
    solved = solve_balance(BODY, coulomb(*coefficients), ANGLES, RATES, delta)
    found = errors(coefficients, delta, solved)
    assert max(found.values()) < 1e-10 * max(coefficients) / min(coefficients), found


@pytest.mark.parametrize("coefficients", COEFFICIENTS, ids=str)
def test_frozen_joints_leave_the_body_exactly_at_rest(coefficients):
    rest = np.zeros_like(RATES)
    for delta in (1.0, 1e-4, 1e-14):
        z = solve_balance(BODY, coulomb(*coefficients), ANGLES, rest, delta).z
        np.testing.assert_array_equal(z, np.zeros((3, len(NAMES))))


@pytest.mark.parametrize("coefficients", COEFFICIENTS[:7], ids=str)
def test_the_answer_does_not_depend_on_a_start_1e6_away(coefficients):
    rng = np.random.default_rng(4)
    friction, chosen = coulomb(*coefficients), SPEED == 1
    angles, rates = ANGLES[:, chosen], RATES[:, chosen]
    for delta in (1e-2, 1e-8):
        at, start = (BODY, friction, angles, rates, delta), rng.normal(size=(3, angles.shape[1]))
        near, far = solve_balance(*at), solve_balance(*at, start=1e6 * start)
        assert far.converged.all()
        ratio = friction.largest / friction.smallest
        np.testing.assert_allclose(far.z, near.z, atol=2e-10 * ratio)


def test_rates_below_delta_are_solved_to_their_own_scale():
    """Viscous limit: the velocity is linear in rates of any size and independent of delta."""
    angles, rates = ANGLES[:, 7:12], np.array([[1.0], [0.3]]) * np.ones((1, 5))
    for coefficients in COEFFICIENTS[:7]:
        friction = coulomb(*coefficients)
        z = [
            solve_balance(BODY, friction, angles, k * rates, 1.0).require().z / k
            for k in (1e-6, 1e-12, 1e-100, 1e-300)
        ]
        most = 2e-10 * friction.largest / friction.smallest
        np.testing.assert_allclose(z[1:], np.broadcast_to(z[0], (3, 3, 5)), atol=most)


def test_rates_and_delta_over_600_decades_do_not_overflow():
    angles, rates = np.array([[1.1], [-0.6]]), np.array([[1.0], [0.3]])
    dry = solve_balance(BODY, Friction(), angles, rates, 1e-13).z
    for k in (1e-290, 1e-100, 1e100, 1e290):
        solved = solve_balance(BODY, Friction(), angles, k * rates, max(k * 1e-13, 5e-324))
        assert solved.converged.all()
        np.testing.assert_allclose(solved.z / k, dry, atol=1e-11)
    for delta in (5e-324, 1e-200, 1e200):
        assert solve_balance(BODY, Friction(), angles, rates, delta).converged.all()


@pytest.mark.parametrize("delta", [1e-2, 1e-6, 1e-10])
def test_scissors_share_their_rate_equally(delta):
    """Folded onto each other, any split of the rate balances without delta, which picks the even one:
    the couple about the common end changes with the split by delta^2, so 1e-11 fixes it to 1e-11 / delta^2."""
    body, angles, rates = Chain((0.5, 0.5)), np.array([[np.pi]]), np.array([[1.0]])
    z = solve_balance(body, Friction(), angles, rates, delta).require().z
    assert abs(z[2, 0] + 0.5) < min(1e-10 / delta**2, 0.5)
    power = total_power(*instant(body, Friction(), angles, rates, z, delta)[1:])
    # two halves, each turning at 1/2 about its end: 2 * integral of s/2 over 0..1/2
    assert power.item() == pytest.approx(0.125, abs=2 * delta)


def test_two_links_that_nearly_rest_beside_one_that_turns_are_followed_from_smoother_friction():
    """Attempts at delta itself stop at residuals of 7e-5 and above; at twice delta all is well."""
    angles = np.array([[2.41881], [-2.41881]])
    rates = np.array([[1.0], [-1.5312e-4]])
    solved = solve_balance(BODY, Friction(mu_t=10.0, mu_f=1.0, mu_b=1.7), angles, rates, 1e-6)
    assert solved.converged.all()
    assert solved.residual.max() <= 1e-11


needs_kernel = pytest.mark.skipif(native_kernel() is None, reason="no C compiler")


@needs_kernel
@pytest.mark.parametrize(
    "delta", [pytest.param(d, marks=[pytest.mark.slow] * (d not in (1e-2, 1e-8))) for d in DELTAS]
)
@pytest.mark.parametrize("coefficients", COEFFICIENTS, ids=str)
def test_every_hard_instant_moves_as_numpy_says(coefficients, delta):
    """A residual leaves max(mu)/min(mu) times as much of the velocity open: it has to be small."""
    at = BODY, coulomb(*coefficients), ANGLES, RATES, delta
    compiled = solve_balance(*at, tolerance=1e-13)
    with numpy_instead():
        reference = solve_balance(*at, tolerance=1e-13)
    np.testing.assert_allclose(compiled.z / SPEED, reference.z / SPEED, rtol=0, atol=1e-9)


@needs_kernel
@pytest.mark.parametrize("delta", [1e-3, 1e-7])
@pytest.mark.parametrize("lengths", [(1 / 3,) * 3, (0.3, 0.2, 0.15, 0.35)], ids=len)
def test_bodies_under_load_are_in_the_state_that_they_state(lengths, delta):
    """Force, potential and power by NumPy; in balance with every load that friction holds."""
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
