"""Many starts, cheaply told apart; the promising ones followed to the final delta.

As docs/search.md says. Where a start meets a gait that an earlier one met at the same delta, it
would go on as that one did. Small loops are slow, and so optimised at a smaller delta only. Optima
of slow motion take a hundredth of the time of those with inertia; hops follow.
"""

from __future__ import annotations

import itertools
import re
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache, partial
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from colloc.bounds.motions import (
    CoulombMotion,
    SmallGait,
    best_mixture,
    heading_of,
    one_joint,
    unit_directions,
)
from colloc.gaits.bspline import Corners
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import Fourier, ellipse
from colloc.gaits.objective import Objective
from colloc.gaits.problem import Problem
from colloc.gaits.robot import widest
from colloc.gaits.starts import (
    is_visible,
    largest_factor,
    latin_hypercube_gait,
    on_speed_floor,
    to_body,
    to_class,
    travelling_wave,
)
from colloc.mechanics.chain import Chain
from colloc.mechanics.law import rate_independent
from colloc.reduced.program import ReducedProgram
from colloc.results.answer import Alternative
from colloc.results.comparison import SAME_VALUE, are_one, fourier_series
from colloc.search.checkpoint import active_run, checkpoint
from colloc.search.iterate import Iterate, evaluate_at, space_near, space_of
from colloc.search.optimise import (
    delta_levels,
    descend,
    halve,
    optimise,
    project_to_zero_rotation,
    regularisation_dominated,
)
from colloc.search.options import COARSE, FINE, MEDIUM, OPTIONS
from colloc.system.errors import CollocError, NotConvergedError, ProblemError


@dataclass(eq=False)
class Candidate:
    """A gait that one or more starts met; `next` is where they went, at the next delta."""

    iterate: Iterate
    starts: int = 0
    n_new: int = 0  # starts that are no hops, which go round near the best gait
    next: Candidate | None = None
    dry_objective: float = np.inf  # at a delta that is small for all
    is_loop: bool = False


_DRY = attrgetter("dry_objective")


class Exploration(NamedTuple):
    optima: list[Iterate]  # at the final delta, best first, before their meshes are refined
    starts: int
    others: Sequence[Alternative] = ()  # all distinct gaits met, best first
    left: Sequence[Iterate] = ()  # at a larger delta, not followed, the most promising first


def first_optimum(problem: Problem, gait: AnyGait) -> Iterate:
    """The optimum at the first delta that the search reaches from a gait.

    At the next delta where friction at that one is dominated by its regularisation; at the final
    delta for a gait that is nearer to an optimum there than 0.1 rad.
    """
    space, v = space_near(problem, gait)
    if not problem.gait.free:
        return optimise(space, v, problem.delta, FINE)
    if problem.delta != problem.delta_start:
        here = evaluate_at(space, v, problem.delta)
        is_flat = here.kkt_error * COARSE <= OPTIONS.close * abs(here.objective)
        if is_flat and here.violation < COARSE:
            with suppress(NotConvergedError):
                optimum = here if here.optimal else optimise(space, v, problem.delta, MEDIUM)
                is_same = optimum.optimal and np.abs(optimum.v - v).max() < COARSE
                if is_same and not regularisation_dominated(optimum):
                    return optimum
    v = space.parameters(project_to_zero_rotation(problem, gait, problem.delta_start))
    active_run().report("explore", 0, 1)
    for delta in delta_levels(problem, problem.delta_start):
        optimum = optimise(space, v, delta, MEDIUM)
        if not regularisation_dominated(optimum):
            break
    return optimum


