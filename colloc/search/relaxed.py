"""The search for relaxed gaits: many starts told apart on few pieces, the best followed to the final delta on all of them.

Between levels pieces that take long are halved, those that take no time dropped, and directions that are not used turned to
where they would help most (`prices`). Both leave the gait as it is, and give the next level what it may need.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from itertools import islice
from typing import Any

import numpy as np

from colloc.gaits.control_problem import control_problem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.gaits.relaxed import Mixture
from colloc.numerics.sqp import stationarity
from colloc.reduced.mixture_space import MixtureSpace
from colloc.reduced.program import ReducedProgram
from colloc.results.answer import Alternative, Answer
from colloc.results.relaxation import Optimality, Relaxation
from colloc.results.solution import Solution
from colloc.search.converge import converged
from colloc.search.descend import levels
from colloc.search.effort import ROUGH, SKETCH, Effort
from colloc.search.explore import ENOUGH, FOLLOWED, PROMISING, Exploration, starting_gaits
from colloc.search.optimum import Optimum
from colloc.search.prescribed import realised
from colloc.search.realise import kept_inside, realised_gaits, relaxed_certificate
from colloc.search.run import this_run
from colloc.system.errors import CollocError, NotConvergedError, ProblemError

_COARSE, _MOST = 0.4, 0.7
"""Pieces on which starts are told apart, and are followed, as shares of those of the answer."""
_SAME = 4e-3
"""Relative difference of efficiencies below which two gaits on few pieces are the same."""
_DIRECTIONS = 72
_IDLE = 1e-7
_MESHES, _GAIN = 3, 2e-5
"""At the final delta, and what one must gain to be followed by another."""
_ROUGH = Effort(1e-2)
"""On the way: for small delta slopes jump wherever a link begins to stick, and SQP creeps for a few 1e-4 of the value. The
answer is as exact as its certificate asks for."""


def directions_tried(n_joint: int) -> np.ndarray:
    """Unit vectors of joint rates ``(n, n_joint)``, evenly spread for two joints, else at random; for more joints more."""
    if n_joint == 2:
        turn = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        return np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = np.random.default_rng(1).standard_normal((_DIRECTIONS * (n_joint - 1), n_joint))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def prices(found: Optimum) -> tuple[np.ndarray, np.ndarray]:
    """What a unit of time in other directions would cost: slopes of -d/W, net of the rows, ``(n_piece, n_tried)``; and these.

    At a local optimum no price is negative, up to what the optimum is accurate to: mixing in another direction does not pay.
    """
    space: Any = found.space
    mixture, tried = space.member(found.v), directions_tried(space.n_joint)
    shape = (space.pieces, len(tried))
    more = Mixture(
        np.concatenate([mixture.durations, np.zeros(shape)], axis=1),
        np.concatenate([mixture.directions, np.broadcast_to(tried, (*shape, space.n_joint))], axis=1),
        mixture.start,
        mixture.symmetry,
    )
    wide = MixtureSpace(space.control, space.pieces, space.given.far, directions=more.durations.shape[1])
    w = wide.parameters(more)
    on_rows = stationarity(found.program(), found.v).on_rows
    program = ReducedProgram(wide, found.delta)
    program.place_rows(w)
    slopes = program.gradient(w) + on_rows @ program.row_slopes(w)
    return slopes[wide.time].reshape(more.durations.shape)[:, space.n_direction :], tried


def with_turned_directions(found: Optimum, pieces: int) -> tuple[MixtureSpace, np.ndarray]:
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
    space = MixtureSpace(found.space.control, len(turned.durations), found.given.far)
    return space, space.parameters(turned)


def explore_relaxed(
    problem: Problem,
    starts: int = ENOUGH,
    goes_on: Callable[[], bool] = lambda: True,
    first: tuple = (),
    least_extent: float = 0.0,
) -> Exploration:
    """Relaxed gaits at the problem's delta, most efficient first, and how many starts led to about each on few pieces.

    The first is a local optimum, the others are nearly.

    Parameters
    ----------
    problem : Problem
        Its class is `colloc.gaits.relaxed.Relaxed`; `intervals` are pieces of the part that is solved.
    starts : int
        The guess, known gaits and seeded samples (`colloc.search.explore.starting_gaits`).
    goes_on : callable
        Whether there is time for another start, and another gait to be followed.
    first : tuple of gaits
        Tried before the others, beyond their number.
    least_extent : float
        Gaits whose mean angles range over less [rad] come last: loops at one shape are gaits of another kind.

    Raises
    ------
    ProblemError
        If anything but the efficiency is asked for.
    NotConvergedError
        If no start leads anywhere.
    """
    if problem.objective != EFFICIENCY or problem.at_least or problem.rotation != 0:
        raise ProblemError("relaxed gaits are measured by their efficiency alone; leave objective, rotation and at_least out.")
    run, coarse, count = this_run(), max(6, round(_COARSE * problem.intervals)), starts + len(first)
    known: list[Optimum] = []
    for done, gait in enumerate((*first, *islice(starting_gaits(problem), starts))):
        if known and not goes_on():
            break
        run.told("explore", done, count, min(known, key=lambda f: f.objective, default=None))
        with suppress(CollocError):
            known.append(_tried(problem, gait, coarse))

    def rank(found: Optimum) -> tuple[bool, float]:
        return found.gait.extent < least_extent, found.objective

    known.sort(key=rank)
    ends: list[tuple[Optimum, int]] = []
    promising = _promising(known)
    for done, found in enumerate(promising):
        if ends and not goes_on():
            break
        run.told("follow", done, len(promising), min((end for end, _ in ends), key=rank, default=None))
        with suppress(CollocError):
            ends.append((descend_relaxed(found), sum(_alike(found, other) for other in known)))
    if not ends:
        raise NotConvergedError("no start led to a relaxed gait; give another guess.")
    (best, count), *others = sorted(ends, key=lambda end: rank(end[0]))
    met = [(refine_relaxed(best), count), *others]
    told = tuple(Alternative(f.value, f.delta, count, False, f.gait) for f, count in met)
    return Exploration(tuple(found for found, _ in met), starts, told)


def _alike(one: Optimum, other: Optimum) -> bool:
    """Whether two gaits on few pieces are the same, as far as their efficiency tells."""
    return abs(one.objective / other.objective - 1) <= _SAME


def _tried(problem: Problem, gait: AnyGait, pieces: int) -> Optimum:
    """Where a start leads on few pieces, at the first two deltas."""
    if isinstance(gait, Mixture):
        gait = gait.split(pieces)
        pieces = len(gait.durations)
    space = MixtureSpace(control_problem(problem), pieces)
    first, *others = levels(problem, problem.delta_start)
    found = converged(space, space.parameters(gait), first, SKETCH)
    for delta in others[:1]:
        found = converged(*with_turned_directions(found, pieces), delta, SKETCH).after(*found.history)
    return found


def _promising(known: list[Optimum]) -> list[Optimum]:
    """The best few that differ in efficiency."""
    chosen: list[Optimum] = []
    for found in known:
        if found.objective > PROMISING * known[0].objective or len(chosen) == FOLLOWED:
            break
        if not any(_alike(found, other) for other in chosen):
            chosen.append(found)
    return chosen


def descend_relaxed(found: Optimum) -> Optimum:
    """From a gait at some delta down to the problem's, on most of its pieces, roughly."""
    problem, run = found.problem, this_run()
    below = levels(problem, found.delta)[1:]
    for count, delta in enumerate(below):
        run.told("descend", count, len(below), found)
        # where friction is smoothest the mixture is found, below it follows
        effort: Effort = SKETCH if count else _ROUGH
        ready = with_turned_directions(found, round(_MOST * problem.intervals))
        found = converged(*ready, delta, effort).after(*found.history)
    return found


