"""What a body has to answer for: its balance, the velocities that keep it, the shapes it may take,
and its outline.

A body is described by n_joint *shape coordinates* (joint angles of a chain, amplitudes of the modes
of a smooth body), in axes that move with it. The *tail velocity* ``z = (u, v, omega)`` is that of
its tail in those axes, and their rotation rate. All that lies above `mechanics` and `smooth` is
written for a `Body`; `colloc.mechanics.chain.Chain` and `colloc.smooth.modal_body.ModalBody` are
two.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, Self, runtime_checkable

import numpy as np

from colloc.mechanics.balance_results import (
    BalancedMotion,
    BalanceSolution,
    Branches,
    Sliding,
)
from colloc.mechanics.contact import Contact
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array
from colloc.system.errors import ProblemError

FULL, IMPLICIT = FORMULATIONS = ("full", "implicit velocity")
"""Nonlinear programs, see `colloc.transcription.full_program`: with tail velocities and link
forces as variables and the balance as constraints, or with the velocities tied to those of the
balance solver."""
ARROWS = 12
"""Points along a body at which friction is usually drawn."""
_SHOWN, _STEP = 5, 1e-6
"""Parts whose speeds are drawn, and the time over which their motion within the body is
differenced."""
Pairs = tuple[tuple[int, int], ...]
"""Pairs of parts of a body."""


class Usual(NamedTuple):
    """Numbers of a body that a problem takes where it names none, and what a certificate allows.

    delta, delta_start: regularisation speeds of the end and the start of a search [body lengths per
    period]. limit: on the angles of `Body.limited`, largest_limit: the most that may be asked for,
    limit_name: what the bound is called. Allowed are an excess over it [rad] and a relative change
    of the efficiency for delta -> 0. A replay begins with at least so many instants, and so many
    for each point of the mesh, which an optimiser may have exploited.
    """

    delta: float = 1e-4
    delta_start: float = 0.1
    limit: float = float(np.pi)
    largest_limit: float = float(np.pi)
    limit_name: str = "joint limits"
    excess: float = 1e-6
    delta_influence: float = 1e-2
    """That is allowed: the paper's own claim, less than 1 % below delta = 1e-4."""
    instants: int = 1600
    instants_a_point: int = 10


class Stretch(NamedTuple):
    """A stretch of a smooth body: places where it begins and ends, and the angles at places on it
    per shape coordinate, ``(n, n_joint)``; for CasADi at one place."""

    first: float
    last: float
    angles_at: Callable[[Array], Array]


