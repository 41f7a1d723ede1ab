"""What is said of a body's balance at instants: how it slides, the velocities that keep it, and the
motion that follows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from colloc.numerics.arrays import Array
from colloc.system.errors import NotConvergedError


class Sliding(NamedTuple):
    """A body that slides with a given tail velocity."""

    force: Array
    """``(3, n_time)``: net force and torque about the tail, zero in balance (paper, eq. ftb)."""
    centre: Array
    """Velocity of the centre of mass, in the body's axes, ``(2, n_time)``."""
    power: Array
    """``(1, n_time)``: dissipated by friction (integrand of the paper's eq. W)."""


@dataclass(frozen=True, eq=False)
class BalanceSolution:
    """Tail velocities that balance the body, instant by instant.

    Attributes
    ----------
    z : (3, n_time)
        Tail velocity (u, v, omega) in the body frame.
    residual : (n_time,)
        Largest of |net force| and |torque about the anchor| / body length, in units of the friction
        on a body that moves at the largest rate: the largest coefficient, or less where delta
        exceeds that rate.
    iterations : (n_time,)
        Newton and fixed-point steps taken.
    converged : (n_time,)
        Whether the residual reached the tolerance.
    anchor : (n_time,)
        The slowest part (link of a chain, edge of a panel), in whose velocity the instant was
        solved.
    anchor_velocity : (3, n_time)
        Velocity of the anchor (the midpoint of a link), and its rotation rate, in body-frame axes.
    """

    z: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    converged: np.ndarray
    anchor: np.ndarray
    anchor_velocity: np.ndarray

    def require(self) -> BalanceSolution:
        """This solution, or a `NotConvergedError` naming the instants that failed."""
        if not self.converged.all():
            bad = np.flatnonzero(~self.converged)
            raise NotConvergedError(
                f"the balance did not converge at {bad.size} of {self.converged.size} instants "
                f"(first: {bad[:5].tolist()}, worst residual {self.residual[bad].max():.1e})."
            )
        return self


class BalancedMotion(NamedTuple):
    """Motion of a balanced body at instants."""

    z: np.ndarray
    """Tail velocity (u, v, omega) in the body frame, ``(3, n_time)``."""
    centre: np.ndarray
    """Velocity of the centre of mass, in the body frame, ``(2, n_time)``."""
    power: np.ndarray
    """Power dissipated by friction, ``(n_time,)``."""
    actuator_power: np.ndarray
    """``(n_time,)``: power of what bends the body, from the moments of the friction on all that
    lies ahead; equals `power` in balance."""


class Branches(NamedTuple):
    """Balanced velocities of instants, from one to `n_root` each."""

    z: np.ndarray
    """``(n_root, 3, n_time)``: tail velocities (u, v, omega) in the body frame; NaN beyond those
    that were found."""
    sign: np.ndarray
    """``(n_root, n_time)``: of the determinant of `colloc.mechanics.balance.balance_jacobian`; 0
    beyond those that were found."""

    @property
    def number(self) -> np.ndarray:
        """How many were found, ``(n_time,)``; 0 where the solver failed."""
        return (self.sign != 0).sum(axis=0)

    @property
    def complete(self) -> np.ndarray:
        """Whether the signs add up to 1, as they do over all solutions, ``(n_time,)``."""
        return self.sign.sum(axis=0) == 1
