"""Independent replay of a gait: from the joint angles alone to distance, work and rotation, by the NumPy solver.

It shares nothing with collocation but the friction law: no scheme, no mesh, no symmetry, no interpolant. Velocities are
solved for on a uniform grid over the whole period and integrated by Simpson's rule; doubling the grid gives the error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from colloc.mechanics.body import Chain
from colloc.mechanics.chain_motion import chain_motion
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.numerics.simpson import cumulative_simpson, simpson
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
    tail : ((n,), (3, n))
        Phases and tail velocities there.
    """

    distance: float
    work: float
    efficiency: float
    rotation: float
    actuator_work: float
    residual: float
    error: float
    instants: int
    tail: tuple[np.ndarray, np.ndarray] = field(repr=False, compare=False)

    def tail_velocity(self, t: np.ndarray) -> np.ndarray:
        """Tail velocities ``(3, n_time)`` at phases t, between those of the replay: good to start a solve from."""
        known, z = self.tail
        return np.stack([np.interp(t, known, row, period=1.0) for row in z])


class _Samples(NamedTuple):
    """Of one piece of the period without jumps, each ``(n,)``, tail velocities ``(3, n)``."""

    t: np.ndarray
    z: np.ndarray
    centre_x: np.ndarray
    centre_y: np.ndarray
    power: np.ndarray
    actuator_power: np.ndarray
    residual: np.ndarray

    def every(self, n: int) -> _Samples:
        return _Samples(*(a[..., ::n] for a in self))

    def interleaved(self, new: _Samples) -> _Samples:
        """With the samples `new` in between."""
        merged = []
        for a, b in zip(self, new, strict=True):
            both = np.empty((*a.shape[:-1], a.shape[-1] + b.shape[-1]))
            both[..., ::2], both[..., 1::2] = a, b
            merged.append(both)
        return _Samples(*merged)


def _sampled(body: Chain, friction: Friction, path: Path, delta: float, t: np.ndarray, near: np.ndarray | None) -> _Samples:
    angles, rates = path(t)
    solved = solve_balance(body, friction, angles, rates, delta, start=near).require()
    motion = chain_motion(body, friction, angles, rates, delta, solved)
    return _Samples(t, motion.z, motion.centre[0], motion.centre[1], motion.power, motion.actuator_power, solved.residual)


def _integrated(segments: list[_Samples], every: int) -> tuple[float, float, float, float, float]:
    """Distance, work, rotation, actuator work and largest residual, by Simpson's rule on every `every`-th instant."""
    heading, end, worked, actuated, worst = 0.0, 0j, 0.0, 0.0, 0.0
    for segment in segments:
        s = segment.every(every)
        step = (s.t[-1] - s.t[0]) / (s.t.size - 1)
        theta = heading + cumulative_simpson(s.z[2], step)
        end += complex(simpson(np.exp(1j * theta) * (s.centre_x + 1j * s.centre_y), step))
        heading = float(theta[-1])
        worked, actuated = worked + float(simpson(s.power, step)), actuated + float(simpson(s.actuator_power, step))
        worst = max(worst, float(s.residual.max()))
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
    near: Replay | None = None,
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
    near : Replay, optional
        Of the same path or one like it: solves start from its velocities, which saves time and changes nothing else.

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
        start = None if near is None else near.tail_velocity(grid)
        segments.append(_sampled(body, friction, path, delta, inside, start)._replace(t=grid))
    while True:
        fine, coarse = _integrated(segments, 1), _integrated(segments, 2)
        if not (fine[1] > 0 and coarse[1] > 0):
            raise ProblemError("the path does not move, or too little to do work against friction: it has no efficiency.")
        # kinks at stick limit the order to two: the difference over three estimates the finer grid's error
        efficiency, before = fine[0] / fine[1], coarse[0] / coarse[1]
        error = abs(efficiency - before) / 3 / max(abs(efficiency), 1e-300)
        n = sum(segment.t.size - 1 for segment in segments)
        if error <= tolerance or 2 * n > most_instants:
            known = np.concatenate([s.t[:-1] for s in segments]), np.concatenate([s.z[:, :-1] for s in segments], axis=1)
            return Replay(fine[0], fine[1], efficiency, fine[2], fine[3], fine[4], error, n, known)
        segments = [
            old.interleaved(_sampled(body, friction, path, delta, *(0.5 * (a[..., 1:] + a[..., :-1]) for a in (old.t, old.z))))
            for old in segments
        ]
