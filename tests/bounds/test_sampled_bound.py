"""The upper bound: identities of its parts, limits where it is known, and gaits it must exceed."""

import time
from itertools import product
from math import comb

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import linprog

import colloc
from colloc import Chain, Foot, Friction, Harmonic, ModalBody, Problem, ProblemError, solve_balance
from colloc.bounds import sampled
from colloc.bounds.motions import CoulombMotion, Domain, fundamental, two_resting
from colloc.bounds.optimality_gap import gap_line, refusal, upper_bound
from colloc.bounds.sampled import Budget, Samples, TensorSpline, efficiency_bound
from research.small_gaits import balanced_motion, small_gait
from tests.shared.mechanics import coulomb

FRICTIONS = [(1.0, 1.0, 1.0), (3.0, 1.0, 1.0), (1.7, 1.0, 1.3), (1.0, 1.0, 3.0)]


def random_points(seed: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0, 2 * np.pi, n)
    return rng.uniform(-np.pi, np.pi, (2, n)), np.stack([np.cos(turn), np.sin(turn)])


def functions(spline, q):
    return spline.matrices(q, 0.0 * q)[0]


@pytest.mark.parametrize("graded", [(), (-2.0, -0.7, 0.7, 2.0)])
def test_splines_add_up_to_one_and_differentiate(graded):
    spline = TensorSpline(2, np.pi, 5, graded)
    q, r = random_points(1, 50)
    q *= 0.99
    coefficients = np.random.default_rng(2).standard_normal(spline.size)
    np.testing.assert_allclose(functions(spline, q).sum(axis=1), 1.0, rtol=1e-13)
    h = 1e-6
    slope = (functions(spline, q + h * r) - functions(spline, q - h * r)) @ coefficients / (2 * h)
    np.testing.assert_allclose(spline.matrices(q, r)[1] @ coefficients, slope, atol=1e-8)


@pytest.mark.parametrize(("n_joint", "together"), [(2, 2), (3, 1), (3, 2), (4, 2)])
def test_sums_over_few_joints_have_no_mixed_difference_in_more_and_miss_nothing(n_joint, together):
    spline, rng = TensorSpline(n_joint, 2.0, 2), np.random.default_rng(31)
    bases = {(a, b): spline.symmetric_basis(a, b, together) for a in (1, -1) for b in (1, -1)}
    # a constant, and for every choice of joints the products of functions that are not
    expected = sum(comb(n_joint, k) * (spline.per_joint - 1) ** k for k in range(together + 1))
    assert sum(basis.shape[1] for basis in bases.values()) == expected
    q = rng.uniform(-2, 2, (n_joint, 30))
    for (mirror, swap), basis in bases.items():
        at = (functions(spline, q) @ basis).toarray()
        np.testing.assert_allclose(functions(spline, -q) @ basis.toarray(), mirror * at, atol=1e-12)
        turned = functions(spline, -q[::-1]) @ basis.toarray()
        np.testing.assert_allclose(turned, swap * at, atol=1e-12)
        assert np.linalg.matrix_rank(basis.toarray()) == basis.shape[1]
        moved, difference = rng.uniform(-2, 2, q.shape), 0.0
        for corner in product((0, 1), repeat=together + 1) if together < n_joint else ():
            moves = np.append(corner, np.zeros(n_joint - together - 1))[:, None] > 0
            mixed = np.where(moves, moved, q)
            difference += (-1) ** sum(corner) * (functions(spline, mixed) @ basis).toarray()
        assert np.abs(difference).max() < 1e-12


