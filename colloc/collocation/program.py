"""What a solver asks of a nonlinear program, whatever was transcribed into it."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from colloc.collocation.layout import Layout
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.numerics.blocks import Assembly
from colloc.numerics.mesh import Mesh


class ProgramLayout(Protocol):
    """Where variables sit; a solver needs to know only which ones describe the gait."""

    @property
    def parameters(self) -> np.ndarray:
        """``(n_parameter, 1)`` indices of the variables that describe the gait: those that a trust region bounds."""


class Program(Protocol):
    """A transcription: objective and constraints in blocks, bounds, and the unit that delta is handed on in."""

    @property
    def assembly(self) -> Assembly: ...

    @property
    def layout(self) -> ProgramLayout: ...

    @property
    def lower(self) -> np.ndarray:
        """``(n,)``, with `upper`: bounds of the variables."""

    @property
    def upper(self) -> np.ndarray: ...

    @property
    def constraint_lower(self) -> np.ndarray:
        """``(m,)``, with `constraint_upper`: bounds of the constraints."""

    @property
    def constraint_upper(self) -> np.ndarray: ...

    @property
    def groups(self) -> dict[str, slice]:
        """Names of the constraint rows, in order."""

    @property
    def lifted(self) -> bool:
        """Whether link forces are variables, which the optimiser has to be leashed for."""

    @property
    def speed_unit(self) -> float:
        """The program's unit of speed: delta is divided by it before the blocks see it."""

    def block_parameters(self, parameters: np.ndarray) -> list[np.ndarray]:
        """Instance parameters of all blocks, objective first, for a gait's parameters ``(n_parameter,)``."""


class GaitProgram(Program, Protocol):
    """The program of a problem: what continuation, refinement and explanation ask of it."""

    @property
    def problem(self) -> Problem: ...

    @property
    def mesh(self) -> Mesh: ...

    @property
    def layout(self) -> Layout: ...

    @property
    def knots(self) -> np.ndarray | None:
        """Phases where the arcs of a free path meet; None for other gaits."""

    def member(self, parameters: np.ndarray) -> AnyGait:
        """The gait of a parameter vector ``(n_parameter,)``."""

    def with_rows(self, lower: np.ndarray, upper: np.ndarray) -> GaitProgram:
        """The program with other bounds of its rows."""

    def phase_mesh(self, gait: AnyGait) -> Mesh:
        """The mesh in phases of a member."""

    def check_excess(self, x: np.ndarray) -> float:
        """How far shapes between nodes exceed what is admissible, for variables x [rad]."""
