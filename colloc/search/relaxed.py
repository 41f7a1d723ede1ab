"""The search for relaxed gaits: many starts told apart on few pieces, the best followed to the final delta on all of them.

Between levels pieces that take long are halved, those that take no time dropped, and directions that are not used turned to
where they would help most (`prices`). Both leave the gait as it is, and give the next level what it may need.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from itertools import islice

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.gaits.relaxed import Mixture
from colloc.numerics.sqp import stationarity
from colloc.reduced.mixture_space import MixtureSpace
from colloc.reduced.program import ReducedProgram
from colloc.results.answer import Alternative
from colloc.results.relaxation import Optimality, Relaxation
from colloc.results.solution import Solution
from colloc.search.converge import FIRST_RADIUS, NEXT_RADIUS, ROUGH, VERY_ROUGH, Found, deltas, settled_apart
from colloc.search.explore import starting_gaits
from colloc.search.prescribed import realised
from colloc.search.realise import realised_gaits, relaxed_certificate
from colloc.system.errors import CollocError, NotConvergedError, ProblemError

RELAXED_STARTS = 8
"""Starts where none are asked for."""
_COARSE, _MOST = 0.4, 0.7
"""Pieces on which starts are told apart, and are followed, as shares of those of the answer."""
_FOLLOWED, _PROMISING, _SAME = 3, 0.8, 4e-3
"""Starts followed; the share of the best efficiency that they need, and the relative difference by which they are others."""
_DIRECTIONS, _SEED = 72, 1
_IDLE = 1e-7
_MESHES, _GAIN = 3, 2e-5
"""At the final delta, and what one must gain to be followed by another."""
_ROUNDS = 2
"""Of SQP on a mesh. For small delta slopes jump wherever a link begins to stick, and SQP creeps for a few 1e-4 of the value."""


def directions_tried(n_joint: int) -> np.ndarray:
    """Unit vectors of joint rates ``(n, n_joint)``, evenly spread for two joints, else at random; for more joints more."""
    if n_joint == 2:
        turn = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        return np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = np.random.default_rng(_SEED).standard_normal((_DIRECTIONS * (n_joint - 1), n_joint))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def _mixtures(found: Found) -> MixtureSpace:
    assert isinstance(found.space, MixtureSpace)
    return found.space


def prices(found: Found) -> tuple[np.ndarray, np.ndarray]:
    """What a unit of time in other directions would cost: slopes of -d/W, net of the rows, ``(n_piece, n_tried)``; and these.

    At a local optimum no price is negative, up to what the optimum is accurate to: mixing in another direction does not pay.
    """
    space = _mixtures(found)
    mixture, tried = space.member(found.v), directions_tried(space.n_joint)
    shape = (space.pieces, len(tried))
    more = Mixture(
        np.concatenate([mixture.durations, np.zeros(shape)], axis=1),
        np.concatenate([mixture.directions, np.broadcast_to(tried, (*shape, space.n_joint))], axis=1),
        mixture.start,
        mixture.symmetry,
    )
    wide = MixtureSpace(space.problem, space.pieces, space.far, directions=more.durations.shape[1])
    w = wide.parameters(more)
    space.move_checks(found.v)
    wide.move_checks(w)
    on_rows = stationarity(ReducedProgram(space, found.delta), found.v).on_rows
    program = ReducedProgram(wide, found.delta)
    slopes = program.gradient(w) + on_rows @ program.row_slopes(w)
    return slopes[wide.time].reshape(more.durations.shape)[:, space.n_direction :], tried


def readied(found: Found, pieces: int) -> tuple[MixtureSpace, np.ndarray]:
    """The gait on so many pieces, its idle directions turned to the cheapest one each: a start that is the same gait."""
    price, tried = prices(found)
    mixture = found.gait
    directions = mixture.directions.copy()
    for piece, used in enumerate(mixture.durations > _IDLE):
        best = tried[np.argsort(price[piece])]
        for slot in np.flatnonzero(~used):
            directions[piece, slot] = best[0]
            # the next one on another side
            best = best[best @ best[0] < 0.5]
    turned = Mixture(mixture.durations, directions, mixture.start, mixture.symmetry).split(pieces)
    space = MixtureSpace(found.space.problem, len(turned.durations), found.space.far)
    return space, space.parameters(turned)


def relaxed_gaits(
    problem: Problem,
    starts: int,
    seconds: float = np.inf,
    report: Callable[[str], object] = lambda _: None,
    first: tuple = (),
    least_extent: float = 0.0,
) -> list[tuple[Found, int]]:
    """Relaxed gaits at the problem's delta, most efficient first, and how many starts led to about each on few pieces.

    The first is a local optimum, the others are nearly.

    Parameters
    ----------
    problem : Problem
        Its class is `colloc.gaits.relaxed.Relaxed`; `intervals` are pieces of the part that is solved.
    starts : int
        The guess, known gaits and seeded samples (`colloc.search.explore.starting_gaits`).
    seconds : float
        Wall time after which no other start is begun or followed.
    report : callable, optional
        Told in words what is under way.
    first : tuple of gaits
        Tried before the others, beyond their number.
    least_extent : float
        Gaits whose mean angles range over less [rad] come last: loops at one shape are gaits of another kind.

    Raises
    ------
    NotConvergedError
        If no start leads anywhere.
    """
    begin, coarse = time.perf_counter(), max(6, round(_COARSE * problem.intervals))
    known: list[Found] = []
    for count, gait in enumerate((*first, *islice(starting_gaits(problem), starts)), 1):
        if known and time.perf_counter() - begin > seconds:
            break
        report(f"trying start {count} of {starts + len(first)}")
        with suppress(CollocError):
            known.append(_tried(problem, gait, coarse))

    def rank(found: Found) -> tuple[bool, float]:
        return found.gait.extent < least_extent, found.objective

    known.sort(key=rank)
    ends: list[tuple[Found, int]] = []
    for found in _promising(known):
        if ends and time.perf_counter() - begin > seconds:
            break
        report(f"following {-found.objective:.4f}")
        with suppress(CollocError):
            ends.append((descended(found), sum(_alike(found, other) for other in known)))
    if not ends:
        raise NotConvergedError("no start led to a relaxed gait; give another guess.")
    (best, count), *others = sorted(ends, key=lambda end: rank(end[0]))
    report(f"refining {-best.objective:.4f}")
    return [(refined(best), count), *others]


def _alike(one: Found, other: Found) -> bool:
    """Whether two gaits on few pieces are the same, as far as their efficiency tells."""
    return abs(one.objective / other.objective - 1) <= _SAME


def _tried(problem: Problem, gait: AnyGait, pieces: int) -> Found:
    """Where a start leads on few pieces, at the first two deltas."""
    if isinstance(gait, Mixture):
        gait = gait.split(pieces)
        pieces = len(gait.durations)
    space = MixtureSpace(problem, pieces)
    levels = deltas(problem, problem.delta_start)
    found = settled_apart(space, space.parameters(gait), levels[0], FIRST_RADIUS, VERY_ROUGH)
    for delta in levels[1:2]:
        found = settled_apart(*readied(found, pieces), delta, NEXT_RADIUS, VERY_ROUGH)
    return found


def _promising(known: list[Found]) -> list[Found]:
    """The best few that differ in efficiency."""
    chosen: list[Found] = []
    for found in known:
        if found.objective > _PROMISING * known[0].objective or len(chosen) == _FOLLOWED:
            break
        if not any(_alike(found, other) for other in chosen):
            chosen.append(found)
    return chosen


def descended(found: Found) -> Found:
    """From a gait at some delta down to the problem's, on most of its pieces, roughly."""
    problem = found.space.problem
    for count, delta in enumerate(deltas(problem, found.delta)[1:]):
        # where friction is smoothest the mixture is found, below it follows
        accuracy = VERY_ROUGH if count else ROUGH
        ready = readied(found, round(_MOST * problem.intervals))
        found = settled_apart(*ready, delta, NEXT_RADIUS, accuracy, rounds=_ROUNDS)
    return found


