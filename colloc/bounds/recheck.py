"""What a potential proves on samples that nobody chose for it: a lattice and climbs of their own.

A sampled bound is a potential; how it was found does not matter. So its value can be looked for
again by anyone, as densely as one likes, from the potential alone.
"""

from __future__ import annotations

import numpy as np

from colloc.bounds.coulomb_motion import CoulombMotion
from colloc.bounds.potential import PotentialSpace, largest_ratios
from colloc.bounds.sampling import Domain

_WINDOW = 0.03
_STEPS = 30


def near_the_top(
    motion: CoulombMotion, ratio: np.ndarray, level: float, spacing: float, count: int
) -> np.ndarray:
    """Indices of up to `count` of the largest that come near `level`, one for each cell of shapes
    and directions."""
    near = np.flatnonzero(ratio > level - _WINDOW)
    near = near[np.argsort(-ratio[near])]
    cell = np.concatenate(
        [np.rint(motion.angles[:, near] / spacing), np.rint(motion.rates[:, near] * 4.0)]
    ).T
    _, first = np.unique(cell, axis=0, return_index=True)
    return near[np.sort(first)][:count]


def summits_met(
    domain: Domain,
    space: PotentialSpace,
    free: np.ndarray,
    *,
    shapes: int = 60,
    directions: int = 120,
    starts: int = 1000,
    seed: int = 0,
    level: float = np.inf,
) -> tuple[np.ndarray, CoulombMotion]:
    """Ratios of gain to power ``(n,)`` where climbs from the best of a lattice end, and the
    motions.

    Parameters
    ----------
    domain : Domain
    space : PotentialSpace
    free : (space.size,)
        The potential.
    shapes, directions, starts : int
        Of the lattice, and climbs.
    seed : int
        Of the climbs; it also moves the lattice.
    level : float
        Climbs begin near it and above, or near the largest ratio on the lattice if that is less.
    """
    rng = np.random.default_rng(seed)

    def ratio(motion: CoulombMotion) -> np.ndarray:
        return largest_ratios(space, free, motion)

    lattice = domain.lattice(shapes, directions, float(rng.uniform(0.1, 0.9)))
    values, spacing = ratio(lattice), 2.0 * domain.joint_limit / shapes
    chosen = near_the_top(lattice, values, min(level, float(values.max())), spacing, starts)
    summit = domain.summits(
        ratio, lattice.take(chosen), 0.5 * spacing, 0.5 * np.pi / directions, _STEPS, rng
    )
    return ratio(summit), summit


def largest_ratio(
    domain: Domain, space: PotentialSpace, free: np.ndarray, **settings: int
) -> tuple[float, CoulombMotion]:
    """The largest ratio of gain to power that a lattice and climbs from its best meet, and the
    motion; see `summits_met`."""
    reached, summit = summits_met(domain, space, free, **settings)
    best = int(np.argmax(reached))
    return float(reached[best]), summit.take(np.array([best]))
