"""The largest of many affine functions made smallest: a sparse program for the interior-point
solver Clarabel.

A plain linear program has its optimum at a vertex, where unknowns that few functions see take wild
values; an exchange of functions then wanders. A small quadratic penalty on roughness picks the
smoothest of nearly equal optima.
"""

from __future__ import annotations

from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from colloc.system.errors import NotConvergedError

_TOLERANCE = 1e-7
_TINY = 1e-10
_USABLE = ("Solved", "AlmostSolved")


class Minimax(NamedTuple):
    """Optimum of a minimax program.

    x ``(n,)``: the unknowns. value: the largest function there. weights ``(m,)``: multipliers, >=
    0, of sum 1.
    """

    x: np.ndarray
    value: float
    weights: np.ndarray


def smallest_maximum(
    rows: sparse.csr_matrix, constants: np.ndarray, penalty: sparse.spmatrix
) -> Minimax:
    """Minimise ``max_i (rows x + constants)_i + x.penalty.x / 2``, with sparse rows ``(m, n)`` and
    a symmetric, positive semidefinite penalty ``(n, n)``. `NotConvergedError` if the solver reports
    neither an optimum nor nearly one."""
    m, n = rows.shape
    left = sparse.hstack([rows, -np.ones((m, 1))], format="csc")
    quadratic = sparse.block_diag([penalty + _TINY * sparse.eye(n), sparse.csc_matrix((1, 1))])
    cost = np.zeros(n + 1)
    cost[-1] = 1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
    matrices = (
        sparse.triu(quadratic, format="csc"),
        cost,
        left,
        -constants,
        [clarabel.NonnegativeConeT(m)],
    )
    for refined in (False, True):
        # refining every linear solve takes a quarter of the time, and is hardly ever needed for
        # this tolerance
        settings.iterative_refinement_enable = refined
        answer = clarabel.DefaultSolver(*matrices, settings).solve()
        if str(answer.status) in _USABLE:
            break
    else:
        raise NotConvergedError(
            f"the program of the bound failed: the interior-point solver reports {answer.status}."
        )
    x = np.array(answer.x)[:-1]
    return Minimax(x, float((rows @ x + constants).max()), np.array(answer.z))
