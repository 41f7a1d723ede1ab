"""The optimal control problem of a `Problem`, in units of friction: dynamics, gaits, objectives,
limits.

Balance and velocities depend on ratios of friction coefficients only; forces and work are
proportional to them, efficiency inversely. So tolerances are relative to friction. An objective of
no degree in the coefficients is left as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.limits import Limit
from colloc.gaits.objective import Objective, integrals_of
from colloc.gaits.problem import Problem
from colloc.gaits.regime import Regime
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import PathLimits, Quantity
from colloc.mechanics.joint_map import JointMap
from colloc.mechanics.law import Law
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme


class Dynamics(NamedTuple):
    """A body under a law of friction, in a regime."""

    body: Body
    law: Law
    regime: Regime
    symmetry: str
    """Symmetry of the motion (`colloc.gaits.symmetry`)."""
    turn: float = 0.0
    """Prescribed rotation over a period [rad]."""
    joint_map: JointMap | None = None

    def in_speeds_of(self, unit: float) -> Dynamics:
        return self._replace(law=self.law.in_speeds_of(unit))


class Admissible(NamedTuple):
    """A class of gaits of a body, and its limits."""

    gait: AnyClass
    body: Body
    joint_limit: Limit
    largest_speeds: tuple[float, ...]
    """[rad per period]; empty without a limit."""
    smallest_shape_speed: float

    @property
    def n_joint(self) -> int:
        return self.body.n_joint

    def member(self, parameters: np.ndarray) -> AnyGait:
        return self.gait.member(parameters, self.n_joint)


class Aims(NamedTuple):
    """Objective, required values, prescribed rotation."""

    objective: Objective
    at_least: tuple[tuple[Objective, float], ...]
    rotation: float | None
    no_way_across: bool

    def uses(self, quantity: str) -> bool:
        return any(
            quantity in aim.uses for aim in (self.objective, *(aim for aim, _ in self.at_least))
        )

    @property
    def integrals(self) -> tuple[Quantity, ...]:
        """Quantities that are integrals over a period."""
        return integrals_of((self.objective, *(aim for aim, _ in self.at_least)))


@dataclass(frozen=True, eq=False)
class ControlProblem:
    """An optimal control problem in units of friction; `unit` is the friction that is 1 here.

    Examples
    --------
    >>> import colloc
    >>> light = control_problem(colloc.Problem("light", friction=colloc.Friction(1e-3, 1e-3, 1e-3)))
    >>> light.unit, light.dynamics.law.mu_t
    (0.001, 1.0)
    >>> round(light.stated(0.25))  # an efficiency
    250
    """

    problem: Problem
    dynamics: Dynamics
    admissible: Admissible
    aims: Aims
    actuators: PathLimits
    formulation: str
    scheme: str
    intervals: int
    delta_start: float
    unit: float

    def mesh(self, edges: np.ndarray | None = None, of_scheme: str = "") -> Mesh:
        """The first mesh on the solved part of the period, or one of given edges and scheme."""
        if edges is None:
            edges = self.admissible.gait.edges(self.intervals)
        return Mesh(scheme(of_scheme or self.scheme), edges)

    def in_phases(self, mesh: Mesh, gait: AnyGait) -> Mesh:
        return Mesh(mesh.scheme, self.admissible.gait.phases(gait, mesh.edges))

    def stated(self, value: float) -> float:
        """Value of the objective in the problem's units."""
        return value * _size(self.aims.objective, self.unit)

    def in_units(self, value: float) -> float:
        return value / _size(self.aims.objective, self.unit)


def control_problem(problem: Problem) -> ControlProblem:
    body = problem.body
    gait = problem.gait
    law = problem.law
    aims = (problem.objective, *(aim for aim, _ in problem.at_least))
    limits, regime = problem.path_limits, problem.regime
    degrees = [part.degree for part in aims] + [limit.friction_degree for limit in limits.each]
    # what a gait says of its pace has no unit
    unit = 1.0 if None in degrees or regime.free_pace else friction_unit(law)
    return ControlProblem(
        problem,
        Dynamics(
            body,
            law if unit == 1.0 else law.in_units_of(unit),
            regime.in_units_of(unit),
            gait.motion_symmetry,
            problem.rotation or 0.0,
            problem.joint_map,
        ),
        Admissible(
            gait, body, problem.joint_limit, problem.largest_speeds, problem.smallest_shape_speed
        ),
        Aims(
            problem.objective,
            tuple((aim, value / _size(aim, unit)) for aim, value in problem.at_least),
            # a row that holds whatever the gait would have no slope but what the mesh errs by
            None if problem.keeps_heading else problem.rotation,
            regime.keeps_ahead,
        ),
        limits.in_units_of(unit),
        problem.formulation,
        problem.scheme,
        problem.intervals,
        problem.delta_start,
        unit,
    )


def friction_unit(law: Law) -> float:
    """Power of ten nearest to the smallest coefficient."""
    return float(10.0 ** np.rint(np.log10(law.smallest)))


def _size(aim: Objective, unit: float) -> float:
    """Factor of an objective for coefficients `unit` times as large."""
    return unit ** (aim.degree or 0.0)
