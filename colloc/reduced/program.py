"""The program of a search: the gait's parameters alone; net rotation, values to be reached and
admissibility are rows."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.objective import Objective
from colloc.gaits.symmetry import NONE
from colloc.motion.kinds import kind_of_motion
from colloc.numerics.mesh import Mesh
from colloc.reduced.actuator_rows import ActuatorRows
from colloc.reduced.constraints import Constraints
from colloc.reduced.given import Given
from colloc.reduced.motion import ReducedMotion, Shapes


class SearchSpace(Shapes, Protocol):
    """A class of gaits on a mesh: its members by parameters v, and what keeps them in the class."""

    control: ControlProblem
    mesh: Mesh
    lower: np.ndarray
    upper: np.ndarray
    given: Given
    own: np.ndarray
    """``(n,)``: which of the full program's gait parameters are v."""

    def member(self, v: np.ndarray) -> AnyGait:
        """The gait of parameters v."""

    def parameters(self, gait: AnyGait) -> np.ndarray:
        """Parameters of the member nearest to a gait."""

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        """The parameters as the full program has them (see `colloc.transcription.layout`)."""

    def at_times(self, v: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles and rates ``(n_joint, n_time)`` at times of the mesh between its points."""

    def constraints(self, v: np.ndarray, later: float = 0.0) -> Constraints:
        """What keeps gaits in the class, with every check at the worst instants of the gait v, or
        later by a share of its mesh cell."""


class ReducedProgram:
    """Maximise an objective over a class of gaits on a mesh, at one delta.

    Rows: net rotation where it is prescribed and no symmetry closes it, on a slope the way across a
    direction that is asked for, what must be reached at least, what actuators can do, the space's.

    Attributes
    ----------
    lower, upper : (n,)
    delta : float
        In the units of the class; may be changed.
    actuators : ActuatorRows, optional
        Where they are limited.
    constraints : Constraints
        The space's, as they were placed last: there are no rows before.
    """

    constraints: Constraints

    def __init__(self, space: SearchSpace, delta: float) -> None:
        self.space, self.delta = space, delta
        aims, limits = space.control.aims, space.control.actuators
        self.motion = ReducedMotion(
            kind_of_motion(space.control.dynamics), space.mesh, space, aims.integrals
        )
        held = (
            {"rotation": aims.rotation}
            if space.control.admissible.gait.closing_symmetry == NONE
            else {}
        )
        held |= {"across": 0.0} if aims.no_way_across else {}
        self._held = [name for name, value in held.items() if value is not None]
        equal, least = [held[name] for name in self._held], [value for _, value in aims.at_least]
        self._objective, self._reached = aims.objective, [aim for aim, _ in aims.at_least]
        self._own_lower, self._own_upper = (
            np.array([*equal, *least]),
            np.array([*equal, *np.full(len(least), np.inf)]),
        )
        self.actuators = ActuatorRows(self.motion, limits, space.at_times) if limits.names else None
        self.lower, self.upper = space.lower, space.upper
        self._gradients: tuple[bytes, float, dict[str, np.ndarray]] | None = None

    def place_rows(self, v: np.ndarray) -> float:
        """Place all rows that depend on where the gait v is, the space's and the actuators'; how
        far it exceeds any bound."""
        excess = self.move_checks(v)
        if self.actuators is None:
            return excess
        return max(excess, self.actuators.place(v, self.delta))

    @property
    def row_lower(self) -> np.ndarray:
        """Lower bounds of the rows; they change as the checks move."""
        return np.concatenate([self._own_lower, self._of_actuators[0], self.constraints.lower])

    @property
    def row_upper(self) -> np.ndarray:
        """Upper bounds of the rows."""
        return np.concatenate([self._own_upper, self._of_actuators[1], self.constraints.upper])

    @property
    def _of_actuators(self) -> tuple[np.ndarray, np.ndarray]:
        return (np.empty(0), np.empty(0)) if self.actuators is None else self.actuators.bounds()

    @property
    def row_names(self) -> list[tuple[str, int]]:
        """What each row is: its kind, and which of the full program's rows of that kind."""
        own = [("period", k) for k in range(self._own_lower.size)]
        if self.actuators is not None:
            own += [
                (f"actuators, share {share}", int(point))
                for share, point in self.actuators.placed.T
            ]
        return own + [
            (kind, int(cell)) for kind, cells in self.constraints.kinds.items() for cell in cells
        ]

    def move_checks(self, v: np.ndarray, later: float = 0.0) -> float:
        """Place the space's constraints for v, or later by a share of a mesh cell; how far it
        exceeds any bound there. Rows of actuators stay where they are."""
        self.constraints = self.space.constraints(v, later)
        return self.constraints.excess

    def follow_worst(self) -> None:
        """Until they are placed again, checks move with the worst instants of whatever gait they
        are asked for."""
        self.constraints = self.constraints.following()

    def of_moving_peaks(self, v: np.ndarray, on_rows: np.ndarray) -> np.ndarray:
        """What limits on actuators add to the second derivatives ``(n, n)`` of multipliers times
        rows, as their largest values between the points move."""
        if self.actuators is None:
            return np.zeros((v.size, v.size))
        first = self._own_lower.size
        mine = on_rows[first : first + self.actuators.placed.shape[1]]
        return self.actuators.of_moving_peaks(v, self.delta, mine)

    def objective(self, v: np.ndarray) -> float:
        """Minus the value that is maximised."""
        return -float(self._objective(self.motion.values(v, self.delta)))

    def stated(self, objective: float) -> float:
        """The value that an `objective` stands for, in the units of the problem."""
        return self.space.control.stated(-objective)

    def period(self, v: np.ndarray) -> dict[str, float]:
        """What a period comes to, by the names of `colloc.gaits.objective.QUANTITIES`, in the units
        of the problem."""
        found = self.motion.values(v, self.delta)
        degrees = {"work": 1.0} | {
            each.name: each.friction_degree or 0.0 for each in self.space.control.aims.integrals
        }
        return {
            name: value * self.space.control.unit ** degrees.get(name, 0.0)
            for name, value in found.items()
        }

    def gradient(self, v: np.ndarray) -> np.ndarray:
        """Of the objective, ``(n,)``."""
        return -self._slope(self._objective, v)

    def _slope(self, aim: Objective, v: np.ndarray) -> np.ndarray:
        return aim.gradient(self.motion.values(v, self.delta), self._slopes(v)) + np.zeros_like(v)

    def _slopes(self, v: np.ndarray) -> dict[str, np.ndarray]:
        key = v.tobytes()
        if self._gradients is None or self._gradients[:2] != (key, self.delta):
            self._gradients = (key, self.delta, self.motion.gradients(v, self.delta))
        return self._gradients[2]

    def rows(self, v: np.ndarray) -> np.ndarray:
        """Values of the rows."""
        values = self.motion.values(v, self.delta) if self._own_lower.size else {}
        own = [values[name] for name in self._held]
        done = np.empty(0) if self.actuators is None else self.actuators.values(v, self.delta)
        return np.concatenate(
            [own, [aim(values) for aim in self._reached], done, self.constraints.values(v)]
        )

    def row_slopes(self, v: np.ndarray) -> np.ndarray:
        """Derivatives of the rows, ``(n_row, n)``."""
        own = [self._slopes(v)[name] for name in self._held]
        done = (
            np.empty((0, v.size))
            if self.actuators is None
            else self.actuators.slopes(v, self.delta)
        )
        return np.vstack(
            [
                *own,
                *(self._slope(aim, v) for aim in self._reached),
                *done,
                self.constraints.slopes(v),
            ]
        )
