"""The best gait, not the nearest one: many starts, cheaply told apart, the promising ones followed to the end.

A start is first followed on a coarse mesh down to a delta at which friction is nearly dry. Where it meets a gait that an
earlier start came through, at the same delta, it goes on as that one did, and is dropped. After every sixteen new starts
come as many hops: the best gait so far, shaken (Wales and Doye, J. Phys. Chem. A 101, 1997). Beside them are a few small
loops (`colloc.search.small_starts`), slow and so followed at a smaller delta only. What is left is sorted by its value at that
one; the first few of both are followed to the final delta, and the best of those is refined, answered and certified.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.guesses import travelling_wave
from colloc.gaits.harmonic import Fourier, ellipse, harmonics_within
from colloc.gaits.path_samples import fourier_through
from colloc.gaits.problem import Problem
from colloc.gaits.starts import laid_into, latin_hypercube_gait, on_speed_floor, over_links, seed_class
from colloc.mechanics.chain import Chain
from colloc.reduced.closure import closed_gait
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.reduced.spaces import space_about, space_near
from colloc.results.distinct_optima import distance
from colloc.results.steps import Alternative, SearchStep
from colloc.search.reduced_search import (
    FIRST_RADIUS,
    NEXT_RADIUS,
    ROUGH,
    VERY_ROUGH,
    Found,
    descended,
    is_viscous,
    settled_apart,
)
from colloc.search.small_starts import small_loops
from colloc.system.errors import CollocError, NotConvergedError

STARTS = 32
_FEWEST = 12
"""Intervals of a coarse mesh, at least."""
_NEARLY_DRY = 0.2
"""Where starts are compared, besides the problem's first delta: at this share of the usual first one, or of a smaller one."""
_SAME_EFFICIENCY, _SAME_GAIT = 1e-3, 0.05
_BROKEN = 1e-2
"""Violation of a row beyond which a gait is not compared with others."""
_FOLLOWED, _FOLLOWED_LOOPS, _PROMISING, _CLOSE = 3, 2, 0.8, 0.01
"""How many gaits are followed to the final delta, and of those from small loops; the share of the best value that they need at
the coarse one, and how far they may be from the best at the final one to be optimised on the whole mesh."""
_TURN, _HOP_SIZES, _HOP_SEED = 16, (0.2, 0.4, 0.8), 1
"""Starts and hops from the best gait known take turns of so many, and how far hops go [rad], in turn. At 0.2 a hop mostly falls
back, at 0.8 it lands where any start would; which of them leads on differs from problem to problem. What start k is depends on
what came before alone: more starts go wherever fewer do."""
_LOOP = -1
"""In place of the number of a start."""
_PATIENCE, _MOST = 8, 3
"""The search goes on until so many in a row have led nowhere better; at most so many times the starts asked for are tried."""
_SPARE = 8
"""Gaits of finite size that are followed at most, until one has not shrunk."""
_ROUNDS = 3
"""Of moving the checks at each delta, where a gait is followed: refinement goes on from there."""
_KNOWN = ((0.0, 2.86, 1.30), (1.11, 0.67, 1.12))
"""The two best ellipses of three equal links under isotropic friction."""
_HARMONICS = 8


Watch = Callable[[SearchStep], object]


@dataclass(eq=False)
class Candidate:
    """A gait that one or more starts came through, where it led, its objective at a delta that is small for all, and whether it
    came from small loops."""

    found: Found
    dry: float = np.inf
    small: bool = False
    starts: list[int] = field(default_factory=list)
    then: Candidate | None = None

    def joined(self, start: int) -> None:
        """Another start came here, and will go where this one went."""
        at: Candidate | None = self
        while at is not None:
            at.starts.append(start)
            at = at.then


def starting_gaits(problem: Problem, seed: int = 0) -> Iterator[AnyGait]:
    """The guess, gaits known from three links, waves both ways, then seeded Latin hypercubes without end."""
    body, limit = problem.body, problem.joint_limit
    known = [over_links(ellipse(*numbers), Chain(), body, limit) for numbers in _KNOWN]
    waves = [travelling_wave(body, limit, w) for w in (-1.0, 1.0)]
    own = seed_class(problem)
    first = [problem.guess, *(laid_into(own, gait, body, limit, problem.smallest_shape_speed) for gait in (*known, *waves))]
    # known gaits and seeds take turns: neither are always better
    seeds = map(partial(latin_hypercube_gait, problem, seed), itertools.count())
    return itertools.chain(itertools.chain.from_iterable(zip(first, seeds, strict=False)), seeds)