def explore(
    problem: Problem, starts: int | None = None, guesses: Sequence[AnyGait] = ()
) -> Exploration:
    """The best gaits of a problem's class that so many starts, and at most three times as many,
    lead to, and gaits that are known: by default 32, with inertia 96 where no optima of slow motion
    are known, or fewer once some of them have met the best one.

    Where they shrink until nobody sees them move, the search begins anew among gaits at least as
    large as the best optimum of finite size; without one, as large as the default guess is, or as
    is usual. `NotConvergedError` if no start leads anywhere.
    """
    run = active_run()
    try:
        any_size = _follow_promising(problem, *multistart(problem, starts, guesses))
        if problem.shrinking or is_visible(any_size.optima[0].gait) or not run.has_time():
            return any_size
        finite = next((each for each in any_size.optima if is_visible(each.gait)), None)
        try:
            if finite:
                size = finite.gait.shape_speed
                visible = problem.with_(smallest_shape_speed=size, guess=finite.gait)
            else:
                visible = problem.with_(guess=None)
                size = min(OPTIONS.min_size, visible.guess.shape_speed)
                size = max(size, problem.smallest_shape_speed)
                visible = visible.with_(smallest_shape_speed=size)
            large = _follow_promising(visible, *multistart(visible, starts, guesses))
        except CollocError:
            return any_size  # nothing moves as much
    finally:
        run.ahead.end()
    # the first one has its size by itself, which counts for something
    enough = (1 + OPTIONS.close) * finite.objective if finite else 0.0
    better = [each for each in large.optima if is_visible(each.gait) and each.objective < enough]
    optima = sorted([*any_size.optima, *better], key=lambda optimum: optimum.objective)
    old, new = (
        [(other.value, fourier_series(problem, other.gait)) for other in each.others]
        for each in (any_size, large)
    )
    more = (
        other
        for other, path in zip(large.others, new, strict=True)
        if not any(are_one(problem, one, path) for one in old)
    )
    others = sorted([*any_size.others, *more], key=lambda other: -other.value)
    return Exploration(optima, any_size.starts + large.starts, others, any_size.left)


@checkpoint
def farthest(problem: Problem) -> list[Iterate]:
    """Optima of the distance, the farthest first."""
    of_distance = problem.with_(objective="distance", least_distance=None, shrinking=True)
    return explore(of_distance, OPTIONS.reach_starts).optima


def with_reachable_distance(problem: Problem) -> tuple[Problem, list[AnyGait]]:
    """The problem with its `least_distance` among `at_least`: all of it, or half of what the
    farthest gait goes, if that is less; and the gaits that go farthest, as few others may go as
    far. They are known first, unless the guess goes twice as far."""
    aims = {aim.name for aim, _ in problem.at_least}
    if problem.least_distance is None or "distance" in aims or not problem.gait.free:
        return problem, []
    optima, least = list[Iterate](), problem.least_distance
    if not _guess_goes(problem, 2 * least):
        optima = farthest(problem)
        least = least if optima[0].value >= least else 0.5 * optima[0].value
        active_run().begin_again()
    reachable = problem.with_(at_least=(*problem.at_least, ("distance", least)))
    return reachable, [each.gait for each in optima]


def _guess_goes(problem: Problem, distance: float) -> bool:
    with suppress(CollocError):
        here = evaluate_at(*space_near(problem, problem.guess), problem.delta)
        return here.violation <= COARSE and here.step.distance >= distance
    return False


def follow_rest(problem: Problem, explored: Exploration) -> list[Iterate]:
    """Optima at the final delta, best first, of the first of the gaits that were left."""
    ends, run = list[Iterate](), active_run()
    left = explored.left[: OPTIONS.patience]
    for done, candidate in enumerate(left):
        if not run.has_time():
            break
        run.report("follow", done, len(left))
        with suppress(CollocError):
            end = follow(problem, candidate)
            optima = (*explored.optima, *ends)
            is_new = not any(same_gait(problem, end, other) for other in optima)
            if end.violation <= COARSE and is_new:
                ends.append(end)
    return sorted(ends, key=lambda end: end.objective)


