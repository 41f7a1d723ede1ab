"""Independent replay of a gait on a slope: the differential equation of its heading, by Adams'
method with steps of its own.

It shares nothing with collocation but the law of friction (`colloc.verification.slope`). The
equation is solved with ever smaller errors a step until the last tenth of them changes the
objective by less than is allowed. The work of the joints is taken from work against friction and
the climb, and beside it from the moments in the joints.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from colloc.gaits.objective import EFFICIENCY, Objective
from colloc.gaits.sloped import Slope
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import (
    LENGTH,
    PathLimit,
    PathLimits,
    Quantity,
    limits_of,
    quantities_of,
)
from colloc.mechanics.law import Law
from colloc.motion.follow import Course
from colloc.verification.adaptive_motion import whole_totals
from colloc.verification.played import Replay, lever, to_tolerance
from colloc.verification.slope import gait_on_slope

_FIRST = 0.1
"""Error of the first run over the relative one that is asked for."""
_LONGEST = 4.0
"""Longest step, in instants of a uniform grid."""


def slope_replay(
    body: Body,
    friction: Law,
    gait: Any,
    delta: float,
    *,
    slope: Slope,
    instants: int = 1600,
    tolerance: float = 1e-6,
    breaks: np.ndarray | tuple[float, ...] = (),
    objective: Objective = EFFICIENCY,
    quantities: Iterable[Quantity | str] = (),
    limits: Iterable[PathLimit] | PathLimits = (),
    **_: object,
) -> Replay:
    """A period of a gait that says where it points, on a slope: arguments as of
    `colloc.verification.replay.replay`.

    Of the result the distance is the way in the direction that counts, the work that of the joints;
    what other balanced motions would change is not known, only for which part of the time there are
    any. `NotConvergedError` if no balance is found at some instant, or rounding hides the accuracy
    that is asked for.
    """
    asked = dict.fromkeys([LENGTH, *objective.integrals, *quantities_of(quantities)])
    followed = tuple(each for each in asked if each.needs_forces)
    on, limits = (
        gait_on_slope(body, friction, gait, delta, slope.grade, breaks),
        limits_of(limits, body.n_joint),
    )
    totals = whole_totals([each for each in asked if not each.needs_forces], gait)

    def run(aim: float) -> tuple[tuple[Course, float], dict[str, float]]:
        ran = on.followed(np.array([gait.theta]), aim, _LONGEST / instants)
        theta, climb, aside, spent, *_ = ran.states[:, -1] - ran.states[:, 0]
        way = slope.counted(complex(climb, aside))
        found = {
            "distance": way.real,
            "work": float(spent + slope.grade * climb),
            "rotation": float(theta),
        }
        sums = on.totals(ran, followed, np.ones(1))[:, 0].tolist()
        return (ran, way.imag), found | {
            each.name: total for each, total in zip(followed, sums, strict=True)
        }

    (ran, across), values, errors = to_tolerance(
        run, _FIRST * tolerance, objective, tolerance, totals
    )
    now, residual = on.instants(ran.phases % 1.0, ran.states[0])
    done = limits.at(now) if limits.names else np.empty((0, ran.phases.size))
    return Replay(
        values=values,
        errors=errors,
        others={},
        lever=float(lever(body, now.angles).max()),
        actuator_work=float(ran.states[4, -1]),
        residual=float(residual.max()),
        error=float(objective.relative_error(values, errors)),
        several=on.several(ran.phases, ran.states[0]),
        instants=ran.phases.size,
        tail=(ran.phases % 1.0, now.z),
        shares=limits.sizes(done).max(axis=1),
        objective=objective,
        across=across,
    )
