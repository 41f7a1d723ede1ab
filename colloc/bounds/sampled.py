"""An upper bound on the efficiency of every gait of a body: derivation in docs/bound.md.

A convex program chooses the potential whose largest (gain / power) over all shapes, headings and
rate directions is smallest, on few samples, and is checked on many. Narrow ridges, where a link
changes between stick and slip, escape any lattice; so the optimum is climbed from a fresh lattice
every round, and the summits join the samples until none rises above. `research/guarantee`
guarantees a bound for associated friction.
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from colloc.bounds.motions import CoulombMotion, Domain, climb_from_lattice, near_the_top
from colloc.bounds.potential import Measure, PotentialSpace, Samples, TensorSpline
from colloc.gaits.gait_fields import fields, statement_hash
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.system.errors import NotConvergedError, ProblemError, ReadOnlyRunWarning, StoreError
from colloc.system.row_file import CACHE, put_rows, read_rows

VERSION = 6
"""Part of the cache key: raise it when the computation changes its result."""
_LARGEST_CUT = 500
_INNER_ROUNDS = 15
_HELD = 2e-4
_WEIGHTY = 1e-7
"""Share of the largest multiplier that a motion of the measure needs: without those below 1e-5 it
closes too badly to tell what knots are worth."""
_NEAR = 0.005
_PATIENCE = 3
"""Programs in a row after which an inequality more than `_NEAR` below the value goes. Dropped at
once it is missed soon after, and the exchange goes in circles."""
_RIPE = 5e-3  # surprise at which the multipliers say where knots are wanted
_UNKNOWN = 0.1  # surprise expected of a program that no climbs have tried
_SIDES = (0.0, 0.08, -0.08)
"""A motion enters with the heading of its largest gain and these [rad] beside it."""
_HOPELESS = 0.005
_CLIMB_STEPS = 14
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
_TOLERANCE, _TINY = 1e-7, 1e-10  # of the interior-point solver, and of its penalty


@dataclass(frozen=True)
class Budget:
    intervals: int = 12  # knot intervals of the splines in every joint angle, at most
    harmonics: tuple[int, ...] | None = None  # in the heading; by default those that help
    shapes: int = 20  # steps of every joint angle, and rate directions, of the first lattice
    directions: int = 48
    rounds: int = 60  # of climbs, at most
    starts: int = 250  # climbs a round, thrice as many in the final check
    tolerance: float = 5e-4  # excess of the summits over the program's value that counts as none
    first: int = 6  # even intervals to begin with; more knots go where they are worth most
    smoothing: float = 1e-5
    """Weight of the roughness of the potential, which is about 0.2: costs 1e-6 of the bound."""
    together: int | None = None  # potentials are sums of functions of so many joint angles


QUICK = Budget()
FOUR_LINKS = Budget(
    5, None, 6, 40, 80, starts=400, tolerance=1e-3, first=5, smoothing=1e-4, together=2
)
"""Functions of two joint angles at a time: 81 unknowns do better than 108 products of three."""
FIVE_LINKS = replace(FOUR_LINKS, intervals=3, first=3, tolerance=3e-3)


@dataclass(frozen=True)
class Bound:
    sampled: float  # largest ratio on any sample, or 1/min(mu) if less
    floor: float
    """Value of the last program: no potential of the space does better on the samples held."""
    converged: bool
    """Last climbs within the budget's tolerance of `floor`, those of a check that knows nothing of
    the samples within twice of it."""
    guaranteed: float | None  # certified between samples too (`research/guarantee`)
    missing: str  # what keeps the sampled value from being a theorem
    angles: tuple[float, ...]  # shape and rates where the sampled value is taken
    rates: tuple[float, ...]
    joint_limit: float
    intervals: int
    harmonics: tuple[int, ...]
    coefficients: tuple[float, ...]  # free ones of the potential
    samples: int
    seconds: float  # processor time
    graded: tuple[float, ...] = ()  # inner knots, if they are not evenly spaced
    together: int | None = None

    def report(self, efficiency: float) -> str:
        """Efficiency, bound, gap, and what is proved, in one line."""
        proved = (
            f"guaranteed {self.guaranteed:.4f}" if self.guaranteed is not None else self.missing
        )
        return (
            f"efficiency {efficiency:.4f}, upper bound {self.sampled:.4f}, gap "
            f"{self.sampled - efficiency:.4f} ({proved})"
        )


class Minimax(NamedTuple):
    """Unknowns x ``(n,)``, the largest function there, and multipliers ``(m,)`` of sum 1."""

    x: np.ndarray
    value: float
    weights: np.ndarray


def smallest_maximum(
    rows: sparse.csr_matrix, constants: np.ndarray, penalty: sparse.spmatrix
) -> Minimax:
    """Minimise ``max_i (rows x + constants)_i + x.penalty.x / 2`` by Clarabel; the penalty picks
    the smoothest of nearly equal optima, as the exchange wanders between vertices."""
    m, n = rows.shape
    left = sparse.hstack([rows, -np.ones((m, 1))], format="csc")
    quadratic = sparse.block_diag([penalty + _TINY * sparse.eye(n), sparse.csc_matrix((1, 1))])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
    cones = [clarabel.NonnegativeConeT(m)]
    program = sparse.triu(quadratic, format="csc"), np.eye(n + 1)[-1], left, -constants, cones
    # refining every linear solve takes a quarter of the time, and is hardly ever needed
    for refine in (False, True):
        settings.iterative_refinement_enable = refine
        answer = clarabel.DefaultSolver(*program, settings).solve()
        if str(answer.status) in ("Solved", "AlmostSolved"):
            x = np.array(answer.x)[:-1]
            return Minimax(x, float((rows @ x + constants).max()), np.array(answer.z))
    raise NotConvergedError(
        f"the program of the bound failed: the interior-point solver reports {answer.status}."
    )


class _Program:
    """Inequalities of samples at headings that are held, for how many programs in a row each was
    slack, and the optimum."""

    def __init__(
        self,
        samples: Samples,
        index: np.ndarray,
        heading: np.ndarray,
        rng: np.random.Generator,
        smoothing: float,
    ) -> None:
        self.samples, self.index, self.heading, self.rng = samples, index, heading, rng
        self.slack, self.penalty = np.zeros_like(index), smoothing * samples.space.roughness
        self.rows, self.constants = samples.rows(index, heading)
        self.best = smallest_maximum(self.rows, self.constants, self.penalty)

    def settle(self, excess: float) -> None:
        """Exchange until no sample exceeds the program's value by more than `excess`."""
        for _ in range(_INNER_ROUNDS):
            ratio, heading = self.samples.ratio(self.best.x)
            if ratio.max() <= self.best.value + excess:
                break
            broken = np.flatnonzero(ratio > self.best.value + 0.5 * _HELD)
            broken = broken[np.argsort(-ratio[broken])[: 4 * _LARGEST_CUT]]
            broken = self.rng.permutation(broken)[:_LARGEST_CUT]
            active = self.rows @ self.best.x + self.constants > self.best.value - _NEAR
            active |= self.best.weights > 1e-6 * self.best.weights.max()
            slack = np.where(active, 0, self.slack + 1)
            keep = slack < _PATIENCE
            index = np.tile(broken, len(_SIDES))
            heading = np.concatenate([heading[broken] + side for side in _SIDES])
            rows, constants = self.samples.rows(index, heading)
            self.rows = sparse.vstack([self.rows[keep], rows], format="csr")
            self.constants = np.append(self.constants[keep], constants)
            self.index = np.append(self.index[keep], index)
            self.heading = np.append(self.heading[keep], heading)
            self.slack = np.append(slack[keep], np.zeros_like(index))
            self.best = smallest_maximum(self.rows, self.constants, self.penalty)

    def measure(self) -> Measure:
        weight = self.best.weights / self.best.weights.sum()
        used = weight > _WEIGHTY * weight.max()
        share = weight[used] / weight[used].sum()
        return Measure(self.samples.motion.take(self.index[used]), self.heading[used], share)