def starting_gaits(problem: Problem) -> Iterator[AnyGait]:
    """The guess, gaits known from three links and waves both ways, in turn with seeded Latin
    hypercubes, which have no end."""
    body, limit = problem.body, problem.joint_limit
    # the two best ellipses of three equal links under isotropic friction: without them one harmonic
    # of other bodies is missed at times, as that of `problems/purcell.py`
    gaits = [
        to_body(ellipse(*ab), Chain(), body, limit)
        for ab in ((0.0, 2.86, 1.30), (1.11, 0.67, 1.12))
    ]
    gaits += [travelling_wave(body, limit, w) for w in (-1.0, 1.0)]
    gaits = [to_class(problem, problem.gait.start_class, gait) for gait in gaits]
    seeds = map(partial(latin_hypercube_gait, problem, 0), itertools.count())
    return itertools.chain(
        itertools.chain.from_iterable(zip([problem.guess, *gaits], seeds, strict=False)), seeds
    )


def in_slow_motion(problem: Problem) -> Problem | None:
    """A problem of inertia without it, with the work against friction for that of the motors, and
    without limits of what they bear; None if there is no such problem."""
    if not problem.regime.froude or problem.regime.free or problem.motion or problem.grade:
        return None

    def without_motors(aim):
        return Objective(re.sub(r"\bdriven_work\b", "work", aim.expression), "", aim.quantities)

    weak = {"torque_limit": None, "power_limit": None, "limits": ()}
    aims = [(without_motors(aim), least) for aim, least in problem.at_least]
    objective, slow = without_motors(problem.objective), problem.without_robot
    with suppress(ProblemError):
        return slow.with_(froude=0.0, objective=objective, at_least=aims, **weak)
    return None


def slow_optima(problem: Problem) -> list[AnyGait]:
    """Gaits that are best in slow motion, of a problem with inertia, the best first."""
    if (slow := in_slow_motion(problem)) is None:
        return []
    candidates, _ = multistart(slow, OPTIONS.max_starts * OPTIONS.starts)
    return [each.iterate.gait for each in candidates]


def same_gait(problem: Problem, a: Iterate, b: Iterate) -> bool:
    """True if two gaits are one, modulo start phase and the symmetries of body and friction."""
    if abs(a.objective - b.objective) > SAME_VALUE * max(abs(a.objective), abs(b.objective)):
        return False  # before the paths are transformed
    one, other = ((each.objective, fourier_series(problem, each.gait)) for each in (a, b))
    return are_one(problem, one, other)


