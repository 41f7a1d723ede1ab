"""Many starts, cheaply told apart; the promising ones followed to the final delta.

A start is optimised on a coarse mesh down to a delta at which friction is nearly dry. Where it
meets a gait that an earlier start met at the same delta, it is dropped: it would go on as that one
did. Every sixteen starts take turns with as many hops from the best gait so far (basin hopping:
Wales and Doye, J. Phys. Chem. A 101, 1997). Beside them are a few small loops
(`colloc.search.small_starts`), slow and so optimised at a smaller delta only.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import ellipse
from colloc.gaits.problem import Problem
from colloc.gaits.starts import (
    is_visible,
    latin_hypercube_gait,
    on_speed_floor,
    to_body,
    to_class,
    travelling_wave,
)
from colloc.mechanics.chain import Chain
from colloc.reduced.program import ReducedProgram
from colloc.results.answer import Alternative
from colloc.results.distinct_optima import SAME_VALUE, are_one, fourier_series
from colloc.search.ahead import Ahead, computing_ahead
from colloc.search.checkpoint import active_run
from colloc.search.closure import project_to_zero_rotation
from colloc.search.converge import optimise
from colloc.search.descend import delta_levels, descend, regularisation_dominated
from colloc.search.iterate import Iterate, evaluate_at
from colloc.search.options import COARSE, FINE, MEDIUM, OPTIONS
from colloc.search.small_starts import small_loops
from colloc.search.spaces import space_near, space_of
from colloc.system.errors import CollocError, NotConvergedError

_THREE_LINK_ELLIPSES = ((0.0, 2.86, 1.30), (1.11, 0.67, 1.12))
"""The two best ellipses of three equal links under isotropic friction: without them one harmonic of
other bodies is missed at times, as that of `problems/purcell.py`."""


@dataclass(eq=False)
class Candidate:
    """A gait that one or more starts met; `next` is where they went, at the next delta."""

    iterate: Iterate
    starts: int = 0
    n_new: int = 0  # starts that are no hops, which go round near the best gait
    next: Candidate | None = None
    dry_objective: float = np.inf  # at a delta that is small for all
    is_loop: bool = False

    def count_start(self, *, is_new: bool) -> None:
        candidate: Candidate | None = self
        while candidate is not None:
            candidate.starts += 1
            candidate.n_new += is_new
            candidate = candidate.next


@dataclass(frozen=True, eq=False)
class Exploration:
    """Distinct optima of many starts.

    Attributes
    ----------
    optima : tuple of Iterate
        At the final delta, best first, before their meshes are refined.
    starts : int
    others : tuple of Alternative
        All distinct gaits met, best first.
    left : tuple of Iterate
        Gaits at a larger delta that were not followed, the most promising first.
    failure : str
        Why the starts led nowhere, where the guess alone is left.
    """

    optima: tuple[Iterate, ...]
    starts: int
    others: tuple[Alternative, ...] = ()
    left: tuple[Iterate, ...] = ()
    failure: str = ""


def first_optimum(problem: Problem, gait: AnyGait) -> Iterate:
    """The optimum at the first delta that the search reaches from a gait.

    At the next delta where friction at that one is dominated by its regularisation; at the final
    delta for a gait that is nearly an optimum there.
    """
    if not problem.gait.free:
        return optimise(*space_near(problem, gait), problem.delta, FINE)
    if (near := _final_optimum(problem, gait)) is not None:
        return near
    closed = project_to_zero_rotation(problem, gait, problem.delta_start)
    space, v = space_near(problem, closed)
    active_run().report("explore", 0, 1, evaluate_at(space, v, problem.delta_start))
    for delta in delta_levels(problem, problem.delta_start):
        optimum = optimise(space, v, delta, MEDIUM)
        if not regularisation_dominated(optimum):
            break
    return optimum


def _final_optimum(problem: Problem, gait: AnyGait) -> Iterate | None:
    """The optimum at the problem's delta, if the gait is nearer to one than 0.1 rad."""
    space, v = space_near(problem, gait)
    here = evaluate_at(space, v, problem.delta)
    is_steep = here.kkt_error * COARSE > OPTIONS.close * abs(here.objective)
    if is_steep or not here.violation < COARSE or problem.delta == problem.delta_start:
        return None
    with suppress(NotConvergedError):
        optimum = here if here.optimal else optimise(space, v, problem.delta, MEDIUM)
        is_near = optimum.optimal and np.abs(optimum.v - v).max() < COARSE
        if is_near and not regularisation_dominated(optimum):
            return optimum
    return None