def test_two_links_rest_while_those_between_buckle_or_turn_as_a_four_bar_linkage():
    body, rng, h = Chain((0.15, 0.2, 0.3, 0.2, 0.15)), np.random.default_rng(32), 1e-6
    angles = rng.uniform(-2, 2, (4, 60))
    angles[1, :20] = angles[2, 10:30] = 0.0
    shapes, rates = two_resting(body, angles, rng)

    def seen(q, i, j):
        """Where link j begins and its heading, seen from link i."""
        heading = np.cumsum(q[i:j], axis=0)
        begin = (np.array(body.lengths[i + 1 : j])[:, None] * np.exp(1j * heading[:-1])).sum(axis=0)
        return np.stack([begin.real, begin.imag, heading[-1]])

    held = np.zeros(shapes.shape[1], dtype=int)
    for i, j in ((0, 3), (1, 4), (0, 4)):
        change = seen(shapes + h * rates, i, j) - seen(shapes - h * rates, i, j)
        held += np.abs(change).max(axis=0) < 1e-7 * h
    assert (held >= 1).all()
    # every shape has the linkage of all five links, those with a straight joint inside what buckles
    # there too
    assert shapes.shape[1] >= 60 + 40


def test_lattices_of_four_links_hold_what_buckles_between_two_resting_links():
    """Without links 2 and 3 that buckle a bound converged at 0.717, and small loops do 0.732."""
    motion = Domain(Chain((0.25,) * 4), Friction(), 2.5).lattice(6, 10, 0.2)
    buckles = np.abs(np.abs(motion.rates.T @ np.array([1, -2, 1])) / np.sqrt(6) - 1) < 1e-9
    assert buckles.sum() > 20
    assert (motion.angles[1, buckles] == 0).all()
    # where links 2 and 3 alone move, at 1/sqrt(6) about an end; bodies that pay less by moving the
    # ends too do so
    least = 0.25**2 / np.sqrt(6)
    assert motion.power[buckles].max() < 1.001 * least
    assert np.isclose(motion.power[buckles], least, rtol=1e-3).mean() > 0.2


@pytest.mark.slow
def test_a_bound_for_four_links_exceeds_the_best_loops_of_no_size():
    best = small_gait(Chain((0.25,) * 4), Friction(), np.zeros(3)).efficiency
    bound = efficiency_bound(Chain((0.25,) * 4), Friction(), 2.5)
    assert bound.converged
    assert best < bound.sampled < 1.002 * best


def test_every_shape_has_a_representative_in_the_fundamental_domain():
    q, _ = random_points(4, 500)
    images = [q, -q, q[::-1], -q[::-1]]
    assert np.any([fundamental(Chain(), image) for image in images], axis=0).all()
    skew = Chain((0.2, 0.3, 0.5))  # its ends are no images of each other
    assert np.any([fundamental(skew, image) for image in images[:2]], axis=0).all()


@pytest.mark.parametrize("harmonics", [(1, 3), (1,), (0, 1)])
def test_largest_gain_is_the_maximum_over_heading(harmonics):
    rng = np.random.default_rng(5)
    amplitudes = {k: rng.standard_normal(200) + 1j * rng.standard_normal(200) for k in harmonics}
    theta = np.linspace(0, 2 * np.pi, 4001)
    brute = np.max(
        [np.real(sum(np.exp(1j * k * t) * a for k, a in amplitudes.items())) for t in theta], axis=0
    )
    gain, heading = sampled.largest_gain(amplitudes)
    np.testing.assert_allclose(gain, brute, rtol=1e-4)
    at = np.real(sum(np.exp(1j * k * heading) * a for k, a in amplitudes.items()))
    np.testing.assert_allclose(at, gain, rtol=1e-12)