def multistart(
    problem: Problem, starts: int | None, guesses: Sequence[AnyGait] = ()
) -> tuple[list[Candidate], int]:
    """Candidates on a coarse mesh, best first, and the number of starts, at least one."""
    slow = slow_optima(problem)
    run, ahead = active_run(), active_run().ahead
    count = starts or OPTIONS.starts
    if problem.regime.froude and not slow and not starts:
        count *= OPTIONS.max_starts
    most = OPTIONS.max_starts * count
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
    last, loops = levels[-1], list[Candidate]()
    for loop in small_loops(problem):
        with suppress(CollocError):
            sketch(coarse, loop, True, [dry], [loops])
    new_gaits, gaits, n_new = starting_gaits(problem), list[AnyGait | None](), 0
    tried, improved, best, begin = 0, -OPTIONS.patience, 0.0, time.process_time()

    def measure(candidates):
        # on wheels that hardly resist the best at the last of these deltas may not be the best dry
        for candidate in (c for c in candidates if c.dry_objective == np.inf):
            dry_program = ReducedProgram(candidate.iterate.space, dry)
            objective = dry_program.objective(candidate.iterate.v)
            candidate.dry_objective = float(np.nan_to_num(objective, nan=np.inf))

    first = [*guesses, *slow]
    for done, gait in enumerate(first):
        run.report("explore", done, len(first) + count, _best([c.iterate for c in last]))
        with suppress(CollocError):
            sketch(coarse, gait, False, deltas, levels)
    measure(last)

    def is_turn_of_new(start):
        return start // (OPTIONS.starts // 2) % 2 == bool(slow)

    def start_gait(start, number):
        """The gait of a start, if there is one, and whether it is new: the one of that number. It
        depends on what came before alone, so more starts go wherever fewer do."""
        if not is_turn_of_new(start) and last:
            best_gait = min(last, key=_DRY).iterate.gait
            size, rng = OPTIONS.hop * 2.0 ** (start % 3 - 1), np.random.default_rng([1, start])
            return problem.gait.start_class.perturb(best_gait, size, 1, rng), False
        while len(gaits) <= number:
            gaits.append(None)
            with suppress(CollocError):
                gaits[-1] = next(new_gaits)
        return gaits[number], True

    def is_finished():
        n_met = min(last, key=_DRY).n_new if last else 0
        sure = n_met >= max(OPTIONS.patience / 2, n_new / OPTIONS.patience)
        # where a start takes long; elsewhere gaits that few starts meet are worth all of them
        may_end_early = problem.regime.froude and not starts
        enough = tried >= count or (sure and may_end_early and 4 * tried >= count)
        if enough and tried > improved + OPTIONS.patience:
            return True
        # joints so weak that no gait keeps their limits, as it seems
        nothing = tried >= OPTIONS.patience and not last and not loops
        return nothing and not starts and bool(problem.path_limits.names)

    while tried == 0 or (tried < most and not is_finished() and run.has_time()):
        ahead.begin((time.process_time() - begin) / max(tried, 1) * (count - tried))
        later = range(tried, min(tried + 2 * ahead.count, most))
        numbers = n_new + np.cumsum([0, *map(is_turn_of_new, later)])
        for start, number in zip(later, numbers, strict=False):
            ahead.submit(start, sketch, coarse, *start_gait(start, int(number)), deltas)
        gait, is_new = start_gait(tried, n_new)
        n_new += is_new
        # a start that is no member of the class, or fails, is one start less
        with suppress(CollocError):
            ahead.wait_for(sketch, coarse, gait, is_new, deltas)
            sketch(coarse, gait, is_new, deltas, levels)
        measure(last)
        before, best = best, min(map(_DRY, last), default=0.0)
        if tried > 0 and best < before - SAME_VALUE * abs(before):
            improved = tried
        tried += 1
        # as a rule loops shrink further on their way down
        shown = [*last, *loops] if problem.shrinking else last
        done, all_starts = len(first) + tried, len(first) + max(tried, count)
        run.report("explore", done, all_starts, _best([c.iterate for c in shown]))

    measure(loops)
    for candidate in loops:
        candidate.is_loop = True
    return sorted([*last, *loops], key=_DRY), tried


def _best(iterates: Sequence[Iterate]) -> Iterate | None:
    """The best that may be the answer: of finite size, unless the problem asks for any."""
    best_first = sorted(iterates, key=lambda each: each.objective)
    fit = (each for each in best_first if each.problem.shrinking or is_visible(each.gait))
    return next(fit, None)


def sketch(
    coarse: Problem,
    gait: AnyGait | None,
    is_new: bool,
    deltas: list[float],
    levels: list[list[Candidate]] | None = None,
) -> None:
    """Optimise a start at one delta after another, a hop at the last, until it meets a known
    candidate of a level; add those that are not known. By default those that this process met
    ahead are known."""
    if gait is None:
        return
    if levels is None:
        levels = _levels_here(coarse.smallest_shape_speed, *deltas)
    if is_new:
        gait = project_to_zero_rotation(coarse, gait, deltas[0])
    else:
        deltas, levels = deltas[-1:], levels[-1:]
    space, v = space_near(coarse, gait)
    before: Candidate | None = None
    for delta, level in zip(deltas, levels, strict=True):
        iterate = optimise(space, v, delta, COARSE)
        if regularisation_dominated(iterate):
            continue  # as far as this delta goes, the start is as it was
        space, v = iterate.space, iterate.v
        if not iterate.violation <= COARSE:
            continue  # no member of the class
        met = next((c for c in level if same_gait(coarse, c.iterate, iterate)), None)
        candidate = met or Candidate(iterate)
        if met is None:
            level.append(candidate)
        if before is not None:
            before.next = candidate
        each: Candidate | None = candidate
        while each is not None:
            each.starts += 1
            each.n_new += is_new
            each = each.next
        if met is not None:
            return
        before = candidate


