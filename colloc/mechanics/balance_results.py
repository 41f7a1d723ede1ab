"""What is said of a body's balance at instants: how it slides, the velocities that keep it, and the motion that follows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from colloc.numerics.arrays import Array
from colloc.system.errors import NotConvergedError


class Sliding(NamedTuple):
    """A body that slides with a given tail velocity.

    Attributes
    ----------
    force : (3, n_time)
        Net force and torque about the tail, zero in balance (paper, eq. ftb).
    centre : (2, n_time)
        Velocity of the centre of mass, in the body's axes.
    power : (1, n_time)
        Dissipated by friction (integrand of the paper's eq. W).
    """

    force: Array
    centre: Array
    power: Array


class Lifted(NamedTuple):
    """A body whose parts' forces are variables: what vanishes where they obey the law of friction, scaled like velocities, and
    where they balance; velocity of the centre of mass ``(2, n_time)`` and power ``(1, n_time)``."""

    laws: Array
    balance: Array
    centre: Array
    power: Array


@dataclass(frozen=True, eq=False)
class BalanceSolution:
    """Tail velocities that balance the body, instant by instant.

    Attributes
    ----------
    z : (3, n_time)
        Tail velocity (u, v, omega) in the body frame.
    residual : (n_time,)
        Largest of |net force| and |torque about the anchor| / body length, in units of the friction on a body that moves at
        the largest rate: the largest coefficient, or less where delta exceeds that rate.
    iterations : (n_time,)
        Newton and fixed-point steps taken.
    converged : (n_time,)
        Whether the residual reached the tolerance.
    anchor : (n_time,)
        The slowest part (link of a chain, edge of a panel), in whose velocity the instant was solved.
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
    """Motion of a balanced body at instants.

    Attributes
    ----------
    z : (3, n_time)
        Tail velocity (u, v, omega) in the body frame.
    centre : (2, n_time)
        Velocity of the centre of mass, in the body frame.
    power : (n_time,)
        Power dissipated by friction.
    actuator_power : (n_time,)
        Power of what bends the body, from the moments of the friction on all that lies ahead; equals `power` in balance.
    """

    z: np.ndarray
    centre: np.ndarray
    power: np.ndarray
    actuator_power: np.ndarray


class Branches(NamedTuple):
    """Balanced velocities of instants, from one to `n_root` each.

    Attributes
    ----------
    z : (n_root, 3, n_time)
        Tail velocities (u, v, omega) in the body frame; NaN beyond those that were found.
    sign : (n_root, n_time)
        Of the determinant of `colloc.mechanics.balance.balance_jacobian`; 0 beyond those that were found.
    """

    z: np.ndarray
    sign: np.ndarray

    @property
    def number(self) -> np.ndarray:
        """How many were found, ``(n_time,)``; 0 where the solver failed."""
        return (self.sign != 0).sum(axis=0)

    @property
    def complete(self) -> np.ndarray:
        """Whether the signs add up to 1, as they do over all solutions, ``(n_time,)``."""
        return self.sign.sum(axis=0) == 1