def compute_bound(domain: Domain, budget: Budget) -> tuple[Bound, Measure]:
    """The bound of the potential whose largest ratio is smallest, and the multipliers of the last
    program; more knots are inserted as they are worth it."""
    begin, body, law = time.process_time(), domain.body, domain.law
    usual = ((1, 3) if body.n_joint <= 2 else (1,)) if law.reversible else (0, 1)
    harmonics, tolerance = budget.harmonics or usual, budget.tolerance
    shapes, directions, rounds, starts = (
        budget.shapes, budget.directions, budget.rounds, budget.starts,
    )  # fmt: skip
    even = min(budget.first, budget.intervals)
    spline = TensorSpline(body.n_joint, domain.joint_limit, even)
    space = PotentialSpace(spline, harmonics, body.symmetric, budget.together)
    rng = np.random.default_rng(0)
    samples = Samples(space, domain.lattice(shapes, directions))
    # random samples at headings all round
    chosen = np.sort(rng.permutation(samples.motion.size)[: 3 * space.size])
    headings = np.repeat(np.arange(12) * (np.pi / 6), chosen.size)
    program = _Program(samples, np.tile(chosen, 12), headings, rng, budget.smoothing)
    spacing, turn = 2.0 * domain.joint_limit / shapes, np.pi / directions
    seen, quiet, surprise = samples.motion.size, 0, _UNKNOWN
    for count in range(1, rounds + 1):
        # a potential that the next climbs will refute need not be exact
        program.settle(float(np.clip(0.1 * surprise, max(_HELD, 0.2 * tolerance), 0.02)))
        free, level = program.best.x, program.best.value
        ratio: Callable[[CoulombMotion], np.ndarray] = partial(space.largest_ratios, free)
        last = quiet > 0 or count == rounds
        shift = max((count * _GOLDEN) % 1.0, 0.01)
        fresh = domain.lattice(shapes * (1 + last), directions * (1 + last), shift)
        pooled = fresh.join(program.samples.motion)
        values = np.concatenate([ratio(fresh), program.samples.ratio(free)[0]])
        chosen = near_the_top(pooled, values, level, spacing, starts * (1 + 2 * last))
        steps = 0.5 * spacing, 0.5 * turn, _CLIMB_STEPS
        summit = domain.summits(ratio, pooled.take(chosen), *steps, rng, level - _HOPELESS)
        reached = ratio(summit)
        seen += fresh.size + chosen.size
        top, best = (
            max(float(reached.max()), float(values.max())),
            summit.take(int(reached.argmax())),
        )
        # two rounds in a row, the second on a finer lattice, must find nothing
        surprise = top - level
        quiet = quiet + 1 if top <= level + tolerance else 0
        coarse = space.spline.intervals < budget.intervals
        if (more := reached > level + 0.25 * tolerance).any():
            program.samples.add(summit.take(more))
        if (quiet == 2 and not coarse) or count == rounds:
            # what a check finds is no more than a sample that was missing
            finer = {"shapes": 3 * shapes, "directions": 2 * directions, "starts": 2 * starts}
            checked, motion = climb_from_lattice(domain, ratio, seed=count, level=level, **finer)
            if checked.max() > top:
                top, best = float(checked.max()), motion.take(int(checked.argmax()))
            quiet = quiet if top <= level + 2 * tolerance else 0
            if quiet or count == rounds:
                break
            if (more := checked > level + tolerance).any():
                program.samples.add(motion.take(more))
        if coarse and surprise < max(_RIPE, tolerance):
            space = space.with_more_knots(program.measure(), budget.intervals)
            held = Samples(space, program.samples.motion), program.index, program.heading
            program, quiet, surprise = _Program(*held, rng, budget.smoothing), 0, _UNKNOWN
    proof = (
        "not certified between them"
        if law.associated
        else "for this law the balance has no convex potential, so neither uniqueness of the "
        "motion nor a margin between samples is known"
    )
    bound = Bound(
        sampled=min(top, 1.0 / law.smallest),
        floor=program.best.value,
        converged=quiet == 2,
        guaranteed=None,
        missing=f"sampled at {seen} motions: {proof}",
        angles=tuple(best.angles.tolist()),
        rates=tuple(best.rates.tolist()),
        joint_limit=domain.joint_limit,
        intervals=space.spline.intervals,
        harmonics=harmonics,
        coefficients=tuple(free.tolist()),
        samples=seen,
        seconds=time.process_time() - begin,
        graded=space.spline.graded,
        together=budget.together,
    )
    return bound, program.measure()


