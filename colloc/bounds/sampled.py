"""An upper bound on the efficiency of every gait of a body: derivation in docs/bound.md.

A convex program chooses the potential whose largest (gain / power) over all shapes, headings and
rate directions is smallest, on samples; `research/guarantee` guarantees one for associated
friction.
"""

from __future__ import annotations

import os
import time
import warnings
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from colloc.bounds.coulomb_motion import MOST_LINKS
from colloc.bounds.cutting_plane import exchanged_optimum
from colloc.bounds.potential import PotentialSpace
from colloc.bounds.sampling import Domain
from colloc.bounds.spline import TensorSpline
from colloc.gaits.gait_fields import fields, statement_hash
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law
from colloc.system.errors import ProblemError, ReadOnlyRunWarning, StoreError
from colloc.system.row_file import CACHE, put_rows, read_rows

VERSION = 6
"""Part of the cache key: raise it when the computation changes its result."""


@dataclass(frozen=True)
class Budget:
    intervals: int = 12  # knot intervals of the splines in every joint angle, at most
    harmonics: tuple[int, ...] | None = None  # in the heading; by default `usual_harmonics`
    shapes: int = 20  # steps of every joint angle, and rate directions, of the first lattice
    directions: int = 48
    rounds: int = 60  # of climbs, at most
    starts: int = 250  # climbs a round
    tolerance: float = 5e-4  # excess of the summits over the program's value that counts as none
    first: int = 6  # even intervals to begin with; more knots go where they are worth most
    smoothing: float = 1e-5  # weight of the roughness of the potential
    together: int | None = None  # potentials are sums of functions of so many joint angles


QUICK = Budget()
FOUR_LINKS = Budget(
    5, None, 6, 40, 80, starts=400, tolerance=1e-3, first=5, smoothing=1e-4, together=2
)
"""Functions of two joint angles at a time: 81 unknowns do better than 108 products of three."""
FIVE_LINKS = replace(FOUR_LINKS, intervals=3, first=3, tolerance=3e-3)


def usual_budget(body: Chain) -> Budget:
    return {3: FOUR_LINKS, 4: FIVE_LINKS}.get(body.n_joint, QUICK)


def usual_harmonics(body: Chain, friction: Law) -> tuple[int, ...]:
    if not friction.reversible:
        return 0, 1
    return (1, 3) if body.n_joint <= 2 else (1,)


@dataclass(frozen=True)
class Bound:
    sampled: float  # largest ratio on any sample, or 1/min(mu) if less
    floor: float
    """Value of the last program: no potential of the space does better on the samples held."""
    converged: bool
    """Last climbs within the budget's tolerance of `floor`, those of a check within twice of it."""
    guaranteed: float | None  # certified between samples too (`research/guarantee`)
    missing: str  # what keeps the sampled value from being a theorem
    angles: tuple[float, ...]  # shape and rates where the sampled value is taken
    rates: tuple[float, ...]
    joint_limit: float
    intervals: int
    harmonics: tuple[int, ...]
    coefficients: tuple[float, ...]  # free ones of the potential, in `potential_space`
    samples: int
    seconds: float  # processor time
    graded: tuple[float, ...] = ()  # inner knots, if they are not evenly spaced
    together: int | None = None

    def potential_space(self, body: Chain) -> PotentialSpace:
        spline = TensorSpline(body.n_joint, self.joint_limit, self.intervals, self.graded)
        return PotentialSpace(spline, self.harmonics, body.symmetric, self.together)

    def report(self, efficiency: float) -> str:
        """Efficiency, bound, gap, and what is proved, in one line."""
        proved = (
            f"guaranteed {self.guaranteed:.4f}" if self.guaranteed is not None else self.missing
        )
        return (
            f"efficiency {efficiency:.4f}, upper bound {self.sampled:.4f}, gap "
            f"{self.sampled - efficiency:.4f} ({proved})"
        )


