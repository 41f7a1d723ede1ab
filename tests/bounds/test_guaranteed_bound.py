"""The guaranteed bound: its certificates hold at every motion inside a cell, and its inequalities are what they claim."""

import dataclasses
import itertools

import numpy as np
import pytest

from colloc.bounds import guaranteed as bound_margin
from colloc.bounds.coulomb_motion import balanced_motion
from colloc.bounds.guaranteed import _KAPPA, _cell_bounds, _Reference, _solve_corners, certify, with_guarantee
from colloc.bounds.loaded_balance import loaded_balance
from colloc.bounds.potential import Samples
from colloc.bounds.sampled import Bound, Budget, efficiency_bound
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.numerics.spline import DEGREE
from colloc.system.errors import ProblemError

BODY = Chain()


@pytest.fixture(scope="module")
def bound() -> Bound:
    return efficiency_bound(BODY, Friction(), budget=Budget(4, (1,), 8, 24, 3, 60, first=4))


def test_loaded_balance_without_load_is_the_balance_of_the_body():
    rng = np.random.default_rng(31)
    q, s = rng.uniform(-3, 3, (2, 200)), rng.uniform(-1, 1, 200)
    r = np.stack([np.ones(200), s])
    free = loaded_balance(BODY, q, r, np.zeros((3, 200)), np.zeros((3, 200)), 1e-8)
    motion = balanced_motion(BODY, Friction(), q, r, 1e-8)
    np.testing.assert_allclose(free.velocity[:2], motion.velocity, atol=1e-6)
    np.testing.assert_allclose(free.velocity[2], motion.spin, atol=1e-6)
    np.testing.assert_allclose(free.power, motion.power, rtol=1e-7)
    assert free.residual.max() < 1e-7


def test_loaded_forces_bound_the_power_from_below():
    """Weak duality: admissible forces in balance with a load prove J(z) >= beta.r + load.z for every motion z."""
    rng = np.random.default_rng(32)
    n = 100
    q, r = rng.uniform(-3, 3, (2, n)), np.stack([np.ones(n), rng.uniform(-1, 1, n)])
    load = rng.uniform(-0.1, 0.1, (3, n)) * [[1.0], [1.0], [0.2]]
    state = loaded_balance(BODY, q, r, load, np.zeros((3, n)), 1e-8)
    beta_r = state.power - (load * state.velocity).sum(axis=0)
    for _ in range(20):
        other = loaded_balance(BODY, q, r, np.zeros((3, n)), rng.uniform(-1, 1, (3, n)) * 0.3, 1e-12, steps=0)
        assert np.all(other.potential >= beta_r + (load * other.velocity).sum(axis=0) - 1e-7)


def _rate_of_the_forces(q, r, state):
    """sum phi_i . B_i r: power of the forces if the middle link rests."""
    held = BODY.velocity(BODY.posture(q, 1), r, np.zeros((3, q.shape[1])), 1)
    return sum((state.forces[:, k] * part).sum(axis=0) for k, part in enumerate(held))


@pytest.mark.parametrize("steps", [0, 2, 40])
def test_what_is_left_unbalanced_is_counted_however_early_the_solver_stops(steps):
    """Power of the forces on all links = their power with the middle link held + (load - leftover) . z, identically."""
    rng = np.random.default_rng(36)
    n = 50
    q, r = rng.uniform(-3, 3, (2, n)), np.stack([np.ones(n), rng.uniform(-1, 1, n)])
    load = rng.uniform(-0.1, 0.1, (3, n))
    state = loaded_balance(BODY, q, r, load, rng.uniform(-1, 1, (3, n)), 1e-6, steps=steps)
    expected = state.power - (load * state.velocity).sum(axis=0) + state.leftover_power
    np.testing.assert_allclose(_rate_of_the_forces(q, r, state), expected, rtol=1e-8, atol=1e-8)


def test_speed_of_a_link_end_is_bounded_by_its_dissipation():
    rng = np.random.default_rng(33)
    sigma = (np.arange(2000) + 0.5) / 2000
    start, end = rng.standard_normal((2, 2, 500))
    line = start[:, :, None] * (1 - sigma) + end[:, :, None] * sigma
    mean = np.hypot(*line).mean(axis=1)
    assert np.all(mean >= _KAPPA * np.hypot(*start) * (1 - 1e-5))
    worst = np.abs(1 - np.sqrt(2) * sigma).mean()
    assert worst == pytest.approx(_KAPPA, abs=1e-5)