def test_rows_are_the_gain_and_its_derivatives():
    space = sampled.PotentialSpace(TensorSpline(2, np.pi, 4), (0, 1, 2), True)
    motion = balanced_motion(Chain(), Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3), *random_points(6, 60))
    samples = Samples(space, motion)
    free = 0.1 * np.random.default_rng(7).standard_normal(space.size)
    chosen, heading = np.arange(motion.size), np.random.default_rng(8).uniform(0, 6, motion.size)
    matrix, constant = samples.rows(chosen, heading)
    waves = (np.exp(1j * k * heading) * a for k, a in samples.amplitudes(free).items())
    gain = np.real(sum(waves)) / motion.power
    np.testing.assert_allclose(matrix @ free + constant, gain, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize(
    "lengths", [(0.4, 0.2, 0.4), (0.2, 0.3, 0.3, 0.2), (0.15, 0.2, 0.3, 0.2, 0.15)], ids=len
)
@pytest.mark.parametrize("mu", FRICTIONS)
def test_mirror_images_and_end_swap_move_alike(mu, lengths):
    friction, body, rng = coulomb(*mu), Chain(lengths), np.random.default_rng(9)
    q, r = rng.uniform(-2.0, 2.0, (body.n_joint, 80)), rng.normal(size=(body.n_joint, 80))
    space = sampled.PotentialSpace(
        TensorSpline(body.n_joint, 2.0, 4), (1,) if friction.reversible else (0, 1), body.symmetric
    )
    free = 0.1 * np.random.default_rng(10).standard_normal(space.size)
    ratio = Samples(space, balanced_motion(body, friction, q, r)).ratio(free)[0]
    assert body.symmetric
    for image in ((-q, -r), (-q[::-1], r[::-1])):
        other = Samples(space, balanced_motion(body, friction, *image)).ratio(free)[0]
        np.testing.assert_allclose(other, ratio, rtol=1e-5)


@pytest.mark.parametrize(("mu_b", "harmonics"), [(1.0, (1, 3)), (2.0, (0, 1))])
def test_directed_friction_tells_headings_apart_by_even_harmonics_too(mu_b, harmonics):
    tiny = Budget(intervals=2, shapes=4, directions=4, rounds=1, starts=5)
    bound = efficiency_bound(Chain(), Friction(mu_b=mu_b), 2.0, budget=tiny)
    assert bound.harmonics == harmonics


def test_two_links_with_reversible_friction_cannot_move():
    """A path in one angle retraces itself: finer splines approach a bound of 0."""
    budgets = [Budget(n, (1,), 64, 1, first=n) for n in (8, 16, 32)]
    begin = time.process_time()
    bounds = [efficiency_bound(Chain((0.4, 0.6)), Friction(), budget=budget) for budget in budgets]
    assert 0 < sum(bound.seconds for bound in bounds) < time.process_time() - begin
    values = [bound.sampled for bound in bounds]
    assert values[0] > 1.5 * values[1] > 2.25 * values[2]
    assert values[2] < 0.01


def test_a_bound_says_whether_the_last_climbs_still_found_more(monkeypatch):
    most, climb = [], sampled.climb_from_lattice

    def kept(*at, **how):
        most.append(found := climb(*at, **how))
        return found

    monkeypatch.setattr(sampled, "climb_from_lattice", kept)
    budgets = (Budget(8, (1,), 64, 1, n) for n in (1, 24))
    few, enough = (efficiency_bound(Chain((0.4, 0.6)), Friction(), budget=b) for b in budgets)
    assert (few.converged, enough.converged) == (False, True)
    assert few.sampled > 1.05 * enough.sampled
    # and is what a check finds that knows nothing of its samples
    assert [each[0].max() for each in most] == [few.sampled, enough.sampled]


@pytest.mark.slow
def test_two_links_with_directed_friction_can_and_obey_the_coefficient_bound():
    law, budget = Friction(mu_t=1.0, mu_f=1.0, mu_b=3.0), Budget(8, (0, 1), 32, 2, 3, 20)
    bound = efficiency_bound(Chain((0.5, 0.5)), law, budget=budget)
    assert 0.05 < bound.sampled < 1.0


def test_minimax_program_agrees_with_a_simplex_solver():
    rng = np.random.default_rng(15)
    rows, constants = rng.standard_normal((60, 8)), rng.uniform(0.0, 1.0, 60)
    best = sampled.smallest_maximum(sparse.csr_matrix(rows), constants, sparse.csr_matrix((8, 8)))
    left = np.hstack([rows, -np.ones((60, 1))])
    simplex = linprog(np.eye(9)[8], left, -constants, bounds=(None, None), method="highs-ds")
    assert best.value == pytest.approx(simplex.fun, abs=1e-6)
    assert best.weights.sum() == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(rows.T @ best.weights, 0.0, atol=1e-6)
    assert best.weights @ constants == pytest.approx(best.value, abs=1e-6)


@pytest.mark.parametrize("n_joint", [2, 3])
def test_roughness_is_the_integral_of_squared_second_derivatives(n_joint):
    """Of f = x^2 y on [-a, a]^n by cubic splines: 4 y^2 + 8 x^2 gives 16 a^4 (2 a)^(n-2)."""
    a = 1.3
    spline = TensorSpline(n_joint, a, 4)
    q = np.random.default_rng(16).uniform(-a, a, (n_joint, 800))
    c = np.linalg.lstsq(functions(spline, q).toarray(), q[0] ** 2 * q[1], rcond=None)[0]
    np.testing.assert_allclose(functions(spline, q) @ c, q[0] ** 2 * q[1], atol=1e-10)
    # the midpoint rule with 8 points an axis misses 1/64 of the mean square
    exact = 16 * a**4 * (2 * a) ** (n_joint - 2) * (1 - 1 / 64)
    assert c @ spline.roughness @ c == pytest.approx(exact, rel=1e-9)


def test_climbs_find_the_summit_of_a_crease():
    """A crease at an angle to all axes, on which coordinate steps would stop."""
    domain = Domain(Chain(), Friction(), 2.0)
    start = domain.lattice(6, 12).take(np.arange(0, 120, 4))

    def crease(motion: CoulombMotion) -> np.ndarray:
        turn = np.arctan2(motion.rates[1], motion.rates[0])
        a, b = motion.angles
        return -5 * np.abs(a + 0.7 * b - 0.5 * np.sin(turn)) - (a - 0.3) ** 2 - (b - 0.2) ** 2

    top = domain.summits(crease, start, 0.3, 0.2, 40, np.random.default_rng(17))
    assert np.median(crease(top)) > -0.05
    assert np.all(crease(top) >= crease(start))


def test_peaks_where_one_joint_turns_alone_are_met_and_climbed_along():
    """Seen at (1.82, -1.82): a cone that falls by 3.6 a radian, between any lattice."""
    domain = Domain(Chain(), Friction(), 2.5)
    lattice = domain.lattice(8, 24, 0.37)
    alone = np.flatnonzero(lattice.rates[1] == 0)
    assert alone.size > 3 * 8  # on a finer lattice of shapes than other rates

    def cone(motion: CoulombMotion) -> np.ndarray:
        a, b = motion.angles
        return -3.6 * np.abs(motion.rates[1]) - (a - 1.82) ** 2 - (b + 1.82) ** 2

    start = lattice.take(alone[np.argsort(-cone(lattice.take(alone)))[-20:]])
    top = domain.summits(cone, start, 0.3, 0.1, 40, np.random.default_rng(18))
    assert np.median(cone(top)) > -1e-3


@pytest.mark.parametrize("shift", [0.0, 0.37])
def test_lattices_hold_the_corners_between_limit_and_contact(shift):
    """A potential that had converged at 0.8609 stood at 1.0283 in such a corner."""
    lattice = Domain(Chain(), Friction(mu_t=0.5, mu_f=1, mu_b=5), 2.5).lattice(8, 6, shift)
    angles, rates = lattice.angles, lattice.rates
    assert {*rates[0, rates[1] == 0]} == {1.0, -1.0}  # joint 1 alone, both ways
    assert np.abs(angles - np.array([[2.5], [1.89109]])).sum(axis=0).min() < 1e-4
    assert np.isclose(angles.max(), 2.5)  # and the limit


def test_bound_is_cached_by_all_inputs(tmp_path, monkeypatch):
    tiny = Budget(intervals=3, harmonics=(1,), shapes=6, directions=6, rounds=1, starts=10)
    cache = tmp_path / "bounds.sqlite"
    first = efficiency_bound(Chain(), Friction(), 2.0, budget=tiny, cache=cache)
    steep = efficiency_bound(Chain(), Friction(mu_t=9.0), 2.0, budget=tiny)
    assert "no convex potential" in steep.report(0.1)
    assert steep.floor < steep.sampled
    monkeypatch.setattr("colloc.bounds.sampled.compute_bound", None)
    assert efficiency_bound(Chain(), Friction(), 2.0, budget=tiny, cache=cache) == first
    assert "gap 0.1000" in first.report(first.sampled - 0.1)
    assert "not certified between" in first.report(0.3)
    keys = {
        sampled.bound_key(Domain(b, f, a), tiny)
        for b in (Chain(), Chain((0.3, 0.4, 0.3)))
        for f in (Friction(), Friction(mu_t=2.0), colloc.Elliptic(mu_t=2.0, mu_f=1.0, mu_b=1.0))
        for a in (2.0, 2.5)
    }
    assert len(keys) == 12
    cache.write_text("{")
    with pytest.raises(colloc.StoreError, match="cannot be read"):
        efficiency_bound(Chain(), Friction(), 2.0, budget=tiny, cache=cache)


def moved(lengths, angles, rates, z, t):
    """Where links begin and how they lie and turn, and the heading of the middle, a time t later."""
    heading = z[2] * t + np.vstack([0 * z[:1], np.cumsum(angles + rates * t, axis=0)])
    along, n = np.array(lengths)[:, None] * np.exp(1j * heading), len(lengths)
    begin = (z[0] + 1j * z[1]) * t + np.cumsum(np.vstack([0 * along[:1], along[:-1]]), axis=0)
    return begin, along, (heading[n // 2] + heading[(n - 1) // 2]) / 2


@pytest.mark.parametrize("lengths", [(0.4, 0.6), (0.3, 0.4, 0.3), (0.1, 0.4, 0.3, 0.2)], ids=len)
def test_a_motion_is_that_of_the_middle_in_its_own_axes(lengths):
    """The middle link's midpoint, or the middle joint along the mean heading there."""
    body, rng, h = Chain(lengths), np.random.default_rng(41), 1e-6
    n = body.n_link
    angles, rates = rng.uniform(-1, 1, (n - 1, 20)), rng.normal(size=(n - 1, 20))
    z = solve_balance(body, Friction(), angles, rates, 1e-8).require().z
    motion = balanced_motion(body, Friction(), angles, rates, 1e-8)

    def middle(t):
        begin, along, heading = moved(lengths, angles, rates, z, t)
        return begin[n // 2] + (n % 2) * along[n // 2] / 2, heading

    (before, turned_before), (after, turned), (_, heading) = middle(-h), middle(h), middle(0.0)
    velocity = (after - before) / (2 * h) * np.exp(-1j * heading)
    np.testing.assert_allclose(motion.velocity[0] + 1j * motion.velocity[1], velocity, atol=1e-6)
    np.testing.assert_allclose(motion.spin, (turned - turned_before) / (2 * h), atol=1e-6)


@pytest.mark.parametrize("lengths", [(0.3, 0.4, 0.3), (0.1, 0.4, 0.3, 0.2)], ids=len)
def test_on_feet_the_centre_of_pressure_is_followed_and_no_faster_than_friction_pays_for(lengths):
    """From places of the feet a moment later; so no potential at all says 1/mu."""
    n, rng, h = len(lengths), np.random.default_rng(43), 1e-6
    pair = (Foot(n - 1, place, weight=0.3) for place in (0.9, 0.1))
    body, law = Chain(lengths, feet=(Foot(0, 0.2, weight=0.4), *pair)), Friction(0.5, 0.5, 0.5)
    angles, rates = rng.uniform(-1, 1, (n - 1, 20)), rng.normal(size=(n - 1, 20))
    z = solve_balance(body, law, angles, rates, 1e-9).require().z
    motion = balanced_motion(body, law, angles, rates)

    def pressed(t):
        begin, along, heading = moved(lengths, angles, rates, z, t)
        places = [begin[foot.link] + foot.place * along[foot.link] for foot in body.feet]
        return np.array([0.4, 0.3, 0.3]) @ places, heading

    velocity = (pressed(h)[0] - pressed(-h)[0]) / (2 * h) * np.exp(-1j * pressed(0.0)[1])
    np.testing.assert_allclose(motion.velocity[0] + 1j * motion.velocity[1], velocity, atol=1e-6)
    assert (0.5 * np.hypot(*motion.velocity) <= motion.power + 1e-8).all()


def test_on_two_feet_a_link_the_bound_lies_between_the_best_small_gait_and_friction_alone():
    budget = Budget(4, (1,), 8, 16, 4, starts=60, tolerance=0.01)
    bound = efficiency_bound(Chain(feet=2), Friction(), 1.0, budget=budget)
    assert small_gait(Chain(feet=2), Friction(), np.zeros(2)).efficiency < bound.sampled < 0.75
    coarse = Budget(2, (1,), 6, 8, 1, starts=10)
    bound = efficiency_bound(Chain(feet=1), Friction(0.5, 0.5, 0.5), budget=coarse)
    assert bound.sampled == 2.0


def test_climbs_go_along_creases_where_one_joint_rests():
    """A crease in the rate of joint 2: only steps that leave it at rest stay there."""
    domain = Domain(Chain((0.25,) * 4), Friction(), 2.5)
    lattice = domain.lattice(4, 10, 0.2)
    first, rests, last = lattice.rates
    start = lattice.take(np.flatnonzero((rests == 0) & (first * last != 0))[:40])

    def crease(motion: CoulombMotion) -> np.ndarray:
        turn, beside = np.arctan2(motion.rates[2], motion.rates[0]), np.abs(motion.rates[1])
        return np.cos(2 * (turn - 0.4)) - 30 * beside - ((motion.angles - 0.3) ** 2).sum(axis=0)

    top = domain.summits(crease, start, 0.5, 0.3, 40, np.random.default_rng(19))
    assert np.median(crease(top)) > 0.99


@pytest.mark.parametrize(
    "changes",
    [{"friction": colloc.Viscous(normal=2.0, tangential=1.0)}, {"body": ModalBody(2)}],
    ids=["drag", "smooth"],
)
def test_no_bound_is_taken_or_computed_for_other_bodies_and_laws(changes, tmp_path):
    problem = Problem("other", gait=Harmonic(1, "antipodal"), **changes)
    assert upper_bound(problem, tmp_path, compute=False) is None
    said = "chains of links under Coulomb friction, or the elliptic law, only"
    with pytest.raises(ProblemError, match=said):
        upper_bound(problem, tmp_path, compute=True)


def test_a_tighter_bound_is_offered_where_one_can_be_computed_alone(tmp_path, monkeypatch):
    monkeypatch.setattr("colloc.bounds.sampled.efficiency_bound", lambda *domain, cache: "computed")
    for body in (*(Chain((1 / n,) * n) for n in (3, 5, 6, 9)), ModalBody(2)):
        problem = Problem("other", body=body, gait=Harmonic(1, "antipodal"))
        try:
            computed = upper_bound(problem, tmp_path, compute=True) == "computed"
        except ProblemError:
            computed = False
        offered = "--bound" in gap_line(problem, 0.1, None)
        assert offered == computed == (isinstance(body, Chain) and body.n_link <= 5), body


NONE_IS_KNOWN = [{"rotation": 0.3}, {"rotation": None}, {"objective": "speed"}]
NONE_IS_KNOWN += [{"grade": 0.1}, {"froude": 0.1}]


@pytest.mark.parametrize("changed", NONE_IS_KNOWN, ids=str)
def test_no_bound_is_offered_of_gaits_that_turn_or_are_sought_for_something_else(changed):
    usual = Problem("usual", gait=Harmonic(1))
    assert refusal(usual) == ""
    assert "gap 0.9000" in gap_line(usual, 0.1, None)
    assert "efficiency, on the level, of gaits that do not turn" in refusal(usual.with_(**changed))
