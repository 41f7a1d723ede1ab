"""Initial gaits of a search: random ones, or a gait of another class or chain.

Admissible shapes stay so when all angles shrink together. So a gait is sampled as a direction in
the space of parameters times a fraction of the largest admissible amplitude. Start number k of a
seed does not depend on the number of starts.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.guesses import largest_factor, largest_share
from colloc.gaits.limits import Limit
from colloc.gaits.problem import Problem
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.system.errors import ProblemError

LATIN_HYPERCUBE, PERTURBED = "latin-hypercube", "perturbed"
SAMPLERS = (LATIN_HYPERCUBE, PERTURBED)
BLOCK = 25
"""Starts per Latin hypercube: start k is of hypercube k // BLOCK, which has a seed of its own."""
LARGEST_SEED = 2**63 - 1
"""Files keep seeds and numbers of starts in so many bits."""
_FRACTIONS = (0.2, 0.95)  # of the largest admissible amplitude
_PHASES = np.arange(200) / 200
_ATTEMPTS = 200
_CLEARLY_MOVING = 1.5  # shape speed, of the smallest
_SPREAD = 0.3  # standard deviation of perturbed coefficients [rad]
_ON_FLOOR = 1e-4
_SHORT = 1.002  # a path on the lower bound of its length is shorter as a polyline
_VISIBLE = np.pi / 20
"""Least swing of a joint to either side [rad] that a person sees: a little more than that of one
joint that moves alone at the default `Problem.smallest_shape_speed`."""
_PERIOD = np.linspace(0.0, 1.0, 1001)
_NEAR = 10.0
"""First delta of a search from a known optimum, of the final one: friction more regularised prefers
other gaits, and leaves it (six harmonics from the best of five: 0.4013, from 100 times the final
delta 0.3998)."""


def largest_amplitude(problem: Problem, gait: AnyGait) -> float:
    """The largest factor by which a gait's angles can be multiplied and stay admissible; inf for
    the straight body."""
    angles = gait.angles(_PHASES)
    largest = largest_factor(problem.body, problem.joint_limit, angles, gait.rest)
    share = largest_share(gait, problem.largest_speeds)
    return min(largest, 1 / share) if share else largest


def on_speed_floor(problem: Problem, gait: AnyGait) -> bool:
    """True if a gait is as slow as ``smallest_shape_speed`` allows, which then decided its size."""
    return gait.shape_speed < problem.smallest_shape_speed * (1 + _ON_FLOOR)


def is_visible(gait: AnyGait) -> bool:
    """True if a person sees a gait move: a joint swings by 9 degrees or more to either side."""
    return bool(np.ptp(gait.angles(_PERIOD), axis=1).max() >= 2 * _VISIBLE)


def latin_hypercube(n: int, dimension: int, rng: np.random.Generator) -> np.ndarray:
    """Points ``(n, dimension)`` of the unit cube, one in every n-th of each coordinate, as those of
    `scipy.stats.qmc`, which takes half a second to load."""
    within, order = rng.uniform(size=(n, dimension)), np.tile(np.arange(1, n + 1), (dimension, 1))
    for coordinate in order:
        rng.shuffle(coordinate)
    return (order.T - within) / n


