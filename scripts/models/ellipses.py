r"""The paper's three-parameter family of one-harmonic gaits of three equal links: which are
admissible, their distance, work and efficiency, local maxima.

``angle_1 = A0 + A1 cos + B1 sin``, ``angle_2 = -A0 - A1 cos + B1 sin`` (paper, section V). A0, A1,
B1 >= 0 holds one of each class of gaits that have equal distance and work: half a period of phase
turns (A1, B1) into (-A1, -B1), the mirror image turns all signs, and time reversal (mu_b = mu_f)
turns B1.

As the second half period repeats the displacement and the work of the first, instants ``t_k = (k +
1/2)/n``, k < n/2, are the midpoint rule with n instants over the whole period. The rule is of second
order: velocities have kinks where links stick. Displacement is that of the middle of the body, which
the symmetry maps to itself; its velocity and rotation are those of the middle link, so no sines and
cosines of the posture enter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter
from scipy.optimize import minimize

from colloc.gaits.harmonic import ellipse
from colloc.mechanics.balance import instant, total_power
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.verification.adaptive_motion import Replay
from colloc.verification.replay import replay
from scripts.paper.study import parallel_map

BODY, ISOTROPIC = Chain(), Friction()
_CHECKED_PHASES = 400
_CHUNK_INSTANTS = 10_000
"""Instants evaluated together: few enough to stay in cache, enough to hide the interpreter."""
_TOLERANCE = 1e-8


def ellipse_angles(gaits: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles and rates, each ``(2, n_gait, n_time)``, of gaits ``(3, n_gait)`` (A0, A1, B1)
    at phases t."""
    A0, A1, B1 = np.asarray(gaits, dtype=float)[:, :, None]
    cos, sin = np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)
    along, across = A0 + A1 * cos, B1 * sin
    along_rate, across_rate = -2 * np.pi * A1 * sin, 2 * np.pi * B1 * cos
    return np.stack([along + across, across - along]), np.stack(
        [along_rate + across_rate, across_rate - along_rate]
    )


def contact_reach(gaits: np.ndarray) -> np.ndarray:
    """Largest value of ``min(2 angle_1 + angle_2, angle_1 + 2 angle_2)`` along each gait ``(3,
    n_gait)``, exactly.

    With equal links, links 1 and 3 cross iff it exceeds 2 pi. With c = A0 + A1 cos it is the
    maximum of ``3 B1 sin - |c|``: where c = 0, unless the maximum of ``3 B1 sin - c`` lies at c >
    0.
    """
    A0, A1, B1 = np.abs(np.asarray(gaits, dtype=float))
    radius = np.hypot(A1, 3 * B1)
    # c at the maximum of the smooth branch is A0 - A1^2/radius
    smooth = A0 * radius >= A1 * A1
    ratio = np.divide(A0, A1, out=np.ones_like(A0), where=~smooth)
    return np.where(smooth, radius - A0, 3 * B1 * np.sqrt(np.clip(1 - ratio * ratio, 0, None)))


def admissible(
    body: Chain, gaits: np.ndarray, joint_limit: float = np.pi, slack: float = 1e-9
) -> np.ndarray:
    """Whether gaits ``(3, n_gait)`` keep |angles| <= joint_limit and links apart: exact for three
    equal links.

    For unequal links crossing is looked for at 400 phases of half a period.
    """
    gaits = np.asarray(gaits, dtype=float)
    A0, A1, B1 = np.abs(gaits)
    inside = A0 + np.hypot(A1, B1) <= joint_limit + slack
    if len(set(body.lengths)) == 1:
        return inside & (contact_reach(gaits) <= 2 * np.pi + slack)
    for gait in np.flatnonzero(inside):
        angles, _ = ellipse_angles(gaits[:, gait : gait + 1], np.linspace(0, 0.5, _CHECKED_PHASES))
        inside[gait] = crossing_depth(body, angles[:, 0]).max() <= slack
    return inside