def same_gait(problem: Problem, a: Found, b: Found) -> bool:
    """Whether two gaits are one, modulo start phase and the symmetries of body and friction."""
    if abs(a.objective - b.objective) > _SAME_EFFICIENCY * max(abs(a.objective), abs(b.objective)):
        return False
    one, other = (fourier_through(f.gait, harmonics_within(_HARMONICS, problem.gait.symmetry)) for f in (a, b))
    return distance(one, other, problem.body, problem.friction) < _SAME_GAIT


def candidates(problem: Problem, count: int, goes_on: Callable[[], bool], watch: Watch) -> tuple[list[Candidate], int]:
    """What the starts lead to on a coarse mesh, best first, and how many were tried, at least one."""
    coarse = problem.with_(intervals=min(problem.intervals, max(problem.gait.coarse_intervals(problem.body.n_joint), _FEWEST)))
    usual = min(problem.with_(delta_start=None).delta_start, problem.delta_start)  # compared where friction is nearly dry
    deltas = [max(delta, problem.delta) for delta in (problem.delta_start, _NEARLY_DRY * usual)]
    # where friction is as dry for a loop as slow as may be
    dry = max(deltas[-1] * (1.0 if problem.gait.unit_speed else problem.smallest_shape_speed), problem.delta)
    known: list[list[Candidate]] = [[] for _ in deltas]
    small: list[Candidate] = []
    for loop in small_loops(problem):
        with suppress(CollocError):
            _follow(*space_about(coarse, closed_gait(coarse, loop, dry)), _LOOP, [dry], [small])
    starts, last, tried, best = starting_gaits(problem), count - 1, 0, 0.0
    while tried == 0 or (tried <= min(last, _MOST * count - 1) and goes_on()):
        start, tried = tried, tried + 1
        # a start that is no member of the class, or fails, is one start less
        with suppress(CollocError):
            if start // _TURN % 2 == 0 or not known[-1]:
                _follow(*space_about(coarse, closed_gait(coarse, next(starts), deltas[0])), start, deltas, known)
            else:
                shaken = _shaken(problem, min((c.found for c in known[-1]), key=lambda f: f.objective).gait, start)
                _follow(*space_about(coarse, shaken), start, deltas[-1:], known[-1:])
        before, best = best, min((c.found.objective for c in known[-1]), default=0.0)
        if start > 0 and best < before - _SAME_EFFICIENCY * abs(before):
            last = max(last, start + _PATIENCE)
        watch(_step("starts", tried, max(tried, count), [c.found for c in (*known[-1], *small)]))

    for candidate in (ends := [*known[-1], *small]):
        candidate.dry, candidate.small = objective_at(dry, candidate.found), candidate in small
    return sorted(ends, key=lambda c: c.dry), tried


def objective_at(delta: float, found: Found) -> float:
    """Minus the value of a gait at another delta, as it is; inf where it has none."""
    return float(np.nan_to_num(ReducedProgram(found.space, delta).objective(found.v), nan=np.inf))


def _shaken(problem: Problem, gait: AnyGait, number: int) -> AnyGait:
    """The Fourier series of a gait with every coefficient moved by chance: where the next hop from basin to basin lands."""
    own, rng = seed_class(problem), np.random.default_rng([_HOP_SEED, number])
    series = fourier_through(gait, own)
    size = _HOP_SIZES[number % len(_HOP_SIZES)]
    falling = size / np.arange(1, series.cos.shape[1] + 1)
    moved = Fourier(
        series.mean + size * rng.normal(size=series.mean.shape),
        series.cos + falling * rng.normal(size=series.cos.shape),
        series.sin + falling * rng.normal(size=series.sin.shape),
    )
    return own.fourier(own.parameters(moved), problem.body.n_joint)


def _step(what: str, done: int, count: int, found: Sequence[Found]) -> SearchStep:
    best = min(found, key=lambda f: f.objective, default=None)
    return SearchStep(what, done, count, np.nan if best is None else -best.objective, np.nan if best is None else best.delta)


def _follow(space: SearchSpace, v: np.ndarray, start: int, deltas: list[float], known: list[list[Candidate]]) -> None:
    """Follow a start through the deltas until it comes through a known gait; what it finds is added to the known ones."""
    problem = space.problem
    before, radius = None, FIRST_RADIUS
    for delta, here in zip(deltas, known, strict=True):
        found = settled_apart(space, v, delta, radius, VERY_ROUGH)
        if is_viscous(found):
            continue  # as far as this delta goes, the start is as it was
        space, v, radius = found.space, found.v, NEXT_RADIUS
        if found.conditions.violation > _BROKEN:
            continue  # no member of the class yet, whatever its value
        at = next((c for c in here if same_gait(problem, c.found, found)), None)
        new = at is None
        if at is None:
            at = Candidate(found)
            here.append(at)
        if before is not None:
            before.then = at
        at.joined(start)
        if not new:
            return
        before = at


