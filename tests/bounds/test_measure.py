"""The multipliers of the bound's program are a motion that closes in the mean."""

import numpy as np
import pytest

from colloc import Chain, Friction
from colloc.bounds.motions import Domain
from colloc.bounds.potential import PotentialSpace, Samples, TensorSpline
from colloc.bounds.sampled import Budget, compute_bound
from scripts.check_potential import Kept, keep, largest_ratio, potentials

LIMIT = 2.5


@pytest.fixture(scope="module")
def found():
    domain = Domain(Chain(), Friction(), LIMIT)
    space = PotentialSpace(TensorSpline(2, LIMIT, 4), (1,), True)
    return space, *compute_bound(domain, Budget(4, (1,), 10, 24, 4, 20, 1e-2, first=4))


def efficiency(measure):
    """Distance over work of a mixture of motions, along heading 0."""
    (u, v), heading = measure.motion.velocity, measure.heading
    return measure.weight / measure.motion.power @ (np.cos(heading) * u - np.sin(heading) * v)


def test_the_measure_travels_as_the_program_says(found):
    _, bound, measure = found
    assert measure.weight.sum() == pytest.approx(1.0)
    assert efficiency(measure) == pytest.approx(bound.floor, abs=2e-3)


def test_no_potential_of_the_space_changes_what_the_measure_travels(found):
    space, _, measure = found
    matrix, constant = Samples(space, measure.motion).rows(
        np.arange(measure.weight.size), measure.heading
    )
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
    # four rounds were too few: what they missed shows
    assert min(values) > bound.floor
    # another potential is worse
    assert largest_ratio(*at, 0.5 * free, **how)[0] > max(values) + 0.1


@pytest.mark.slow
def test_more_knots_lower_the_program(found):
    budget = Budget(6, (1,), 10, 24, 8, 40, 1e-2, first=4)
    more, _ = compute_bound(Domain(Chain(), Friction(), LIMIT), budget)
    assert more.intervals == 6
    assert more.graded
    assert more.floor < found[1].floor - 1e-3


def test_graded_splines_hold_every_cubic_exactly():
    spline = TensorSpline(1, LIMIT, 6, (-1.9, -1.2, 0.0, 1.2, 1.9))
    angles = np.linspace(-LIMIT, LIMIT, 200)[None]

    def cubic(x):
        return 1 - 2 * x + 0.3 * x**2 - 0.7 * x**3

    matrix, change = (each.toarray() for each in spline.matrices(angles, np.ones_like(angles)))
    coefficients = np.linalg.lstsq(matrix, cubic(angles[0]), rcond=None)[0]
    assert np.allclose(matrix @ coefficients, cubic(angles[0]), atol=1e-10)
    assert np.allclose(
        change @ coefficients, -2 + 0.6 * angles[0] - 2.1 * angles[0] ** 2, atol=1e-9
    )
