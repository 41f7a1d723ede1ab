"""The program of a search: the gait's parameters alone, with net rotation and admissibility as rows."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.gaits.symmetry import NONE
from colloc.mechanics.bodies import Pairs
from colloc.numerics.mesh import Mesh
from colloc.reduced.motion import ReducedMotion, Shapes


class SearchSpace(Shapes, Protocol):
    """A class of gaits on a mesh: its members by parameters v, and the rows and bounds that keep them in the class."""

    problem: Problem
    mesh: Mesh
    far: Pairs
    lower: np.ndarray
    upper: np.ndarray
    row_lower: np.ndarray
    row_upper: np.ndarray
    watched: dict[str, np.ndarray]
    """The rows in order: of each kind, those of the full program's rows of that name that are among them."""
    knots: np.ndarray | None
    """Phases where the arcs of a free path meet; None for other gaits."""
    own: np.ndarray
    """``(n,)``: which of the full program's gait parameters are v."""

    def member(self, v: np.ndarray) -> AnyGait:
        """The gait of parameters v."""

    def parameters(self, gait: AnyGait) -> np.ndarray:
        """Parameters of the member nearest to a gait."""

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        """The parameters as the full program has them (see `colloc.collocation.layout`)."""

    def phase_mesh(self, gait: AnyGait) -> Mesh:
        """The mesh in phases of a member."""

    def remeshed(self, gait: AnyGait, edges: np.ndarray, scheme: str) -> SearchSpace:
        """The class near a member on another mesh, in the member's phases."""

    def with_far(self, far: Pairs) -> SearchSpace:
        """The class with other pairs of links kept apart."""

    def move_checks(self, v: np.ndarray) -> float:
        """Place every check at the worst instants of the gait v; how far the gait exceeds any bound there [rad]."""

    def rows(self, v: np.ndarray) -> np.ndarray: ...

    def row_slopes(self, v: np.ndarray) -> np.ndarray: ...


class ReducedProgram:
    """Minimise -d/W over a class of gaits on a mesh, at one delta; rows: net rotation where nothing closes it, the space's.

    Attributes
    ----------
    lower, upper : (n,)
    delta : float
        In the units of the class; may be changed.
    """

    def __init__(self, space: SearchSpace, delta: float) -> None:
        self.space, self.delta = space, delta
        problem = space.problem
        self.motion = ReducedMotion(problem.body, problem.friction, problem.gait.symmetry, space.mesh, space)
        self._closes = problem.gait.symmetry == NONE
        self.lower, self.upper = space.lower, space.upper
        self._gradients: tuple[bytes, float, np.ndarray] | None = None

    @property
    def row_lower(self) -> np.ndarray:
        """Lower bounds of the rows; they change as the checks move."""
        return np.append(0.0, self.space.row_lower) if self._closes else self.space.row_lower

    @property
    def row_upper(self) -> np.ndarray:
        """Upper bounds of the rows."""
        return np.append(0.0, self.space.row_upper) if self._closes else self.space.row_upper

    def objective(self, v: np.ndarray) -> float:
        """-d/W."""
        return float(self.motion.values(v, self.delta)[0])

    def gradient(self, v: np.ndarray) -> np.ndarray:
        """Of the objective, ``(n,)``."""
        return self._both(v)[0]

    def _both(self, v: np.ndarray) -> np.ndarray:
        key = v.tobytes()
        if self._gradients is None or self._gradients[:2] != (key, self.delta):
            self._gradients = (key, self.delta, self.motion.gradients(v, self.delta))
        return self._gradients[2]

    def rows(self, v: np.ndarray) -> np.ndarray:
        """Net rotation, if it is a row, and the rows of the space."""
        own = self.space.rows(v)
        return np.append(self.motion.values(v, self.delta)[1], own) if self._closes else own

    def row_slopes(self, v: np.ndarray) -> np.ndarray:
        """Derivatives of the rows, ``(n_row, n)``."""
        own = self.space.row_slopes(v)
        return np.vstack([self._both(v)[1], own]) if self._closes else own
