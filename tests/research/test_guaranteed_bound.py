"""The guaranteed bound: certificates hold at every motion in a cell; the inequalities are true."""

import json
from pathlib import Path

import numpy as np
import pytest

from colloc import Chain, Elliptic, Friction, ProblemError
from colloc.bounds import sampled
from colloc.bounds.motions import CoulombMotion, Domain
from colloc.bounds.sampled import PotentialSpace, Samples, TensorSpline
from colloc.mechanics.contact import crossing_depth
from research.guarantee import enclosure, guaranteed
from research.guarantee.enclosure import DELTA, by_convexity, by_loads, corner_motions
from research.guarantee.guaranteed import Guarantee, cell_bounds, certify, with_guarantee
from research.guarantee.loaded_balance import loaded_balance
from research.guarantee.potential_range import PotentialRange, potential_space, turned
from research.small_gaits import balanced_motion
from tests.shared.cases import slow
from tests.shared.mechanics import numpy_instead

BODY, UNIT = Chain(), Friction()
ALLOWANCES = json.loads(Path(__file__).with_name("allowances.json").read_text(encoding="utf-8"))
"""Gain and power of cells by the inequalities of research/guarantee/README.md, written out a second
time, with more digits (tests/research of commit 5b26e882)."""


@pytest.fixture(scope="module")
def bound() -> sampled.Bound:
    return sampled.efficiency_bound(
        BODY, Friction(), budget=sampled.Budget(4, (1, 3), 8, 24, 3, 60, first=4)
    )


@pytest.fixture(scope="module")
def potential(bound) -> PotentialRange:
    return PotentialRange(potential_space(bound, BODY), np.array(bound.coefficients))


def all_cells(low, sizes):
    """Cells that share no corners."""
    points = (low[:, :, None] + sizes[:, :, None] * enclosure.CORNERS.T[:, None, :]).reshape(3, -1)
    return enclosure.Cells(low, sizes, points, np.arange(points.shape[1]).reshape(-1, 8))


def random_cells(body, friction, size, seed, thin=False, count=8):
    """Cells of any body, motions at their corners, a reference point unrelated to potentials."""
    rng = np.random.default_rng(seed)
    low, sizes = (
        rng.uniform(-1, 1, (3, count)) * [[2.5], [2.5], [0.9]],
        size * rng.uniform(0.7, 1.3, (3, count)),
    )
    if thin:
        low[2] = 10.0 ** rng.uniform(-9, -3, count)
        sizes[2] = low[2] * 3.0
    at, centre = rng.normal(size=(2, 8 * count)), rng.normal(size=(2, count))
    reference = enclosure.ReferencePoint(
        at[0] + 1j * at[1], centre[0] + 1j * centre[1], *rng.uniform(0.1, 1, (3, count))
    )
    cells = all_cells(low, sizes)
    return cells, corner_motions(body, friction, cells), reference


def boxes(potential, size, count, seed, thin=False):
    """Random cells that no knot cuts; if thin, near s = 0, where one joint turns alone."""
    rng, knots = np.random.default_rng(seed), potential.spline.knots
    least, most = np.array([[0, -np.pi, -1], [np.pi - size, np.pi - size, 1 - size]])[..., None]
    low = rng.uniform(least, most, (3, count))
    sizes = np.full((3, count), size)
    if thin:
        low[2] = 10.0 ** rng.uniform(-8, -3, count)
        sizes[2] = low[2] * 3.0
    inside = (np.searchsorted(knots, low[:2]) == np.searchsorted(knots, low[:2] + size)).all(axis=0)
    return all_cells(low[:, inside], sizes[:, inside])


def motions_inside(cells, count, seed, body=BODY, friction=UNIT):
    """Share of corners ``(n, count, 8)`` at random points of cells; balanced motions there."""
    shares = np.random.default_rng(seed).uniform(0, 1, (3, cells.low.shape[1], count))
    weights = np.prod(
        np.where(
            enclosure.CORNERS.T[:, None, None, :] == 1, shares[..., None], 1 - shares[..., None]
        ),
        axis=0,
    )
    q1, q2, s = (cells.low[:, :, None] + cells.size[:, :, None] * shares).reshape(3, -1)
    rest, r = np.zeros((3, s.size)), np.stack([np.ones_like(s), s])
    rest[2] = (1 - s) / 3
    q = np.stack([q1, q2])
    return weights, r, q, loaded_balance(body, friction, q, r, np.zeros_like(rest), rest, 1e-10)