def usual_budget(domain: Domain) -> Budget:
    return {3: FOUR_LINKS, 4: FIVE_LINKS}.get(domain.body.n_joint, QUICK)


def bound_key(domain: Domain, budget: Budget) -> str:
    """SHA-256 of what a bound depends on."""
    stated = {
        "body": fields(domain.body),
        "friction": fields(domain.friction),
        "joint_limit": domain.joint_limit,
    }
    return statement_hash({"version": VERSION, "domain": stated, "budget": asdict(budget)})


def known_bound(domain: Domain, budget: Budget, cache: Path) -> Bound | None:
    """The bound of an earlier run in the cache, or None."""
    if (entry := read_rows(cache, CACHE).get(bound_key(domain, budget))) is None:
        return None
    try:
        stored = {k: tuple(v) if isinstance(v, list) else v for k, v in entry.items()}
        return Bound(**stored)  # type: ignore[arg-type]
    except (TypeError, AttributeError):
        raise StoreError(f"{cache} holds something else than bounds; move it away.") from None


def efficiency_bound(
    body: Chain,
    friction: Friction,
    joint_limit: float = float(np.pi),
    *,
    budget: Budget | None = None,
    cache: str | os.PathLike[str] | None = None,
) -> Bound:
    """An upper bound on d/W over all gaits with |joint angles| <= joint_limit whose links do not
    cross, for delta -> 0; kept in an SQLite file `cache`, which if it cannot be written costs a
    warning."""
    domain = Domain(body, friction, float(joint_limit))
    budget = budget or usual_budget(domain)
    if cache is not None and (known := known_bound(domain, budget, Path(cache))) is not None:
        return known
    if domain.law.reversible and any(k % 2 == 0 for k in budget.harmonics or ()):
        raise ProblemError(
            "even harmonics do nothing where mu_b = mu_f (reversal in time): name odd ones only."
        )
    bound, _ = compute_bound(domain, budget)
    if cache is not None:
        try:
            put_rows(Path(cache), CACHE, {bound_key(domain, budget): asdict(bound)})
        except StoreError as error:
            warnings.warn(f"{error} The bound is not kept.", ReadOnlyRunWarning, stacklevel=2)
    return bound
