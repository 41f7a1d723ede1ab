"""A period of a gait at delta = 0: distance, work and efficiency between bounds, by
`colloc.verification.dry_balance`.

A replay at a small delta is corrected for how far dry friction is from it, instant by instant. At
every instant of the replay the motion under dry friction is bounded, whatever it is. Between two
instants it counts as at the worse of them, and the error of the replay's quadrature, as it
estimates it, is added: these two are estimates, all else is bounds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.balance import instant, total_power
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.law import Law
from colloc.system.errors import ProblemError
from colloc.verification.dry_balance import dry_balance
from colloc.verification.played import Path
from colloc.verification.replay import replay

DRY = 1e-6
"""Of the largest mean rate: the delta of the replay, which is corrected for."""
OPEN = 1e-2
"""Of the largest rate: velocities that are known less well than this count as open."""


class Between(NamedTuple):
    """An interval."""

    least: float
    most: float


class DryFriction(NamedTuple):
    """What a gait does in a period under dry friction."""

    distance: Between
    work: Between
    open: float
    """Part of the period at which velocities are not known to 1 % of the largest rate: several
    motions may be balanced."""
    instants: int

    @property
    def efficiency(self) -> Between:
        return Between(self.distance.least / self.work.most, self.distance.most / self.work.least)

    def __str__(self) -> str:
        least, most = self.efficiency
        several = (
            f"; the motion is open at {100 * self.open:.2g} % of the period" if self.open else ""
        )
        return f"d/W between {least:.8f} and {most:.8f}, at {self.instants} instants{several}"

    def facts(self) -> dict:
        """As plain numbers (JSON)."""
        intervals = {name: list(getattr(self, name)) for name in ("efficiency", "distance", "work")}
        return {**intervals, "open": self.open, "instants": self.instants}


def dry_friction(
    body: Body,
    friction: Law,
    path: Path,
    *,
    breaks: np.ndarray | tuple[float, ...] = (),
    tolerance: float = 1e-6,
    turn: float = 0.0,
) -> DryFriction:
    """Distance of the centre of mass and work of a path over a period at delta = 0, between bounds.

    Arguments as those of `colloc.verification.replay.replay`.

    Raises
    ------
    ProblemError
        For bodies that are no chains, and laws that have no bounds
        (`colloc.verification.dry_balance.dry_balance`).

    Examples
    --------
    >>> import colloc
    >>> from colloc.verification.dry_friction import dry_friction
    >>> gait = colloc.ellipse(A0=0, A1=2.859, B1=1.302)
    >>> print(str(dry_friction(colloc.Chain(), colloc.Friction(), gait))[:20])
    d/W between 0.260027
    """
    if not isinstance(body, Chain):
        raise ProblemError(
            f"bounds for delta = 0 are there for a Chain, not for a {type(body).__name__}."
        )
    law = body.law(friction)
    mean_rate = float(np.abs(path(np.linspace(0.0, 1.0, 101))[1]).max(axis=0).mean())
    delta = DRY * (mean_rate or 1.0)
    # says first if there are no bounds
    dry_balance(body, friction, *(a[:, :1] for a in path(np.array([0.0]))))
    replayed = replay(body, friction, path, delta, breaks=breaks, tolerance=tolerance, turn=turn)
    t, z = replayed.tail
    angles, rates = path(t)
    found = dry_balance(body, friction, angles, rates)
    smooth = instant(body, law, angles, rates, z, delta)
    power = total_power(smooth.velocity, smooth.force)[0]
    moved, turned = _centre(body, angles, rates, z), z[2]
    off = np.abs(_centre(body, angles, rates, found.z) - moved) + np.hypot(*found.apart[:2])
    spin = np.abs(found.z[2] - turned) + found.apart[2]
    step = np.diff(np.append(t, 1.0))

    def integral(values: np.ndarray) -> float:
        """The most that it can be, by the worse of neighbours."""
        return float(step @ np.maximum(values, np.roll(values, -1)))

    reach = integral(np.abs(moved))
    off_distance = replayed.errors["distance"] + integral(off) + reach * integral(spin)
    work, error = replayed.work, replayed.errors["work"]
    largest = np.abs(rates).max(axis=0)
    return DryFriction(
        distance=Between(
            max(replayed.distance - off_distance, 0.0), replayed.distance + off_distance
        ),
        work=Between(
            work - error - integral(power - found.least),
            work + error + integral(found.most - power),
        ),
        open=float(step @ (found.apart.max(axis=0) > OPEN * largest)),
        instants=t.size,
    )


def _centre(body: Chain, angles: np.ndarray, rates: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Velocity of the centre of mass in the body's axes, complex."""
    posture = body.posture(angles)
    x, y = body.centre_velocity(posture, body.velocity(posture, rates, z))
    return (x + 1j * y)[0]