@pytest.mark.slow
def test_loaded_forces_bound_the_power_from_below():
    """Weak duality: admissible forces in balance with a load prove J(z) >= beta.r + load.z."""
    rng = np.random.default_rng(32)
    n = 100
    q, r = rng.uniform(-3, 3, (2, n)), np.stack([np.ones(n), rng.uniform(-1, 1, n)])
    load = rng.uniform(-0.1, 0.1, (3, n)) * [[1.0], [1.0], [0.2]]
    state = loaded_balance(BODY, UNIT, q, r, load, np.zeros((3, n)), DELTA)
    at = np.stack([*q, r[1]])
    beta_r = enclosure.states(BODY, UNIT, at, state.velocity, load)[:, 20]
    for _ in range(20):
        z = rng.uniform(-1, 1, (3, n)) * 0.3
        other = loaded_balance(BODY, UNIT, q, r, np.zeros((3, n)), z, 1e-12, steps=0)
        assert np.all(other.potential >= beta_r + (load * other.velocity).sum(axis=0) - 1e-7)


ODD_LENGTHS = Chain((0.3, 0.45, 0.25))
DIRECTED = Elliptic(mu_t=1.0, mu_f=0.6, mu_b=1.4)
CASES = pytest.mark.parametrize(
    ("body", "friction"),
    [
        (BODY, UNIT),
        (ODD_LENGTHS, UNIT),
        (BODY, Elliptic(mu_t=1.0, mu_f=0.5, mu_b=0.5)),
        (ODD_LENGTHS, DIRECTED),
    ],
    ids=["equal", "unlike lengths", "elliptic", "unlike and directed"],
)


@CASES
@pytest.mark.parametrize("thin", [False, True], ids=["anywhere", "where one joint hardly turns"])
@pytest.mark.parametrize("size", [slow(0.06), 0.01, slow(0.002)])
def test_balanced_motions_stay_within_what_is_allowed(potential, body, friction, size, thin):
    """Gain and power at random motions inside, against the interpolated ones."""
    cells = boxes(potential, size, 300, 34, thin)
    corners, reference = corner_motions(body, friction, cells), potential.reference(cells)
    weights, _, _, true = motions_inside(cells, 20, 35, body, friction)
    trial = np.einsum("ncj,knj->knc", weights, corners.velocity[:, cells.at])
    dx, dy, spin = true.velocity.reshape(trial.shape) - trial
    gain = np.abs(dx + 1j * dy + 1j * reference.centre[:, None] * spin).max(axis=1)
    least = np.einsum("ncj,nj->nc", weights, corners.potential[cells.at] - DELTA)
    power = (least - true.potential.reshape(dx.shape)).max(axis=1)
    for allowed in (
        by_convexity(body, friction, cells, corners, reference),
        by_loads(body, friction, cells, corners, reference, 4 / np.sqrt(size)),
    ):
        assert np.all(gain <= allowed.gain)
        assert np.all(power <= allowed.power)
    # convexity is known of most small cells, and its allowance is not vacuous
    known = by_convexity(body, friction, cells, corners, reference).gain
    if size < 0.01 and friction is not DIRECTED:
        assert np.isfinite(known).mean() > 0.7
        assert np.median(known[np.isfinite(known)]) < 1e-3


