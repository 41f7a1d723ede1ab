"""Programs and classes of gaits for a problem of any kind: which of them a class of gaits wants."""

from __future__ import annotations

import numpy as np

from colloc.collocation.path_transcription import transcribe_path
from colloc.collocation.program import GaitProgram
from colloc.collocation.transcription import transcribe
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.gaits.relaxed import Relaxed
from colloc.gaits.symmetry import ANTIPODAL
from colloc.mechanics.bodies import Pairs
from colloc.reduced.harmonic_space import HarmonicSpace
from colloc.reduced.path_space import PathSpace
from colloc.reduced.program import SearchSpace
from colloc.system.errors import ProblemError


def transcribed(problem: Problem, gait: AnyGait | None = None, edges: np.ndarray | None = None, far: Pairs = ()) -> GaitProgram:
    """The nonlinear program of a problem of any class near a gait, by default its guess.

    Self-contact is constrained between links two apart, and between the pairs `far` (see `colloc.search.far_contact`).
    """
    _check_has_program(problem)
    if problem.has_path:
        return transcribe_path(problem, problem.guess if gait is None else gait, edges, far)
    return transcribe(problem, edges, far)


def _check_has_program(problem: Problem) -> None:
    if isinstance(problem.gait, Relaxed):
        raise ProblemError(
            "relaxed gaits have a search of their own: colloc solve FILE, or colloc.search.relaxed_search.best_relaxed_gait."
        )


def heading(program: GaitProgram, x: np.ndarray) -> GaitProgram:
    """The program with the net rotation closed as variables x close it.

    The first orientation of an antipodal gait is minus the last, or, where it travels the other way along its axis, pi more:
    their sum is a whole number of turns.
    """
    if program.problem.gait.symmetry != ANTIPODAL:
        return program
    theta, rows = x[program.layout.theta[0]], np.zeros(program.constraint_lower.size)
    rows[program.groups["rotation"]] = 2 * np.pi * np.round((theta[0] + theta[-1]) / (2 * np.pi))
    return program.with_rows(program.constraint_lower + rows, program.constraint_upper + rows)


def space_near(
    problem: Problem, gait: AnyGait, edges: np.ndarray | None = None, scheme: str = ""
) -> tuple[SearchSpace, np.ndarray]:
    """The class of a problem on its first mesh, or a given one, and the parameters of its member nearest to a gait.

    Raises
    ------
    NotConvergedError
        If no path of the class is found near the gait.
    """
    _check_has_program(problem)
    space = PathSpace(problem, gait, edges, scheme) if problem.has_path else HarmonicSpace(problem, edges, scheme)
    return space, space.parameters(gait)


def nearest_parameters(program: GaitProgram, gait: AnyGait) -> np.ndarray:
    """Parameters of the member of a program's class that is nearest to a gait, on the program's mesh."""
    space, v = space_near(program.problem, gait, program.mesh.edges)
    return space.full_parameters(v)
