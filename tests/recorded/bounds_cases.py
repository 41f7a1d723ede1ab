"""The upper bound: lattices, climbs, potentials, mixtures, small gaits, and what is proved of whole
cells."""

import numpy as np

from colloc import Chain, Friction
from colloc.bounds.coulomb_motion import (
    admissible,
    all_motions,
    balanced_motion,
    drawn_in,
    fundamental,
    unit_directions,
)
from colloc.bounds.cutting_plane import exchanged_optimum
from colloc.bounds.potential import Measure, PotentialSpace, Samples, with_more_knots, worth
from colloc.bounds.sampled import Budget, efficiency_bound
from colloc.bounds.sampling import Domain, near_the_top
from colloc.bounds.spline import TensorSpline
from research.guarantee.enclosure import by_convexity, by_loads
from research.guarantee.guaranteed import certify
from research.guarantee.loaded_balance import loaded_balance
from research.guarantee.potential_range import PotentialRange, gain_bound
from research.small_gaits import best_small_gait, small_gait
from tests.recorded.bodies import shapes
from tests.research.random_cells import random_cells

PRECISION, FLOOR = 1e-6, 1e-10

THREE, ODD = Chain(), Chain((0.3, 0.45, 0.25))
ISOTROPIC, UNEQUAL, STEEP = (
    Friction(),
    Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3),
    Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0),
)
SPACES = {
    "odd": PotentialSpace(TensorSpline(2, np.pi, 6), (1, 3), True),
    "even": PotentialSpace(TensorSpline(2, 2.5, 5, (-1.0, -0.3, 0.3, 1.0)), (0, 1), False),
}


def _motions(law=ISOTROPIC, body=THREE, count=30):
    angles, rates, _ = shapes(body, count, 21, 2.0)
    return balanced_motion(body, law, angles, rates / np.linalg.norm(rates, axis=0))


def _free(space):
    return 0.1 * np.random.default_rng(22).normal(size=space.size)


def motions_and_shapes():
    angles, rates, _ = shapes(THREE, 40, 23, np.pi)
    inside, _, _ = shapes(THREE, 40, 24, 0.5)
    found = [
        all_motions(THREE, STEEP, 0.8 * angles, rates),
        fundamental(THREE, angles),
        fundamental(ODD, angles),
    ]
    found += [admissible(body, angles, margin) for body in (THREE, ODD) for margin in (0.0, 0.1)]
    found += [drawn_in(THREE, angles, inside, 1e-6), drawn_in(ODD, angles, 0 * inside, 0.01)]
    return (
        found,
        [unit_directions(n, 20, half) for n in (1, 2, 3) for half in (True, False)],
        _motions(UNEQUAL),
    )


def lattices_and_climbs():
    found = [
        Domain(THREE, ISOTROPIC, 2.8).lattice(7, 6, 0.3),
        Domain(ODD, UNEQUAL, np.pi).lattice(5, 8),
    ]
    domain, space = Domain(THREE, UNEQUAL, 2.5), SPACES["even"]
    start, rng = domain.lattice(4, 6), np.random.default_rng(1)

    def ratio(motion):
        return Samples(space, motion).ratio(_free(space))[0]

    hopeless = float(np.median(ratio(start)))
    chosen = near_the_top(start, ratio(start), float(ratio(start).max()), 0.8, 12)
    return (
        found,
        chosen,
        domain.summits(ratio, start.take(np.arange(0, start.size, 5)), 0.2, 0.1, 6, rng, hopeless),
    )


def potentials():
    found = []
    for space in SPACES.values():
        samples = Samples(space, _motions(UNEQUAL)).joined(_motions(ISOTROPIC, count=5))
        rows, constants = samples.rows(np.arange(0, 30, 3), np.linspace(0, 6, 10))
        found += [
            str(space.layout),
            space.coefficients(_free(space)),
            space.roughness.toarray(),
            samples.ratio(_free(space)),
        ]
        found += [samples.amplitudes(_free(space)), rows.toarray(), constants]
    return found


def mixtures_and_knots():
    rng, motion = np.random.default_rng(25), _motions()
    weight = rng.uniform(size=motion.size) ** 3
    measure = Measure(motion, rng.uniform(0, 2 * np.pi, motion.size), weight / weight.sum())
    few = np.flatnonzero(motion.angles[0] > 1.5)
    there = Measure(motion.take(few), measure.heading[few], np.full(few.size, 1 / few.size))
    found = [measure.efficiency()]
    for space in SPACES.values():
        found += [worth(space, each) for each in (measure, there)]
        found += [
            with_more_knots(space, each, most).spline.knots
            for each in (measure, there)
            for most in (8, 20)
        ]
    return found