@pytest.mark.parametrize(
    ("name", "body", "friction", "size", "thin", "seed"),
    [
        ("large", ODD_LENGTHS, UNIT, 0.02, False, 44),
        ("small", Chain((0.5, 0.3, 0.2)), UNIT, 0.01, False, 45),
        ("end that rests", Chain((0.1, 0.3, 0.6)), UNIT, 0.01, False, 55),
        ("pivots", ODD_LENGTHS, UNIT, 0.002, True, 49),
        ("middle that rests", ODD_LENGTHS, UNIT, 0.0003, True, 50),
        ("widely spread", ODD_LENGTHS, UNIT, 0.02, True, 68),
        ("elliptic", ODD_LENGTHS, Elliptic(mu_t=1.0, mu_f=0.5, mu_b=0.5), 0.01, False, 44),
        ("elliptic, thin", BODY, Elliptic(mu_t=1.0, mu_f=2.0, mu_b=2.0), 0.002, True, 49),
        ("both senses", ODD_LENGTHS, DIRECTED, 0.01, False, 136),
        ("directed, thin", BODY, Elliptic(mu_t=1.0, mu_f=2.0, mu_b=1.5), 0.002, True, 50),
        ("both senses, large", BODY, Elliptic(mu_t=1.0, mu_f=1.2, mu_b=1.0), 0.02, False, 79),
        ("both senses, thin", BODY, DIRECTED, 0.002, True, 64),
    ],
)
def test_allowances_by_convexity_are_inequalities_or_more(name, body, friction, size, thin, seed):
    """Motions do not come near the margins, so these are held against the inequalities."""
    cells, corners, reference = random_cells(body, friction, size, seed, thin)
    found = by_convexity(body, friction, cells, corners, reference)
    for n, *exact in ALLOWANCES[name]:
        for value, least in zip((found.gain[n], found.power[n]), exact, strict=True):
            assert (1 - 1e-8) * least <= value <= (1 + 1e-5) * least + 1e-12


@pytest.mark.parametrize(
    ("name", "friction", "size", "thin", "steps"),
    [
        ("loads 0", UNIT, 0.05, False, 40),
        ("loads 1", UNIT, 0.003, True, 40),
        ("loads 2", DIRECTED, 0.01, False, 40),
        ("loads 3", UNIT, 0.05, False, 3),
    ],
)
def test_allowances_by_loads_are_the_inequalities_written_out(name, friction, size, thin, steps):
    cells, _, reference = random_cells(ODD_LENGTHS, friction, size, 52, thin)
    rest = np.zeros((3, cells.points.shape[1]))
    corners = loaded_balance(
        ODD_LENGTHS, friction, cells.points[:2], cells.rates, rest, rest, DELTA, steps
    )
    multiplier = 2.0 ** np.round(np.log2(4 / np.sqrt(size)))
    found = by_loads(ODD_LENGTHS, friction, cells, corners, reference, multiplier)
    for n, gain, power in ALLOWANCES[name]:
        assert found.gain[n] == pytest.approx(gain, rel=1e-8, abs=1e-8)
        assert found.power[n] == pytest.approx(power, rel=1e-8, abs=1e-8)


@CASES
@pytest.mark.parametrize("size", [0.06, 0.01])
def test_cell_bounds_hold_at_random_motions_inside(potential, body, friction, size):
    cells = boxes(potential, size, 300, 36)
    value = cell_bounds(body, friction, potential, cells, 0.0)
    _, rates, angles, true = motions_inside(cells, 20, 37, body, friction)
    motion = CoulombMotion(angles, rates, true.velocity[:2], true.velocity[2], true.potential)
    ratio = Samples(potential.space, motion).ratio(potential.free)[0].reshape(-1, 20).max(axis=1)
    assert np.all(ratio <= value)
    if size == 0.01:
        assert np.median(value - ratio) < 0.05


@pytest.mark.parametrize("way", ["by_convexity", "by_loads"])
def test_what_a_motion_inside_may_gain_and_save_raises_the_bound(potential, monkeypatch, way):
    """By just as much, whichever way it is known; a motion that may cost nothing has no bound."""
    cells, other = boxes(potential, 0.01, 100, 41), ({"by_convexity", "by_loads"} - {way}).pop()

    def bound_with(gain, power):
        none = np.zeros(cells.low.shape[1])
        allowed = enclosure.Allowance(none + gain, none + power)
        unknown = enclosure.Allowance(none + np.inf, none + np.inf)
        monkeypatch.setattr(guaranteed, way, lambda *_: allowed)
        monkeypatch.setattr(guaranteed, other, lambda *_: unknown)
        return cell_bounds(BODY, UNIT, potential, cells, 0.0)

    motions = corner_motions(BODY, UNIT, cells)
    power = (motions.potential - DELTA)[cells.at]
    gain = (
        potential.corner_gain(cells, motions)[cells.at]
        + potential.trial_error(cells, motions)[:, None]
    )
    for more, share in ((0.0, 0.0), (0.02, 0.0), (0.0, 0.1), (0.02, 0.9)):
        less = share * power.min()
        known = ((gain + more) / (power - less)).max(axis=1)
        np.testing.assert_allclose(bound_with(more, less), known, rtol=2e-9)
    assert (bound_with(0.0, 0.5 * (power.min(axis=1) + power.max(axis=1))) == np.inf).all()


