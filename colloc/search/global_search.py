"""The best gait, not the nearest one: many starts, cheaply told apart, the promising ones followed to the end.

A start is first followed on a coarse mesh down to a delta at which friction is nearly dry. Where it meets a gait that an
earlier start came through, at the same delta, it goes on as that one did, and is dropped. What is left is sorted by its value;
the first few are followed to the final delta, and the best of those is refined, answered and certified.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain, islice

import numpy as np

from colloc.gaits.equivalence import distance
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.guesses import travelling_wave
from colloc.gaits.harmonic import Harmonic, ellipse
from colloc.gaits.laid_gaits import laid_into, over_links
from colloc.gaits.path_samples import fourier_through
from colloc.gaits.problem import Problem
from colloc.gaits.sampling import latin_hypercube_gait, on_speed_floor, seed_class
from colloc.mechanics.body import Chain
from colloc.reduced.closure import closed_gait
from colloc.reduced.spaces import space_near
from colloc.results.alternative import Alternative
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
from colloc.system.errors import CollocError, NotConvergedError

STARTS = 16
_FEWEST = 12
"""Intervals of a coarse mesh, at least; else half of what the class asks for."""
_LEVELS = (1.0, 0.2)
"""Deltas at which starts are compared, in units of the problem's first one."""
_SAME_EFFICIENCY, _SAME_GAIT = 1e-3, 0.05
_FOLLOWED, _PROMISING = 3, 0.8
"""How many gaits are followed to the final delta, and the share of the best value that they need at the coarse one."""
_KNOWN = ((0.0, 2.86, 1.30), (1.11, 0.67, 1.12))
"""The two best ellipses of three equal links under isotropic friction."""
_HARMONICS = 8


@dataclass(eq=False)
class Candidate:
    """A gait that one or more starts came through, and where it led."""

    found: Found
    starts: list[int] = field(default_factory=list)
    then: Candidate | None = None

    def joined(self, start: int) -> None:
        """Another start came here, and will go where this one went."""
        at: Candidate | None = self
        while at is not None:
            at.starts.append(start)
            at = at.then


def starting_gaits(problem: Problem, count: int, seed: int = 0) -> Iterator[AnyGait]:
    """The guess, gaits known from three links, waves both ways, then a seeded Latin hypercube."""
    body, limit = problem.body, problem.joint_limit
    known = [over_links(ellipse(*numbers), Chain(), body, limit) for numbers in _KNOWN]
    waves = [travelling_wave(body, limit, w) for w in (-1.0, 1.0)]
    own = seed_class(problem)
    first = [problem.guess, *(laid_into(own, gait, body, limit, problem.smallest_shape_speed) for gait in (*known, *waves))]
    # known gaits and seeds take turns: neither are always better
    seeds = (latin_hypercube_gait(problem, seed, k) for k in range(count))
    turns = chain.from_iterable(zip(first, seeds, strict=False))
    return islice(chain(turns, seeds), count)


def same_gait(problem: Problem, a: Found, b: Found) -> bool:
    """Whether two gaits are one, modulo start phase and the symmetries of body and friction."""
    if abs(a.objective - b.objective) > _SAME_EFFICIENCY * max(abs(a.objective), abs(b.objective)):
        return False
    one, other = (fourier_through(f.gait, Harmonic(_HARMONICS, problem.gait.symmetry)) for f in (a, b))
    return distance(one, other, problem.body, problem.friction) < _SAME_GAIT


