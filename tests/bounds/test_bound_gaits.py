"""No gait beats the bound: thousands of random ones, for several frictions; and the multipliers of the
bound's program are a motion that closes in the mean."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from colloc import Chain, Friction
from colloc.bounds import sampled
from colloc.bounds.motions import CoulombMotion, Domain, admissible
from colloc.bounds.sampled import Samples, TensorSpline, efficiency_bound
from research.guarantee.potential_range import potential_space
from research.small_gaits import balanced_motion, best_small_gait, small_gait
from scripts.check_potential import Kept, keep, largest_ratio, potentials
from tests.shared.cases import slow
from tests.shared.mechanics import coulomb

ODD = sampled.Budget(intervals=5, harmonics=(1,), shapes=10, directions=24, rounds=5, starts=40)
DIRECTED = dataclasses.replace(ODD, harmonics=(0, 1))
STEPS = 48


@cache
def bound_of(mu: tuple[float, float, float]) -> sampled.Bound:
    friction = coulomb(*mu)
    return efficiency_bound(Chain(), friction, budget=ODD if friction.reversible else DIRECTED)


def antipodal_fourier(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Random gaits q(t + 1/2) = -q(t), so any friction closes the rotation."""
    t = (np.arange(STEPS) + 0.5) / STEPS
    k = 2 * np.pi * np.array([1, 3, 5])
    a, b = rng.standard_normal((2, 2, count, 3)) * [1.0, 0.4, 0.2]
    wave = lambda p, c: np.einsum("jnk,kt->jnt", p, c)  # noqa: E731
    q = wave(a, np.cos(np.outer(k, t))) + wave(b, np.sin(np.outer(k, t)))
    rate = wave(-a * k, np.sin(np.outer(k, t))) + wave(b * k, np.cos(np.outer(k, t)))
    size = rng.uniform(0.1, 2.0, count) / np.abs(q).max(axis=(0, 2))
    return q * size[:, None], rate * size[:, None]


