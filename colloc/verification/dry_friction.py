"""A period of a gait at delta = 0: distance, work and efficiency between bounds.

A replay at a small delta is corrected, instant by instant, for how far dry friction is from it
(`colloc.verification.dry_balance`). Between two instants the worse of them counts, and the error of
the replay's quadrature is added: these two are estimates, all else is bounds.
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
from colloc.verification.replay import replay
from colloc.verification.replay_record import Path

DRY = 1e-6  # delta of the replay that is corrected, over the largest mean rate
OPEN = 1e-2  # velocities known less well than this, over the largest rate, count as open


class Between(NamedTuple):
    least: float
    most: float


class DryFriction(NamedTuple):
    """A period under dry friction."""

    distance: Between
    work: Between
    open: float
    """Part of the period at which velocities are not known to 1 % of the largest rate."""
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
    """Distance of the centre of mass and work over a period at delta = 0, with the arguments of
    `colloc.replay`. `ProblemError` for bodies that are no chains, and laws that have no bounds."""
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
    dry, posture = dry_balance(body, friction, angles, rates), body.posture(angles)

    def centre_velocity(z: np.ndarray) -> np.ndarray:
        x, y = body.centre_velocity(posture, body.velocity(posture, rates, z))
        return (x + 1j * y)[0]

    smooth = instant(body, law, angles, rates, z, delta)
    power, moved = total_power(smooth.velocity, smooth.force)[0], centre_velocity(z)
    off = np.abs(centre_velocity(dry.z) - moved) + np.hypot(*dry.apart[:2])
    spin = np.abs(dry.z[2] - z[2]) + dry.apart[2]
    step = np.diff(np.append(t, 1.0))

    def integral(values: np.ndarray) -> float:
        """Upper bound, by the worse of neighbours."""
        return float(step @ np.maximum(values, np.roll(values, -1)))

    turned = integral(np.abs(moved)) * integral(spin)
    way, off_way = replayed.distance, replayed.errors["distance"] + integral(off) + turned
    work, error = replayed.work, replayed.errors["work"]
    low, high = integral(power - dry.least), integral(dry.most - power)
    largest = np.abs(rates).max(axis=0)
    return DryFriction(
        distance=Between(max(way - off_way, 0.0), way + off_way),
        work=Between(work - error - low, work + error + high),
        open=float(step @ (dry.apart.max(axis=0) > OPEN * largest)),
        instants=t.size,
    )
