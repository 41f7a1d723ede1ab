"""The reduced program: gait parameters are the variables; net rotation, required values and path
constraints are rows."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from colloc.dynamics.control_problem import ControlProblem
from colloc.dynamics.kinds import kind_of_motion
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.objective import Objective
from colloc.gaits.symmetry import NONE
from colloc.mechanics.contact import Pairs
from colloc.numerics.mesh import Mesh
from colloc.reduced.actuator_rows import ActuatorRows
from colloc.reduced.constraints import Constraints
from colloc.reduced.motion import ReducedMotion, Shapes


class SearchSpace(Shapes, Protocol):
    """Gaits of a class on a mesh by parameters v, with their path constraints."""

    control: ControlProblem
    mesh: Mesh
    lower: np.ndarray
    upper: np.ndarray
    edges: np.ndarray | None
    scheme: str
    far: Pairs
    """Arguments of the mesh, and pairs of links more than two apart that are kept apart."""
    own: np.ndarray
    """Indices of v ``(n,)`` among the full program's gait parameters."""

    def member(self, v: np.ndarray) -> AnyGait: ...

    def parameters(self, gait: AnyGait) -> np.ndarray:
        """Parameters of the member nearest to a gait."""

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        """Gait parameters of the full program (`colloc.transcription.layout`)."""

    def at_times(self, v: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles and rates ``(n_joint, n_time)`` at times of the mesh."""

    def accelerations(self, v: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Second derivatives of the angles, ``(n_joint, n_time)``."""

    def accelerations_vjp(self, v: np.ndarray, on_points: np.ndarray) -> np.ndarray:
        """Derivatives ``(k, n)`` of k numbers, from those along the accelerations at the points,
        ``(k, n_joint, n_point)``."""

    def constraints(self, v: np.ndarray, later: float = 0.0) -> Constraints:
        """Path constraints at the worst instants of v, or later by a part of the mesh cell."""


class ReducedProgram:
    """Maximise an objective over a class of gaits on a mesh, at one delta.

    Rows: net rotation where it is prescribed and no symmetry closes it, on a slope the way across a
    prescribed direction, required values, limits of actuators, path constraints.
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
        self._own_lower = np.array([*equal, *least])
        self._own_upper = np.array([*equal, *np.full(len(least), np.inf)])
        self.actuators = ActuatorRows(self.motion, limits) if limits.names else None
        self.lower, self.upper = space.lower, space.upper
        self._gradients: tuple[bytes, float, dict[str, np.ndarray]] | None = None

    def place_rows(self, v: np.ndarray) -> float:
        """Move all rows to the worst instants of v; return how far it exceeds any bound."""
        excess = self.move_checks(v)
        if self.actuators is None:
            return excess
        return max(excess, self.actuators.place(v, self.delta))

    @property
    def row_lower(self) -> np.ndarray:
        return np.concatenate([self._own_lower, self._of_actuators[0], self.constraints.lower])

    @property
    def row_upper(self) -> np.ndarray:
        return np.concatenate([self._own_upper, self._of_actuators[1], self.constraints.upper])

    @property
    def _of_actuators(self) -> tuple[np.ndarray, np.ndarray]:
        return (np.empty(0), np.empty(0)) if self.actuators is None else self.actuators.bounds()

    @property
    def row_names(self) -> list[tuple[str, int]]:
        """Kind of each row, and index among the full program's rows of that kind."""
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
        """Move the path constraints to the worst instants of v, or later by a part of a mesh cell;
        return the excess."""
        self.constraints = self.space.constraints(v, later)
        return self.constraints.excess

    def follow_worst(self) -> None:
        """Until they are placed again, let path constraints follow the worst instants."""
        self.constraints = self.constraints.following()

    def of_moving_peaks(self, v: np.ndarray, on_rows: np.ndarray) -> np.ndarray:
        """Part ``(n, n)`` of the Lagrangian's second derivatives due to moving peaks of the
        actuators."""
        if self.actuators is None:
            return np.zeros((v.size, v.size))
        first = self._own_lower.size
        mine = on_rows[first : first + self.actuators.placed.shape[1]]
        return self.actuators.of_moving_peaks(v, self.delta, mine)

    def objective(self, v: np.ndarray) -> float:
        return -float(self._objective(self.motion.values(v, self.delta)))

    def stated(self, objective: float) -> float:
        """Value of the problem's objective."""
        return self.space.control.stated(-objective)

    def period(self, v: np.ndarray) -> dict[str, float]:
        """Totals of a period in the units of the problem."""
        found = self.motion.values(v, self.delta)
        degrees = {"work": 1.0} | {
            each.name: each.friction_degree or 0.0 for each in self.space.control.aims.integrals
        }
        return {
            name: value * self.space.control.unit ** degrees.get(name, 0.0)
            for name, value in found.items()
        }

    def gradient(self, v: np.ndarray) -> np.ndarray:
        return -self._slope(self._objective, v)

    def _slope(self, aim: Objective, v: np.ndarray) -> np.ndarray:
        return aim.gradient(self.motion.values(v, self.delta), self._slopes(v)) + np.zeros_like(v)

    def _slopes(self, v: np.ndarray) -> dict[str, np.ndarray]:
        key = v.tobytes()
        if self._gradients is None or self._gradients[:2] != (key, self.delta):
            self._gradients = (key, self.delta, self.motion.gradients(v, self.delta))
        return self._gradients[2]

    def rows(self, v: np.ndarray) -> np.ndarray:
        values = self.motion.values(v, self.delta) if self._own_lower.size else {}
        own = [values[name] for name in self._held]
        done = np.empty(0) if self.actuators is None else self.actuators.values(v, self.delta)
        return np.concatenate(
            [own, [aim(values) for aim in self._reached], done, self.constraints.values(v)]
        )

    def row_slopes(self, v: np.ndarray) -> np.ndarray:
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
