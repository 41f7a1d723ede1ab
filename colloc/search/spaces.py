"""From a problem to its programs: the full one, and the space of gaits that a search sees; which of
them a class wants.

A class that derives from `LinearClass`, as `Harmonic` does, needs nothing here; any other has a
line in `SEARCHED`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from colloc.collocation.program import GaitProgram
from colloc.collocation.transcription import transcribe, transcribe_path
from colloc.gaits.control_problem import ControlProblem, control_problem
from colloc.gaits.free_path import FreePath
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.linear import LinearClass
from colloc.gaits.polygon import Polygon
from colloc.gaits.prescribed import Prescribed
from colloc.gaits.problem import Problem
from colloc.gaits.serpenoid import Serpenoid
from colloc.gaits.symmetry import ANTIPODAL
from colloc.mechanics.bodies import Pairs
from colloc.motion.heading import whole_turns
from colloc.reduced.linear_space import LinearSpace, SerpenoidSpace
from colloc.reduced.one_gait import OneGait
from colloc.reduced.path_space import PathSpace
from colloc.reduced.program import SearchSpace
from colloc.system.errors import ProblemError


class Searched(NamedTuple):
    """How a class of gaits is collocated, and how a search sees it."""

    program: Callable[[ControlProblem, AnyGait, np.ndarray | None, str, Pairs], GaitProgram]
    """Of a control problem, a gait near, the edges of a mesh, a scheme, and pairs of links that
    must not cross: its nonlinear program."""
    space: Callable[[ControlProblem, AnyGait, np.ndarray | None, str, Pairs], SearchSpace]
    """Of the same: its parameters."""


_LINEAR = Searched(
    lambda control, gait, edges, scheme, far: transcribe(control, edges, scheme, far),
    lambda control, gait, edges, scheme, far: LinearSpace(control, edges, scheme, far),
)
_ALONG_PATHS = Searched(transcribe_path, PathSpace)
_SERPENOID = Searched(
    _LINEAR.program,
    lambda control, gait, edges, scheme, far: SerpenoidSpace(control, edges, scheme, far),
)
_GIVEN = Searched(
    _LINEAR.program,
    lambda control, gait, edges, scheme, far: OneGait(control, edges, scheme, far),
)
SEARCHED: dict[type, Searched] = {
    FreePath: _ALONG_PATHS,
    Polygon: _ALONG_PATHS,
    Serpenoid: _SERPENOID,
    LinearClass: _LINEAR,
    Prescribed: _GIVEN,
}
"""By class, for it and those that derive from it; the first that fits counts."""


def _searched(problem: Problem) -> Searched:
    found = next((how for kind, how in SEARCHED.items() if isinstance(problem.gait, kind)), None)
    if found is None:
        raise ProblemError(
            f"no search is known for the class {type(problem.gait).__name__}: derive it from "
            f"LinearClass if its angles are "
            "linear in its parameters, or give its program and its space a line in SEARCHED of "
            "colloc.search.spaces "
            "(docs/howto/own_gait_class.md)."
        )
    return found


def transcribed(
    problem: Problem,
    gait: AnyGait | None = None,
    edges: np.ndarray | None = None,
    scheme: str = "",
    far: Pairs = (),
) -> GaitProgram:
    """The nonlinear program of a problem of any class near a gait, by default its guess, in units
    of friction.

    Self-contact is constrained between links two apart, and between the pairs `far`
    (see `colloc.search.converge.crossing_pairs`).
    """
    near = problem.guess if gait is None else gait
    return _searched(problem).program(control_problem(problem), near, edges, scheme, far)


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
    return _searched(problem).space(control_problem(problem), near, edges, scheme, far)


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


def nearest_parameters(program: GaitProgram, gait: AnyGait) -> np.ndarray:
    """Parameters of the member of a program's class that is nearest to a gait, on the program's
    mesh."""
    space, v = space_near(
        program.control.problem, gait, program.mesh.edges, program.mesh.scheme.name
    )
    return space.full_parameters(v)