def latin_hypercube_gait(problem: Problem, seed: int, start: int) -> AnyGait:
    """Start of a Latin hypercube over a problem's class of gaits that clearly moves, or the fastest
    of many. `ProblemError` if no admissible gait is as fast as ``smallest_shape_speed``."""
    block, row = divmod(start, BLOCK)
    seeds, n_joint = problem.gait.start_class, problem.body.n_joint
    least = problem.smallest_shape_speed
    fastest: AnyGait = None
    dimension = seeds.sample_dimension(n_joint) + 1
    rng = np.random.default_rng([seed, block]).spawn(1)[0]  # as newer releases of SciPy do
    unit = latin_hypercube(BLOCK, dimension, rng)[row]
    again = np.random.default_rng([seed, block, row + 1])
    for _ in range(_ATTEMPTS + 1):
        fraction = _FRACTIONS[0] + unit[-1] * (_FRACTIONS[1] - _FRACTIONS[0])
        gait = _with_amplitude(problem, seeds.sample(unit[:-1], n_joint), fraction)
        if fastest is None or gait.shape_speed > fastest.shape_speed:
            fastest = gait
        if fastest.shape_speed > _CLEARLY_MOVING * least:
            return fastest
        unit = again.random(dimension)
    if fastest.shape_speed > least:
        return fastest
    raise ProblemError(
        f"found no admissible start as fast as smallest_shape_speed {least:g}; make it smaller."
    )


def _with_amplitude(problem: Problem, gait: AnyGait, fraction: float) -> AnyGait:
    """The class member nearest to a gait, at a fraction of the largest admissible amplitude."""
    seeds = problem.gait.start_class
    member = seeds.member(seeds.parameters(gait), problem.body.n_joint)
    largest = largest_amplitude(problem, member)
    return member.scaled(fraction * largest) if np.isfinite(largest) else member


def perturbed_gait(problem: Problem, seed: int, start: int) -> AnyGait:
    """Start near the guess of a problem: its coefficients move by normals of 0.3 rad, and it
    shrinks until it is admissible."""
    rng = np.random.default_rng([seed, start])
    for _ in range(_ATTEMPTS):
        member = problem.gait.start_class.perturb(problem.guess, _SPREAD, 0, rng)
        gait = _with_amplitude(problem, member, min(1.0, 1.0 / largest_amplitude(problem, member)))
        if gait.shape_speed > _CLEARLY_MOVING * problem.smallest_shape_speed:
            return gait
    raise ProblemError(f"found no admissible start within {_SPREAD:g} rad of the guess.")


def start_gait(problem: Problem, sampler: str, seed: int, start: int) -> AnyGait:
    return (perturbed_gait if sampler == PERTURBED else latin_hypercube_gait)(problem, seed, start)


def to_body(gait: AnyGait, body: Chain, other: Body, joint_limit: Limit = float(np.pi)) -> AnyGait:
    """Transfer a gait of a chain to another body: every link gets the mean tangent angle of the
    part of the body it covers. Where links would cross, or a joint pass its limit, all angles
    shrink."""
    matrix = other.from_chain(np.array(body.lengths))
    angles = matrix @ gait.angles(_PERIOD)
    return gait.mapped(matrix * min(1.0, largest_factor(other, joint_limit, angles)))


def to_class(
    gait_class: AnyClass,
    gait: AnyGait,
    body: Body,
    joint_limit: Limit = float(np.pi),
    smallest_shape_speed: float = 0.1,
) -> AnyGait:
    """Transfer a gait to a class, and make it admissible: a truncated series overshoots, and cuts
    corners."""
    start = gait_class.through(gait)
    growth = 2 * np.pi * smallest_shape_speed / start.length
    if growth > _SHORT:
        start = start.grown(growth)
    if start is gait or not start.is_series:
        return start
    return start.scaled(
        min(1.0, largest_factor(body, joint_limit, start.angles(_PERIOD), start.rest))
    )


def prolong(problem: Problem, gait: AnyGait, gait_class: AnyClass, **changes: object) -> Problem:
    """The problem in another class of gaits, to be searched from a known optimum of any class;
    delta stays what it is relative to the shape speed."""
    relative = problem.delta / (1.0 if problem.gait.relative_delta else problem.guess.length)
    delta = relative * (1.0 if gait_class.relative_delta else gait.length)
    guess = to_class(
        gait_class, gait, problem.body, problem.joint_limit, problem.smallest_shape_speed
    )
    stated = {"guess": guess, "gait": gait_class, "delta": delta, "delta_start": _NEAR * delta}
    return problem.with_(**(stated | changes))
