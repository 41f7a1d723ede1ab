"""Linear programs with few equations, by HiGHS through CasADi: SciPy's optimize takes as long to
load as 200 of them."""

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
    multipliers ``(m,)``, what a unit of each right side adds. `NotConvergedError` if there is
    none."""
    with _ONE_AT_A_TIME:
        solver = _solver(*equations.shape)
        answer = solver(g=-gain, a=equations, lba=right, uba=right, lbx=0.0, ubx=np.inf)
        stats = solver.stats()
    if not stats["success"]:
        raise NotConvergedError(f"a linear program failed: {stats['return_status']}")
    return -float(answer["cost"]), *(answer[key].toarray()[:, 0] for key in ("x", "lam_a"))


@lru_cache(maxsize=16)
def _solver(m: int, n: int) -> ca.Function:
    silent = {"error_on_fail": False, "highs": {"output_flag": False}}
    return ca.conic("program", "highs", {"a": ca.Sparsity.dense(m, n)}, silent)
