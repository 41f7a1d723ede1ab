"""Least-squares multipliers of equations at a point."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

_REGULARISATION = 1e-10  # makes the matrix regular where equations are redundant


def quasi_definite_factors(jacobian: sparse.csr_matrix) -> SuperLU:
    """Factors of the matrix ``[[1, J'], [J, -eps]]`` for a Jacobian J ``(m, n)``.

    It is quasi-definite, so it has factors in any symmetric order without pivoting (Vanderbei,
    1995). Minimum degree keeps their fill linear in the mesh; pivoting makes it quadratic.
    """
    m, n = jacobian.shape
    system = sparse.bmat(
        [[sparse.eye(n), jacobian.T], [jacobian, -_REGULARISATION * sparse.eye(m)]], format="csc"
    )
    return splu(
        system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )


def least_squares_multipliers(jacobian: sparse.csr_matrix, gradient: np.ndarray) -> np.ndarray:
    """Multipliers ``(m,)`` that minimise ``|gradient + J' multipliers|``, J ``(m, n)``."""
    m, n = jacobian.shape
    factors = quasi_definite_factors(jacobian)
    x = factors.solve(np.concatenate([-gradient, np.zeros(m)]))
    # without pivoting some digits are lost; one refinement brings them back
    left = np.concatenate([-gradient - x[:n] - jacobian.T @ x[n:], -jacobian @ x[:n]])
    left[n:] += _REGULARISATION * x[n:]
    return (x + factors.solve(left))[n:]
