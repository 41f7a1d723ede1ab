"""Serpenoid gaits as a search sees them: by their few own parameters, from which the Fourier coefficients follow."""

from __future__ import annotations

import numpy as np

from colloc.gaits.control_problem import ControlProblem
from colloc.mechanics.bodies import Pairs
from colloc.reduced.constraints import Constraints
from colloc.reduced.linear_space import LinearSpace


class SerpenoidSpace(LinearSpace):
    """Members of the class `colloc.gaits.serpenoid.Serpenoid` by their own parameters v; the chain rule to what a space of
    series knows of their coefficients."""

    def __init__(self, control: ControlProblem, edges: np.ndarray | None = None, scheme: str = "", far: Pairs = ()) -> None:
        super().__init__(control, edges, scheme, far)
        self.n = control.admissible.gait.n_own
        self.lower, self.upper, self.own = self.lower[: self.n], self.upper[: self.n], self.own[: self.n]

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        return self._admissible.gait.full(v, self._admissible.n_joint)

    def _slopes(self, v: np.ndarray) -> np.ndarray:
        """Of the full parameters, ``(n_full, n)``."""
        return np.vstack([np.eye(self.n), self._admissible.gait.coefficient_slopes(v, self._admissible.n_joint)])

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return super().at(self.full_parameters(v))

    def pulled_back(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        return super().pulled_back(self.full_parameters(v), on_shape, on_pace) @ self._slopes(v)

    def constraints(self, v: np.ndarray, later: float = 0.0) -> Constraints:
        return super().constraints(v, later).through(self.full_parameters, self._slopes)
