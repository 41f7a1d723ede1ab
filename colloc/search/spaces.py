"""From a problem to its programs: the full one, and the space of gaits that a search sees; which of
them a class wants.

A class that derives from `LinearClass`, as `Harmonic` does, needs nothing here; any other has a
line in `SEARCHED`.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.control_problem import control_problem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.linear import LinearClass
from colloc.gaits.prescribed import Prescribed
from colloc.gaits.problem import Problem
from colloc.gaits.serpenoid import Serpenoid
from colloc.gaits.symmetry import ANTIPODAL
from colloc.mechanics.bodies import Pairs
from colloc.motion.heading import whole_turns
from colloc.reduced.linear_space import LinearSpace, SerpenoidSpace
from colloc.reduced.one_gait import OneGait
from colloc.reduced.program import SearchSpace
from colloc.system.errors import ProblemError
from colloc.transcription.full_program import FullProgram, full_program


def _space_class(problem: Problem) -> type[LinearSpace] | type[OneGait]:
    if isinstance(problem.gait, Serpenoid):
        return SerpenoidSpace
    if isinstance(problem.gait, Prescribed):
        return OneGait
    if isinstance(problem.gait, LinearClass):
        return LinearSpace
    raise ProblemError(
        f"no search is known for the class {type(problem.gait).__name__}: derive it from "
        f"LinearClass (docs/howto/own_gait_class.md)."
    )


def program_of(problem: Problem, gait: AnyGait | None = None) -> FullProgram:
    """The full program of a problem on its first mesh, in units of friction, with the limits of
    the shape at the worst instants of the member nearest to a gait, by default its guess."""
    space, v = space_near(problem, problem.guess if gait is None else gait)
    return full_program(space.control, space.full_parameters(v))


def heading(program: FullProgram, x: np.ndarray) -> FullProgram:
    """The program with the net rotation closed as variables x close it."""
    if program.control.admissible.gait.closing_symmetry != ANTIPODAL:
        return program
    if "rotation" not in program.groups:
        return program
    theta = x[program.layout.theta[0]]
    turns = np.array([whole_turns(theta[0], theta[-1])])
    return program.with_bounds("rotation", turns, turns)


def space_near(
    problem: Problem, gait: AnyGait, edges: np.ndarray | None = None, scheme: str = ""
) -> tuple[SearchSpace, np.ndarray]:
    """The class of a problem on its first mesh, or a given one, and the parameters of its member
    nearest to a gait. `NotConvergedError` if no path of the class is found near the gait."""
    space = space_of(problem, gait, edges, scheme)
    return space, space.parameters(gait)


def space_of(
    problem: Problem,
    near: AnyGait,
    edges: np.ndarray | None = None,
    scheme: str = "",
    far: Pairs = (),
) -> SearchSpace:
    """The class of a problem on its first mesh, or a given one, with the pairs `far` kept apart;
    `near` says which of several kinds of members are meant."""
    return _space_class(problem)(control_problem(problem), edges, scheme, far)


def with_far(space: SearchSpace, far: Pairs) -> SearchSpace:
    """The same class on the same mesh with other pairs of links kept apart."""
    return space_of(space.control.problem, *space.given._replace(far=far))


def remeshed(space: SearchSpace, gait: AnyGait, edges: np.ndarray, scheme: str) -> SearchSpace:
    """The same class near a member on another mesh, in the member's phases."""
    near = space.control.admissible.gait.laid_on(gait, edges)
    return space_of(space.control.problem, near, edges, scheme, space.given.far)


def space_about(problem: Problem, gait: AnyGait) -> tuple[SearchSpace, np.ndarray]:
    """The class of a problem on its first mesh, and parameters about a gait that need not keep
    every row: ten times as fast for free paths."""
    space = space_of(problem, gait)
    return space, space.laid(gait)
