"""Near-global search for gaits of finite size: the cycle with the largest ratio of distance to work on a lattice.

States are (shape on a square lattice, direction of the last step, heading of the middle link). A step goes to a nearby lattice
point in one of 16 directions, and may turn by one direction only: that limits the curvature of the path in shape space.
Shapes stay on the lattice exactly; the heading is interpolated. Dinkelbach's method: for a ratio lambda, value iteration
finds the policy with the largest mean of (distance - lambda work); following it gives cycles, the best of them the next lambda.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from colloc.bounds.coulomb_motion import admissible, balanced_motion
from colloc.gaits.harmonic import Fourier
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.system.errors import ProblemError
from colloc.verification.replay import Path

_QUADRANT = ((1, 0), (2, 1), (1, 1), (1, 2))
STEPS = np.array([*_QUADRANT, *((-b, a) for a, b in _QUADRANT)])
STEPS = np.concatenate([STEPS, -STEPS])
"""The 16 steps in order of their direction, ``(16, 2)``."""
_PARTS = 3
"""Motions a step is made of."""
_DELTA = 1e-6
_SLACK, _SLACK_PER_DISTANCE = 0.15, 0.5
"""A cycle may miss its own heading by this [rad], and by this over its distance; closing it is left to collocation."""
_BLOCKED = -1e3


class Cycle(NamedTuple):
    """A closed path on the lattice.

    ratio: distance over work along it, with the heading followed exactly. shapes ``(2, n)``: corners of the polygon.
    rotation: what the heading misses over one cycle [rad].
    """

    ratio: float
    shapes: np.ndarray
    rotation: float


@dataclass
class _Edges:
    """What steps do: index of the next shape (-1: none), displacement in the axes at the start, rotation and work."""

    shapes: np.ndarray
    following: np.ndarray
    move: np.ndarray
    turn: np.ndarray
    work: np.ndarray


def _edges(body: Chain, friction: Friction, joint_limit: float, intervals: int) -> _Edges:
    axis = np.linspace(-joint_limit, joint_limit, intervals + 1)
    grid = np.stack(np.meshgrid(np.arange(intervals + 1), np.arange(intervals + 1), indexing="ij")).reshape(2, -1)
    kept = admissible(body, axis[grid], 1e-9)
    grid = grid[:, kept]
    number = np.full((intervals + 1, intervals + 1), -1)
    number[grid[0], grid[1]] = np.arange(grid.shape[1])
    target = grid[:, :, None] + STEPS.T[:, None, :]
    inside = ((target >= 0) & (target <= intervals)).all(axis=0)
    following = np.where(inside, number[tuple(np.clip(target, 0, intervals))], -1)
    shape, step = np.nonzero(following >= 0)
    change = (axis[1] - axis[0]) * STEPS[step].T
    edges = _Edges(axis[grid], following, *(np.zeros(following.shape, dtype=t) for t in (complex, float, float)))
    move, turn, work = np.zeros(shape.size, dtype=complex), np.zeros(shape.size), np.zeros(shape.size)
    for part in range(_PARTS):
        # Coulomb friction is homogeneous: a part of a step is a motion for unit time with these rates
        middle = axis[grid[:, shape]] + (part + 0.5) / _PARTS * change
        motion = balanced_motion(body, friction, middle, change / _PARTS, _DELTA)
        if motion.size != shape.size:
            raise ProblemError("some steps of the lattice have no balanced motion; choose another number of intervals.")
        # in the mean, the velocity is turned by half of the rotation
        move += np.exp(1j * (turn + 0.5 * motion.spin)) * (motion.velocity[0] + 1j * motion.velocity[1])
        turn += motion.spin
        work += motion.power
    edges.move[shape, step], edges.turn[shape, step], edges.work[shape, step] = move, turn, work
    return edges


class _Values:
    """Value iteration on (shape, last step, heading)."""

    def __init__(self, edges: _Edges, headings: int, turning: int) -> None:
        self.edges, self.headings, self.turns = edges, headings, np.arange(-turning, turning + 1)
        n = edges.shapes.shape[1]
        heading = np.arange(headings) * (2 * np.pi / headings)
        self.distance = np.real(np.exp(1j * heading) * edges.move[:, :, None]).astype(np.float32)
        shift = edges.turn * headings / (2 * np.pi)
        self.floor, self.part = np.floor(shift).astype(int), (shift - np.floor(shift)).astype(np.float32)
        self.low = (np.arange(headings) + self.floor[:, :, None]) % headings
        self.best = np.zeros((n, len(STEPS), headings), dtype=np.float32)
        self.step_index = np.arange(len(STEPS))[None, :]

    def taken(self, ratio: float) -> np.ndarray:
        """Value of every step ``(shape, step, heading)`` for the current values after it."""
        after = self.best[self.edges.following, self.step_index]
        low = np.take_along_axis(after, self.low, axis=2)
        high = np.take_along_axis(after, (self.low + 1) % self.headings, axis=2)
        total = self.distance - np.float32(ratio) * self.edges.work[:, :, None].astype(np.float32)
        total += low + self.part[:, :, None] * (high - low)
        total[self.edges.following < 0] = _BLOCKED
        return total

    def sweep(self, ratio: float) -> None:
        taken = self.taken(ratio)
        best = taken
        for turn in self.turns:
            best = np.maximum(best, np.roll(taken, turn, axis=1))
        # half a step of averaging keeps periodic policies from oscillating; the mean does not matter
        self.best = 0.5 * (self.best + best)
        self.best -= self.best.max()
        np.maximum(self.best, 0.5 * _BLOCKED, out=self.best)


def _followed(values: _Values, ratio: float, starts: int, length: int, rng: np.random.Generator) -> list[Cycle]:
    """Cycles met by following the policy from random states, with exact headings."""
    edges, taken = values.edges, values.taken(ratio)
    n, steps, headings = taken.shape
    shape, last, theta = rng.integers(0, n, starts), rng.integers(0, steps, starts), rng.uniform(0, 2 * np.pi, starts)
    trace = []
    for _ in range(length):
        position = theta * headings / (2 * np.pi)
        low = np.floor(position).astype(int) % headings
        part = position - np.floor(position)
        options = (last[:, None] + values.turns) % steps
        at = shape[:, None]
        value = (1 - part[:, None]) * taken[at, options, low[:, None]]
        value += part[:, None] * taken[at, options, (low[:, None] + 1) % headings]
        step = options[np.arange(starts), np.argmax(value, axis=1)]
        alive = edges.following[shape, step] >= 0
        move = np.where(alive, np.exp(1j * theta) * edges.move[shape, step], 0.0)
        work = np.where(alive, edges.work[shape, step], np.inf)
        trace.append((shape, step, theta, move, work))
        theta = theta + np.where(alive, edges.turn[shape, step], 0.0)
        shape, last = np.where(alive, edges.following[shape, step], shape), step
    shapes, stepped, thetas, moves, works = (np.stack(column) for column in zip(*trace, strict=True))
    found = []
    for k in range(starts):
        if not np.isfinite(works[:, k]).all():
            continue
        # the end of the trajectory, against earlier visits of the same state
        end = length - 1
        same = np.flatnonzero((shapes[:end, k] == shapes[end, k]) & (stepped[:end, k] == stepped[end, k]))
        for begin in same[::-1]:
            rotation = thetas[end, k] - thetas[begin, k]
            part = slice(begin, end)
            distance = float(abs(moves[part, k].sum()))
            if abs(rotation) < min(_SLACK, _SLACK_PER_DISTANCE * distance):
                found.append(Cycle(distance / works[part, k].sum(), edges.shapes[:, shapes[part, k]], float(rotation)))
                break
    return found


def best_cycle(
    body: Chain,
    friction: Friction,
    joint_limit: float = float(np.pi),
    *,
    intervals: int = 24,
    headings: int = 24,
    turning: int = 1,
    sweeps: int = 200,
    rounds: int = 12,
    starts: int = 200,
    seed: int = 0,
) -> Cycle:
    """The best cycle found on a lattice of shapes; a longer step or fewer intervals means a smoother path.

    Parameters
    ----------
    body : Chain
        Three links.
    friction : Friction
    joint_limit : float
    intervals, headings : int
        Of the lattice of each joint angle, and of the heading.
    turning : int
        Largest change of direction from step to step, in sixteenths of a full turn; at most 7: no step is undone at once.
    sweeps : int
        Value iterations for each ratio.
    rounds : int
        Largest number of ratios tried.
    starts : int
        Trajectories followed for each.
    seed : int

    Raises
    ------
    ProblemError
        For a body without exactly two joints, turning outside 1 to 7, or if no cycle is found.
    """
    if body.n_joint != 2:
        raise ProblemError(f"the cycle search is for three links, not {body.n_link}.")
    if not 1 <= turning <= 7:
        raise ProblemError(f"turning must be an integer from 1 to 7, not {turning!r}.")
    rng = np.random.default_rng(seed)
    values = _Values(_edges(body, friction, joint_limit, intervals), headings, turning)
    best: Cycle | None = None
    failures = 0
    for _ in range(rounds):
        ratio = best.ratio if best is not None else 0.1
        for _ in range(sweeps):
            values.sweep(ratio)
        found = max(_followed(values, ratio, starts, 12 * intervals, rng), key=lambda c: c.ratio, default=None)
        if found is not None and (best is None or found.ratio > best.ratio):
            best, failures = found, 0
        else:
            failures += 1
        if failures == 2:
            break
    if best is None:
        raise ProblemError("no cycle was found; allow more sweeps, or another number of intervals.")
    return best


def polygon_path(shapes: np.ndarray) -> Path:
    """The closed polygon with corners ``(n_joint, n)``, run through at constant speed: angles and rates at phases ``(m,)``."""
    sides = np.roll(shapes, -1, axis=1) - shapes
    ends = np.cumsum(np.hypot(*sides))
    ends /= ends[-1]
    begins = np.concatenate([[0.0], ends[:-1]])

    def path(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        t = np.asarray(t) % 1.0
        side = np.minimum(np.searchsorted(ends, t, side="right"), ends.size - 1)
        rate = sides[:, side] / (ends - begins)[side]
        return shapes[:, side] + rate * (t - begins[side]), rate

    return path


def polygon_gait(shapes: np.ndarray, harmonics: int, joint_limit: float = float(np.pi)) -> Fourier:
    """The polygon's Fourier series, drawn together towards its mean where it would leave |angles| <= joint_limit."""
    count = 64 * harmonics
    angles = polygon_path(shapes)(np.arange(count) / count)[0]
    wave = np.fft.rfft(angles, axis=1)[:, : harmonics + 1] * 2.0 / count
    gait = Fourier(0.5 * wave[:, 0].real, wave[:, 1:].real, -wave[:, 1:].imag)
    fine = gait.angles(np.arange(1000) / 1000) - gait.mean[:, None]
    room = (joint_limit - np.sign(fine) * gait.mean[:, None]) / np.maximum(np.abs(fine), 1e-12)
    scale = min(1.0, 0.999 * float(room.min()))
    return Fourier(gait.mean, scale * gait.cos, scale * gait.sin)
