"""From a problem to its programs: the full one, and the space of gaits that a search sees."""

from __future__ import annotations

import numpy as np

from colloc.collocation.program import GaitProgram
from colloc.collocation.transcription import transcribe
from colloc.gaits.control_problem import ControlProblem, control_problem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.linear import LinearClass
from colloc.gaits.prescribed import Prescribed
from colloc.gaits.problem import Problem
from colloc.gaits.serpenoid import Serpenoid
from colloc.gaits.symmetry import ANTIPODAL
from colloc.mechanics.bodies import Pairs
from colloc.motion.heading import whole_turns
from colloc.reduced.linear_space import LinearSpace, SerpenoidSpace
from colloc.reduced.program import SearchSpace
from colloc.system.errors import ProblemError


def _searched(problem: Problem) -> ControlProblem:
    """A problem whose class is linear in its parameters."""
    if not isinstance(problem.gait, (LinearClass, Prescribed)):
        raise ProblemError(
            f"no search is known for the class {type(problem.gait).__name__}: derive it from "
            f"LinearClass (docs/howto/own_gait_class.md)."
        )
    return control_problem(problem)


def _times(problem: Problem, gait: AnyGait | None, edges: np.ndarray | None) -> np.ndarray | None:
    """Edges of a program's mesh, from phases of a gait where there is one."""
    return edges if gait is None or edges is None else problem.gait.times(gait, edges)


def transcribed(
    problem: Problem,
    gait: AnyGait | None = None,
    edges: np.ndarray | None = None,
    scheme: str = "",
    far: Pairs = (),
) -> GaitProgram:
    """The nonlinear program of a problem, in units of friction, on its first mesh or a given one,
    in phases of a gait or, without one, in the program's own time.

    Self-contact is constrained between links two apart, and between the pairs `far`
    (see `colloc.search.converge.crossing_pairs`).
    """
    return transcribe(_searched(problem), _times(problem, gait, edges), scheme, far)


def heading(program: GaitProgram, x: np.ndarray) -> GaitProgram:
    """The program with the net rotation closed as variables x close it."""
    if program.control.admissible.gait.closing_symmetry != ANTIPODAL:
        return program
    theta, rows = x[program.layout.theta[0]], np.zeros(program.constraint_lower.size)
    rows[program.groups["rotation"]] = whole_turns(theta[0], theta[-1])
    return program.with_rows(program.constraint_lower + rows, program.constraint_upper + rows)


def space_near(
    problem: Problem, gait: AnyGait, edges: np.ndarray | None = None, scheme: str = ""
) -> tuple[SearchSpace, np.ndarray]:
    """The class of a problem on its first mesh, or one in phases of a gait, and the parameters of
    its member nearest to that gait."""
    space = space_of(problem, gait, edges, scheme)
    return space, space.parameters(gait)


def space_of(
    problem: Problem,
    gait: AnyGait | None = None,
    edges: np.ndarray | None = None,
    scheme: str = "",
    far: Pairs = (),
) -> SearchSpace:
    """The class of a problem on a mesh as of `transcribed`, with the pairs `far` kept apart."""
    made = SerpenoidSpace if isinstance(problem.gait, Serpenoid) else LinearSpace
    return made(_searched(problem), _times(problem, gait, edges), scheme, far)


def with_far(space: SearchSpace, far: Pairs) -> SearchSpace:
    """The same class on the same mesh with other pairs of links kept apart."""
    return space_of(space.control.problem, None, *space.given._replace(far=far))


def remeshed(space: SearchSpace, gait: AnyGait, edges: np.ndarray, scheme: str) -> SearchSpace:
    """The same class on another mesh, in phases of a member."""
    return space_of(space.control.problem, gait, edges, scheme, space.given.far)


def nearest_parameters(program: GaitProgram, gait: AnyGait) -> np.ndarray:
    """Parameters of the member of a program's class that is nearest to a gait, on the program's
    mesh."""
    space = space_of(program.control.problem, None, program.mesh.edges, program.mesh.scheme.name)
    return space.full_parameters(space.parameters(gait))