def refined(found: Found) -> Found:
    """The gait on all pieces, until another mesh of as many gains nothing."""
    problem = found.space.problem
    for _ in range(_MESHES):
        before = found.objective
        found = settled_apart(*readied(found, problem.intervals), found.delta, NEXT_RADIUS, ROUGH, rounds=_ROUNDS)
        if found.objective > before - _GAIN:
            break
    return found


def best_relaxed_gait(
    problem: Problem,
    starts: int,
    repeats: tuple[int, ...] = (1, 2, 4),
    seconds: float = np.inf,
    report: Callable[[str], object] = lambda _: None,
    first: tuple = (),
) -> Solution:
    """The best relaxed gait that so many starts lead to, and finite gaits near it, all certified.

    Parameters
    ----------
    problem, starts, seconds, report, first
        See `relaxed_gaits`.
    repeats : tuple of int
        Of the directions on every piece, in the finite gaits; more if these lose more than half a percent.
    """
    if problem.objective != EFFICIENCY or problem.at_least or problem.rotation != 0:
        raise ProblemError("relaxed gaits are measured by their efficiency alone; leave objective, rotation and at_least out.")
    begin = time.perf_counter()
    ends = relaxed_gaits(problem, starts, seconds, report, first)
    solution = certified(ends[0][0], repeats, report)
    solution.seconds, solution.starts = time.perf_counter() - begin, starts
    solution.others = tuple(Alternative(-f.objective, f.delta, count, False, f.gait) for f, count in ends)
    return solution


def certified(best: Found, repeats: tuple[int, ...] = (1,), report: Callable[[str], object] = lambda _: None) -> Solution:
    """A relaxed gait, and finite gaits near it, with their certificates."""
    report("certifying the relaxed gait")
    problem, conditions, gait = best.space.problem, best.conditions, best.gait
    # where the class has another direction to give
    free = (gait.durations <= _IDLE).any(axis=1)
    price = float(prices(best)[0][free].min(initial=0.0))
    optimality = Optimality(-best.objective, conditions.kkt_error, conditions.violation, price, best.iterations)
    certificate = relaxed_certificate(problem, gait, optimality)
    finite = realised_gaits(problem, gait, repeats, certificate.efficiency, report)
    relaxed = Relaxation(gait, optimality, certificate, finite)
    level = realised(problem.with_(gait=problem.gait.finite), relaxed.best.gait)
    return Solution(problem, [level], relaxed.best.certificate, best.seconds, message=relaxed.message, relaxed=relaxed)