def replayed(motion: CoulombMotion, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Distance of the middle link and work of gaits stored one after the other."""
    spin = motion.spin.reshape(count, STEPS) / STEPS
    heading = np.cumsum(spin, axis=1) - 0.5 * spin
    v = (motion.velocity[0] + 1j * motion.velocity[1]).reshape(count, STEPS)
    distance = np.abs((np.exp(1j * heading) * v).mean(axis=1))
    return distance, motion.power.reshape(count, STEPS).mean(axis=1)


def ratios(friction: Friction, q: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, CoulombMotion]:
    count = q.shape[1]
    motion = balanced_motion(Chain(), friction, q.reshape(2, -1), rate.reshape(2, -1))
    assert motion.size == count * STEPS
    distance, work = replayed(motion, count)
    return distance / work, motion


FRICTIONS = [(1.0, 1.0, 1.0), (3.0, 1.0, 1.0), (1.7, 1.0, 1.3), (1.0, 1.0, 3.0)]


@pytest.mark.parametrize("mu", [FRICTIONS[0], *(slow((mu,)) for mu in FRICTIONS[1:])])
def test_no_random_gait_beats_the_bound(mu):
    friction = coulomb(*mu)
    bound = bound_of(mu)
    assert bound.sampled < 1 / friction.smallest
    efficiency, _ = ratios(friction, *antipodal_fourier(np.random.default_rng(21), 700))
    # the midpoint rule overrates a gait by about a percent at most
    assert 0.1 < efficiency.max() < bound.sampled


def test_a_bound_is_pinned_from_both_sides():
    """Reached at the motion it names, at least the program's optimum, not exceeded."""
    isotropic = bound_of((1.0, 1.0, 1.0))

    def value(q, r):
        samples = Samples(
            potential_space(isotropic, Chain()), balanced_motion(Chain(), Friction(), q, r, 1e-6)
        )
        return samples.ratio(np.array(isotropic.coefficients))[0]

    reached = value(np.array(isotropic.angles)[:, None], np.array(isotropic.rates)[:, None])
    assert reached[0] == pytest.approx(isotropic.sampled, rel=1e-6)
    # in 16 runs with other seeds and settings five rounds left 0.6 to 24 % between them, as the
    # samples happened to fall
    assert isotropic.floor <= isotropic.sampled <= 1.3 * isotropic.floor
    rng = np.random.default_rng(23)
    q, turn = rng.uniform(-np.pi, np.pi, (2, 4000)), rng.uniform(0, 2 * np.pi, 4000)
    inside = admissible(Chain(), q)
    rates = np.stack([np.cos(turn), np.sin(turn)])
    assert value(q[:, inside], rates[:, inside]).max() < isotropic.sampled
    # of this coarse program with harmonic 1 (0.4796 to 0.4803 in those runs); finer ones come down
    # to 0.459, and small gaits at the fold reach 0.456
    assert isotropic.floor == pytest.approx(0.480, rel=0.003)


def test_small_gait_is_what_a_small_polygon_does():
    shape = np.array([2.2, -2.2])
    gait = small_gait(Chain(), Friction(), shape, directions=360)
    for size in (0.04, 0.02):
        corners = gait.path(shape, size)
        sides = np.roll(corners, -1, axis=1) - corners
        part = (np.arange(20) + 0.5) / 20
        q = (corners[:, :, None] + sides[:, :, None] * part).reshape(2, -1)
        motion = balanced_motion(Chain(), Friction(), q, np.repeat(sides, 20, axis=1) / 20)
        heading = np.cumsum(motion.spin) - 0.5 * motion.spin
        velocity = motion.velocity[0] + 1j * motion.velocity[1]
        distance = abs(np.sum(np.exp(1j * heading) * velocity))
        assert abs(distance / motion.power.sum() - gait.efficiency) < 0.05 * size


def test_four_straight_links_crawl_sideways_by_bends_of_no_size():
    """Within 0.1 % of the sampled bound for joints within 2.5, 0.7322."""
    found = [small_gait(Chain((0.25,) * 4), Friction(), np.zeros(3), count) for count in (180, 400)]
    assert all(0.7314 < one.efficiency < 0.7322 for one in found)
    assert all(abs(np.cos(one.heading)) < 1e-6 for one in found)
    for one in found:
        np.testing.assert_allclose(one.rates @ one.weights, 0.0, atol=1e-8)


@pytest.mark.slow
def test_the_best_small_gait_is_found_along_a_ridge_that_no_axis_follows():
    """At (3, 1, 1) both ends are bent alike; along the axes a search ends at 0.188."""
    best, shape = best_small_gait(Chain(), Friction(mu_t=3.0, mu_f=1.0, mu_b=1.0), 2.5)
    assert best.efficiency > 0.208
    assert shape[0] == pytest.approx(-shape[1], abs=5e-3)


FOLDED = [(0, 10, 0, 0), (5, -11, -12, 132 / 7), (-1, 1, 12, -132 / 7)]
"""The best small gait known at the fold: a, w1, w2, w3 of three motions, each for the same time, of
a body whose first link lies on its second. In units of a link all velocities are lateral: a + w1 xi,
a + w2 xi and a + w2 + w3 xi at xi of [0, 1] along the links, away from the first joint."""
EXACT = 462 / 1013
"""What these do for their work, in rational arithmetic: 4 units forwards, of a work of 2026/77."""


def test_the_best_gait_known_at_the_fold_is_in_balance_closes_and_is_worth_462_over_1013():
    said, joints = [], []
    for a, w1, w2, w3 in FOLDED:
        joints.append([w1 - w2, w2 - w3])
        z, rates = np.array([[0.0], [(a + w1) / 3], [-w1]]), np.array(joints[-1])[:, None]
        at = np.array([[np.pi], [0.0]]), rates, z, np.full((1, 1), 1e-12)
        said.append(Chain().sliding(Friction(), *at))
    np.testing.assert_allclose(np.sum(joints, axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose([9 * each.power.item() for each in said], [5, 838 / 77, 73 / 7])
    # the second link, at rest beneath the first, holds that with the whole of its friction
    np.testing.assert_allclose(said[0].force[:, 0], [0.0, -1 / 3, -1 / 18], atol=1e-3)
    np.testing.assert_allclose([each.force[:, 0] for each in said[1:]], 0.0, atol=1e-11)
    work = sum(each.power.item() for each in said)
    assert sum(each.centre[1, 0] for each in said) / work == pytest.approx(EXACT, rel=1e-9)


def test_the_linear_program_over_directions_finds_the_same_value_but_for_the_creep_of_delta():
    """Of many joints, from directions at random alone, the column generation ended at 0.8624."""
    found = small_gait(Chain(), Friction(), np.array([np.pi, 0.0])).efficiency
    assert 0 < EXACT - found < 2e-5
    found = small_gait(Chain((0.2,) * 5), Friction(), np.zeros(4))
    assert found.efficiency == pytest.approx(0.8640, abs=2e-4)


LIMIT = 2.5


@pytest.fixture(scope="module")
def found():
    domain = Domain(Chain(), Friction(), LIMIT)
    space = sampled.PotentialSpace(TensorSpline(2, LIMIT, 4), (1,), True)
    budget = sampled.Budget(4, (1,), 10, 24, 4, 20, 1e-2, first=4)
    return space, *sampled.compute_bound(domain, budget)


def efficiency(measure):
    """Distance over work of a mixture of motions, along heading 0."""
    (u, v), heading = measure.motion.velocity, measure.heading
    return measure.weight / measure.motion.power @ (np.cos(heading) * u - np.sin(heading) * v)


def test_the_measure_travels_as_the_program_says_and_no_potential_of_the_space_changes_that(found):
    space, bound, measure = found
    assert measure.weight.sum() == pytest.approx(1.0)
    assert efficiency(measure) == pytest.approx(bound.floor, abs=2e-3)
    every = np.arange(measure.weight.size)
    matrix, constant = Samples(space, measure.motion).rows(every, measure.heading)
    # the rate of every potential of the space vanishes in the mean, up to the penalty on roughness
    mean = measure.weight @ matrix
    sizes = np.abs(matrix).T @ measure.weight
    assert np.abs(mean).max() < 1e-2 * sizes.max()
    assert measure.weight @ constant == pytest.approx(efficiency(measure))


def test_knots_are_worth_something_only_where_the_measure_does_not_close(found):
    space, _, measure = found
    finer = [space.with_knots(np.array([place])).worth(measure) for place in (0.6, 1.9)]
    assert space.worth(measure) < 0.05 * min(finer)
    more = space.with_more_knots(measure, 6)
    inner = np.array(more.spline.graded)
    assert more.spline.intervals == 6
    assert np.allclose(inner, -inner[::-1])
    assert set(np.round(space.spline.knots, 9)) <= set(np.round(more.spline.knots, 9))
    # of the two places it took the better
    values = [space.with_knots(np.array([place])).worth(measure) for place in (0.625, 1.875)]
    assert np.abs(inner - (0.625, 1.875)[int(np.argmax(values))]).min() < 1e-9


def test_a_kept_potential_is_the_one_that_was_found(found, tmp_path):
    space, bound, measure = found
    domain, path = Domain(Chain(), Friction(), LIMIT), tmp_path / "potentials.json"
    path.write_text("[]")
    for more in (space, space.with_knots(np.array([1.9]))):
        free = np.random.default_rng(5).standard_normal(more.size)
        keep(Kept(domain, more, free, bound.floor), path)
        kept, motion = potentials(path)[-1], measure.motion
        assert (kept.domain, kept.program) == (domain, bound.floor)
        pairs = (more, free), (kept.space, kept.free)
        ratios = [Samples(each, motion).ratio(given)[0] for each, given in pairs]
        np.testing.assert_allclose(*ratios, atol=1e-12)
    assert len(potentials(path)) == 2


def test_a_potential_is_checked_by_samples_that_were_not_chosen_for_it(found):
    space, bound, _ = found
    at = Domain(Chain(), Friction(), LIMIT), space
    free, how = np.array(bound.coefficients), {"shapes": 20, "directions": 48, "starts": 100}
    values = [largest_ratio(*at, free, seed=seed, **how)[0] for seed in (1, 2)]
    assert values[0] == pytest.approx(values[1], abs=2e-3)
    assert min(values) > bound.floor  # four rounds were too few: what they missed shows
    # another potential is worse
    assert largest_ratio(*at, 0.5 * free, **how)[0] > max(values) + 0.1


@pytest.mark.slow
def test_more_knots_lower_the_program(found):
    budget = sampled.Budget(6, (1,), 10, 24, 8, 40, 1e-2, first=4)
    more, _ = sampled.compute_bound(Domain(Chain(), Friction(), LIMIT), budget)
    assert more.intervals == 6
    assert more.graded
    assert more.floor < found[1].floor - 1e-3
