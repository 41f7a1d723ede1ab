"""The interface of a crawling body, and what is computed of its balance.

A body has n_joint *shape coordinates* (joint angles of a chain, amplitudes of the modes of a smooth
body), in axes that move with it. The *tail velocity* ``z = (u, v, omega)`` is that of its tail in
those axes, and their rotation rate. Arrays are ``(n, n_time)``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from colloc.mechanics.contact import Contact
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array
from colloc.system.errors import NotConvergedError, ProblemError

FULL, IMPLICIT = FORMULATIONS = ("full", "implicit velocity")
"""Nonlinear programs (`colloc.transcription.full_program`): tail velocities and link forces as
variables with the balance as constraints, or velocities tied to those of the balance solver."""


class Defaults(NamedTuple):
    """A body's words and default numbers for a problem, and tolerances of its certificate."""

    coordinate: str = "joint"
    quantity: str = "joint angle"
    delta: float = 1e-4
    delta_start: float = 0.1
    limit: float = float(np.pi)
    """Bound on its angles; `largest_limit` is the most that may be asked for."""
    largest_limit: float = float(np.pi)
    limit_name: str = "joint limits"
    excess: float = 1e-6
    """Allowed excess over the bound [rad]."""
    delta_influence: float = 1e-2
    """Allowed relative change of the efficiency for delta -> 0: the paper's claim is less than 1 %
    below delta = 1e-4."""
    instants: int = 1600
    """Time points of a replay, at least, and for each point of the mesh."""
    instants_a_point: int = 10


class Stretch(NamedTuple):
    """An interval of a smooth body's arc length, and the tangent angles at places on it per shape
    coordinate, ``(n, n_joint)``."""

    first: float
    last: float
    angles_at: Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class BoundedAngles:
    """Angles of a body that limits bound.

    rows: per shape coordinate, ``(n, n_joint)``. stretches: of a smooth body, those that each row
    stands for. fine: shapes to angles at many places ``(n, n_time)``; by default the rows.
    """

    rows: np.ndarray
    names: tuple[str, ...]
    stretches: tuple[Stretch, ...] = ()
    fine: Callable[[np.ndarray], np.ndarray] | None = None

    def largest(self, angles: np.ndarray) -> np.ndarray:
        values = self.rows @ angles if self.fine is None else self.fine(angles)
        return np.abs(values).max(axis=0)


class Sliding(NamedTuple):
    """A body that slides with a given tail velocity.

    force: net force and torque about the tail, zero in balance (paper, eq. ftb), ``(3, n_time)``.
    centre: velocity of the centre of mass, in the body's axes, ``(2, n_time)``. power: dissipated
    by friction (integrand of the paper's eq. W), ``(1, n_time)``.
    """

    force: Array
    centre: Array
    power: Array


@dataclass(frozen=True, eq=False)
class BalanceSolution:
    """Tail velocities z ``(3, n_time)`` that balance a body, time point by time point.

    residual: largest of |net force| and |torque about the anchor| / body length, in units of the
    friction on a body that moves at the largest rate: the largest coefficient, or less where delta
    exceeds that rate. iterations: Newton and fixed-point steps. converged: where the residual
    reached the tolerance. anchor: the slowest part (link of a chain, edge of a panel), in whose
    velocity it was solved; that of its midpoint, and its rotation rate, in body-frame axes:
    anchor_velocity ``(3, n_time)``. The others ``(n_time,)``.
    """

    z: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    converged: np.ndarray
    anchor: np.ndarray
    anchor_velocity: np.ndarray

    def require(self) -> BalanceSolution:
        """This solution; a `NotConvergedError` that names the time points if any failed."""
        if not self.converged.all():
            bad = np.flatnonzero(~self.converged)
            raise NotConvergedError(
                f"the balance did not converge at {bad.size} of {self.converged.size} time points "
                f"(first: {bad[:5].tolist()}, worst residual {self.residual[bad].max():.1e})."
            )
        return self


class BalancedMotion(NamedTuple):
    """Motion of a balanced body: tail velocity z ``(3, n_time)``, velocity of the centre of mass in
    the body frame ``(2, n_time)``, power dissipated by friction, and power of what bends the body,
    from the moments of friction, ``(n_time,)`` each: equal in balance."""

    z: np.ndarray
    centre: np.ndarray
    power: np.ndarray
    actuator_power: np.ndarray


@runtime_checkable
class Body(Protocol):
    """A crawling body of unit length and mass. A new one says its coordinates, balance and
    outline; the rest has defaults."""

    def __hash__(self) -> int:
        return id(self)

    @property
    def n_joint(self) -> int: ...

    def sliding(
        self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array
    ) -> Sliding:
        """Net force, centre and power at any tail velocity; NumPy and CasADi."""

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
        """Tail velocities that keep the balance, from `start` ``(3, n_time)`` or from anywhere."""

    def motion(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> BalancedMotion:
        """The motion that follows from a balance."""

    def outline(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points along the body in its axes, x and y, ``(n_point, n_time)``, tail first."""

    def centre(self, angles: np.ndarray) -> np.ndarray:
        """Centre of mass in the same axes, ``(2, n_time)``."""
        x, y = self.outline(angles)
        length = np.hypot(np.diff(x, axis=0), np.diff(y, axis=0))
        middles = np.stack([0.5 * (axis[1:] + axis[:-1]) for axis in (x, y)])
        return (length * middles).sum(axis=1) / length.sum(axis=0)

    def describe(self) -> str:
        return type(self).__name__

    @property
    def defaults(self) -> Defaults:
        return Defaults()

    @property
    def symmetries(self) -> tuple[str, ...]:
        """Symmetries that its gaits may have (`colloc.gaits.gait`)."""
        return ("none", "antipodal")

    @property
    def reversal(self) -> np.ndarray | None:
        """Map ``(n_joint, n_joint)`` to the coordinates counted from the other end, of a body that
        is the same from both ends."""
        return None

    @property
    def bounded_angles(self) -> BoundedAngles:
        name = self.defaults.coordinate
        names = tuple(f"{name} {j + 1}" for j in range(self.n_joint))
        return BoundedAngles(np.eye(self.n_joint), names)

    def contacts(self, far: Sequence[tuple[int, int]] = ()) -> list[Contact]:
        """Parts that must not cross: near ones, and the pairs `far` of parts farther apart."""
        return []

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        """Factors ``(n_joint,)`` of cosine and sine of the phase in a travelling wave."""
        phase = 2 * np.pi * waves * (np.arange(1, self.n_joint + 1) / (self.n_joint + 1) - 0.5)
        return -np.sin(phase), np.cos(phase)

    def from_chain(self, lengths: np.ndarray) -> np.ndarray:
        """Matrix ``(n_joint, n_joint of a chain)`` from the shapes of a chain to the nearest ones
        of this body."""
        raise ProblemError(f"no gait of a chain can be laid into {self.describe()}.")
