"""Independent replay of a gait: from the joint angles alone to distance, work and rotation, by the NumPy solver.

It shares nothing with collocation but the friction law: no scheme, no mesh, no symmetry, no interpolant. Velocities are
solved for on a uniform grid over the whole period and integrated by Simpson's rule; doubling the grid gives the error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import cumulative_simpson, simpson

from colloc.mechanics.balance import Instant, instant, total_power
from colloc.mechanics.body import Chain
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.system.errors import ProblemError

Path = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Joint angles and rates, each ``(n_joint, n_time)``, at phases ``(n_time,)``."""


_ONE_SIDED = 1e-12


@dataclass(frozen=True)
class Replay:
    """A gait replayed over one period.

    Attributes
    ----------
    distance, work, efficiency : float
    rotation : float
        Net rotation over the period [rad]; the distance means something only if it vanishes.
    actuator_work : float
        Work of the joints, from the moments of the friction forces about them; equals `work` in balance.
    residual : float
        Largest force or torque left over.
    error : float
        Estimated relative error of the efficiency, from the grid of half as many instants.
    instants : int
    """

    distance: float
    work: float
    efficiency: float
    rotation: float
    actuator_work: float
    residual: float
    error: float
    instants: int


def _actuator_power(body: Chain, now: Instant, angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Power of the joint moments, ``(n_time,)``: moment at a joint balances the friction on all links ahead of it."""
    x, y = body.joints(angles)
    fx = now.force.tangential * now.posture.cos - now.force.normal * now.posture.sin
    fy = now.force.tangential * now.posture.sin + now.force.normal * now.posture.cos
    power = np.zeros(angles.shape[1])
    for joint in range(body.n_joint):
        ahead = slice(joint + 1, None)
        arm_x, arm_y = now.posture.x[ahead] - x[joint + 1], now.posture.y[ahead] - y[joint + 1]
        moment = (arm_x * fy[ahead] - arm_y * fx[ahead] + now.force.couple[ahead]).sum(axis=0)
        power -= moment * rates[joint]
    return power


def _at(body: Chain, friction: Friction, path: Path, delta: float, t: np.ndarray) -> tuple[np.ndarray, ...]:
    """Times, rotation rate, centre velocity, power, actuator power and residual at instants t."""
    angles, rates = path(t)
    solved = solve_balance(body, friction, angles, rates, delta).require()
    now = instant(body, friction, angles, rates, solved.z, delta)
    cx, cy = body.centre_velocity(now.posture, now.velocity)
    power = total_power(now.velocity, now.force)[0]
    return t, solved.z[2], cx[0], cy[0], power, _actuator_power(body, now, angles, rates), solved.residual


def _integrated(segments: list[tuple[np.ndarray, ...]], every: int) -> tuple[float, float, float, float, float]:
    """Distance, work, rotation, actuator work and largest residual, by Simpson's rule on every `every`-th instant."""
    heading, end, worked, actuated, worst = 0.0, 0j, 0.0, 0.0, 0.0
    for segment in segments:
        t, omega, cx, cy, power, actuator, residual = (a[::every] for a in segment)
        theta = heading + cumulative_simpson(omega, x=t, initial=0.0)
        c, s = np.cos(theta), np.sin(theta)
        end += simpson(c * cx - s * cy, x=t) + 1j * simpson(s * cx + c * cy, x=t)
        heading = float(theta[-1])
        worked, actuated = worked + float(simpson(power, x=t)), actuated + float(simpson(actuator, x=t))
        worst = max(worst, float(residual.max()))
    return float(abs(end)), worked, heading, actuated, worst


def replay(
    body: Chain,
    friction: Friction,
    path: Path,
    delta: float,
    *,
    instants: int = 1600,
    tolerance: float = 1e-6,
    most_instants: int = 25600,
    breaks: np.ndarray | tuple[float, ...] = (),
) -> Replay:
    """Distance, work and efficiency of a path over one period, to a relative error in the efficiency.

    Parameters
    ----------
    body, friction
    path : callable
        Joint angles and rates at phases in [0, 1].
    delta : float
        Regularisation speed, per period.
    instants : int
        Grid to begin with (even); it doubles until the estimated error is below `tolerance`.
    tolerance : float
        Relative error of the efficiency.
    most_instants : int
    breaks : (n,), optional
        Phases in (0, 1) where the rates jump (corners); they are integrated up to and from there.

    Raises
    ------
    ProblemError
        If the path does not move, or the grid is too small.
    NotConvergedError
        If the balance cannot be solved at some instant.
    """
    if instants < 4 or instants % 2:
        raise ProblemError(f"instants must be an even number of at least 4, not {instants!r}.")
    ends = np.concatenate([[0.0], np.asarray(breaks, dtype=float), [1.0]])
    segments = []
    for a, b in pairwise(ends):
        count = 4 * max(1, round(instants * (b - a) / 4))
        grid = np.linspace(a, b, count + 1)
        # one-sided limits at jumps
        inside = grid.copy()
        inside[0] += _ONE_SIDED * (b - a) if a > 0 else 0.0
        inside[-1] -= _ONE_SIDED * (b - a) if b < 1 else 0.0
        segments.append((grid, *_at(body, friction, path, delta, inside)[1:]))
    while True:
        fine, coarse = _integrated(segments, 1), _integrated(segments, 2)
        if not (fine[1] > 0 and coarse[1] > 0):
            raise ProblemError("the path does not move, or too little to do work against friction: it has no efficiency.")
        # kinks at stick limit the order to two: the difference over three estimates the finer grid's error
        efficiency, before = fine[0] / fine[1], coarse[0] / coarse[1]
        error = abs(efficiency - before) / 3 / max(abs(efficiency), 1e-300)
        n = sum(segment[0].size - 1 for segment in segments)
        if error <= tolerance or 2 * n > most_instants:
            return Replay(fine[0], fine[1], efficiency, fine[2], fine[3], fine[4], error, n)
        segments = [_interleaved(old, _at(body, friction, path, delta, 0.5 * (old[0][1:] + old[0][:-1]))) for old in segments]


def _interleaved(old: tuple[np.ndarray, ...], new: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    result = []
    for a, b in zip(old, new, strict=True):
        merged = np.empty(a.size + b.size)
        merged[::2], merged[1::2] = a, b
        result.append(merged)
    return tuple(result)