def small_gaits():
    """Paths in two digits: where a value is largest, it says little of what it is the value of."""
    gaits = (
        small_gait(THREE, UNEQUAL, (0.9, 0.4), 36, 6, 6),
        small_gait(THREE, ISOTROPIC, (2.0, 0.3), 40, 6, 3),
    )
    best, shape = best_small_gait(THREE, ISOTROPIC, 2.0, steps=2, refined=1)
    return (
        [gait.efficiency for gait in gaits],
        np.round(gaits[0].path(np.array([0.9, 0.4]), 0.1), 2),
        best.efficiency,
        shape,
    )


def a_sampled_bound():
    """The program's digits are the solver's: values alone, and few of their digits."""
    found = []
    for law, rounds in ((ISOTROPIC, 2), (Friction(mu_t=1.0, mu_f=1.0, mu_b=3.0), 1)):
        budget = Budget(
            intervals=5, shapes=5, directions=6, rounds=rounds, starts=8, tolerance=5e-2, first=3
        )
        bound = efficiency_bound(
            Chain((0.5, 0.5)) if rounds == 1 else THREE, law, 2.5, budget=budget
        )
        found += [
            np.round([bound.sampled, bound.floor], 4),
            bound.converged,
            bound.intervals,
            bound.harmonics,
            bound.graded,
        ]
        found += [bound.samples, bound.report(0.2)[:40], bound.missing[:7], bound.missing[-30:]]
    return found


def an_exchange_of_samples():
    settings = {"shapes": 4, "directions": 6, "rounds": 1, "starts": 4, "tolerance": 1e-1}
    found = exchanged_optimum(
        Domain(THREE, ISOTROPIC, 2.5),
        PotentialSpace(TensorSpline(2, 2.5, 4), (1, 3), True),
        **settings,
    )
    values = (
        np.round([found.floor, found.measure.efficiency()], 4),
        with_more_knots(found.space, found.measure, 30).spline.knots,
    )
    return found.rounds, found.samples, found.measure.weight.size, values


def allowances_of_cells():
    """Logarithms, as they span many orders of magnitude: of large cells, small ones, and ones where
    links rest; where the solver stopped early too."""
    found = []
    thin = (ODD, 0.002, True), (Chain((0.1, 0.3, 0.6)), 0.0003, True), (ODD, 0.02, True)
    for body, size, rests in ((ODD, 0.02, False), (THREE, 0.006, False), *thin):
        cells, corners, reference = random_cells(body, ISOTROPIC, size, 26, rests, 60)
        early = corners._replace(
            velocity=corners.velocity
            * (1.0 + 1e-5 * np.random.default_rng(29).normal(size=3)[:, None])
        )
        known = [
            by_loads(body, ISOTROPIC, cells, given, reference, 4 / np.sqrt(size))
            for given in (corners, early)
        ]
        known += [
            by_convexity(body, ISOTROPIC, cells, given, reference) for given in (corners, early)
        ]
        found.append([np.log(part) for each in known for part in each])
    return found


def cells_of_a_potential():
    space = PotentialSpace(TensorSpline(2, np.pi, 5), (1, 3), True)
    cells, motions, _ = random_cells(THREE, ISOTROPIC, 0.05, 26)
    potential = PotentialRange(space, _free(space))
    bounds = gain_bound({k: np.exp(1j * k * np.arange(9.0)) / k for k in (1, 3)})
    proved = certify(
        Domain(THREE, ISOTROPIC, np.pi), space, _free(space), 3.0, deepest=1, part=(7, 400)
    )
    found = proved.guaranteed, proved.open_cells, proved.cells, proved.levels
    return (
        potential.corner_gain(cells, motions),
        potential.trial_error(cells, motions),
        potential.reference(cells),
        bounds,
        found,
    )


def balances_under_loads():
    angles, rates, start = shapes(ODD, 12, 27, 2.0)
    load = 0.3 * np.random.default_rng(28).normal(size=(3, 12))
    return loaded_balance(ODD, ISOTROPIC, angles, rates, load, start, 1e-3), loaded_balance(
        ODD, ISOTROPIC, angles, rates, load, start, 1e-8, 3
    )