def explore(
    problem: Problem, starts: int | None = None, has_time: Callable[[], bool] = lambda: True
) -> Exploration:
    """The best gaits of a problem's class that many starts lead to.

    Where they shrink until nobody sees them move, the search begins anew among gaits at least as
    large as the best optimum of finite size (`smallest_shape_speed`).

    Parameters
    ----------
    problem : Problem
    starts : int, optional
        Starts at least, and at most three times as many while they lead on. By default 32, with
        inertia 96, or fewer once some of them have met the best gait.
    has_time : callable
        Whether there is time for another start, or another gait to follow.

    Raises
    ------
    NotConvergedError
        If no start leads anywhere.

    Examples
    --------
    >>> import colloc
    >>> from colloc.search.explore import explore
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> round(explore(problem, starts=2).optima[0].value, 2)
    0.26
    """
    with computing_ahead(problem) as ahead:
        any_size = _explore(problem, starts, has_time, ahead)
        if problem.shrinking or is_finite(any_size.optima[0]) or not has_time():
            return any_size
        finite = next((optimum for optimum in any_size.optima if is_finite(optimum)), None)
        try:
            large = _explore(_among_large(problem, finite), starts, has_time, ahead)
        except CollocError:
            return any_size  # nothing moves as much
    # the first one has its size by itself, which counts for something
    enough = (1 + OPTIONS.close) * finite.objective if finite else 0.0
    better = [each for each in large.optima if is_finite(each) and each.objective < enough]
    optima = sorted([*any_size.optima, *better], key=lambda optimum: optimum.objective)
    series = [(other.value, fourier_series(problem, other.gait)) for other in any_size.others]
    others = list(any_size.others)
    for other in large.others:
        here = other.value, fourier_series(problem, other.gait)
        if not any(are_one(one, here, problem.body, problem.law) for one in series):
            others.append(other)
    others.sort(key=lambda other: -other.value)
    n_starts = any_size.starts + large.starts
    return Exploration(tuple(optima), n_starts, tuple(others), any_size.left)


def _among_large(problem: Problem, finite: Iterate | None) -> Problem:
    """The problem among gaits as large as one of finite size; without one, as large as the default
    guess is, or as is usual."""
    if finite is None:
        stated = problem.with_(guess=None)
        size = min(OPTIONS.min_size, stated.guess.shape_speed)
        return stated.with_(smallest_shape_speed=max(size, problem.smallest_shape_speed))
    return problem.with_(smallest_shape_speed=finite.gait.shape_speed, guess=finite.gait)


def _explore(
    problem: Problem, starts: int | None, has_time: Callable[[], bool], ahead: Ahead
) -> Exploration:
    candidates, n_starts = multistart(problem, starts, has_time, ahead)
    if not candidates:
        limited = " that keeps the limits of its joints" if problem.path_limits.names else ""
        raise NotConvergedError(
            f"none of {n_starts} starts led to a gait of the class{limited}; give a guess."
        )
    ends = _follow_promising(problem, candidates, has_time, ahead)
    distinct: list[tuple[Iterate, Candidate]] = []
    for optimum, candidate in sorted(ends, key=lambda end: end[0].objective):
        twin = next((led for other, led in distinct if same_gait(problem, other, optimum)), None)
        if twin is None:
            distinct.append((optimum, candidate))
        else:
            twin.starts += candidate.starts
    left = [c for c in candidates if not any(c is followed for _, followed in ends)]
    met = [*distinct, *((c.iterate, c) for c in left)]
    others = (
        Alternative(o.value, o.delta, c.starts, on_speed_floor(problem, o.gait), o.gait)
        for o, c in met
    )
    return Exploration(
        tuple(optimum for optimum, _ in distinct),
        n_starts,
        tuple(others),
        tuple(c.iterate for c in left),
    )


