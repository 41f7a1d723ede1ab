"""Paths through shapes in time, and the record of a period that was simulated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from colloc.dynamics.follow import Course
from colloc.gaits.objective import EFFICIENCY, Objective
from colloc.gaits.period import Period
from colloc.mechanics.bodies import Body
from colloc.system.errors import NotConvergedError

Path = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Joint angles and rates, each ``(n_joint, n_time)``, at phases ``(n_time,)``."""
Ran = TypeVar("Ran")
Numbers = dict[str, float]
_TENTH = 0.1  # error of each run over that of the last
LEAST = 1e-12  # the smallest error that is tried


@dataclass(frozen=True)
class Replay(Period):
    """A simulated period of a gait, and how far its quantities can be trusted."""

    lever: float  # largest distance of a point of the body from its centre of mass [body lengths]
    actuator_work: float  # of the joints, by their moments; equals `work` in balance
    residual: float
    """Largest force or torque left over, in units of the largest friction coefficient; with inertia
    the change of the momenta in a period."""
    error: float  # relative, of the objective
    several: float  # part of the period at which several motions are balanced
    instants: int
    tail: tuple[np.ndarray, np.ndarray] = field(compare=False)
    """Phases ``(n,)`` and tail velocities there ``(3, n)``."""
    shares: np.ndarray = field(default_factory=lambda: np.empty(0), compare=False)
    """Largest shares of the actuators' limits."""
    objective: Objective = EFFICIENCY
    across: float = 0.0  # on a slope the way across the direction that counts
    multipliers: tuple[complex, ...] = ()
    """By what small changes of the momenta are multiplied in a period with inertia."""

    def __repr__(self) -> str:
        value = f"{self.objective.short} = {self.value:.6g} +- {self.error * abs(self.value):.0e}"
        return (
            f"<Replay at {self.instants} instants: {value}, d = {self.distance:.6g}, W = "
            f"{self.work:.6g}>"
        )

    def tail_velocity(self, t: np.ndarray) -> np.ndarray:
        """Tail velocities ``(3, n_time)`` interpolated at phases t."""
        known, z = self.tail
        return np.stack([np.interp(t, known, row, period=1.0) for row in z])

    @property
    def value(self) -> float:
        """The objective."""
        return self.objective(self.values)

    @property
    def ambiguity(self) -> float:
        """Largest relative change of the objective by other balanced motions."""
        return self.ambiguity_of(self.objective)

    @property
    def turning(self) -> float:
        """Rotation times lever over distance: relative change of the distance by another followed
        point of the body."""
        return abs(self.rotation) * self.lever / max(self.distance, 1e-300)


def to_tolerance(
    run: Callable[[float], tuple[Ran, Numbers]],
    first: float,
    objective: Objective,
    tolerance: float,
    known: tuple[Numbers, Numbers],
    errors_of: Callable[[Ran, Ran], Numbers] | None = None,
) -> tuple[Ran, Numbers, Numbers]:
    """Solve a differential equation with ever smaller errors a step until these change an objective
    by less than a relative error: the last run, its numbers and their errors.

    `run` takes an error, `first` to begin with; `known` are other numbers and their errors;
    `errors_of` compares a run with one of ten times the error: by default their difference, but
    half of the error at least, as differences vanish now and then. `NotConvergedError` if rounding
    hides the accuracy.
    """
    aim, before = max(first, LEAST / _TENTH), None
    while aim > 0.5 * LEAST:
        ran, now = run(aim)
        if before is not None:
            if errors_of is None:
                errors = {x: max(abs(now[x] - before[1][x]), 0.5 * aim) for x in now}
            else:
                errors = dict.fromkeys(now, 0.0) | errors_of(ran, before[0])
            values, errors = now | known[0], errors | known[1]
            if not objective.relative_error(values, errors) > tolerance:
                return ran, values, errors
        aim, before = _TENTH * aim, (ran, now)
    raise NotConvergedError(
        f"the motion cannot be replayed to a relative error of {tolerance:.0e}."
    )


def through_periods(
    run: Callable[[np.ndarray], Course], start: np.ndarray, periods: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Phases, states there, and states at the ends of periods ``(n_state, periods + 1)``."""
    courses, ends = [], [start]
    for _ in range(periods):
        courses.append(run(ends[-1]))
        ends.append(courses[-1].states[:, -1])
    phases = np.concatenate([k + course.phases for k, course in enumerate(courses)])
    states = np.concatenate([course.states for course in courses], axis=1)
    return phases, states, np.stack(ends, axis=1)


def lever(body: Body, angles: np.ndarray) -> np.ndarray:
    """Largest distance of a point of the body from its centre of mass, ``(n_time,)``."""
    (x, y), (gx, gy) = body.outline(angles), body.centre(angles)
    return np.asarray(np.hypot(x - gx, y - gy).max(axis=0))
