"""A class without parameters, on a mesh."""

from __future__ import annotations

import numpy as np

from colloc.dynamics.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.mechanics.contact import Pairs
from colloc.reduced.constraints import Constraints

_NONE = np.empty(0)


class OneGait:
    """A `SearchSpace` of the only member of a class, or of that of parameters `full`."""

    n = 0
    lower = upper = _NONE
    own = np.arange(0)

    def __init__(
        self,
        control: ControlProblem,
        edges: np.ndarray | None = None,
        scheme: str = "",
        far: Pairs = (),
        full: np.ndarray = _NONE,
    ) -> None:
        self.control, self.edges, self.scheme, self.far = control, edges, scheme, far
        self.mesh, self._full = control.mesh(edges, scheme), full
        self._gait = control.admissible.member(full)

    def member(self, v: np.ndarray) -> AnyGait:
        return self._gait

    def parameters(self, gait: AnyGait) -> np.ndarray:
        return _NONE

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        return self._full

    def trajectory(self, v: np.ndarray) -> AnyGait:
        return self._gait

    def at_times(self, v: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return tuple(self._gait(t))

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return *self._gait(self.mesh.times), np.ones(self.mesh.n_point)

    def accelerations(self, v: np.ndarray, t: np.ndarray) -> np.ndarray:
        n_joint = self.control.admissible.n_joint
        return (self.control.admissible.gait.angle_matrix(t, n_joint, 2) @ self._full).T

    def accelerations_vjp(self, v: np.ndarray, on_points: np.ndarray) -> np.ndarray:
        return np.empty((len(on_points), 0))

    def vjp(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        return np.empty((len(on_shape), 0))

    def constraints(self, v: np.ndarray, later: float = 0.0) -> Constraints:
        return Constraints({}, _NONE, _NONE, -np.inf, lambda v: _NONE, lambda v: np.empty((0, 0)))