def refine_relaxed(found: Optimum) -> Optimum:
    """The gait on all pieces, until another mesh of as many gains nothing."""
    problem, run = found.problem, this_run()
    for count in range(_MESHES):
        run.told("refine", count, _MESHES, found)
        before = found.objective
        ready = with_turned_directions(found, problem.intervals)
        found = converged(*ready, found.delta, ROUGH).after(*found.history)
        if found.objective > before - _GAIN:
            break
    return found


def realised_solution(optimum: Optimum, repeats: tuple[int, ...] = (1, 2, 4)) -> Solution:
    """A relaxed gait, and finite gaits near it, with their certificates; the best of these is the answer.

    Parameters
    ----------
    optimum : Optimum
        Of a class of relaxed gaits.
    repeats : tuple of int
        Of the directions on every piece, in the finite gaits; more if these lose more than half a percent.
    """
    problem, gait, run = optimum.problem, optimum.gait, this_run()
    run.told("certify", 0, 1 + len(repeats), optimum)
    # where the class has another direction to give
    free = (gait.durations <= _IDLE).any(axis=1)
    price = float(prices(optimum)[0][free].min(initial=0.0))
    optimality = Optimality(optimum.value, optimum.kkt_error, optimum.violation, price, optimum.iterations)

    def certified() -> Relaxation:
        certificate = relaxed_certificate(problem, gait, optimality)
        return Relaxation(gait, optimality, certificate, realised_gaits(problem, gait, repeats, certificate.efficiency))

    relaxed = run.kept("realise", (optimum, optimality, repeats), certified)
    answer = realised(problem.with_(gait=problem.gait.finite), relaxed.best.gait, optimum.history)
    return Solution(problem, answer, relaxed.best.certificate, message=relaxed.message, relaxed=relaxed)


def unrefined(optimum: Optimum) -> Answer:
    """The finite gait that repeats the directions of a relaxed one once: where there is no time for more."""
    problem = optimum.problem.with_(gait=optimum.problem.gait.finite)
    return realised(problem, kept_inside(optimum.problem, optimum.gait.realised(1)), optimum.history)