@pytest.mark.parametrize("steps", [0, 1, 3])
def test_cell_bounds_hold_for_whatever_the_solver_returns(potential, monkeypatch, steps):
    cells = boxes(potential, 0.01, 200, 38)
    _, rates, angles, true = motions_inside(cells, 10, 39)
    motion = CoulombMotion(angles, rates, true.velocity[:2], true.velocity[2], true.potential)
    ratio = Samples(potential.space, motion).ratio(potential.free)[0].reshape(-1, 10).max(axis=1)
    monkeypatch.setattr(enclosure, "loaded_balance", lambda *at: loaded_balance(*at, steps=steps))
    assert np.all(ratio <= cell_bounds(BODY, UNIT, potential, cells, 0.0))


def test_a_cell_whose_bound_is_not_a_number_stays_open(bound, potential, monkeypatch):
    cells = boxes(potential, 0.01, 50, 40)

    def broken(*given):
        state = loaded_balance(*given)
        return state._replace(velocity=np.nan * state.velocity, power=np.nan * state.power)

    monkeypatch.setattr(enclosure, "loaded_balance", broken)
    assert np.all(cell_bounds(BODY, UNIT, potential, cells, 0.0) == np.inf)
    monkeypatch.setattr(guaranteed, "cell_bounds", lambda *at: np.full(at[3].low.shape[1], np.nan))
    certificate = certify(*stated(bound), 0.95, deepest=0, part=(1, 500))
    assert certificate.open_cells == certificate.cells > 0
    assert certificate.guaranteed == np.inf


def stated(bound, friction=UNIT):
    """Domain and potential of a bound, as `certify` takes them."""
    domain = Domain(BODY, friction, bound.joint_limit)
    return domain, potential_space(bound, BODY), np.array(bound.coefficients)


@pytest.mark.slow
def test_no_gait_of_the_isotropic_body_reaches_nine_tenths(bound):
    certificate = certify(*stated(bound), 0.9, seconds=100.0)
    assert certificate.open_cells == 0
    assert certificate.guaranteed == 0.9


@pytest.mark.parametrize(("target", "closed"), [(0.46, True), (0.44, False)])
def test_on_twice_the_friction_the_bound_is_half_as_large(bound, monkeypatch, target, closed):
    """Cells are bounded for coefficients of 1: by 0.9 here."""
    monkeypatch.setattr(guaranteed, "cell_bounds", lambda *at: np.full(at[3].low.shape[1], 0.9))
    certificate = certify(
        *stated(bound, friction=Friction(2.0, 2.0, 2.0)), target, deepest=0, part=(1, 50)
    )
    assert (certificate.open_cells == 0) == closed
    assert certificate.guaranteed == pytest.approx(target if closed else 0.45)


@pytest.mark.parametrize("body", [BODY, Chain((0.4, 0.25, 0.35)), Chain((0.25, 0.3, 0.45))])
def test_parts_share_the_cells_and_these_fill_the_domain(body, monkeypatch):
    """Each once, and all rates, also where cells are halved."""
    seen = []

    def recorded(view, friction, potential, cells, goal):
        again = (cells.low[0] < 0.3) & (cells.size[0] > 0.05)
        seen.append((view, *(part[:, ~again] for part in (cells.low, cells.size))))
        return np.where(again, np.inf, 0.0)

    monkeypatch.setattr(guaranteed, "cell_bounds", recorded)
    space = PotentialSpace(TensorSpline(2, np.pi, 4), (1,), body.symmetric)
    at = Domain(body, UNIT, np.pi), space, np.zeros(space.size), 0.9
    for k in (1, 2, 3):
        assert certify(*at, deepest=1, part=(k, 3)).open_cells == 0
    rng = np.random.default_rng(42)
    for view in {view for view, *_ in seen}:
        low, size = (np.hstack([each[k] for each in seen if each[0] == view]) for k in (1, 2))
        assert low.shape[1] == np.unique(low.round(12), axis=1).shape[1]
        assert size[2].min() > 0.9e-9
        for s in (-1e-10, 1e-10, 1e-7, -1e-5, 0.5, -0.93):
            shapes = rng.uniform([[0], [-np.pi]], np.pi, (2, 400))
            there = (low[2] <= s) & (s <= low[2] + size[2])
            begin, end = (each[:2, there, None] for each in (low, low + size))
            held = ((begin <= shapes[:, None]) & (shapes[:, None] <= end)).all(axis=0).any(axis=0)
            free = crossing_depth(view, shapes) == 0
            assert held[free].all()
            assert held[~free].mean() < 0.4, "boxes well inside the crossing are left out"


