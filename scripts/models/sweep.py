"""Distance, work and efficiency of many ellipse gaits: direct, or through the velocity map; local
maxima, refined.

With a body that reads the same from both ends and mu_b = mu_f, the second half period of an ellipse
gait repeats the displacement and the work of the first (see `gaits.symmetry`), so instants ``t_k =
(k + 1/2)/n``, k < n/2, are the midpoint rule with n instants over the whole period. The rule is of
second order: velocities have kinks where links stick. Displacement is that of the middle of the
body, which the symmetry maps to itself; its velocity and rotation are those of the middle link, so
no sines and cosines of the posture enter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from colloc.gaits.harmonic import ellipse
from colloc.mechanics.balance import instant, total_power
from colloc.mechanics.chain import Chain
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.system.errors import ProblemError
from colloc.verification.adaptive_motion import Replay
from colloc.verification.replay import replay
from scripts.models.ellipses import ellipse_angles, largest_amplitude
from scripts.models.velocity_map import VelocityMap
from scripts.paper.parallel import parallel_map

_CHUNK_INSTANTS = 10_000
"""Instants evaluated together: few enough to stay in cache, enough to hide the interpreter."""
_DIRECT_TOLERANCE = 1e-8


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


@dataclass(frozen=True)
class Route:
    """How tail velocities are found for a symmetric body with mu_b = mu_f: directly, begun at the map's,
    or by the map alone; delta per period."""

    body: Chain
    friction: Friction
    delta: float
    velocity_map: VelocityMap | None = None
    direct: bool = True
    method: str = "cubic"

    def __post_init__(self) -> None:
        if self.body.n_link != 3 or not self.body.symmetric or not self.friction.reversible:
            raise ProblemError(
                "a sweep over ellipse gaits needs three links that are symmetric end to end and "
                "mu_b = mu_f."
            )
        if not self.direct and self.velocity_map is None:
            raise ProblemError("the route through the map needs a velocity_map.")
        known = self.velocity_map
        if known is not None and (known.body != self.body or known.friction != self.friction):
            raise ProblemError(
                "the velocity map was made for another body or other friction coefficients."
            )

    def tail_velocity(self, angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Tail velocities (u, v, omega), ``(3, n_time)``."""
        z = None
        if self.velocity_map is not None:
            z = self.velocity_map.tail_velocity(angles, rates, method=self.method)
        if not self.direct:
            return z  # type: ignore[return-value]
        solved = solve_balance(
            self.body,
            self.friction,
            angles,
            rates,
            self.delta,
            start=z,
            tolerance=_DIRECT_TOLERANCE,
        )
        return solved.require().z


def _chunk_performance(gaits: np.ndarray, *, route: Route, instants: int) -> Performance:
    half = instants // 2
    n_gait = gaits.shape[1]
    t = (np.arange(half) + 0.5) / instants
    angles, rates = (a.reshape(2, -1) for a in ellipse_angles(gaits, t))
    z = route.tail_velocity(angles, rates)
    now = instant(route.body, route.friction, angles, rates, z, route.delta)
    work = 2.0 / instants * total_power(now.velocity, now.force).reshape(n_gait, half).sum(axis=1)
    vs, vn, w = (row[1].reshape(n_gait, half) for row in now.velocity)
    theta = (np.cumsum(w, axis=1) - 0.5 * w) / instants
    cos, sin = np.cos(theta), np.sin(theta)
    dx, dy = (cos * vs - sin * vn).sum(axis=1), (sin * vs + cos * vn).sum(axis=1)
    return Performance(2.0 / instants * np.hypot(dx, dy), work)


