"""Programs of a problem: the full one, and the space of gaits on a mesh that a search sees."""

from __future__ import annotations

import numpy as np

from colloc.dynamics.collocated import whole_turns
from colloc.dynamics.control_problem import control_problem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.prescribed import Prescribed
from colloc.gaits.problem import Problem
from colloc.gaits.symmetry import ANTIPODAL
from colloc.mechanics.contact import Pairs
from colloc.reduced.linear_space import LinearSpace
from colloc.reduced.program import SearchSpace
from colloc.transcription.full_program import FullProgram, full_program

SPACES = LinearSpace, SearchSpace


def space_of(
    problem: Problem,
    gait: AnyGait | None = None,
    edges: np.ndarray | None = None,
    scheme: str = "",
    far: Pairs = (),
) -> SearchSpace:
    """The class of a problem on its first mesh, or on edges in phases of a gait (in the program's
    own time without one), with pairs of links `far` kept from crossing."""
    if gait is not None and edges is not None:
        edges = problem.gait.times(gait, edges)
    space: type = SearchSpace if isinstance(problem.gait, Prescribed) else LinearSpace
    return space(control_problem(problem), edges, scheme, far)


def space_near(
    problem: Problem, gait: AnyGait, edges: np.ndarray | None = None, scheme: str = ""
) -> tuple[SearchSpace, np.ndarray]:
    """The space of `space_of`, and the parameters of its member nearest to a gait."""
    space = space_of(problem, gait, edges, scheme)
    return space, space.parameters(gait)


def with_far(space: SearchSpace, far: Pairs) -> SearchSpace:
    return space_of(space.control.problem, None, space.edges, space.scheme, far)


def on_mesh_of(space: SearchSpace, gait: AnyGait, edges: np.ndarray, scheme: str) -> SearchSpace:
    return space_of(space.control.problem, gait, edges, scheme, space.far)


def program_of(problem: Problem, gait: AnyGait | None = None) -> FullProgram:
    """The full program of a problem on its first mesh, in units of friction, with shape limits at
    the worst instants of the member nearest to a gait (by default the guess)."""
    space, v = space_near(problem, problem.guess if gait is None else gait)
    return full_program(space.control, space.full_parameters(v))


def with_whole_turns(program: FullProgram, x: np.ndarray) -> FullProgram:
    """The program with the net rotation of an antipodal gait closed as variables x close it."""
    if program.control.aims.closing != ANTIPODAL:
        return program
    if "rotation" not in program.groups:
        return program
    theta = x[program.layout.theta[0]]
    turns = np.array([whole_turns(theta[0], theta[-1])])
    return program.with_bounds("rotation", turns, turns)
