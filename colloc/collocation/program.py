"""A collocated problem, whatever its class of gaits: objective and constraints in blocks, bounds,
and names of the rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.collocation.implicit_velocity import ImplicitVelocity
from colloc.collocation.layout import Layout
from colloc.collocation.motion_rows import BlockParts
from colloc.collocation.shape_checks import ShapeCheck
from colloc.collocation.worst_instants import held_shares, worst_instants
from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.numerics.blocks import Assembly, Block
from colloc.numerics.constraint_rows import Group, stacked
from colloc.numerics.mesh import Mesh

Implicit = dict[str, Callable[[ca.MX, ca.MX], ca.MX]]
"""By name of a block, the velocities that are tied to those of the balance solver, from its locals
and delta."""


class CollocatedClass(Protocol):
    """A class of gaits on a mesh."""

    @property
    def mesh(self) -> Mesh: ...

    @property
    def checks(self) -> list[ShapeCheck]:
        """Shape functions whose largest value in each mesh cell is constrained."""

    def placed(self, check: ShapeCheck, times: np.ndarray) -> np.ndarray:
        """What a check's block is given at an instant of every cell, ``(n_given, n_cell)``."""


@dataclass(frozen=True, eq=False)
class GaitProgram:
    """An optimal control problem on a mesh, ready for a solver of nonlinear programs."""

    control: ControlProblem
    gaits: CollocatedClass
    layout: Layout
    assembly: Assembly
    names: tuple[str, ...]
    """Of the assembly's blocks, in order."""
    lower: np.ndarray
    upper: np.ndarray
    """Bounds of the variables, ``(n,)`` each."""
    constraint_lower: np.ndarray  # (m,)
    constraint_upper: np.ndarray  # (m,)
    groups: dict[str, slice]
    """Names of the constraint rows, in order."""
    speed_unit: float
    """The program's unit of speed: delta is divided by it before the blocks see it."""
    velocity: ImplicitVelocity | None
    """Kept alive here for the functions that call it."""

    @property
    def mesh(self) -> Mesh:
        return self.gaits.mesh

    @property
    def checks(self) -> list[ShapeCheck]:
        return self.gaits.checks

    def with_rows(self, lower: np.ndarray, upper: np.ndarray) -> GaitProgram:
        """The program with other bounds of its rows."""
        return replace(self, constraint_lower=lower, constraint_upper=upper)

    @property
    def lifted(self) -> bool:
        """Whether link forces are variables, which the optimiser has to be leashed for."""
        return self.layout.forces.size > 0

    def member(self, parameters: np.ndarray) -> AnyGait:
        """The gait of a parameter vector ``(n_parameter,)``."""
        return self.control.admissible.member(parameters)

    def block_parameters(self, parameters: np.ndarray) -> list[np.ndarray]:
        """Instance parameters of all blocks (objective first), with every check moved to its cell's
        worst instant.

        An inequality between nodes is kept by constraining it where the gait `parameters` comes
        closest to it: see `colloc.collocation.worst_instants`.
        """
        gait, body, limit, *_ = self.control.admissible
        trajectory, given = gait.trajectory(parameters, body.n_joint), {}
        for check, times in zip(
            self.checks, worst_instants(trajectory, self.mesh, self.checks, limit), strict=True
        ):
            given[check.name] = np.vstack(
                [self.gaits.placed(check, times), held_shares(check, trajectory, times)]
            )
        blocks = zip(self.names, self.assembly.blocks, strict=True)
        return [
            self.assembly.objective.parameters,
            *(given.get(name, block.parameters) for name, block in blocks),
        ]


class ProgramRows(NamedTuple):
    """Constraint rows as a solver sees them."""

    linear: sparse.csr_matrix
    blocks: tuple[Block, ...]
    lower: np.ndarray
    upper: np.ndarray
    groups: dict[str, slice]


def stacked_rows(
    n: int, blocks: dict[str, BlockParts], groups: list[Group], implicit: Implicit | None = None
) -> ProgramRows:
    """Groups of rows over the first of n variables, or all, one below the other."""
    ends = np.cumsum([0] + [g.m for g in groups])
    scattered = tuple(
        Block(
            function,
            gather,
            stacked(groups, name, function.n_out * gather.shape[1]),
            given,
            (implicit or {}).get(name),
        )
        for name, (function, gather, given) in blocks.items()
    )
    linear = [
        sparse.csr_matrix((g.linear.data, g.linear.indices, g.linear.indptr), shape=(g.m, n))
        for g in groups
    ]
    return ProgramRows(
        sparse.vstack(linear).tocsr(),
        scattered,
        np.concatenate([g.lower for g in groups]),
        np.concatenate([g.upper for g in groups]),
        {g.name: slice(int(a), int(b)) for g, a, b in zip(groups, ends, ends[1:], strict=False)},
    )