@pytest.mark.parametrize("friction", [UNIT, DIRECTED], ids=["equal", "directed"])
def test_a_potential_says_the_same_of_a_body_turned_end_for_end(friction):
    """Time runs backwards then, so that every link slides in the same sense along itself."""
    rng = np.random.default_rng(46)
    space = PotentialSpace(TensorSpline(2, np.pi, 4), (0, 1, 2), False)
    free, q, r = rng.normal(size=space.size), *rng.uniform(-3, 3, (2, 2, 60))
    ratios = []
    for lengths, own, angles, rates in (
        (ODD_LENGTHS.lengths, free, q, r),
        (ODD_LENGTHS.lengths[::-1], turned(space, free), -q[::-1], r[::-1]),
    ):
        motion = balanced_motion(Chain(lengths), friction, angles, rates)
        assert motion.size == 60
        ratios.append(Samples(space, motion).ratio(own)[0])
    np.testing.assert_allclose(ratios[0], ratios[1], rtol=1e-4, atol=1e-4)


def test_out_of_time_says_what_is_proved_so_far(bound):
    certificate = certify(*stated(bound), 0.5, seconds=0.0)
    assert certificate.open_cells > 0
    assert certificate.guaranteed > 0.5
    assert "left open" in with_guarantee(bound, certificate).missing
    done = Guarantee(0.5, 0.5, 0, 10, 1, 1.0)
    assert with_guarantee(bound, done).guaranteed == 0.5
    assert with_guarantee(bound, done).missing == ""


@pytest.mark.parametrize(
    ("body", "friction", "harmonics"),
    [
        (BODY, Friction(mu_t=2.0, mu_f=1.0, mu_b=1.0), (1,)),  # no convex potential
        (Chain((0.25,) * 4), Friction(), (1,)),
        (Chain(weights=(0.25, 0.5, 0.25)), Friction(), (1,)),
        (BODY, Friction(), (0, 1)),
        (BODY, Elliptic(mu_t=2.0, mu_f=1.0, mu_b=1.0), (0, 1)),  # harmonics of a reversible law
        (BODY, Friction(), (3,)),  # no displacement
    ],
)
def test_what_the_proof_does_not_cover_is_refused(body, friction, harmonics):
    spline = TensorSpline(body.n_joint, np.pi, 3)
    space = PotentialSpace(spline, harmonics, body.symmetric and body.n_link % 2 == 1)
    with pytest.raises(ProblemError, match="associated"):
        certify(Domain(body, friction, np.pi), space, np.zeros(space.size), 0.5, seconds=0.0)


def test_without_a_compiler_it_says_what_is_wanting(potential):
    cells = boxes(potential, 0.01, 5, 43)
    with numpy_instead(), pytest.raises(ProblemError, match="C compiler"):
        cell_bounds(BODY, UNIT, potential, cells, 0.5)


@pytest.mark.parametrize("delta", [1e-3, 1e-2, 1e-1])
def test_finite_delta_costs_at_most_delta_in_dissipation_and_in_power(delta):
    """J <= J_delta <= J + delta, and power at most delta below: all that the allowance for finite
    delta uses (research/guarantee/README.md)."""
    q, r = np.random.default_rng(35).uniform(-3, 3, (2, 2, 300))
    rest = np.zeros((3, 300))
    exact = loaded_balance(BODY, UNIT, q, r, rest, rest, 1e-10)
    soft = loaded_balance(BODY, UNIT, q, r, rest, rest, delta)
    # the dissipation J of the regularised motion itself: evaluated there, no step taken
    there = loaded_balance(BODY, UNIT, q, r, rest, soft.velocity, 1e-12, steps=0)
    least = exact.potential
    assert np.all(there.potential >= least - 1e-7)
    assert np.all(there.potential <= least + delta + 1e-7)
    assert np.all(soft.power >= there.potential - delta - 1e-7)
    assert np.all(soft.power <= soft.potential + 1e-7)
    # and not vacuously: motions do change
    assert np.max(there.potential - least) > 1e-3 * delta