def performance(
    route: Route,
    gaits: np.ndarray,
    *,
    instants: int = 100,
    processes: int | None = 1,
    label: str = "",
) -> Performance:
    """Distance and work of ellipse gaits (A0, A1, B1), ``(3, n_gait)``, at an even number of instants, half
    of which are evaluated."""
    gaits = np.asarray(gaits, dtype=float)
    if gaits.ndim != 2 or len(gaits) != 3:
        raise ProblemError(f"gaits must have shape (3, n_gait), not {gaits.shape}.")
    if instants < 4 or instants % 2:
        raise ProblemError(f"instants must be even and at least 4, not {instants}.")
    chunks = max(1, -(-gaits.shape[1] * instants // 2 // _CHUNK_INSTANTS))
    tasks = np.array_split(gaits, chunks, axis=1)
    results = parallel_map(
        partial(_chunk_performance, route=route, instants=instants),
        tasks,
        processes=processes,
        label=label,
    )
    return Performance(*(np.concatenate(parts) for parts in zip(*results, strict=True)))


def local_maxima(values: np.ndarray) -> np.ndarray:
    """Indices ``(n_maximum, ndim)`` of nodes above all their neighbours (diagonals too; NaN counts
    as lower), best first."""
    filled = np.where(np.isnan(values), -np.inf, values)
    padded = np.pad(filled, 1, constant_values=-np.inf)
    highest = np.full(values.shape, -np.inf)
    for offset in np.ndindex(*(3,) * values.ndim):
        if any(o != 1 for o in offset):
            window = tuple(slice(o, o + n) for o, n in zip(offset, values.shape, strict=True))
            np.maximum(highest, padded[window], out=highest)
    found = np.argwhere((filled > highest) & np.isfinite(filled))
    return found[np.argsort(-values[tuple(found.T)], kind="stable")]


@dataclass(frozen=True)
class Maximum:
    """A local maximum of the efficiency over ellipse gaits."""

    A0: float
    A1: float
    B1: float
    replay: Replay
    at_contact: bool
    position_error: float


def _climbed(route: Route, start: np.ndarray, instants: int, size: float) -> np.ndarray:
    """(A0, fraction of the largest amplitude, direction) that maximises the efficiency, by Nelder
    and Mead's simplex."""

    def gait(x: np.ndarray) -> np.ndarray:
        A0, direction = abs(x[0]), np.clip(x[2], 0.0, 0.5 * np.pi)
        amplitude = min(x[1], 1.0) * largest_amplitude(route.body, A0, direction)
        return np.array([[A0], [amplitude * np.cos(direction)], [amplitude * np.sin(direction)]])

    def loss(x: np.ndarray) -> float:
        if x[1] <= 0.02 or abs(x[0]) > np.pi - 0.02:
            return 0.0
        beyond = max(0.0, x[1] - 1.0)  # leads back to the boundary
        return float(-performance(route, gait(x), instants=instants).efficiency[0] + beyond)

    simplex = start + size * np.vstack(
        [np.zeros(3), np.eye(3) * np.where(start[1] > 1 - size, [1, -1, 1], 1)]
    )
    options = {"initial_simplex": simplex, "xatol": 1e-5, "fatol": 1e-10, "maxfev": 400}
    found = minimize(loss, start, method="Nelder-Mead", options=options).x
    return gait(found)[:, 0]


def refined_maximum(
    route: Route, gait: np.ndarray, *, instants: int = 800, size: float = 0.02
) -> Maximum:
    """Climb from a gait (A0, A1, B1) to the local maximum of the efficiency nearby, and replay it
    directly."""
    body = route.body

    def coordinates(values: np.ndarray) -> np.ndarray:
        direction = np.arctan2(values[2], values[1])
        return np.array(
            [
                values[0],
                np.hypot(*values[1:]) / largest_amplitude(body, values[0], direction),
                direction,
            ]
        )

    coarse = _climbed(route, coordinates(np.asarray(gait, dtype=float)), instants // 2, size)
    fine = _climbed(route, coordinates(coarse), instants, 0.25 * size)
    fraction = coordinates(fine)[1]
    path = ellipse(*fine)
    exact = replay(body, route.friction, lambda t: (path.angles(t), path.rates(t)), route.delta)
    A0, A1, B1 = (float(a) for a in fine)
    return Maximum(A0, A1, B1, exact, bool(fraction > 1 - 1e-4), float(np.abs(fine - coarse).max()))


def distinct_maxima(
    route: Route,
    values: np.ndarray,
    gaits: np.ndarray,
    *,
    most: int = 40,
    apart: float = 0.1,
    instants: int = 800,
) -> list[Maximum]:
    """The different local maxima that the maxima of a grid climb to, best first."""
    found: list[Maximum] = []
    for index in local_maxima(values)[:most]:
        start = gaits[(slice(None), *index)]
        if any(np.abs(start - (m.A0, m.A1, m.B1)).max() < apart for m in found):
            continue
        maximum = refined_maximum(route, start, instants=instants)
        place = np.array([maximum.A0, maximum.A1, maximum.B1])
        if all(np.abs(place - (m.A0, m.A1, m.B1)).max() >= apart for m in found):
            found.append(maximum)
    return sorted(found, key=lambda m: -m.replay.efficiency)