class Moved(Protocol):
    """What moves a body: its balance under friction, and what follows from that. Arrays are ``(n,
    n_time)``; `angles` and `rates` are shape coordinates and their rates ``(n_joint, n_time)``."""

    @property
    def force_names(self) -> tuple[str, ...]:
        """The forces that are variables of a full program; none for a body that has only the
        implicit formulation."""
        return ()

    def law(self, friction: Law) -> Law:
        """The law of friction of all of it that touches the floor, where the problem states
        `friction`."""
        return friction

    def sliding(
        self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array
    ) -> Sliding:
        """The balance at any tail velocity z ``(3, n_time)``: the one statement of it, for NumPy
        and CasADi."""

    def forces(self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array) -> Array:
        """The forces on the body's parts, ``(n_force, n_time)``, for NumPy and CasADi."""
        return np.empty((0, angles.shape[1]))

    def largest_forces(self, friction: Law) -> np.ndarray:
        """Their largest magnitudes, ``(n_force, 1)``."""
        return np.empty((0, 1))

    def solve(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        *,
        start: np.ndarray | None = None,
        tolerance: float = 1e-11,
    ) -> BalanceSolution:
        """Tail velocities that keep the balance, from `start` ``(3,
        n_time)`` or from anywhere; NumPy."""

    def motion(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> BalancedMotion:
        """What follows from a balance."""

    def slopes(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> np.ndarray:
        """Derivatives ``(6, 2 n_joint, n_time)`` of tail velocity, velocity of the centre and power
        along (angles, rates)."""

    def replayed(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        start: np.ndarray | None,
    ) -> tuple[BalancedMotion, np.ndarray]:
        """The motion by the most accurate solver there is, and its residual ``(n_time,)``: what
        certificates are made of."""

    @property
    def looks_for_all_velocities(self) -> bool:
        """Whether `all_velocities` finds more than one."""
        return False

    def all_velocities(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float
    ) -> Branches | None:
        """Every tail velocity that keeps the balance, as far as they can be found; None where
        others are not looked for."""
        return None

    def slowness(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, z: np.ndarray
    ) -> np.ndarray:
        """What has to vanish for a kink of the velocities in time, ``(n_part, n_time)``; no rows
        where there are none."""
        return np.empty((0, angles.shape[1]))

    @property
    def panels(self) -> int:
        """Panels of its quadrature, which a search doubles until they no longer matter; 0 where
        there is none to refine."""
        return 0

    def on_panels(self, panels: int) -> Self:
        """The same body on so many."""
        return self


class Shaped(Protocol):
    """Which shapes a body may take. What stands here is said of a body whose coordinates are
    bounded one by one."""

    @property
    def n_joint(self) -> int:
        """Number of shape coordinates."""

    @property
    def symmetries(self) -> tuple[str, ...]:
        """Of `colloc.gaits.symmetry`, those that its gaits may have."""
        return ("none", "bilateral", "antipodal") if self.symmetric else ("none", "antipodal")

    @property
    def symmetric(self) -> bool:
        """It reads the same from both ends."""
        return False

    def swapped(self, shape: np.ndarray) -> np.ndarray:
        """Shape coordinates ``(n_joint, ...)`` of the same shape named from the other end, for a
        symmetric body."""
        return -shape[::-1]

    def seen_from_head(
        self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Velocity of the head in the axes of a body that is named from it, and its heading in the
        body's own axes, turned by
        half a turn [rad]: what a bilateral gait needs."""  # fmt: skip
        raise ProblemError(f"gaits of a {type(self).__name__} are never bilateral.")

    @property
    def usual(self) -> Usual:
        """Numbers that a problem takes where it names none."""
        return Usual()

    @property
    def schedule(self) -> tuple[float, ...]:
        """Of a body whose motion is prescribed: phases from 0 to the part of the period that is
        solved, between which it is smooth in time. Its shape coordinates are the point (cos 2 pi t,
        sin 2 pi t). Empty for bodies that are free to move."""
        return ()

    @property
    def limited(self) -> np.ndarray:
        """``(n, n_joint)``: the angles that a search bounds, per shape coordinate; `limit_names`
        tells them apart."""
        return np.eye(self.n_joint)

    @property
    def stretches(self) -> tuple[Stretch, ...]:
        """Of a smooth body those for whose largest angle each of `limited` stands; none if these
        are all there are."""
        return ()

    def largest_angles(self, angles: np.ndarray) -> np.ndarray:
        """The largest angle of the kind that is bounded, at any place of the body,
        ``(n_time,)``."""
        return np.asarray(np.abs(self.limited @ angles).max(axis=0))

    def contacts(self, far: Sequence[tuple[int, int]] = ()) -> list[Contact]:
        """Parts that a search keeps from crossing: near ones always, pairs `far` apart if asked
        for."""
        return []

    @property
    def far_pairs(self) -> Pairs:
        """Pairs of parts that might cross and are not among `contacts` unless asked for."""
        return ()

    def crossing_depth(
        self, angles: np.ndarray, pairs: Sequence[tuple[int, int]] | None = None
    ) -> np.ndarray:
        """How far parts penetrate each other, ``(n_time,)``; of all pairs, or of given ones."""
        return np.zeros(angles.shape[1])

    def passing_depth(self, angles: np.ndarray) -> float:
        """How far parts pass through each other from instant to instant of a path."""
        return 0.0

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        """A travelling wave of bending: the factors ``(n_joint,)`` of the cosine and the sine of
        the phase."""
        phase = 2 * np.pi * waves * (np.arange(1, self.n_joint + 1) / (self.n_joint + 1) - 0.5)
        return -np.sin(phase), np.cos(phase)


@runtime_checkable
class Body(Moved, Shaped, Protocol):
    """A crawling body of unit length and mass: what moves it, which shapes it may take, and, here,
    how it looks. Derived from this class it has to say its `outline` alone of these; centre,
    friction and speeds along it follow."""

    def __hash__(self) -> int:
        return id(self)

    def describe(self) -> str:
        """The body in words, for reports."""
        return type(self).__name__

    @property
    def coordinate(self) -> str:
        """What one is called: "joint"."""
        return "joint"

    @property
    def quantity(self) -> str:
        """What it measures: "joint angle"."""
        return f"{self.coordinate} angle"

    @property
    def limit_names(self) -> tuple[str, ...]:
        """What the rows of `limited` are called."""
        return tuple(f"{self.coordinate} {j + 1}" for j in range(len(self.limited)))

    @property
    def drawn_width(self) -> float:
        """Of the strip along the outline [body lengths]; 0 for a line."""
        return 0.0

    def outline(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points along the body in its axes, seen from the tail, x and y, ``(n_point, n_time)``
        each, tail first."""

    @property
    def hinges(self) -> slice:
        """Which points of the outline are joints."""
        return slice(0, 0)

    def centre(self, angles: np.ndarray) -> np.ndarray:
        """Centre of mass in the same axes, ``(2, n_time)``."""
        x, y = self.outline(angles)
        length = np.hypot(np.diff(x, axis=0), np.diff(y, axis=0))
        middles = np.stack([0.5 * (axis[1:] + axis[:-1]) for axis in (x, y)])
        return np.asarray((length * middles).sum(axis=1) / length.sum(axis=0))

    def rubbing(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        z: np.ndarray,
        count: int = ARROWS,
    ) -> tuple[np.ndarray, np.ndarray]:
        """About `count` points along the body and the force per length there, in its axes, ``(2,
        n_point, n_time)`` each."""
        (x, y), (dx, dy), (vx, vy) = self._parts(angles, rates, z, count)
        fs, fn = self.law(friction).density(vx * dx + vy * dy, vy * dx - vx * dy, delta)
        return np.stack([x, y]), np.stack([fs * dx - fn * dy, fs * dy + fn * dx])

    def speeds(
        self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray
    ) -> tuple[str, np.ndarray]:
        """Speeds of a few parts ``(n_part, n_time)``, and what a part is called: for drawing what
        sticks."""
        return "part", np.hypot(*self._parts(angles, rates, z, _SHOWN)[2])

    def _parts(
        self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, count: int
    ) -> tuple[np.ndarray, ...]:
        """Middles of about `count` parts of the outline, their directions and velocities, ``(2,
        n_part, n_time)`` each."""
        ahead, now, behind = (
            np.stack(self.outline(angles + step * rates)) for step in (_STEP, 0.0, -_STEP)
        )
        moved = (ahead - behind) / (2 * _STEP) + z[:2, None] + z[2] * np.stack([-now[1], now[0]])
        parts = slice(None, None, max(1, (now.shape[1] - 1) // count))
        place, velocity = (0.5 * (a[:, 1:] + a[:, :-1])[:, parts] for a in (now, moved))
        along = np.diff(now, axis=1)[:, parts]
        return place, along / np.hypot(*along), velocity

    def footprints(self, angles: np.ndarray, wheel: float = 0.0) -> np.ndarray:
        """Where the feet of a body are, seen from the tail, ``(2, 2, n_foot, n_time)``: both ends
        of pads, and of wheels that are `wheel` of their link long, a point twice; `speeds` are then
        theirs. None for a body that lies on the floor."""
        return np.zeros((2, 2, 0, angles.shape[1]))

    def imbalance(self, angles: np.ndarray) -> np.ndarray:
        """How far from beneath the centre of mass its weight presses on the floor [body lengths],
        ``(n_time,)``."""
        return np.zeros(angles.shape[1])

    @property
    def bending(self) -> np.ndarray:
        """``(n_place, n_joint)``: how far the body bends at places from tail to head, per shape
        coordinate."""
        return np.eye(self.n_joint)

    def laid(self, lengths: np.ndarray) -> np.ndarray:
        """``(n_joint, n_joint of a chain)``: the shape nearest to that of a chain of given lengths,
        per joint angle."""
        raise ProblemError(f"no gait of a chain can be laid into {self.describe()}.")


def formulations(body: Body) -> tuple[str, ...]:
    """Of `FORMULATIONS`, those that can be stated for a body, the usual one first."""
    return FORMULATIONS if body.force_names else (IMPLICIT,)
