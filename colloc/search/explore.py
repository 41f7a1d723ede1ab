"""Where a search begins: many starts, cheaply told apart, the promising ones followed to the final
delta.

A start is first followed on a coarse mesh down to a delta at which friction is nearly dry. Where it
meets a gait that an earlier start came through, at the same delta, it goes on as that one did, and
is dropped. After every sixteen new starts come as many hops: the best gait so far, shaken (Wales
and Doye, J. Phys. Chem. A 101, 1997). Beside them are a few small loops
(`colloc.search.small_starts`), slow and so followed at a smaller delta only. What is left is sorted
by its value at that one; the first few of both are followed to the final delta.
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
from colloc.gaits.guesses import travelling_wave
from colloc.gaits.harmonic import ellipse
from colloc.gaits.problem import Problem
from colloc.gaits.starts import (
    is_visible,
    laid_into,
    latin_hypercube_gait,
    on_speed_floor,
    over_links,
)
from colloc.mechanics.chain import Chain
from colloc.reduced.program import ReducedProgram
from colloc.results.answer import Alternative
from colloc.results.distinct_optima import SAME_VALUE, are_one, fourier_series
from colloc.search.closure import closed_gait
from colloc.search.converge import as_it_is, converged
from colloc.search.descend import FACTOR, descend, is_viscous, levels
from colloc.search.effort import FINE, ROUGH, SKETCH
from colloc.search.helpers import Helpers, helping
from colloc.search.optimum import Optimum
from colloc.search.run import this_run
from colloc.search.small_starts import small_loops
from colloc.search.spaces import space_near, space_of
from colloc.system.errors import CollocError, NotConvergedError

STARTS, ENOUGH, _MOST = 32, 8, 3
"""Starts where no number is asked for, or fewer, a quarter of them at least, once one new start in
so many that are enough, and half as many, met the best gait. The search goes on until enough in a
row have led nowhere better, and ends at so many times the starts. With inertia, which makes many
more gaits, as many times are asked for: of 16 problems of `benchmarks.zoo` with inertia (1, 8, 15,
..., 99 less 29, 82, 93) 32 starts come within 1 % of 128 on the coarse mesh in 11; with these rules
78 do in all."""
FOLLOWED, PROMISING, CLOSE = 3, 0.8, 0.01
"""How many different gaits those that are followed to the final delta may come to, and small loops;
the share of the best value that they need at the coarse one, and how far they may be from the best
at the final one to be optimised on the whole mesh."""
_HOP = 0.4
"""How far hops from the best gait known go [rad], in turn half as far, as far and twice as far;
half as many as usual starts take turns with as many hops. At 0.2 a hop mostly falls back, at 0.8 it
lands where any start would; which of them leads on differs from problem to problem. What start k is
depends on what came before alone: more starts go wherever fewer do."""
_SIZE = 0.5
"""Least root-mean-square shape speed searched where no optimum is of finite size: five joints that
swing by 18 degrees."""
_KNOWN = ((0.0, 2.86, 1.30), (1.11, 0.67, 1.12))
"""The two best ellipses of three equal links under isotropic friction: without them one harmonic of
other bodies is missed at times, as that of `problems/purcell.py`."""


@dataclass(eq=False)
class Candidate:
    """A gait that one or more starts came through."""

    optimum: Optimum
    starts: int = 0
    met: int = 0
    """Starts without hops, which go round near the best gait."""
    leads_to: Candidate | None = None
    """Where they went from here, at the next delta."""
    dry: float = np.inf
    """Its objective at a delta that is small for all."""
    is_loop: bool = False

    def joined(self, *, hop: bool) -> None:
        """Another start came here, and will go where this one went."""
        at: Candidate | None = self
        while at is not None:
            at.starts += 1
            at.met += not hop
            at = at.leads_to


@dataclass(frozen=True, eq=False)
class Exploration:
    """What many starts led to.

    Attributes
    ----------
    optima : tuple of Optimum
        Distinct gaits at the final delta, best first, before their meshes are refined.
    starts : int
        Tried in all.
    others : tuple of Alternative
        All distinct gaits met, the best first.
    left : tuple of Optimum
        Gaits at a larger delta that nobody followed further, the most promising first (see
        `followed_further`).
    failure : str
        Why the starts led nowhere, where the guess alone is left.
    """

    optima: tuple[Optimum, ...]
    starts: int
    others: tuple[Alternative, ...] = ()
    left: tuple[Optimum, ...] = ()
    failure: str = ""


def begin_at(problem: Problem, gait: AnyGait) -> Optimum:
    """The optimum at the first delta that the search comes to from a gait; where that is a viscous
    one, at the next delta.

    A gait that is nearly an optimum at the problem's delta is not led there from a larger one: it
    begins there.
    """
    if not problem.gait.free:
        return converged(*space_near(problem, gait), problem.delta, FINE)
    near = _at_the_end(problem, gait)
    if near is not None:
        return near
    space, v = space_near(problem, closed_gait(problem, gait, problem.delta_start))
    this_run().told("explore", 0, 1, as_it_is(space, v, problem.delta_start))
    for delta in levels(problem, problem.delta_start):
        found = converged(space, v, delta, ROUGH)
        if not is_viscous(found):
            break
    return found


def _at_the_end(problem: Problem, gait: AnyGait) -> Optimum | None:
    """The optimum at the problem's delta that a gait is a sketch of, if it is one: nearer than that
    [rad]."""
    space, v = space_near(problem, gait)
    here, near = as_it_is(space, v, problem.delta), SKETCH.kkt_error
    steep = here.kkt_error * near > CLOSE * abs(here.objective)
    if steep or not here.violation < near or problem.delta == problem.delta_start:
        return None
    with suppress(NotConvergedError):
        found = here if here.optimal else converged(space, v, problem.delta, ROUGH)
        if found.optimal and np.abs(found.v - v).max() < near and not is_viscous(found):
            return found
    return None


def explore(
    problem: Problem, starts: int | None = None, goes_on: Callable[[], bool] = lambda: True
) -> Exploration:
    """The best gaits of a problem's class that many starts lead to.

    Where they shrink until nobody sees them move, the search begins anew among gaits that are as
    large as the best optimum of finite size, at least (`smallest_shape_speed`). What is better
    there than that one is among the gaits returned.

    Parameters
    ----------
    problem : Problem
    starts : int, optional
        At least so many: they go on while they lead on, to three times as many at most. By default
        32, with inertia 96, or fewer once some of them have met the best gait.
    goes_on : callable
        Whether there is time for another start, and another gait to be followed.

    Returns
    -------
    Exploration

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
    with helping(problem) as helpers:
        found = _explored(problem, starts, goes_on, helpers)
        if problem.shrinking or is_finite(found.optima[0]) or not goes_on():
            return found
        finite = next((optimum for optimum in found.optima if is_finite(optimum)), None)
        try:
            large = _explored(_as_large(problem, finite), starts, goes_on, helpers)
        except CollocError:
            return found  # nothing moves as much
    # the first one has a size of its own, which counts for something
    enough = (1 + CLOSE) * finite.objective if finite else 0.0
    better = [
        optimum for optimum in large.optima if is_finite(optimum) and optimum.objective < enough
    ]
    optima = sorted([*found.optima, *better], key=lambda optimum: optimum.objective)
    known = [(other.value, fourier_series(problem, other.gait)) for other in found.others]
    others = list(found.others)
    for other in large.others:
        here = other.value, fourier_series(problem, other.gait)
        if not any(are_one(one, here, problem.body, problem.law) for one in known):
            others.append(other)
    others.sort(key=lambda other: -other.value)
    return Exploration(tuple(optima), found.starts + large.starts, tuple(others), found.left)