MISSING_MARGIN = "sampled at {samples} motions: not certified between them"
MISSING_LAW = (
    "sampled at {samples} motions: for this law the balance has no convex potential, so neither "
    "uniqueness of the "
    "motion nor a margin between samples is known"
)


def compute_bound(domain: Domain, budget: Budget) -> Bound:
    begin, body = time.process_time(), domain.body
    harmonics = budget.harmonics or usual_harmonics(body, domain.law)
    spline = TensorSpline(body.n_joint, domain.joint_limit, min(budget.first, budget.intervals))
    space = PotentialSpace(spline, harmonics, body.symmetric, budget.together)
    names = "intervals", "shapes", "directions", "rounds", "starts", "tolerance", "smoothing"
    settings = {name: getattr(budget, name) for name in names}
    best = exchanged_optimum(domain, space, **settings)
    missing = MISSING_MARGIN if domain.law.associated else MISSING_LAW
    return Bound(
        sampled=min(best.top, 1.0 / domain.law.smallest),
        floor=best.floor,
        converged=best.converged,
        guaranteed=None,
        missing=missing.format(samples=best.samples),
        angles=tuple(best.summit.angles[:, 0].tolist()),
        rates=tuple(best.summit.rates[:, 0].tolist()),
        joint_limit=domain.joint_limit,
        intervals=best.space.spline.intervals,
        harmonics=harmonics,
        coefficients=tuple(best.free.tolist()),
        samples=best.samples,
        seconds=time.process_time() - begin,
        graded=best.space.spline.graded,
        together=budget.together,
    )


def bound_key(domain: Domain, budget: Budget) -> str:
    """SHA-256 of what a bound depends on."""
    stated = {
        "body": fields(domain.body),
        "friction": fields(domain.friction),
        "joint_limit": domain.joint_limit,
    }
    return statement_hash({"version": VERSION, "domain": stated, "budget": asdict(budget)})


def known_bound(
    body: Chain,
    friction: Friction,
    joint_limit: float = float(np.pi),
    *,
    budget: Budget | None = None,
    cache: str | os.PathLike,
) -> Bound | None:
    """The bound of an earlier run in the cache, or None."""
    key = bound_key(Domain(body, friction, float(joint_limit)), budget or usual_budget(body))
    entry = read_rows(Path(cache), CACHE).get(key)
    if entry is None:
        return None
    try:
        stored: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else v for k, v in entry.items()
        }
        return Bound(**stored)
    except (TypeError, AttributeError):
        raise StoreError(f"{cache} holds something else than bounds; move it away.") from None


def efficiency_bound(
    body: Chain,
    friction: Friction,
    joint_limit: float = float(np.pi),
    *,
    budget: Budget | None = None,
    cache: str | os.PathLike | None = None,
) -> Bound:
    """An upper bound on d/W over all gaits with |joint angles| <= joint_limit whose links do not
    cross, for delta -> 0; kept in an SQLite file `cache`, which if it cannot be written costs a
    warning."""
    if not 0 < joint_limit <= np.pi + 1e-12:
        raise ProblemError(f"joint_limit must lie in (0, pi], not {joint_limit:g}.")
    if body.n_link > MOST_LINKS:
        raise ProblemError(
            f"bounds are computed for at most {MOST_LINKS} links, not {body.n_link}: the samples "
            f"fill all of shape space."
        )
    budget = budget or usual_budget(body)
    if cache is not None:
        known = known_bound(body, friction, joint_limit, budget=budget, cache=cache)
        if known is not None:
            return known
    domain = Domain(body, friction, float(joint_limit))
    if domain.law.reversible and any(k % 2 == 0 for k in budget.harmonics or ()):
        raise ProblemError(
            "even harmonics do nothing where mu_b = mu_f (reversal in time): name odd ones only."
        )
    bound = compute_bound(domain, budget)
    if cache is not None:
        try:
            put_rows(Path(cache), CACHE, {bound_key(domain, budget): asdict(bound)})
        except StoreError as error:
            warnings.warn(f"{error} The bound is not kept.", ReadOnlyRunWarning, stacklevel=2)
    return bound
