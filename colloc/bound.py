"""An upper bound on the efficiency of every gait of a body: derivation in docs/bound.md.

The bound is the value of a convex problem: choose a potential over shape and heading (`colloc.potential`) so that the
largest (gain / power) over all shapes, headings and rate directions is smallest. It is solved on samples, refined where
the bound is nearly attained: Newton on a soft maximum finds the neighbourhood, a linear program with constraint
generation (HiGHS) the optimum. What comes out is a *sampled* bound; `colloc.bound_margin`
guarantees one for isotropic friction.
"""

from __future__ import annotations

import os
import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.sparse.linalg import spsolve

from colloc.body import Chain
from colloc.bound_sampling import Domain
from colloc.coulomb_motion import swaps_ends
from colloc.errors import ProblemError
from colloc.friction import Friction
from colloc.json_cache import hash_of, load_entries, save_entry
from colloc.linear_bound import linear_optimum
from colloc.potential import PotentialSpace, Samples
from colloc.soft_maximum import minimise_soft_maximum
from colloc.spline import TensorSpline

VERSION = 1
"""Part of the cache key: raise it when the computation changes its result."""


@dataclass(frozen=True)
class Budget:
    """How much work a bound is worth.

    Parameters
    ----------
    intervals : tuple of int
        Knot intervals of the splines, coarse to fine; each must divide the next.
    harmonics : tuple of int, optional
        Harmonics in the heading; by default (1,), or (0, 1) where mu_b differs from mu_f.
    shapes, directions : int
        The first lattice: steps of every joint angle, and rate directions.
    refinements : int
        How often the lattice is halved where the bound is nearly attained.
    linear_rounds : int
        Rounds of constraint generation at the end.
    """

    intervals: tuple[int, ...] = (8,)
    harmonics: tuple[int, ...] | None = None
    shapes: int = 40
    directions: int = 40
    refinements: int = 4
    linear_rounds: int = 16


QUICK = Budget()
THOROUGH = Budget(intervals=(8, 16), refinements=5, linear_rounds=24)


@dataclass(frozen=True)
class Bound:
    """An upper bound on the efficiency of every gait, and how well it is known.

    Attributes
    ----------
    sampled : float
        Largest ratio met on any sample; what lies between samples may exceed it.
    floor : float
        No potential of this spline space gets below this on these samples (value of the linear program).
    guaranteed : float or None
        Value certified between samples too (`colloc.bound_margin`), if asked for and possible.
    missing : str
        What keeps the sampled value from being a theorem; empty if `guaranteed` is set.
    angles, rates : tuple of float
        Shape and rate direction where the sampled value is taken.
    joint_limit : float
    intervals : int
    harmonics : tuple of int
    coefficients : tuple of float
        Free coefficients of the potential (see `potential_space`).
    samples : int
    seconds : float
    """

    sampled: float
    floor: float
    guaranteed: float | None
    missing: str
    angles: tuple[float, ...]
    rates: tuple[float, ...]
    joint_limit: float
    intervals: int
    harmonics: tuple[int, ...]
    coefficients: tuple[float, ...]
    samples: int
    seconds: float

    def potential_space(self, body: Chain) -> PotentialSpace:
        """The space `coefficients` belong to."""
        spline = TensorSpline(body.n_joint, self.joint_limit, self.intervals)
        return PotentialSpace(spline, self.harmonics, swaps_ends(body))

    def gap(self, efficiency: float) -> float:
        """How far an efficiency is from the sampled bound."""
        return self.sampled - efficiency

    def report(self, efficiency: float) -> str:
        """One line for reports: efficiency, bound, gap, and what is proved."""
        proved = f"guaranteed {self.guaranteed:.4f}" if self.guaranteed is not None else self.missing
        return f"efficiency {efficiency:.4f}, upper bound {self.sampled:.4f}, gap {self.gap(efficiency):.4f} ({proved})"


MISSING_MARGIN = "sampled at {samples} motions: not certified between them"
MISSING_LAW = (
    "sampled at {samples} motions: for unequal coefficients the balance has no convex potential, so neither uniqueness of the "
    "motion nor a margin between samples is known"
)


def lifted(coarse: PotentialSpace, free: np.ndarray, fine: PotentialSpace) -> np.ndarray:
    """The same potential in a space with finer knots (exact when the knots are nested)."""
    per_joint = 2 * fine.spline.per_joint + 1
    axis = np.linspace(-fine.spline.limit, fine.spline.limit, per_joint)
    angles = np.stack([a.ravel() for a in np.meshgrid(*[axis] * fine.spline.n_joint, indexing="ij")])
    old, new = coarse.spline.matrix(angles), fine.spline.matrix(angles)
    full = coarse.coefficients(free)
    result = np.zeros(fine.size)
    for k, part, where in fine.layout:
        wanted = old @ (full[k].real, full[k].imag)[part]
        left = new @ fine.bases[part]
        result[where] = spsolve((left.T @ left).tocsc(), left.T @ wanted)
    return result


_LARGEST_REFINED = 1500
_SURPRISE = 1e-3


def _largest(values: np.ndarray, threshold: float, count: int) -> np.ndarray:
    """Indices of values above the threshold, at most `count` of them, the largest."""
    chosen = np.flatnonzero(values > threshold)
    return chosen if chosen.size <= count else chosen[np.argpartition(-values[chosen], count)[:count]]