def _as_large(problem: Problem, finite: Optimum | None) -> Problem:
    """The problem among gaits as large as one of finite size; without one, as large as is usual, or
    the usual first gait is."""
    if finite is None:
        usual = problem.with_(guess=None)
        return usual.with_(
            smallest_shape_speed=max(
                min(_SIZE, usual.guess.shape_speed), problem.smallest_shape_speed
            )
        )
    return problem.with_(smallest_shape_speed=finite.gait.shape_speed, guess=finite.gait)


def _explored(
    problem: Problem, starts: int | None, goes_on: Callable[[], bool], helpers: Helpers
) -> Exploration:
    """What starts lead to, of whatever size."""
    known, tried = candidates(problem, starts, goes_on, helpers)
    if not known:
        kept = " that keeps the limits of its joints" if problem.path_limits.names else ""
        raise NotConvergedError(
            f"none of {tried} starts led to a gait of the class{kept}; give a guess."
        )
    ends = _followed_to_the_end(problem, known, goes_on, helpers)
    distinct: list[tuple[Optimum, Candidate]] = []
    for optimum, candidate in sorted(ends, key=lambda end: end[0].objective):
        twin = next((led for other, led in distinct if same_gait(problem, other, optimum)), None)
        if twin is None:
            distinct.append((optimum, candidate))
        else:
            twin.starts += candidate.starts
    followed = [_alternative(problem, optimum, led.starts) for optimum, led in distinct]
    left = [c for c in known if not any(c is done for _, done in ends)]
    others = *followed, *(_alternative(problem, c.optimum, c.starts) for c in left)
    return Exploration(
        tuple(optimum for optimum, _ in distinct), tried, others, tuple(c.optimum for c in left)
    )