@lru_cache(maxsize=1)
def _levels_here(smallest: float, *deltas: float) -> list[list[Candidate]]:
    return [[] for _ in deltas]


def _follow_promising(problem: Problem, candidates: list[Candidate], starts: int) -> Exploration:
    """Distinct optima of promising candidates at the final delta, those close to the best on the
    whole mesh. Gaits may shrink on the way: they are followed until one has not."""
    if not candidates:
        limited = " that keeps the limits of its joints" if problem.path_limits.names else ""
        raise NotConvergedError(
            f"none of {starts} starts led to a gait of the class{limited}; give a guess."
        )
    ends, left, run = list[tuple[Iterate, Candidate]](), list(candidates), active_run()

    def is_promising(candidate):
        # by what the best one promises, or has come to where it promised too much
        reached = min((optimum.objective for optimum, _ in ends), default=-np.inf)
        best = max(candidates[0].dry_objective, reached)
        return candidate.dry_objective <= best + (1 - OPTIONS.promising) * abs(best)

    def report():
        best = _best([optimum for optimum, _ in ends]) or _best([c.iterate for c in left])
        run.report("follow", len(candidates) - len(left), len(candidates), best)

    def add(candidate):
        is_new = False
        left.remove(candidate)
        run.ahead.wait_for(follow, problem, candidate.iterate)
        with suppress(CollocError):
            end = follow(problem, candidate.iterate)
            if end.violation <= COARSE:
                is_known = any(same_gait(problem, end, other) for other, _ in ends)
                is_new = not is_known and not end.strays
                ends.append((end, candidate))
        report()
        return is_new

    report()
    queues = [[c for c in candidates if c.is_loop == is_loop] for is_loop in (False, True)]
    first = itertools.chain(*(queue[: OPTIONS.followed] for queue in queues))
    for number, candidate in enumerate(filter(is_promising, first)):
        run.ahead.submit(number, follow, problem, candidate.iterate)
    for queue in queues:
        n_new = 0  # candidates that differ may come to one gait
        for candidate in queue[: OPTIONS.patience]:
            wanted = n_new < OPTIONS.followed and is_promising(candidate)
            if wanted and (run.has_time() or not ends):
                n_new += add(candidate)
    for candidate in [c for c in left if is_visible(c.iterate.gait)][: OPTIONS.patience]:
        if any(is_visible(optimum.gait) for optimum, _ in ends) or (ends and not run.has_time()):
            break
        add(candidate)
    if not ends:
        raise NotConvergedError(
            "no gait could be followed to the final delta; start at a larger delta or give another "
            "guess."
        )
    close = (1 - OPTIONS.close) * min(optimum.objective for optimum, _ in ends)
    finite = [optimum.objective for optimum, _ in ends if is_visible(optimum.gait)]
    close_finite = max(close, (1 - OPTIONS.close) * min(finite, default=0.0))
    for k, (optimum, candidate) in enumerate(ends):
        if optimum.objective <= (close_finite if is_visible(optimum.gait) else close):
            (whole, v), edges = space_near(problem, optimum.gait), optimum.space.mesh.edges
            if len(edges) == whole.mesh.n + 1 and np.allclose(edges, whole.mesh.edges):
                continue  # it is optimal there
            with suppress(CollocError):
                on_whole = optimise(whole, v, optimum.delta, MEDIUM)
                ends[k] = on_whole.after(optimum.history), candidate
    distinct: list[tuple[Iterate, Candidate]] = []
    for optimum, candidate in sorted(ends, key=lambda end: (end[0].strays, end[0].objective)):
        twin = next((led for other, led in distinct if same_gait(problem, other, optimum)), None)
        if twin is None:
            distinct.append((optimum, candidate))
        else:
            twin.starts += candidate.starts
    distinct.sort(key=lambda end: end[0].objective)
    left = [c for c in candidates if not any(c is followed for _, followed in ends)]
    others = [
        Alternative(o.value, o.delta, c.starts, on_speed_floor(problem, o.gait), o.gait)
        for o, c in [*distinct, *((c.iterate, c) for c in left)]
    ]
    return Exploration([o for o, _ in distinct], starts, others, [c.iterate for c in left])