@dataclass(frozen=True, eq=False)
class Chosen:
    """The best of many starts at the final delta, before their meshes are refined.

    Attributes
    ----------
    contenders : list of list of Found
        Distinct gaits at the final delta, best first, each by the levels that led there.
    starts : int
        Tried in all.
    others : tuple of Alternative
        All distinct gaits, the best contender first.
    finite : list of list of Found
        Contenders of finite size, where the best one is as small as the bound on the shape speed allows.
    """

    contenders: list[list[Found]]
    starts: int
    others: tuple[Alternative, ...]
    finite: list[list[Found]]


def best_of(problem: Problem, count: int, seconds: float = np.inf, watch: Watch = lambda step: None) -> Chosen:
    """The most efficient gait that so many starts lead to.

    Parameters
    ----------
    problem : Problem
    count : int
        Of starts, at least: they go on while they lead on, to three times as many at most.
    seconds : float
        Wall time after which no other start is begun and no other gait is followed.
    watch : callable
        Called with a `colloc.results.steps.SearchStep` after every start and every gait that was followed.

    Raises
    ------
    NotConvergedError
        If no start leads anywhere.
    """
    begin = time.perf_counter()

    def goes_on() -> bool:
        return time.perf_counter() - begin < seconds

    known, tried = candidates(problem, count, goes_on, watch)
    if not known:
        raise NotConvergedError("no start led to any gait of the class; give a guess.")
    ends: list[tuple[Candidate, list[Found]]] = []

    def is_finite(found: Found) -> bool:
        return not on_speed_floor(problem, found.gait)

    least = -known[0].dry - (1 - _PROMISING) * abs(known[0].dry)
    # gaits of finite size may shrink on the way, so they are followed until one has not
    promising = [c for c in known if -c.dry >= least]
    queue = [c for c in promising if not c.small][:_FOLLOWED] + [c for c in promising if c.small][:_FOLLOWED_LOOPS]
    spare = [c for c in known if is_finite(c.found) and c not in queue][:_SPARE]
    for number, candidate in enumerate((*queue, *spare), 1):
        if (ends and not goes_on()) or (candidate in spare and any(is_finite(levels[-1]) for _, levels in ends)):
            break
        with suppress(CollocError):
            ends.append((candidate, _followed(problem, candidate.found)))
        watch(_step("gaits", number, len(queue) + len(spare), [levels[-1] for _, levels in ends]))
    if not ends:
        raise NotConvergedError("no gait could be followed to the final delta; start at a larger delta or give another guess.")
    close = (1 - _CLOSE) * min(levels[-1].objective for _, levels in ends)
    finite_close = (1 - _CLOSE) * min((levels[-1].objective for _, levels in ends if is_finite(levels[-1])), default=0.0)
    for _, levels in ends:
        last = levels[-1]
        if last.objective <= close or (is_finite(last) and last.objective <= finite_close):
            with suppress(CollocError):
                levels.append(settled_apart(*space_near(problem, last.gait), last.delta, NEXT_RADIUS, ROUGH, rounds=_ROUNDS))
    ends.sort(key=lambda end: end[1][-1].objective)
    distinct: list[tuple[list[Found], list[int]]] = []
    for candidate, levels in ends:
        twin = next((starts for known, starts in distinct if same_gait(problem, known[-1], levels[-1])), None)
        if twin is None:
            distinct.append((levels, list(candidate.starts)))
        else:
            twin.extend(candidate.starts)
    followed = [_alternative(problem, levels[-1], starts) for levels, starts in distinct]
    dropped = [_alternative(problem, c.found, c.starts) for c in known if not any(c is done for done, _ in ends)]
    contenders = [levels for levels, _ in distinct]
    finite = [] if is_finite(contenders[0][-1]) else [levels for levels in contenders if is_finite(levels[-1])]
    return Chosen(contenders, tried, (*followed, *dropped), finite)


def _followed(problem: Problem, found: Found) -> list[Found]:
    """Levels down to the final delta, with a free path's few arcs, on a mesh that resolves more."""
    edges = found.space.phase_mesh(found.gait).edges
    finer = np.sort(np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])]))
    space, v = space_near(problem, found.gait, finer)
    levels = [settled_apart(space, v, found.delta, NEXT_RADIUS, ROUGH, rounds=_ROUNDS)]
    descended(levels[0], problem, levels.append, _ROUNDS)
    return levels


def _alternative(problem: Problem, found: Found, starts: list[int]) -> Alternative:
    return Alternative(-found.objective, found.delta, len(starts), on_speed_floor(problem, found.gait), found.gait)