def followed_further(
    problem: Problem, explored: Exploration, goes_on: Callable[[], bool]
) -> tuple[Optimum, ...]:
    """What the first of the gaits left over lead to at the final delta, best first, where none of
    those followed will do."""
    ends: list[Optimum] = []
    left = explored.left[:ENOUGH]
    for done, optimum in enumerate(itertools.takewhile(lambda _: goes_on(), left)):
        this_run().told("follow", done, len(left))
        with suppress(CollocError):
            end = _followed(problem, optimum)
            if _is_member(end) and not any(
                same_gait(problem, end, other) for other in (*explored.optima, *ends)
            ):
                ends.append(end)
    return tuple(sorted(ends, key=lambda end: end.objective))


def starting_gaits(problem: Problem, seed: int = 0) -> Iterator[AnyGait]:
    """The guess, gaits known from three links, waves both ways, then seeded Latin hypercubes
    without end."""
    body, limit = problem.body, problem.joint_limit
    known = [over_links(ellipse(*numbers), Chain(), body, limit) for numbers in _KNOWN]
    waves = [travelling_wave(body, limit, w) for w in (-1.0, 1.0)]
    own = problem.gait.seeds
    first = [
        problem.guess,
        *(
            laid_into(own, gait, body, limit, problem.smallest_shape_speed)
            for gait in (*known, *waves)
        ),
    ]
    # known gaits and seeds take turns: neither are always better
    seeds = map(partial(latin_hypercube_gait, problem, seed), itertools.count())
    return itertools.chain(itertools.chain.from_iterable(zip(first, seeds, strict=False)), seeds)


def same_gait(problem: Problem, a: Optimum, b: Optimum) -> bool:
    """Whether two gaits are one, modulo start phase and the symmetries of body and friction."""
    if abs(a.objective - b.objective) > SAME_VALUE * max(abs(a.objective), abs(b.objective)):
        return False  # before the paths are transformed
    one, other = ((f.objective, fourier_series(problem, f.gait)) for f in (a, b))
    return are_one(one, other, problem.body, problem.law)


