"""Linear programs with few equations, by HiGHS through CasADi: SciPy has it too, and takes as long
to load as 200 of them."""

from __future__ import annotations

from functools import lru_cache
from threading import Lock

import casadi as ca
import numpy as np

from colloc.system.errors import NotConvergedError

_ONE_AT_A_TIME = Lock()
"""CasADi lets other threads run while HiGHS does, and a second one in the same solver ends the
process."""


def linear_maximum(
    gain: np.ndarray, equations: np.ndarray, right: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """The largest ``gain @ x`` with ``equations @ x == right`` and x >= 0; x at a corner ``(n,)``;
    the equations' multipliers ``(m,)``, what a unit of their right sides adds.

    Raises
    ------
    NotConvergedError
        If there is none.

    Examples
    --------
    >>> value, x, multipliers = linear_maximum(np.array([1.0, 3.0]), np.array([[1.0, 2.0]]),
    ...     np.array([1.0]))
    >>> value, x.tolist(), multipliers.tolist()
    (1.5, [0.0, 0.5], [1.5])
    """
    with _ONE_AT_A_TIME:
        solver = _solver(*equations.shape)
        found = solver(g=-gain, a=equations, lba=right, uba=right, lbx=0.0, ubx=np.inf)
        stats = solver.stats()
    if not stats["success"]:
        raise NotConvergedError(f"a linear program failed: {stats['return_status']}")
    return -float(found["cost"]), found["x"].toarray()[:, 0], found["lam_a"].toarray()[:, 0]


@lru_cache(maxsize=16)
def _solver(m: int, n: int) -> ca.Function:
    silent = {"error_on_fail": False, "highs": {"output_flag": False}}
    return ca.conic("program", "highs", {"a": ca.Sparsity.dense(m, n)}, silent)
