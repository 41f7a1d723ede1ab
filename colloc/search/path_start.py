"""Where a search begins: the member of the problem's class nearest to any gait, as a parameter vector of a program."""

from __future__ import annotations

import numpy as np

from colloc.collocation.path_transcription import PathTranscription, path_through, transcribe_fit, transcribe_path
from colloc.collocation.program import GaitProgram
from colloc.collocation.transcription import transcribe
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.path_classes import FreePath
from colloc.gaits.path_samples import fourier_through
from colloc.gaits.problem import Problem
from colloc.mechanics.contact import Pairs
from colloc.numerics.blocks import oracles
from colloc.search.nlp import Solver
from colloc.system.errors import NotConvergedError

_EXACT, _ADMISSIBLE = 1e-7, 1e-9
"""Largest violation at which a gait counts as a member already: what optima keep to; and what a new member keeps to."""
_ROUNDS, _SETTLED = 12, 1e-5
"""Of moving the checks to the worst instants: two joints need 2 or 3, three joints up to 8. Where the worst instant of a cell
swings between two, they never keep to `_ADMISSIBLE`; a start may touch a bound by `_SETTLED` [rad], the search ends that."""
_FIT_OPTIONS: dict[str, object] = {"max_iter": 200, "mu_init": 1e-2, "bound_push": 1e-2, "bound_frac": 1e-2}


def transcribed(problem: Problem, gait: AnyGait | None = None, edges: np.ndarray | None = None, far: Pairs = ()) -> GaitProgram:
    """The nonlinear program of a problem of any class near a gait, by default its guess.

    Self-contact is constrained between links two apart, and between the pairs `far` (see `colloc.search.far_contact`).
    """
    if problem.has_path:
        return transcribe_path(problem, problem.guess if gait is None else gait, edges, far)
    return transcribe(problem, edges, far)


def nearest_parameters(program: GaitProgram, gait: AnyGait) -> np.ndarray:
    """Parameters of the member of the program's class that is nearest to a gait, on the program's mesh.

    Raises
    ------
    NotConvergedError
        If no path of the class is found near the gait.
    """
    problem = program.problem
    if not isinstance(program, PathTranscription):
        return problem.gait.parameters(fourier_through(gait, problem.gait))
    near, _ = path_through(problem, gait, program.mesh.edges)
    x = problem.gait.parameters(near)
    fit = transcribe_fit(problem, near, program.mesh.edges)
    if _largest_violation(fit, x) < _EXACT:
        return x
    solver = Solver(fit, _FIT_OPTIONS)
    least, best = _SETTLED, None
    for _ in range(_ROUNDS):
        result = solver.solve(x, 1.0)
        x = result.x
        if not result.optimal:
            break
        excess = fit.check_excess(x)
        if excess < least:
            least, best = excess, x
        if excess < _ADMISSIBLE:
            break
    if best is not None:
        return best
    bound = f"; allow more curvature than {problem.gait.curvature:g}" if isinstance(problem.gait, FreePath) else ""
    raise NotConvergedError(f"found no {problem.gait.describe()} near the guess; try another guess{bound}.")


def _largest_violation(fit: PathTranscription, x: np.ndarray) -> float:
    functions = oracles(fit.assembly)
    g = np.array(functions.options["jac_g"](x, functions.parameter_vector(1.0, fit.block_parameters(x)))[0]).ravel()
    rows = np.maximum(fit.constraint_lower - g, g - fit.constraint_upper).max()
    return float(max(rows, (fit.lower - x).max(), (x - fit.upper).max(), fit.check_excess(x)))
