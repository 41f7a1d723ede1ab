"""Where a search over gaits begins: by chance, or at a gait of another class or chain that is laid
into this one.

Start number k of a seed is the same whatever the number of starts.
Admissible shapes form a region that is star-shaped about the straight body (joint limits and
non-crossing keep holding when all angles shrink together). So a gait is sampled as a direction in
the space of parameters, from a Latin hypercube, times a fraction of the largest amplitude that is
admissible in that direction.
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
"""Starts per Latin hypercube: start k belongs to hypercube k // BLOCK, seeded by that number and
the run's seed."""
LARGEST_SEED = 2**63 - 1
"""Files keep seeds and numbers of starts in so many bits."""
_FRACTIONS = (0.2, 0.95)
_PHASES = 200
_ATTEMPTS = 200
_CLEARLY_MOVING = 1.5
_SPREAD = 0.3
_ON_FLOOR = 1e-4
_SHORT = 1.002
"""An optimum on the lower bound of the path length is not too short; its length as a polyline is,
by the corners it cuts."""
_VISIBLE = np.pi / 20
"""Least swing of one joint to either side [rad] in a gait that a person sees move, 9 degrees: a
little more than one joint that moves alone has at the usual `Problem.smallest_shape_speed`."""
_PERIOD = np.linspace(0.0, 1.0, 1001)
_NEAR = 10.0
"""A search from a known optimum begins at so many times the final delta: friction more regularised
than that prefers other gaits, and leaves it (six harmonics from the best of five: 0.4013, from 100
times the final delta 0.3998)."""


def largest_amplitude(problem: Problem, gait: AnyGait) -> float:
    """The largest factor by which a gait's angles can be multiplied and stay admissible; inf for
    the straight body."""
    largest = largest_factor(
        problem.body, problem.joint_limit, gait.angles(np.arange(_PHASES) / _PHASES), gait.rest
    )
    share = largest_share(gait, problem.largest_speeds)
    return min(largest, 1 / share) if share else largest


def on_speed_floor(problem: Problem, gait: AnyGait) -> bool:
    """Whether a gait is as slow as ``smallest_shape_speed`` allows: then that bound, and no
    mechanics, decided its size."""
    return gait.shape_speed < problem.smallest_shape_speed * (1 + _ON_FLOOR)


def is_visible(gait: AnyGait) -> bool:
    """Whether a person sees a gait move, so that it is of finite size: a joint swings by 9 degrees
    or more to either side."""
    return bool(np.ptp(gait.angles(_PERIOD), axis=1).max() >= 2 * _VISIBLE)


def latin_hypercube(n: int, dimension: int, rng: np.random.Generator) -> np.ndarray:
    """Points ``(n, dimension)`` of the unit cube, one in every n-th of each coordinate (McKay,
    Beckman and Conover, 1979).

    Those of `scipy.stats.qmc`, which takes half a second to load: a tenth of a whole search.
    """
    within, order = rng.uniform(size=(n, dimension)), np.tile(np.arange(1, n + 1), (dimension, 1))
    for coordinate in order:
        rng.shuffle(coordinate)
    return (order.T - within) / n


def latin_hypercube_gait(problem: Problem, seed: int, start: int) -> AnyGait:
    """Start number `start` of a Latin hypercube over the problem's class of gaits: one that clearly
    moves, or the fastest of many. `ProblemError` if no admissible gait moves as fast as the
    problem's ``smallest_shape_speed``.
    """
    block, row = divmod(start, BLOCK)
    dimension = problem.gait.seeds.dimension(problem.body.n_joint) + 1
    rng = np.random.default_rng([seed, block]).spawn(1)[0]  # as newer releases of SciPy do
    unit = latin_hypercube(BLOCK, dimension, rng)[row]
    again = np.random.default_rng([seed, block, row + 1])
    fastest = _scaled(problem, unit)
    for _ in range(_ATTEMPTS):
        if fastest.shape_speed > _CLEARLY_MOVING * problem.smallest_shape_speed:
            return fastest
        fastest = max(
            fastest, _scaled(problem, again.random(dimension)), key=lambda gait: gait.shape_speed
        )
    if fastest.shape_speed > problem.smallest_shape_speed:
        return fastest
    raise ProblemError(
        f"found no admissible start as fast as smallest_shape_speed "
        f"{problem.smallest_shape_speed:g}; make it smaller."
    )


def _scaled(problem: Problem, unit: np.ndarray) -> AnyGait:
    """The member of the class that a point of the unit cube stands for."""
    drawn = problem.gait.seeds.drawn(unit[:-1], problem.body.n_joint)
    return _multiplied(problem, drawn, _FRACTIONS[0] + unit[-1] * (_FRACTIONS[1] - _FRACTIONS[0]))


