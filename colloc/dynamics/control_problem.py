"""The optimal control problem of a `Problem`, in units of friction: dynamics, gaits, objectives,
limits.

Balance and velocities depend on ratios of friction coefficients only; forces and work are
proportional to them, efficiency inversely. So tolerances are relative to friction. An objective of
no degree in the coefficients is left as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from colloc.dynamics.dynamics import QuasiStatic, StaticParameter, dynamics_of
from colloc.gaits.gait import fraction
from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.objective import Objective
from colloc.gaits.problem import Problem
from colloc.gaits.robot import Limit, widest
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import PathLimits, Quantity
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme


class Admissible(NamedTuple):
    """A class of gaits of a body and its limits. Vectors of parameters are those of the class, then
    the static ones."""

    gait: AnyClass
    body: Body
    joint_limit: Limit
    largest_speeds: tuple[float, ...]
    """[rad per period]; empty without a limit."""
    smallest_shape_speed: float
    static: tuple[StaticParameter, ...]
    fraction: float
    """Part of the period that is solved."""

    @property
    def n_joint(self) -> int:
        return self.body.n_joint

    @property
    def n_shape(self) -> int:
        """Number of parameters of the class."""
        return int(self.gait.size(self.n_joint))

    def member(self, parameters: np.ndarray) -> AnyGait:
        shape, static = np.split(parameters, [self.n_shape])
        gait = self.gait.member(shape, self.n_joint)
        pairs = zip(self.static, static, strict=True)
        values = {each.name: float(value) for each, value in pairs if not np.isnan(value)}
        return replace(gait, **values) if values else gait

    def parameters(self, gait: AnyGait) -> np.ndarray:
        """Parameters of the member nearest to a gait; NaN for a heading that it does not state, or
        states for another phase than that of the class."""
        member = self.gait.through(gait)
        source = gait if gait.is_series else member
        values = {each.name: getattr(source, each.name) for each in self.static}
        in_phase = values.get("theta") is not None and self.gait.is_synchronous(member)
        static = []
        for name, lower, upper, guess in self.static:
            has_value = in_phase if name == "theta" else values[name] is not None
            static.append(np.clip(values[name], lower, upper) if has_value else guess)
        shape = self.gait.project(member) if in_phase else self.gait.parameters(member)
        return np.append(shape, static)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        lower, upper = self.gait.bounds(self.body, widest(self.joint_limit))
        return (
            np.append(lower, [each.lower for each in self.static]),
            np.append(upper, [each.upper for each in self.static]),
        )


class Aims(NamedTuple):
    objective: Objective
    at_least: tuple[tuple[Objective, float], ...]
    integrals: tuple[Quantity, ...]
    rotation: float | None
    no_way_across: bool
    closing: str
    """Symmetry that closes the net rotation."""


@dataclass(frozen=True, eq=False)
class ControlProblem:
    """An optimal control problem in units of friction; `unit` is the friction that is 1 here."""

    problem: Problem
    dynamics: QuasiStatic
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
        gaits, fraction = self.admissible.gait, self.admissible.fraction
        if edges is None and gaits.fraction == fraction:
            edges = gaits.edges(self.intervals)
        elif edges is None:
            edges = np.linspace(0.0, fraction, self.intervals + 1)
        return Mesh(scheme(of_scheme or self.scheme), edges)

    def in_phases(self, mesh: Mesh, gait: AnyGait) -> Mesh:
        return Mesh(mesh.scheme, self.admissible.gait.phases(gait, mesh.edges))

    def unscale(self, value: float) -> float:
        """Value of the objective in the problem's units."""
        return value * _size(self.aims.objective, self.unit)


def control_problem(problem: Problem) -> ControlProblem:
    gait, law, regime = problem.gait, problem.law, problem.regime
    aims, limits = problem.aims, problem.path_limits
    degrees = [part.degree for part in aims] + [limit.friction_degree for limit in limits.each]
    # the power of ten nearest to the smallest coefficient; what a gait says of its pace has no unit
    unit = 1.0 if None in degrees or regime.free else 10.0 ** np.rint(np.log10(law.smallest))
    if unit != 1.0:
        law, regime = law.in_units_of(unit), regime.in_units_of(unit)
    symmetry, turn = regime.motion_symmetry(gait.symmetry), problem.rotation or 0.0
    dynamics = dynamics_of(problem.body, law, regime, symmetry, turn, problem.joint_map)
    return ControlProblem(
        problem,
        dynamics,
        Admissible(
            gait, problem.body, problem.joint_limit, problem.largest_speeds,
            problem.smallest_shape_speed, dynamics.static_parameters, fraction(symmetry),
        ),
        Aims(
            problem.objective,
            tuple((aim, value / _size(aim, unit)) for aim, value in problem.at_least),
            problem.integrals,
            # a row that holds whatever the gait would have no slope but what the mesh errs by
            None if problem.keeps_heading else problem.rotation,
            regime.towards is not None,
            regime.closing_symmetry(gait.symmetry),
        ),
        limits.in_units_of(unit),
        problem.formulation,
        problem.scheme,
        problem.intervals,
        problem.delta_start,
        unit,
    )  # fmt: skip


def _size(aim: Objective, unit: float) -> float:
    return unit ** (aim.degree or 0.0)
