"""What is solved: how a body moves, which of its gaits are allowed, what they are to be best at;
and friction's own unit.

A `Problem` is what somebody states. It is taken apart here, once, into an optimal control problem:
`Dynamics`, `Admissible`, `Aims` and limits on actuators. Programs, motions and errors of meshes are
made from these, and none of them asks a `Problem`.

Friction comes in units of its own size, so that what a solver sees is never larger or smaller than
it was made for. Balance and velocities depend on the ratios of the coefficients only; forces and
work are proportional to them, efficiency inversely. So a problem with coefficients of 1e-6 is one
with coefficients of 1, and tolerances are relative to friction. An objective that is proportional
to no power of the coefficients is left as it is.
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
    """What moves how: a body under a law of friction, in a regime such as slow on the level."""

    body: Body
    law: Law
    regime: Regime
    symmetry: str
    """Of the motion: which part of a period follows from the other (`colloc.gaits.symmetry`)."""
    turn: float = 0.0
    """By which a period is asked to turn the body [rad]: the way is seen from axes that turn evenly
    (`colloc.gaits.period`)."""
    joint_map: JointMap | None = None

    def in_speeds_of(self, unit: float) -> Dynamics:
        """The same for speeds that are divided by a unit."""
        return self._replace(law=self.law.in_speeds_of(unit))


class Admissible(NamedTuple):
    """Gaits that are allowed: a class of gaits of a body, and its limits."""

    gait: AnyClass
    """The class."""
    body: Body
    joint_limit: Limit
    largest_speeds: tuple[float, ...]
    """Of each shape coordinate [rad per period]; none if there is no limit."""
    smallest_shape_speed: float

    @property
    def n_joint(self) -> int:
        return self.body.n_joint

    def member(self, parameters: np.ndarray) -> AnyGait:
        """The gait of a parameter vector of the full program."""
        return self.gait.member(parameters, self.n_joint)


class Aims(NamedTuple):
    """What a gait is to be best at, what it must keep to, and what it must reach."""

    objective: Objective
    at_least: tuple[tuple[Objective, float], ...]
    rotation: float | None
    """Over a period [rad]; None: free."""
    no_way_across: bool
    """Whether what counts on a slope is the way in a direction, with none across it."""

    def uses(self, quantity: str) -> bool:
        """Whether any of it speaks of a quantity of a period, by its name."""
        return any(
            quantity in aim.uses for aim in (self.objective, *(aim for aim, _ in self.at_least))
        )

    @property
    def integrals(self) -> tuple[Quantity, ...]:
        """The quantities of which it speaks that are integrals of functions of an instant."""
        return integrals_of((self.objective, *(aim for aim, _ in self.at_least)))


@dataclass(frozen=True, eq=False)
class ControlProblem:
    """An optimal control problem in units of friction.

    Attributes
    ----------
    problem : Problem
        What it stands for. Stages hand it on; nobody below them looks into it.
    dynamics : Dynamics
    admissible : Admissible
    aims : Aims
    actuators : PathLimits
    formulation : str
        Of the full program.
    scheme : str
    intervals : int
        Scheme of collocation, and intervals of the first mesh.
    delta_start : float
        In the units of the class.
    unit : float
        The friction that is 1 here.

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
        """The first mesh on the part of the period that is solved, that of the class and of the
        usual scheme; or as given."""
        if edges is None:
            edges = self.admissible.gait.edges(self.intervals)
        return Mesh(scheme(of_scheme or self.scheme), edges)

    def in_phases(self, mesh: Mesh, gait: AnyGait) -> Mesh:
        """A program's mesh in phases of a member."""
        return Mesh(mesh.scheme, self.admissible.gait.phases(gait, mesh.edges))

    def stated(self, value: float) -> float:
        """A value of the objective as the problem states it."""
        return value * _size(self.aims.objective, self.unit)

    def in_units(self, value: float) -> float:
        """The other way round."""
        return value / _size(self.aims.objective, self.unit)


def control_problem(problem: Problem) -> ControlProblem:
    """What solves a problem: its parts, in units of friction."""
    body, gait, law, aims = (
        problem.body,
        problem.gait,
        problem.law,
        (problem.objective, *(aim for aim, _ in problem.at_least)),
    )
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
    """The power of ten nearest to the smallest coefficient, which bounds the efficiency: 1 for
    friction of usual size."""
    return float(10.0 ** np.rint(np.log10(law.smallest)))


def _size(aim: Objective, unit: float) -> float:
    """What an objective comes to for coefficients `unit` times as large, over what it is."""
    return unit ** (aim.degree or 0.0)