def follow(problem: Problem, iterate: Iterate) -> Iterate:
    """The gait at the final delta, with every interval halved."""
    space = space_of(problem, halve(iterate.space.mesh.edges))
    v = space.parameters(iterate.gait)
    return descend(optimise(space, v, iterate.delta, MEDIUM))


_SHAPES = 60  # that are drawn, and directions of rates at each


@checkpoint
def small_loops(problem: Problem) -> list[AnyGait]:
    """Small loops at the shapes where they travel farthest for their work, in the class that starts
    are drawn from, both ways round, best first; none where the pace matters.

    Dry friction lets a loop of any size move a body, and at a few shapes, such as folded ones,
    which samples of a class hardly ever meet, small loops beat most large gaits. A linear program
    gives the best one at a shape.
    """
    if problem.froude or not rate_independent(problem.law):
        return []
    body, law, joints = problem.body, problem.law, problem.joint_map
    n, shapes = problem.n_motor, _shapes(problem)
    directions = np.hstack([one_joint(n, half=False), unit_directions(n, _SHAPES, half=False)])
    if joints is not None:
        directions = joints.joint_rates(directions)
    count, delta = directions.shape[1], 1e-2 * problem.delta_start  # dry
    angles, rates = np.repeat(shapes, count, axis=1), np.tile(directions, shapes.shape[1])
    solved = body.solve(law, angles, rates, delta)
    now = body.motion(law, angles, rates, delta, solved)
    # around a closed loop every point of the body is carried as far
    motions = CoulombMotion(angles, rates, now.centre, now.z[2], now.power)
    # two headings in half a turn, the first of which is no axis of symmetry of usual shapes
    headings = 0.5 + 0.5 * np.pi * np.arange(2 if law.reversible else 4)
    best: list[tuple[SmallGait, np.ndarray]] = []
    for k, shape in enumerate(shapes.T):
        columns = np.arange(k * count, (k + 1) * count)
        here = motions.take(columns[solved.converged[columns]])
        try:
            first = max((best_mixture(here, h) for h in headings), key=lambda mixture: mixture[0])
            heading = heading_of(here, first[1])
            value, weights, _ = best_mixture(here, heading)
        except NotConvergedError:
            continue
        used = weights > 1e-6 * weights.max()
        # mirror images differ by less
        if not any(abs(value - other.efficiency) < 1e-3 * value for other, _ in best):
            best.append((SmallGait(value, heading, here.rates[:, used], weights[used]), shape))
    best.sort(key=lambda pair: -pair[0].efficiency)
    size = 1.5 * 2 * np.pi * problem.smallest_shape_speed
    return [
        to_class(problem, problem.gait.start_class, Corners(small.path(shape, size, back=back)))
        for small, shape in best[:2]
        for back in (False, True)
    ]


def _shapes(problem: Problem) -> np.ndarray:
    body, limit, seeds = problem.body, problem.joint_limit, problem.gait.start_class
    n_joint = body.n_joint
    levels, rng = np.linspace(-1.0, 1.0, 5), np.random.default_rng(2)
    shapes = rng.choice(levels, (_SHAPES, n_joint)) * widest(limit)
    none, rest = np.zeros((n_joint, 1)), seeds.offset(n_joint)[:, 0]
    constant = (Fourier(mean, none, none) for mean in shapes)
    means = np.array([seeds.member(seeds.parameters(each), n_joint).mean for each in constant])
    # of a shape and its mirror image, the one whose first bend is to the left
    first = np.take_along_axis(means, (means != 0).argmax(axis=1)[:, None], axis=1)
    means = np.unique(np.where(first < 0, -means, means) + 0.0, axis=0)

    def admissible(mean):
        factor = largest_factor(body, limit, mean[:, None], rest[:, None])
        return rest + (mean - rest) * min(1.0, factor)

    return np.array([*map(admissible, means)]).T
