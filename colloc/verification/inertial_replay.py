"""A replay with inertia: what a certificate asks of a gait that is played at some pace.

What a body comes to that sets out from rest is looked at, too: if it is another motion, the gait
has several.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from typing import Any

import numpy as np

from colloc.gaits.objective import EFFICIENCY, Objective
from colloc.gaits.regime import Regime
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import Quantity
from colloc.mechanics.inertia import kinetic_energy, tail_velocity
from colloc.mechanics.law import Law
from colloc.system.errors import NotConvergedError
from colloc.verification.inertial_motion import gait_with_inertia, inertial_motion
from colloc.verification.played import Path, Replay, lever

_APART = 1e-2
"""Momenta [body lengths per period] by which motions differ that are not one."""


def inertial_replay(
    body: Body,
    friction: Law,
    gait: Path,
    delta: float,
    *,
    regime: Regime,
    tolerance: float = 1e-6,
    breaks: np.ndarray | tuple[float, ...] = (),
    objective: Objective = EFFICIENCY,
    turn: float = 0.0,
    quantities: Iterable[Quantity | str] = (),
    near: Replay | None = None,
    **_: object,
) -> Replay:
    """A period of a gait with inertia (`colloc.verification.inertial_motion`), as of
    `colloc.verification.replay.replay`; the regime says its pace. Of a gait replayed `near`
    another, as at another delta, one motion is looked for where that had one.

    Of the result the residual is the change of the momenta in a period; the work of the joints is
    that against friction and what the body gains in kinetic energy.
    """
    settings: Any = {"breaks": breaks, "turn": turn, "regime": regime}
    played = gait_with_inertia(body, friction, gait, delta, froude=regime.froude, **settings)
    settings |= {"tolerance": tolerance, "objective": objective, "quantities": quantities}
    begin = None if near is None else played.momenta(near.tail_velocity(np.zeros(1)))
    ran = inertial_motion(body, friction, gait, delta, regime.froude, **settings, near=begin)
    phases = ran.phases % 1.0
    chain, (angles, rates) = played.body, played.path(phases)
    from_rest = ran.states[:3, 0]
    if near is None or near.several:
        with suppress(NotConvergedError):  # Newton's method need not lead to any from there
            from_rest = played.closed(np.zeros(3)).momenta
    several = float(np.abs(from_rest - ran.states[:3, 0]).max() > _APART)
    other: Any = played.run(from_rest, tolerance) if several else ran
    z = tail_velocity(chain, angles, rates, ran.states[:3])
    energy = regime.froude * kinetic_energy(chain, angles, rates, z)[0]
    here, there = (played.passed(each.states) for each in (ran, other))
    way = ran.states[4:6, -1] - ran.states[4:6, 0]
    return Replay(
        values=ran.values,
        errors=ran.errors,
        others={name: abs(there[name] - here[name]) for name in here},
        lever=float(lever(chain, angles).max()),
        actuator_work=ran.work + float(energy[-1] - energy[0]),
        residual=float(np.abs(ran.states[:3, -1] - ran.states[:3, 0]).max()),
        error=ran.error_of(objective),
        several=several,
        instants=ran.phases.size,
        tail=(phases, z),
        objective=objective,
        across=regime.counted(complex(*way)).imag,
        multipliers=tuple(map(complex, ran.multipliers)),
    )