def candidates(problem: Problem, count: int, goes_on: Callable[[], bool]) -> tuple[list[Candidate], int]:
    """What the starts lead to on a coarse mesh, best first, and how many were tried, at least one."""
    intervals = min(problem.intervals, max(problem.gait.intervals(problem.body.n_joint) // 2, _FEWEST))
    coarse = problem.with_(intervals=intervals)
    deltas = [max(factor * problem.delta_start, problem.delta) for factor in _LEVELS]
    known: list[list[Candidate]] = [[] for _ in deltas]
    tried = 0
    for start, gait in enumerate(starting_gaits(problem, count)):
        if start > 0 and not goes_on():
            break
        tried += 1
        # a start that is no member of the class, or fails, is one start less
        with suppress(CollocError):
            _follow(coarse, gait, start, deltas, known)
    return sorted(known[-1], key=lambda c: c.found.objective), tried


def _follow(problem: Problem, gait: AnyGait, start: int, deltas: list[float], known: list[list[Candidate]]) -> None:
    """Follow a start through the deltas until it comes through a known gait; what it finds is added to the known ones."""
    space, v = space_near(problem, closed_gait(problem, gait, deltas[0]))
    before, radius = None, FIRST_RADIUS
    for delta, here in zip(deltas, known, strict=True):
        found = settled_apart(space, v, delta, radius, VERY_ROUGH)
        if is_viscous(found):
            continue  # as far as this delta goes, the start is as it was
        space, v, radius = found.space, found.v, NEXT_RADIUS
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
    """The best of many starts at the final delta, before its mesh is refined.

    Attributes
    ----------
    found : Found
    levels : list of Found
        That led there.
    starts : int
        Tried in all.
    others : tuple of Alternative
        All distinct gaits, the chosen one first.
    finite : list of Found
        Levels of the best gait of finite size, where the chosen one is as small as the bound on the shape speed allows.
    """

    found: Found
    levels: list[Found]
    starts: int
    others: tuple[Alternative, ...]
    finite: list[Found]


def best_of(problem: Problem, count: int, seconds: float = np.inf) -> Chosen:
    """The most efficient gait that so many starts lead to.

    Parameters
    ----------
    problem : Problem
    count : int
    seconds : float
        Wall time after which no other start is begun and no other gait is followed.

    Raises
    ------
    NotConvergedError
        If no start leads anywhere.
    """
    begin = time.perf_counter()

    def goes_on() -> bool:
        return time.perf_counter() - begin < seconds

    known, tried = candidates(problem, count, goes_on)
    if not known:
        raise NotConvergedError("no start led to any gait of the class; give a guess.")
    ends: list[tuple[Candidate, list[Found]]] = []

    def is_finite(found: Found) -> bool:
        return not on_speed_floor(problem, found.gait)

    least = -known[0].found.objective - (1 - _PROMISING) * abs(known[0].found.objective)
    # gaits of finite size may shrink on the way, so they are followed until one has not
    queue = [c for c in known if -c.found.objective >= least][:_FOLLOWED]
    spare = [c for c in known if is_finite(c.found) and c not in queue][:_FOLLOWED]
    for candidate in (*queue, *spare):
        if (ends and not goes_on()) or (candidate in spare and any(is_finite(levels[-1]) for _, levels in ends)):
            break
        levels: list[Found] = []
        with suppress(CollocError):
            space, v = space_near(problem, candidate.found.gait)
            levels.append(settled_apart(space, v, candidate.found.delta, NEXT_RADIUS, ROUGH))
            descended(levels[0], problem, levels.append)
            ends.append((candidate, levels))
    if not ends:
        raise NotConvergedError("no gait could be followed to the final delta; start at a larger delta or give another guess.")
    ends.sort(key=lambda end: end[1][-1].objective)
    distinct: list[tuple[Found, list[int]]] = []
    for candidate, levels in ends:
        twin = next((starts for found, starts in distinct if same_gait(problem, found, levels[-1])), None)
        if twin is None:
            distinct.append((levels[-1], list(candidate.starts)))
        else:
            twin.extend(candidate.starts)
    followed = [_alternative(problem, found, starts) for found, starts in distinct]
    dropped = [_alternative(problem, c.found, c.starts) for c in known if not any(c is done for done, _ in ends)]
    best = ends[0][1]
    finite = [] if is_finite(best[-1]) else next((levels for _, levels in ends if is_finite(levels[-1])), [])
    return Chosen(best[-1], best, tried, (*followed, *dropped), finite)


def _alternative(problem: Problem, found: Found, starts: list[int]) -> Alternative:
    return Alternative(-found.objective, found.delta, len(starts), on_speed_floor(problem, found.gait), found.gait)