def _optimised(domain: Domain, budget: Budget) -> tuple[PotentialSpace, Samples, np.ndarray, float]:
    body = domain.body
    harmonics = budget.harmonics or ((1,) if domain.friction.reversible else (0, 1))
    spaces = [
        PotentialSpace(TensorSpline(body.n_joint, domain.joint_limit, n), harmonics, swaps_ends(body)) for n in budget.intervals
    ]
    space = spaces[0]
    samples = Samples(space, domain.lattice(budget.shapes, budget.directions))
    free = np.zeros(space.size)
    spacing, turn = 2 * domain.joint_limit / budget.shapes, np.pi / budget.directions
    for sharpness in (10.0, 30.0, 100.0):
        free = minimise_soft_maximum(samples, free, sharpness, 1e-4, 30)
    floor = 0.0
    for step in range(budget.refinements):
        spacing, turn = 0.5 * spacing, 0.5 * turn
        ratio = samples.ratio(free)[0]
        near = _largest(ratio, ratio.max() - max(0.04 * 0.5**step, 4e-3), _LARGEST_REFINED)
        samples = samples.joined(domain.refined(samples.motion, near, spacing, turn))
        finer = spaces[min(step, len(spaces) - 1)]
        if finer is not space:
            free = lifted(space, free, finer)
            space, samples = finer, Samples(finer, samples.motion)
        if step < 2 or len(budget.intervals) == 1:
            for sharpness in (100.0, 300.0):
                free = minimise_soft_maximum(samples, free, sharpness, 3e-4, 8)
        free, floor = linear_optimum(samples, free, budget.linear_rounds)
        if step >= 1:
            # a lattice that shares no point with the first finds what refinement near the maximum cannot
            check = domain.lattice(budget.shapes + 2 * step + 3, budget.directions + 2 * step + 3)
            found = Samples(space, check).ratio(free)[0]
            samples = samples.joined(check.take(_largest(found, samples.ratio(free)[0].max() - 4e-3, 10 * _LARGEST_REFINED)))
    free, floor = linear_optimum(samples, free, budget.linear_rounds)
    return space, samples, free, floor


def compute_bound(domain: Domain, budget: Budget) -> Bound:
    """The sampled bound, computed anew (see `efficiency_bound`)."""
    begin = time.perf_counter()
    space, samples, free, floor = _optimised(domain, budget)
    for repair in range(3):
        inner = samples.motion.take(np.flatnonzero(domain.keeps(samples.motion.angles, 0.0)))
        check = domain.lattice(2 * budget.shapes + 1 + 2 * repair, 2 * budget.directions + 1 + 2 * repair, 0.0)
        worst = Samples(space, inner.joined(check))
        ratio = worst.ratio(free)[0]
        surprise = ratio.max() - samples.ratio(free)[0].max()
        if surprise < _SURPRISE or repair == 2:
            break
        samples = samples.joined(worst.motion.take(_largest(ratio, ratio.max() - 2 * surprise, 10 * _LARGEST_REFINED)))
        free, floor = linear_optimum(samples, free, budget.linear_rounds)
    top = int(np.argmax(ratio))
    missing = MISSING_MARGIN if domain.friction.isotropic else MISSING_LAW
    return Bound(
        float(ratio[top]),
        float(floor),
        None,
        missing.format(samples=ratio.size),
        tuple(worst.motion.angles[:, top].tolist()),
        tuple(worst.motion.rates[:, top].tolist()),
        domain.joint_limit,
        space.spline.intervals,
        space.harmonics,
        tuple(free.tolist()),
        int(ratio.size),
        time.perf_counter() - begin,
    )


def bound_key(domain: Domain, budget: Budget) -> str:
    """SHA-256 of what a bound depends on."""
    fields = {"version": VERSION, "domain": asdict(domain), "budget": asdict(budget)}
    return hash_of(fields)


def known_bound(
    body: Chain,
    friction: Friction,
    joint_limit: float = float(np.pi),
    *,
    budget: Budget = QUICK,
    cache: str | os.PathLike,
) -> Bound | None:
    """The bound that an earlier run left in the cache, or None; arguments as for `efficiency_bound`."""
    entry = load_entries(cache).get(bound_key(Domain(body, friction, float(joint_limit)), budget))
    if entry is None:
        return None
    fields: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in entry.items()}
    return Bound(**fields)


def efficiency_bound(
    body: Chain,
    friction: Friction,
    joint_limit: float = float(np.pi),
    *,
    budget: Budget = QUICK,
    cache: str | os.PathLike | None = None,
) -> Bound:
    """An upper bound on d/W over all gaits with |joint angles| <= joint_limit and links i, i + 2 not crossing.

    Parameters
    ----------
    body : Chain
        Two or three links; four are possible with a coarse budget.
    friction : Friction
        Coulomb friction, delta -> 0 (docs/bound.md states what finite delta changes).
    joint_limit : float
        At most pi.
    budget : Budget
    cache : path, optional
        A JSON file where bounds are kept by the hash of all inputs.

    Raises
    ------
    ProblemError
        For a joint limit outside (0, pi], more than four links, or an unreadable cache.
    """
    if not 0 < joint_limit <= np.pi + 1e-12:
        raise ProblemError(f"joint_limit must lie in (0, pi], not {joint_limit:g}.")
    if body.n_joint > 3:
        raise ProblemError(
            f"bounds are computed for at most four links, not {body.n_link}: the samples fill all of shape space."
        )
    known = known_bound(body, friction, joint_limit, budget=budget, cache=cache) if cache is not None else None
    if known is not None:
        return known
    domain = Domain(body, friction, float(joint_limit))
    key = bound_key(domain, budget)
    bound = compute_bound(domain, budget)
    if cache is not None:
        save_entry(cache, key, asdict(bound))
    return bound