def largest_amplitude(A0: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Largest admissible ``hypot(A1, B1)`` for a centre A0 and direction ``angle = atan2(B1, A1)``,
    by bisection."""
    A0, angle = np.broadcast_arrays(np.asarray(A0, dtype=float), angle)
    low, high = np.zeros(A0.shape), np.full(A0.shape, np.pi)
    for _ in range(52):
        middle = 0.5 * (low + high)
        gaits = np.stack([A0, middle * np.cos(angle), middle * np.sin(angle)])
        inside = admissible(BODY, gaits.reshape(3, -1), slack=0.0).reshape(A0.shape)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low


@dataclass(frozen=True, eq=False)
class GaitGrid:
    """A rectangular grid of gaits, and the admissible ones on it."""

    A0: np.ndarray
    A1: np.ndarray
    B1: np.ndarray
    inside: np.ndarray

    @property
    def gaits(self) -> np.ndarray:
        """The admissible gaits ``(3, n_gait)``, in the order of ``inside`` flattened."""
        return np.stack(
            [a[self.inside] for a in np.meshgrid(self.A0, self.A1, self.B1, indexing="ij")]
        )

    def unflattened(self, values: np.ndarray) -> np.ndarray:
        """Values of the admissible gaits on the whole grid, NaN elsewhere."""
        result = np.full(self.inside.shape, np.nan)
        result[self.inside] = values
        return result


def gait_grid(step: float, *, A0: np.ndarray | None = None) -> GaitGrid:
    """Gaits with A0, A1, B1 >= 0 on a grid of the given step [rad]; `A0` replaces the first
    axis."""
    nodes = step * np.arange(int(np.pi / step + 1e-9) + 1)
    first = nodes if A0 is None else A0
    gaits = np.stack(np.meshgrid(first, nodes, nodes, indexing="ij"))
    inside = admissible(BODY, gaits.reshape(3, -1)).reshape(gaits.shape[1:])
    return GaitGrid(first, nodes, nodes, inside)


class Performance(NamedTuple):
    """Distance and work per period of gaits, each ``(n_gait,)``."""

    distance: np.ndarray
    work: np.ndarray

    @property
    def efficiency(self) -> np.ndarray:
        """d/W; 0 for a gait that does no work."""
        return np.divide(
            self.distance, self.work, out=np.zeros_like(self.work), where=self.work > 0
        )


def _chunk(gaits: np.ndarray, *, delta: float, instants: int) -> Performance:
    n_gait, half = gaits.shape[1], instants // 2
    t = (np.arange(half) + 0.5) / instants
    angles, rates = (a.reshape(2, -1) for a in ellipse_angles(gaits, t))
    z = solve_balance(BODY, ISOTROPIC, angles, rates, delta, tolerance=_TOLERANCE).require().z
    now = instant(BODY, ISOTROPIC, angles, rates, z, delta)
    work = 2.0 / instants * total_power(now.velocity, now.force).reshape(n_gait, half).sum(axis=1)
    vs, vn, w = (row[1].reshape(n_gait, half) for row in now.velocity)
    theta = (np.cumsum(w, axis=1) - 0.5 * w) / instants
    way = ((vs + 1j * vn) * np.exp(1j * theta)).sum(axis=1)
    return Performance(2.0 / instants * np.abs(way), work)


def performance(
    delta: float, gaits: np.ndarray, instants: int = 100, processes: int = 1, label: str = ""
) -> Performance:
    """Distance and work of ellipse gaits (A0, A1, B1), ``(3, n_gait)``, at an even number of
    instants, half of which are evaluated."""
    chunks = max(1, -(-gaits.shape[1] * instants // 2 // _CHUNK_INSTANTS))
    tasks = np.array_split(gaits, chunks, axis=1)
    one = partial(_chunk, delta=delta, instants=instants)
    results = parallel_map(one, tasks, processes=processes, label=label)
    return Performance(*(np.concatenate(parts) for parts in zip(*results, strict=True)))


def local_maxima(values: np.ndarray) -> np.ndarray:
    """Indices ``(n_maximum, ndim)`` of nodes above all their neighbours (diagonals too; NaN counts
    as lower), best first."""
    filled = np.where(np.isnan(values), -np.inf, values)
    around = np.ones((3,) * values.ndim, dtype=bool)
    around[(1,) * values.ndim] = False
    highest = maximum_filter(filled, footprint=around, mode="constant", cval=-np.inf)
    found = np.argwhere((filled > highest) & np.isfinite(filled))
    return found[np.argsort(-values[tuple(found.T)], kind="stable")]


@dataclass(frozen=True)
class Maximum:
    """A local maximum of the efficiency over ellipse gaits."""

    gait: np.ndarray  # (A0, A1, B1)
    replay: Replay
    at_contact: bool
    position_error: float


def refined_maximum(
    delta: float, gait: np.ndarray, instants: int = 800, size: float = 0.02
) -> Maximum:
    """Climb from a gait (A0, A1, B1) to the local maximum of the efficiency nearby, with half the
    instants and then all, by Nelder and Mead's simplex; and replay it."""

    def gait_at(x: np.ndarray) -> np.ndarray:
        """From A0, the fraction of the largest amplitude, and the direction."""
        A0, direction = abs(x[0]), np.clip(x[2], 0.0, 0.5 * np.pi)
        amplitude = min(x[1], 1.0) * largest_amplitude(A0, direction)
        return np.array([A0, amplitude * np.cos(direction), amplitude * np.sin(direction)])

    def coordinates(gait: np.ndarray) -> np.ndarray:
        direction = np.arctan2(gait[2], gait[1])
        return np.array(
            [gait[0], np.hypot(*gait[1:]) / largest_amplitude(gait[0], direction), direction]
        )

    def climbed(start: np.ndarray, instants: int, size: float) -> np.ndarray:
        def loss(x: np.ndarray) -> float:
            if x[1] <= 0.02 or abs(x[0]) > np.pi - 0.02:
                return 0.0
            beyond = max(0.0, x[1] - 1.0)  # leads back to the boundary
            return float(beyond - performance(delta, gait_at(x)[:, None], instants).efficiency[0])

        inward = np.where(start[1] > 1 - size, [1, -1, 1], 1)
        simplex = start + size * np.vstack([np.zeros(3), np.eye(3) * inward])
        options = {"initial_simplex": simplex, "xatol": 1e-5, "fatol": 1e-10, "maxfev": 400}
        return gait_at(minimize(loss, start, method="Nelder-Mead", options=options).x)

    coarse = climbed(coordinates(gait), instants // 2, size)
    fine = climbed(coordinates(coarse), instants, 0.25 * size)
    at_contact = bool(coordinates(fine)[1] > 1 - 1e-4)
    path = ellipse(*fine)
    exact = replay(BODY, ISOTROPIC, lambda t: (path.angles(t), path.rates(t)), delta)
    return Maximum(fine, exact, at_contact, float(np.abs(fine - coarse).max()))


def distinct_maxima(
    delta: float, values: np.ndarray, gaits: np.ndarray, instants: int = 800
) -> list[Maximum]:
    """The different local maxima that the best 40 maxima of a grid climb to, best first."""
    found: list[Maximum] = []

    def known(gait: np.ndarray) -> bool:
        return any(np.abs(gait - one.gait).max() < 0.1 for one in found)

    for index in local_maxima(values)[:40]:
        if not known(start := gaits[(slice(None), *index)]):
            maximum = refined_maximum(delta, start, instants)
            found += [] if known(maximum.gait) else [maximum]
    return sorted(found, key=lambda one: -one.replay.efficiency)
