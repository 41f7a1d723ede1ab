"""Multipliers of equations that come closest to stationarity: the least-squares estimate at a
point."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

_REGULARISATION = 1e-10
"""Makes the matrix regular where equations are redundant; changes the multipliers of the others by
about as much."""


def quasi_definite_factors(jacobian: sparse.csr_matrix) -> SuperLU:
    """Factors of the matrix ``[[1, J'], [J, -eps]]`` for a Jacobian J ``(m, n)``.

    It is quasi-definite, so it has factors in any symmetric order without pivoting (Vanderbei,
    1995). Minimum degree keeps their fill linear in the mesh; orders for general matrices with
    pivoting make it quadratic, the time cubic.
    """
    m, n = jacobian.shape
    system = sparse.bmat(
        [[sparse.eye(n), jacobian.T], [jacobian, -_REGULARISATION * sparse.eye(m)]], format="csc"
    )
    return splu(
        system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )


def estimated_multipliers(jacobian: sparse.csr_matrix, gradient: np.ndarray) -> np.ndarray:
    """The multipliers ``(m,)`` that minimise ``|gradient + J' multipliers|``, J being the Jacobian
    ``(m, n)`` of the equations and the gradient ``(n,)`` that of the objective."""
    m, n = jacobian.shape
    factors = quasi_definite_factors(jacobian)
    solution = factors.solve(np.concatenate([-gradient, np.zeros(m)]))
    # without pivoting some digits are lost; one refinement brings them back
    remaining = np.concatenate(
        [-gradient - solution[:n] - jacobian.T @ solution[n:], -jacobian @ solution[:n]]
    )
    remaining[n:] += _REGULARISATION * solution[n:]
    return (solution + factors.solve(remaining))[n:]