def candidates(
    problem: Problem, asked: int | None, goes_on: Callable[[], bool], helpers: Helpers
) -> tuple[list[Candidate], int]:
    """What the starts lead to on a coarse mesh, best first, and how many were tried, at least
    one."""
    run, count = this_run(), asked or STARTS * (_MOST if problem.regime.froude else 1)
    coarse = problem.with_(
        intervals=min(problem.intervals, problem.gait.intervals(problem.body.n_joint) // 2)
    )
    # compared where friction is nearly dry
    usual = min(problem.with_(delta_start=None).delta_start, problem.delta_start)
    deltas = [max(delta, problem.delta) for delta in (problem.delta_start, FACTOR * usual)]
    # where friction is as dry for a loop as slow as may be
    dry = max(
        deltas[-1] * (1.0 if problem.gait.relative_delta else problem.smallest_shape_speed),
        problem.delta,
    )
    with suppress(CollocError):  # something to show from the first second on
        run.told("explore", 0, count, as_it_is(*space_near(coarse, problem.guess), deltas[0]))
    known: list[list[Candidate]] = [[] for _ in deltas]
    loops: list[Candidate] = []
    for loop in run.kept("small loops", (problem,), lambda: small_loops(problem)):
        with suppress(CollocError):
            _follow(coarse, _closed(coarse, loop, dry), [dry], [loops])
    starts, drawn = starting_gaits(problem), list[AnyGait | None]()
    used, tried, better, best, begin = 0, 0, -ENOUGH, 0.0, time.monotonic()

    def knows() -> bool:
        sure = 4 * tried >= count and _met_best(known[-1]) >= max(ENOUGH / 2, used / ENOUGH)
        return (tried >= count or (sure and not asked)) and tried > better + ENOUGH

    def begun(start: int, number: int) -> tuple[AnyGait | None, bool]:
        """Where a start begins, if anywhere: at the next new gait, of that number, or at a hop; and
        whether it is new."""
        if not _is_new(start) and known[-1]:
            return _shaken(
                problem, min((c.optimum for c in known[-1]), key=lambda f: f.objective).gait, start
            ), False
        while len(drawn) <= number:
            drawn.append(None)
            with suppress(CollocError):
                drawn[-1] = next(starts)
        return drawn[number], True

    def is_hopeless() -> bool:
        """Whether the joints are so weak that no gait keeps their limits, as it seems."""
        nothing = tried >= ENOUGH and not known[-1] and not loops
        return nothing and not asked and bool(problem.path_limits.names)

    while tried == 0 or (tried < _MOST * count and not knows() and not is_hopeless() and goes_on()):
        helpers.begin((time.monotonic() - begin) / max(tried, 1) * (count - tried))
        ahead = range(tried, min(tried + 2 * helpers.count, _MOST * count))
        for start, number in zip(ahead, used + np.cumsum([0, *map(_is_new, ahead)]), strict=False):
            if helpers.has(start):
                helpers.ask(sketched, coarse, *begun(start, int(number)), deltas)
        start, tried = tried, tried + 1
        gait, is_new = begun(start, used)
        used += is_new
        # a start that is no member of the class, or fails, is one start less
        with suppress(CollocError):
            helpers.await_for(sketched, coarse, gait, is_new, deltas)
            _sketch(coarse, gait, is_new, deltas, known)
        before, best = best, min((c.optimum.objective for c in known[-1]), default=0.0)
        if start > 0 and best < before - SAME_VALUE * abs(before):
            better = start
        # as a rule loops shrink further on their way down
        shown = [*known[-1], *loops] if problem.shrinking else known[-1]
        run.told("explore", tried, max(tried, count), _best([c.optimum for c in shown]))

    for candidate in (ends := [*known[-1], *loops]):
        candidate.dry, candidate.is_loop = objective_at(dry, candidate.optimum), candidate in loops
    return sorted(ends, key=lambda c: c.dry), tried


def objective_at(delta: float, optimum: Optimum) -> float:
    """Minus the value of a gait at another delta, as it is; inf where it has none."""
    return float(
        np.nan_to_num(ReducedProgram(optimum.space, delta).objective(optimum.v), nan=np.inf)
    )


def _met_best(candidates: Sequence[Candidate]) -> int:
    """How many starts, without hops, met the best gait so far."""
    best = min(candidates, key=lambda c: c.optimum.objective, default=None)
    return 0 if best is None else best.met


def _best(optima: Sequence[Optimum]) -> Optimum | None:
    """The best that may be the answer while others are known: of finite size, unless the problem
    asks for any."""
    return min(
        (f for f in optima if f.problem.shrinking or is_finite(f)),
        key=lambda f: f.objective,
        default=None,
    )


def _shaken(problem: Problem, gait: AnyGait, number: int) -> AnyGait:
    """What stands for a gait with every coefficient moved by chance: where the next hop from basin
    to basin lands."""
    size = _HOP * 2.0 ** (number % 3 - 1)
    return problem.gait.seeds.moved(gait, size, 1, np.random.default_rng([1, number]))


def _is_new(start: int) -> bool:
    """Half as many as usual starts take turns with as many hops."""
    return start // (STARTS // 2) % 2 == 0


def sketched(coarse: Problem, gait: AnyGait, is_new: bool, deltas: list[float]) -> None:
    """What a start comes through, for the run that keeps it; as far as no earlier one of this
    process has come through it."""
    _sketch(coarse, gait, is_new, deltas, _met_here(coarse.smallest_shape_speed, *deltas))


@lru_cache(maxsize=1)
def _met_here(smallest: float, *deltas: float) -> list[list[Candidate]]:
    return [[] for _ in deltas]


def _sketch(
    coarse: Problem,
    gait: AnyGait | None,
    is_new: bool,
    deltas: list[float],
    known: list[list[Candidate]],
) -> None:
    """Follow a new start through all deltas, a hop through the last."""
    if is_new and gait is not None:
        _follow(coarse, _closed(coarse, gait, deltas[0]), deltas, known)
    elif gait is not None:
        _follow(coarse, gait, deltas[-1:], known[-1:], hop=True)


def _closed(coarse: Problem, gait: AnyGait, delta: float) -> AnyGait:
    return this_run().kept("begin", (coarse, gait, delta), lambda: closed_gait(coarse, gait, delta))


def _follow(
    problem: Problem,
    gait: AnyGait,
    deltas: list[float],
    known: list[list[Candidate]],
    *,
    hop: bool = False,
) -> None:
    """Follow a start through the deltas until it comes through a known gait; what it finds is added
    to the known ones."""
    space, v = space_near(problem, gait)
    before = None
    for delta, here in zip(deltas, known, strict=True):
        found = converged(space, v, delta, SKETCH)
        if is_viscous(found):
            continue  # as far as this delta goes, the start is as it was
        space, v = found.space, found.v
        if not _is_member(found):
            continue
        at = next((c for c in here if same_gait(problem, c.optimum, found)), None)
        new = at is None
        if at is None:
            at = Candidate(found)
            here.append(at)
        if before is not None:
            before.leads_to = at
        at.joined(hop=hop)
        if not new:
            return
        before = at


def _is_member(found: Optimum) -> bool:
    """Whether a gait is one of its class, about; else its value means nothing."""
    return found.violation <= SKETCH.kkt_error


def is_finite(optimum: Optimum) -> bool:
    """Whether a person sees the gait move, and it did not shrink."""
    return is_visible(optimum.gait)


def _followed_to_the_end(
    problem: Problem, known: list[Candidate], goes_on: Callable[[], bool], helpers: Helpers
) -> list[tuple[Optimum, Candidate]]:
    """The promising ones at the final delta, those close to the best on the whole mesh.

    Gaits of finite size may shrink on the way, so they are followed until one has not.
    """
    run, ends, left, new = this_run(), list[tuple[Optimum, Candidate]](), list(known), list[bool]()

    def promising(candidate: Candidate) -> bool:
        """By what the best one promises; or has come to, where it promised too much."""
        best = max(known[0].dry, min((optimum.objective for optimum, _ in ends), default=-np.inf))
        return candidate.dry <= best + (1 - PROMISING) * abs(best)

    def follow(candidate: Candidate) -> None:
        left.remove(candidate)
        helpers.await_for(_followed, problem, candidate.optimum)
        with suppress(CollocError):
            end = _followed(problem, candidate.optimum)
            if _is_member(end):
                new.append(not any(same_gait(problem, end, other) for other, _ in ends))
                ends.append((end, candidate))
        tell()

    def tell() -> None:
        best = _best([optimum for optimum, _ in ends]) or _best([c.optimum for c in left])
        run.told("follow", len(known) - len(left), len(known), best)

    tell()
    queues = [c for c in known if not c.is_loop], [c for c in known if c.is_loop]
    for number, candidate in enumerate(
        filter(promising, itertools.chain(*(queue[:FOLLOWED] for queue in queues)))
    ):
        if helpers.has(number):
            helpers.ask(_followed, problem, candidate.optimum)
    for queue in queues:
        new = list[bool]()  # sketches may be told apart that come to one gait
        for candidate in queue[:ENOUGH]:
            if sum(new) < FOLLOWED and promising(candidate) and (goes_on() or not ends):
                follow(candidate)
    for candidate in [c for c in left if is_finite(c.optimum)][:ENOUGH]:
        if any(is_finite(optimum) for optimum, _ in ends) or (ends and not goes_on()):
            break
        follow(candidate)
    if not ends:
        raise NotConvergedError(
            "no gait could be followed to the final delta; start at a larger delta or give another "
            "guess."
        )
    best = min(optimum.objective for optimum, _ in ends)
    best_finite = min((optimum.objective for optimum, _ in ends if is_finite(optimum)), default=0.0)
    close = (1 - CLOSE) * best, (1 - CLOSE) * best_finite
    for k, (optimum, candidate) in enumerate(ends):
        if optimum.objective <= close[0] or (is_finite(optimum) and optimum.objective <= close[1]):
            with suppress(CollocError):
                whole = converged(*space_near(problem, optimum.gait), optimum.delta, ROUGH)
                ends[k] = whole.after(*optimum.history), candidate
    return ends


def _followed(problem: Problem, optimum: Optimum) -> Optimum:
    """The gait at the final delta, on a mesh that resolves more."""
    edges = optimum.space.mesh.edges
    finer = np.sort(np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])]))
    space = space_of(problem, None, finer)
    v = space.parameters(optimum.gait)
    return descend(converged(space, v, optimum.delta, ROUGH))


def _alternative(problem: Problem, optimum: Optimum, starts: int) -> Alternative:
    return Alternative(
        optimum.value, optimum.delta, starts, on_speed_floor(problem, optimum.gait), optimum.gait
    )
