"""Joint angles over time for a machine: a period in seconds, within joint speed limits.

Distance and work under dry friction do not depend on pacing. With phase t and time tau, pacing is
``d tau/dt = p(t)``, and joint j moves at ``|dq_j/dt| / p``. Speed limits v_j ask for ``p >= s(t) =
max_j |dq_j/dt| / v_j``; the least change of an even pace that takes T seconds is

    p(t) = max(level, s(t)),   level such that  int p dt = T.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from colloc.gaits.robot import checked_actuator_limit, of_each
from colloc.system.arguments import check_finite
from colloc.system.errors import ProblemError
from colloc.verification.adaptive_motion import Path

_PHASES = np.linspace(0.0, 1.0, 20001)
MOST_SAMPLES = 2_000_000
_APPROACH = 5000  # steps in which the clock of an approach is summed up


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One cycle at a fixed rate of samples; the sample after the last is the first."""

    time: np.ndarray  # seconds, 0, 1/rate, ..., period - 1/rate, (n,)
    phase: np.ndarray  # of the gait, in [0, 1), (n,)
    angles: np.ndarray  # [rad], (n_joint, n)
    speeds: np.ndarray  # [rad/s], (n_joint, n)
    period: float  # seconds; a whole number of samples


def plan_trajectory(
    path: Path,
    rate: float,
    period: float | None = None,
    limits: np.ndarray | float | None = None,
    *,
    keep_pace: bool = False,
) -> Trajectory:
    """Sample a path at `rate` samples a second, with speed limits [rad/s], ``(n_joint,)`` or one.

    The period [s] is rounded up to whole samples; by default it is the shortest within the limits.
    To keep the gait's pace, limits make it longer. `ProblemError` for what cannot be.
    """
    from scipy.optimize import brentq

    check_finite(positive=True, rate=rate, period=1.0 if period is None else period)
    vertices, _ = path(_PHASES)
    most = np.full(len(vertices), np.inf)
    if limits is not None:
        most = one_each(limits, len(vertices), "joint speed limit")
    elif period is None:
        raise ProblemError("a trajectory needs a period in seconds or joint speed limits.")
    slowest = _slowest(vertices, most, keep_pace)
    shortest = float(slowest.mean())
    cycle = shortest if period is None else period
    if cycle < shortest * (1 - 1e-9):
        pace = " at the gait's own pace, which matters here" if keep_pace else ""
        raise ProblemError(
            f"a cycle of {cycle:g} s is too short for the joint speed limits{pace}; use at least "
            f"{shortest:.6g} s."
        )
    count = int(np.ceil(cycle * rate * (1 - 1e-6)))  # one at its bound is longer
    if not 4 <= count <= MOST_SAMPLES:
        raise ProblemError(
            f"{count:g} samples per cycle are too {'few' if count < 4 else 'many'}; change the "
            f"rate or the period."
        )
    period, level = count / rate, 0.0

    def excess(level):
        return float(np.maximum(level, slowest).mean()) - period

    if excess(0.0) < 0:
        level = float(brentq(excess, 0.0, 2 * period, xtol=1e-14, rtol=1e-14))
    pace = np.maximum(level, slowest)
    clock = np.append(0.0, np.cumsum(pace) / pace.size)
    clock *= period / clock[-1]
    time = np.arange(count) / rate
    phase, *angles = (np.interp(time, clock, row) for row in (_PHASES, *vertices))
    speeds = _within(path(phase)[1], pace, clock, time, most)
    return Trajectory(time, phase, np.array(angles), speeds, period)


def _within(
    speeds: np.ndarray, pace: np.ndarray, clock: np.ndarray, time: np.ndarray, most: np.ndarray
) -> np.ndarray:
    index = np.clip(np.searchsorted(clock, time, side="right") - 1, 0, pace.size - 1)
    return np.clip(speeds / pace[index], -most[:, None], most[:, None])


class Approach(NamedTuple):
    time: np.ndarray  # seconds, below 0, (n,)
    angles: np.ndarray
    speeds: np.ndarray


def approach(trajectory: Trajectory, rate: float, limits: np.ndarray) -> Approach:
    """Grow a gait from the straight body at rest into a trajectory within limits ``(n_joint,)``.

    Over a cycle joints are ``a(t) q(t)``, a rising from 0 to 1 and flat at both ends; where a
    joint would be too fast, the clock slows down.
    """
    from scipy.interpolate import CubicHermiteSpline

    period, both = trajectory.period, (trajectory.angles, trajectory.speeds)
    closed = (np.append(rows, rows[:, :1], axis=1) for rows in both)
    cycle = CubicHermiteSpline(np.append(trajectory.time, period), *closed, axis=1)
    share = np.linspace(0.0, 1.0, _APPROACH + 1)
    grown = share**3 * (10.0 + share * (6.0 * share - 15.0))
    growth = 30.0 * share**2 * (1.0 - share) ** 2 / period
    bent, turning = cycle(share * period), cycle(share * period, 1)
    angles, speeds = grown * bent + 0.0, grown * turning + growth * bent + 0.0  # no -0
    step = period / _APPROACH
    pace = np.maximum(1.0, np.abs(np.diff(angles) / step / limits[:, None]).max(axis=0))
    clock = np.append(0.0, np.cumsum(pace)) * step
    time = np.arange(-int(np.ceil(clock[-1] * rate - 1e-9)), 0) / rate
    at = time + clock[-1]
    angles, speeds = (
        np.array([np.interp(at, clock, r) for r in rows]) for rows in (angles, speeds)
    )
    return Approach(time, angles, _within(speeds, pace, clock, at, limits))


def shortest_period(path: Path, limits: np.ndarray, *, keep_pace: bool = False) -> float:
    return float(_slowest(path(_PHASES)[0], limits, keep_pace).mean())


def _slowest(vertices: np.ndarray, limits: np.ndarray, keep_pace: bool) -> np.ndarray:
    """Seconds per phase that speed limits ask for, on every side of a path as a polygon, ``(n -
    1,)``."""
    slowest = (np.abs(np.diff(vertices, axis=1)) * (_PHASES.size - 1) / limits[:, None]).max(axis=0)
    return np.full_like(slowest, slowest.max()) if keep_pace else slowest


def one_each(limits: np.ndarray | Sequence[float] | float, n_joint: int, what: str) -> np.ndarray:
    """Positive limits ``(n_joint,)`` from one for all or one each."""
    limit = np.ravel(limits)[0] if np.size(limits) == 1 else limits
    return np.array(of_each(checked_actuator_limit(what, limit, n_joint), n_joint))