def follow_rest(
    problem: Problem, explored: Exploration, has_time: Callable[[], bool]
) -> tuple[Iterate, ...]:
    """Optima at the final delta, best first, of the first of the gaits that were left."""
    ends: list[Iterate] = []
    left = explored.left[: OPTIONS.patience]
    for done, candidate in enumerate(itertools.takewhile(lambda _: has_time(), left)):
        active_run().report("follow", done, len(left))
        with suppress(CollocError):
            end = follow(problem, candidate)
            known = (*explored.optima, *ends)
            if is_member(end) and not any(same_gait(problem, end, other) for other in known):
                ends.append(end)
    return tuple(sorted(ends, key=lambda end: end.objective))


def starting_gaits(problem: Problem, seed: int = 0) -> Iterator[AnyGait]:
    """The guess, gaits known from three links and waves both ways, in turn with seeded Latin
    hypercubes, which have no end."""
    body, limit = problem.body, problem.joint_limit
    ellipses = [to_body(ellipse(*ab), Chain(), body, limit) for ab in _THREE_LINK_ELLIPSES]
    waves = [travelling_wave(body, limit, w) for w in (-1.0, 1.0)]
    first = [
        problem.guess,
        *(
            to_class(problem.gait.start_class, gait, body, limit, problem.smallest_shape_speed)
            for gait in (*ellipses, *waves)
        ),
    ]
    seeds = map(partial(latin_hypercube_gait, problem, seed), itertools.count())
    return itertools.chain(itertools.chain.from_iterable(zip(first, seeds, strict=False)), seeds)


def same_gait(problem: Problem, a: Iterate, b: Iterate) -> bool:
    """True if two gaits are one, modulo start phase and the symmetries of body and friction."""
    if abs(a.objective - b.objective) > SAME_VALUE * max(abs(a.objective), abs(b.objective)):
        return False  # before the paths are transformed
    one, other = ((each.objective, fourier_series(problem, each.gait)) for each in (a, b))
    return are_one(one, other, problem.body, problem.law)


def is_finite(iterate: Iterate) -> bool:
    """True if a person sees the gait move: it did not shrink."""
    return is_visible(iterate.gait)


def is_member(iterate: Iterate) -> bool:
    """True for a gait about in its class; the value of others means nothing."""
    return iterate.violation <= COARSE