def _multiplied(problem: Problem, drawn: AnyGait, fraction: float) -> AnyGait:
    """The class member nearest to `drawn`, at a fraction of the largest admissible amplitude."""
    own = problem.gait.seeds
    gait = own.member(own.parameters(drawn), problem.body.n_joint)
    largest = largest_amplitude(problem, gait)
    if not np.isfinite(largest):
        return gait
    return gait.scaled(fraction * largest)


def perturbed_gait(problem: Problem, seed: int, start: int) -> AnyGait:
    """Start number `start` near the problem's own guess, whose coefficients move by normals of 0.3
    rad.

    Where that leaves the admissible region, the whole gait is shrunk back into it.
    """
    rng = np.random.default_rng([seed, start])
    for _ in range(_ATTEMPTS):
        member = problem.gait.seeds.moved(problem.guess, _SPREAD, 0, rng)
        gait = _multiplied(problem, member, min(1.0, 1.0 / largest_amplitude(problem, member)))
        if gait.shape_speed > _CLEARLY_MOVING * problem.smallest_shape_speed:
            return gait
    raise ProblemError(f"found no admissible start within {_SPREAD:g} rad of the guess.")


def start_gait(problem: Problem, sampler: str, seed: int, start: int) -> AnyGait:
    """The gait of start number `start` of a sampler by name; "perturbed" ones lie near the
    problem's own guess."""
    if sampler not in SAMPLERS:
        raise ProblemError(f"sampler must be one of {', '.join(SAMPLERS)}, not {sampler!r}.")
    if sampler == PERTURBED:
        return perturbed_gait(problem, seed, start)
    return latin_hypercube_gait(problem, seed, start)


def over_links(
    gait: AnyGait, body: Chain, other: Body, joint_limit: Limit = float(np.pi)
) -> AnyGait:
    """A gait of a chain laid into another body: every link gets the mean tangent angle of the part
    of the body it covers.

    That is linear in the joint angles and keeps the symmetries, if both bodies have them. Where
    links would cross, or a joint pass its limit, all angles shrink.
    """
    matrix = other.laid(np.array(body.lengths))
    angles = matrix @ gait.angles(_PERIOD)
    matrix = matrix * min(1.0, largest_factor(other, joint_limit, angles))
    return gait.mapped(matrix)


def laid_into(
    gait_class: AnyClass,
    gait: AnyGait,
    body: Body,
    joint_limit: Limit = float(np.pi),
    smallest_shape_speed: float = 0.1,
) -> AnyGait:
    """The gait that starts a search in a class: what stands for it there, made admissible.

    A truncated series overshoots, and a path that touches its limits is no longer admissible then:
    all angles shrink. It cuts corners, and a path as short as it may be becomes too short: it grows
    about its mean.
    """
    near = gait_class.through(gait)
    growth = 2 * np.pi * smallest_shape_speed / near.length
    if growth > _SHORT:
        near = near.grown(growth)
    if near is gait or not near.is_series:
        return near
    largest = largest_factor(body, joint_limit, near.angles(_PERIOD), near.rest)
    return near.scaled(min(1.0, largest))


def delta_in(gait_class: AnyClass, gait: AnyGait, relative: float) -> float:
    """Delta in the units of a class, from delta relative to the shape speed, for a gait of the same
    path length."""
    return relative * (1.0 if gait_class.relative_delta else gait.length)


def prolonged(problem: Problem, gait: AnyGait, gait_class: AnyClass, **changes: object) -> Problem:
    """The problem in another class of gaits, to be searched from a known optimum of any class.

    Delta stays what it is relative to the shape speed; other fields may be changed too
    (``intervals=...``).

    Examples
    --------
    >>> from colloc import Harmonic, Polygon, Problem, ellipse
    >>> best = ellipse(0, 2.86, 1.30)
    >>> prolonged(Problem("loop", best, gait=Harmonic(1, "bilateral")), best, Polygon(5,
    ...     "bilateral")).gait
    Polygon(corners=5, symmetry='bilateral', axis='corner')
    """
    relative = problem.delta / delta_in(problem.gait, problem.guess, 1.0)
    delta = delta_in(gait_class, gait, relative)
    guess = laid_into(
        gait_class, gait, problem.body, problem.joint_limit, problem.smallest_shape_speed
    )
    stated = {"guess": guess, "gait": gait_class, "delta": delta, "delta_start": _NEAR * delta}
    return problem.with_(**(stated | changes))