@pytest.mark.parametrize("n", [64, 256])
def test_cell_bounds_hold_at_random_motions_inside(bound, n):
    rng = np.random.default_rng(34)
    size = np.array([2 * np.pi / n, 2 * np.pi / n, 4 / n])
    count = 150
    low = rng.integers([n // 2, 0, 0], [n, n, n // 2], (count, 3)).T * size[:, None] - np.array([np.pi, np.pi, 1.0])[:, None]
    value, _ = _cell_bounds(BODY, _Reference(bound, BODY), low, size, 8.0, 1e-7)
    inside = low[:, :, None] + size[:, None, None] * rng.uniform(0, 1, (3, count, 20))
    q, r = inside[:2].reshape(2, -1), np.stack([np.ones(count * 20), inside[2].ravel()])
    motion = balanced_motion(BODY, Friction(), q, r, 1e-10)
    assert motion.size == count * 20
    ratio = Samples(bound.potential_space(BODY), motion).ratio(np.array(bound.coefficients))[0].reshape(count, 20)
    assert np.all(ratio.max(axis=1) <= value)
    # and they are not vacuous; most of the excess is the roughness of this coarse reference point
    assert np.median(value - ratio.max(axis=1)) < (0.3 if n == 64 else 0.15)


@pytest.fixture(scope="module")
def some_cells():
    rng, n = np.random.default_rng(37), 64
    size = np.array([2 * np.pi / n, 2 * np.pi / n, 4 / n])
    low = rng.integers([n // 2, 0, 0], [n, n, n // 2], (40, 3)).T * size[:, None] - np.array([np.pi, np.pi, 1.0])[:, None]
    inside = low[:, :, None] + size[:, None, None] * rng.uniform(0, 1, (3, 40, 20))
    return low, size, balanced_motion(BODY, Friction(), inside[:2].reshape(2, -1), np.stack([np.ones(800), inside[2].ravel()]))


def test_cell_bounds_hold_for_whatever_the_loaded_solver_returns(bound, some_cells, monkeypatch):
    """Far from balance the forces prove less, but nothing false: here they belong to a wild motion and no step is taken."""
    low, size, motion = some_cells
    ratio = Samples(bound.potential_space(BODY), motion).ratio(np.array(bound.coefficients))[0].reshape(40, 20)

    def wild(body, angles, rates, load, start, delta):
        return loaded_balance(body, angles, rates, load, start + 1e3 * load.any(), delta, steps=0 if load.any() else 40)

    monkeypatch.setattr(bound_margin, "loaded_balance", wild)
    value, _ = _cell_bounds(BODY, _Reference(bound, BODY), low, size, 8.0, 1e-7)
    assert np.all(ratio.max(axis=1) <= value)


def bound_of_one_cell(reference, low, size, multiplier, delta):
    """The inequality at the end of docs/bound.md, section 3, corner by corner and load by load; equal links."""
    length, kappa, allowed = 1 / 3, np.sqrt(2) - 1, 1e-9
    steps = list(itertools.product((0, 1), repeat=3))
    corners = np.array([low + size * np.array(step) for step in steps]).T
    solved = _solve_corners(BODY, reference, corners, multiplier, delta)
    x, y, w = solved.free.velocity
    joints = {0: (x, y - length / 2 * w), 1: (x, y + length / 2 * w)}  # behind the middle link, and before it

    def change(vectors, axis):
        """Largest change along an axis of the cell, from corner to corner."""
        pairs = [
            (a, b)
            for a, s in enumerate(steps)
            for b, t in enumerate(steps)
            if (t[axis], s[axis]) == (1, 0) and all(s[k] == t[k] for k in range(3) if k != axis)
        ]
        return max(np.hypot(*(v[b] - v[a] for v in vectors)) for a, b in pairs)

    power = solved.free.potential + allowed
    for axis, speeds in joints.items():
        power = power + length * (size[axis] ** 2 / 8 * np.hypot(*speeds).max() + size[axis] / 4 * change(speeds, axis))
    centre = (low + size / 2)[:2, None]
    off = sum(size[k] ** 2 / 8 * reference.largest(centre, tuple(2 * np.eye(2, dtype=int)[k]))[:, 0] for k in (0, 1))
    slope_off = sum(
        size[k] ** 2 / 8 * reference.largest(centre, tuple(2 * np.eye(2, dtype=int)[k] + np.eye(2, dtype=int)[j]))[:, 0]
        for k in (0, 1)
        for j in (0, 1)
    )
    fastest_turn = (4 * power.max() + 2 * length**2) / (3 * length**2)
    sides = {}
    for k, (component, sign) in enumerate([(0, 1), (0, -1), (1, 1), (1, -1)]):
        state = solved.loaded[k]
        t = state.residual[0].max() / length + 4 * state.residual[1].max() / length**2 + allowed
        for link, axis in ((0, 0), (2, 1)):
            force = state.forces[link, :2]
            t += (size[axis] ** 2 / 8 * length + size[axis] / 4 * change(force, axis)) / (kappa * 2 * length)
        moment = state.forces[2, 1] * length / 2 + state.forces[2, 2]
        a = (
            multiplier * size[2] / 4 * change((moment, 0 * moment), 2)
            + slope_off[component]
            + fastest_turn * off[1 - component]
        )
        numerator = multiplier * (state.power + state.leftover_power) - solved.gain[k] - a
        side = multiplier * (1 + t) - numerator / power
        sides[component, sign] = np.full(8, np.inf) if numerator.min() < 0 else np.maximum(side, 0)
    return max(np.hypot(sides[0, i], sides[1, j]).max() for i in (1, -1) for j in (1, -1)) + allowed


def test_the_bound_of_a_cell_is_the_inequality_of_the_documentation(bound):
    """Margins are far above what motions reach, so that sampled motions do not tell when one is too small."""
    rng, reference, finite = np.random.default_rng(38), _Reference(bound, BODY), 0
    for n, multiplier in ((64, 8.0), (512, 30.0)):
        size = np.array([2 * np.pi / n, 2 * np.pi / n, 4 / n])
        for _ in range(6):
            low = rng.integers([n // 2, 0, 0], [n, n, n // 2]) * size - np.array([np.pi, np.pi, 1.0])
            value, _ = _cell_bounds(BODY, reference, low[:, None], size, multiplier, 1e-7)
            assert value[0] == pytest.approx(bound_of_one_cell(reference, low, size, multiplier, 1e-7), rel=1e-12)
            finite += np.isfinite(value[0])
    assert finite > 8


@pytest.mark.parametrize("order", [(2, 0), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)])
def test_derivatives_of_the_reference_point_stay_below_their_bound_which_is_met_where_they_are_constant(bound, order):
    reference, rng = _Reference(bound, BODY), np.random.default_rng(39)
    centres = rng.uniform(-3, 3, (2, 30))
    largest = reference.largest(centres, order)
    spline = reference.spline
    cell = spline.cell(centres)
    knots = [spline.extended[DEGREE + cell[a]] for a in (0, 1)], [spline.extended[DEGREE + 1 + cell[a]] for a in (0, 1)]
    inside = np.array(knots[0])[:, :, None] + (np.array(knots[1]) - np.array(knots[0]))[:, :, None] * rng.uniform(
        0.001, 0.999, (2, 30, 200)
    )
    found = np.abs((spline.matrix(inside.reshape(2, -1), order) @ reference.c.T).T).reshape(2, 30, 200).max(axis=2)
    assert np.all(found <= largest * (1 + 1e-9) + 1e-12)
    assert np.median(largest / found) < 3


def test_the_spin_of_a_balanced_motion_is_bounded_by_its_dissipation():
    """Of the middle link: |omega| <= (4 P + l1^2 + l3^2) / (l1^2 + l2^2 + l3^2) for rates of at most 1."""
    rng = np.random.default_rng(40)
    motion = balanced_motion(BODY, Friction(), rng.uniform(-3, 3, (2, 400)), np.stack([np.ones(400), rng.uniform(-1, 1, 400)]))
    assert np.all(np.abs(motion.spin) <= (4 * motion.power + 2 / 9) / (3 / 9))


def test_a_cell_whose_bound_is_not_a_number_stays_open(bound, some_cells, monkeypatch):
    low, size, _ = some_cells

    def broken(*arguments):
        state = loaded_balance(*arguments)
        return state._replace(power=np.full_like(state.power, np.nan))

    monkeypatch.setattr(bound_margin, "loaded_balance", broken)
    value, _ = _cell_bounds(BODY, _Reference(bound, BODY), low, size, 8.0, 1e-7)
    assert np.all(value == np.inf)
    everywhere = lambda body, reference, low, *rest: (np.full(low.shape[1], np.nan), np.full(low.shape[1], np.nan))  # noqa: E731
    monkeypatch.setattr(bound_margin, "_cell_bounds", everywhere)
    certificate = certify(BODY, Friction(), bound, 0.95, deepest=0)
    assert certificate.open_cells == certificate.cells > 0
    assert certificate.guaranteed == np.inf


@pytest.mark.slow
def test_no_gait_of_the_isotropic_body_reaches_nine_tenths(bound):
    certificate = certify(BODY, Friction(), bound, 0.95, seconds=100.0)
    assert certificate.open_cells == 0
    assert certificate.guaranteed == 0.95
    assert 0 < certificate.distance_allowance(1.0, 1e-6) < 1e-3


@pytest.mark.parametrize(("target", "closed"), [(0.46, True), (0.44, False)])
def test_a_body_on_twice_the_friction_goes_half_as_far_for_its_work(bound, monkeypatch, target, closed):
    """Cells are bounded for coefficients of 1: by 0.9 here."""
    cells = lambda body, reference, low, *rest: (np.full(low.shape[1], 0.9), np.full(low.shape[1], 8.0))  # noqa: E731
    monkeypatch.setattr(bound_margin, "_cell_bounds", cells)
    certificate = certify(BODY, Friction(2.0, 2.0, 2.0), bound, target, deepest=0)
    assert (certificate.open_cells == 0) == closed
    assert certificate.guaranteed == pytest.approx(target if closed else 0.45)
    assert certificate.largest_multiplier == (4.0 if closed else 0.0)


def test_out_of_time_says_what_is_proved_so_far(bound):
    certificate = certify(BODY, Friction(), bound, 0.5, seconds=0.0)
    assert certificate.open_cells > 0
    assert certificate.guaranteed > 0.5
    assert "left open" in with_guarantee(bound, certificate).missing


@pytest.mark.parametrize(
    ("body", "friction", "harmonics"),
    [
        (BODY, Friction(2.0, 1.0, 1.0), (1,)),
        (Chain((0.3, 0.4, 0.3)), Friction(), (1,)),
        (Chain((0.25,) * 4), Friction(), (1,)),
        (BODY, Friction(), (1, 3)),
    ],
    ids=["no potential", "unequal links", "four links", "higher harmonics"],
)
def test_what_the_proof_does_not_cover_is_refused(bound, body, friction, harmonics):
    with pytest.raises(ProblemError, match="isotropic"):
        certify(body, friction, dataclasses.replace(bound, harmonics=harmonics), 0.5, seconds=0.0)


def test_cells_that_knots_would_cut_are_refused(bound):
    """Slopes of the reference point are bounded on whole knot intervals, and cells halve even ones."""
    with pytest.raises(ProblemError, match="even"):
        certify(BODY, Friction(), dataclasses.replace(bound, graded=(-0.5, 0.0, 0.5)), 0.9)


@pytest.mark.parametrize("delta", [1e-3, 1e-2, 1e-1])
def test_finite_delta_costs_at_most_delta_in_dissipation_and_in_power(delta):
    """J <= J_delta <= J + delta: regularised motions are within delta of minimal dissipation, their power at most delta below.

    These are all that the allowance for finite delta uses (docs/bound.md, section 3).
    """
    q, r = np.random.default_rng(35).uniform(-3, 3, (2, 2, 300))
    rest = np.zeros((3, 300))
    exact = loaded_balance(BODY, q, r, rest, rest, 1e-10)
    soft = loaded_balance(BODY, q, r, rest, rest, delta)
    # the dissipation J of the regularised motion itself: evaluated there, no step taken
    there = loaded_balance(BODY, q, r, rest, soft.velocity, 1e-12, steps=0)
    least = exact.potential
    assert np.all(there.potential >= least - 1e-7)
    assert np.all(there.potential <= least + delta + 1e-7)
    assert np.all(soft.power >= there.potential - delta - 1e-7)
    assert np.all(soft.power <= soft.potential + 1e-7)
    # and not vacuously: motions do change
    assert np.max(there.potential - least) > 1e-3 * delta