def multistart(
    problem: Problem, starts: int | None, has_time: Callable[[], bool], ahead: Ahead
) -> tuple[list[Candidate], int]:
    """Candidates on a coarse mesh, best first, and the number of starts, at least one."""
    run = active_run()
    count = starts or OPTIONS.starts * (OPTIONS.max_starts if problem.regime.froude else 1)
    coarse = problem.with_(intervals=min(problem.intervals, problem.usual_intervals // 2))
    # gaits are compared where friction is nearly dry
    usual = min(problem.with_(delta_start=None).delta_start, problem.delta_start)
    first_deltas = problem.delta_start, OPTIONS.delta_ratio * usual
    deltas = [max(delta, problem.delta) for delta in first_deltas]
    # at which friction is as dry for a loop as slow as may be
    slowest = 1.0 if problem.gait.relative_delta else problem.smallest_shape_speed
    dry = max(deltas[-1] * slowest, problem.delta)
    with suppress(CollocError):  # something to show from the first second on
        guess = evaluate_at(*space_near(coarse, problem.guess), deltas[0])
        run.report("explore", 0, count, guess)
    levels: list[list[Candidate]] = [[] for _ in deltas]
    loops: list[Candidate] = []
    for loop in small_loops(problem):
        with suppress(CollocError):
            closed = project_to_zero_rotation(coarse, loop, dry)
            _descend_levels(coarse, closed, [dry], [loops], is_new=True)
    gaits = _Starts(problem, levels[-1])
    tried, improved, best, begin = 0, -OPTIONS.patience, 0.0, time.monotonic()

    def is_finished() -> bool:
        n_met = min(levels[-1], key=lambda c: c.iterate.objective).n_new if levels[-1] else 0
        sure = n_met >= max(OPTIONS.patience / 2, gaits.n_new / OPTIONS.patience)
        enough = tried >= count or (sure and not starts and 4 * tried >= count)
        if enough and tried > improved + OPTIONS.patience:
            return True
        # joints so weak that no gait keeps their limits, as it seems
        nothing = tried >= OPTIONS.patience and not levels[-1] and not loops
        return nothing and not starts and bool(problem.path_limits.names)

    while tried == 0 or (tried < OPTIONS.max_starts * count and not is_finished() and has_time()):
        ahead.begin((time.monotonic() - begin) / max(tried, 1) * (count - tried))
        later = range(tried, min(tried + 2 * ahead.count, OPTIONS.max_starts * count))
        for start, (gait, is_new) in gaits.peek(later):
            if ahead.takes(start):
                ahead.submit(sketch, coarse, gait, is_new, deltas)
        gait, is_new = gaits.take(tried)
        # a start that is no member of the class, or fails, is one start less
        with suppress(CollocError):
            ahead.wait_for(sketch, coarse, gait, is_new, deltas)
            _sketch(coarse, gait, is_new, deltas, levels)
        before, best = best, min((c.iterate.objective for c in levels[-1]), default=0.0)
        if tried > 0 and best < before - SAME_VALUE * abs(before):
            improved = tried
        tried += 1
        # as a rule loops shrink further on their way down
        shown = [*levels[-1], *loops] if problem.shrinking else levels[-1]
        run.report("explore", tried, max(tried, count), _best([c.iterate for c in shown]))

    for candidate in (ends := [*levels[-1], *loops]):
        candidate.dry_objective = objective_at(dry, candidate.iterate)
        candidate.is_loop = candidate in loops
    return sorted(ends, key=lambda c: c.dry_objective), tried


class _Starts:
    """Starts by number: sixteen new gaits take turns with as many hops from the best candidate.

    A start depends on what came before it alone: more starts go wherever fewer do.
    """

    def __init__(self, problem: Problem, candidates: list[Candidate]) -> None:
        self._problem, self._candidates = problem, candidates
        self._gaits, self._drawn = starting_gaits(problem), list[AnyGait | None]()
        self.n_new = 0

    def take(self, start: int) -> tuple[AnyGait | None, bool]:
        """The gait of a start, if there is one, and whether it is new."""
        gait, is_new = self._start(start, self.n_new)
        self.n_new += is_new
        return gait, is_new

    def peek(self, starts: range) -> Iterator[tuple[int, tuple[AnyGait | None, bool]]]:
        """The starts of some numbers as they are from what is known now."""
        numbers = self.n_new + np.cumsum([0, *map(_is_turn_of_new, starts)])
        for start, number in zip(starts, numbers, strict=False):
            yield start, self._start(start, int(number))

    def _start(self, start: int, number: int) -> tuple[AnyGait | None, bool]:
        if not _is_turn_of_new(start) and self._candidates:
            best = min((c.iterate for c in self._candidates), key=lambda each: each.objective)
            size = OPTIONS.hop * 2.0 ** (start % 3 - 1)
            rng = np.random.default_rng([1, start])
            return self._problem.gait.start_class.perturb(best.gait, size, 1, rng), False
        while len(self._drawn) <= number:
            self._drawn.append(None)
            with suppress(CollocError):
                self._drawn[-1] = next(self._gaits)
        return self._drawn[number], True


def _is_turn_of_new(start: int) -> bool:
    return start // (OPTIONS.starts // 2) % 2 == 0


def objective_at(delta: float, iterate: Iterate) -> float:
    """Objective of the gait at another delta; inf where there is no motion."""
    objective = ReducedProgram(iterate.space, delta).objective(iterate.v)
    return float(np.nan_to_num(objective, nan=np.inf))


def _best(iterates: Sequence[Iterate]) -> Iterate | None:
    """The best that may be the answer: of finite size, unless the problem asks for any."""
    return min(
        (each for each in iterates if each.problem.shrinking or is_finite(each)),
        key=lambda each: each.objective,
        default=None,
    )


def sketch(coarse: Problem, gait: AnyGait, is_new: bool, deltas: list[float]) -> None:
    """Compute a start ahead, as far as it meets no gait that this process has met."""
    _sketch(coarse, gait, is_new, deltas, _levels_here(coarse.smallest_shape_speed, *deltas))


@lru_cache(maxsize=1)
def _levels_here(smallest: float, *deltas: float) -> list[list[Candidate]]:
    return [[] for _ in deltas]


def _sketch(
    coarse: Problem,
    gait: AnyGait | None,
    is_new: bool,
    deltas: list[float],
    levels: list[list[Candidate]],
) -> None:
    """Optimise a new start at all deltas, a hop at the last."""
    if is_new and gait is not None:
        closed = project_to_zero_rotation(coarse, gait, deltas[0])
        _descend_levels(coarse, closed, deltas, levels, is_new=True)
    elif gait is not None:
        _descend_levels(coarse, gait, deltas[-1:], levels[-1:], is_new=False)


def _descend_levels(
    problem: Problem,
    gait: AnyGait,
    deltas: list[float],
    levels: list[list[Candidate]],
    *,
    is_new: bool,
) -> None:
    """Optimise a start at one delta after another until it meets a known candidate; add those that
    are not known."""
    space, v = space_near(problem, gait)
    before = None
    for delta, known in zip(deltas, levels, strict=True):
        iterate = optimise(space, v, delta, COARSE)
        if regularisation_dominated(iterate):
            continue  # as far as this delta goes, the start is as it was
        space, v = iterate.space, iterate.v
        if not is_member(iterate):
            continue
        met = next((c for c in known if same_gait(problem, c.iterate, iterate)), None)
        candidate = met or Candidate(iterate)
        if met is None:
            known.append(candidate)
        if before is not None:
            before.next = candidate
        candidate.count_start(is_new=is_new)
        if met is not None:
            return
        before = candidate


def _follow_promising(
    problem: Problem, candidates: list[Candidate], has_time: Callable[[], bool], ahead: Ahead
) -> list[tuple[Iterate, Candidate]]:
    """Promising candidates at the final delta, those close to the best on the whole mesh.

    Gaits of finite size may shrink on the way, so they are followed until one has not.
    """
    ends, left = list[tuple[Iterate, Candidate]](), list(candidates)

    def is_promising(candidate: Candidate) -> bool:
        # by what the best one promises, or has come to where it promised too much
        reached = min((optimum.objective for optimum, _ in ends), default=-np.inf)
        best = max(candidates[0].dry_objective, reached)
        return candidate.dry_objective <= best + (1 - OPTIONS.promising) * abs(best)

    def report() -> None:
        best = _best([optimum for optimum, _ in ends]) or _best([c.iterate for c in left])
        active_run().report("follow", len(candidates) - len(left), len(candidates), best)

    def add(candidate: Candidate) -> bool:
        """Follow a candidate to its end; return whether that is a new gait."""
        is_new = False
        left.remove(candidate)
        ahead.wait_for(follow, problem, candidate.iterate)
        with suppress(CollocError):
            end = follow(problem, candidate.iterate)
            if is_member(end):
                is_new = not any(same_gait(problem, end, other) for other, _ in ends)
                ends.append((end, candidate))
        report()
        return is_new

    report()
    queues = [[c for c in candidates if c.is_loop == is_loop] for is_loop in (False, True)]
    first = itertools.chain(*(queue[: OPTIONS.followed] for queue in queues))
    for number, candidate in enumerate(filter(is_promising, first)):
        if ahead.takes(number):
            ahead.submit(follow, problem, candidate.iterate)
    for queue in queues:
        n_new = 0  # candidates that differ may come to one gait
        for candidate in queue[: OPTIONS.patience]:
            wanted = n_new < OPTIONS.followed and is_promising(candidate)
            if wanted and (has_time() or not ends):
                n_new += add(candidate)
    for candidate in [c for c in left if is_finite(c.iterate)][: OPTIONS.patience]:
        if any(is_finite(optimum) for optimum, _ in ends) or (ends and not has_time()):
            break
        add(candidate)
    if not ends:
        raise NotConvergedError(
            "no gait could be followed to the final delta; start at a larger delta or give another "
            "guess."
        )
    best = min(optimum.objective for optimum, _ in ends)
    best_finite = min((optimum.objective for optimum, _ in ends if is_finite(optimum)), default=0.0)
    close, close_finite = (1 - OPTIONS.close) * best, (1 - OPTIONS.close) * best_finite
    for k, (optimum, candidate) in enumerate(ends):
        if optimum.objective <= (max(close, close_finite) if is_finite(optimum) else close):
            with suppress(CollocError):
                whole = optimise(*space_near(problem, optimum.gait), optimum.delta, MEDIUM)
                ends[k] = whole.after(optimum.history), candidate
    return ends


def follow(problem: Problem, iterate: Iterate) -> Iterate:
    """The gait at the final delta, on a mesh of half the interval."""
    edges = iterate.space.mesh.edges
    finer = np.sort(np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])]))
    space = space_of(problem, None, finer)
    v = space.parameters(iterate.gait)
    return descend(optimise(space, v, iterate.delta, MEDIUM))
