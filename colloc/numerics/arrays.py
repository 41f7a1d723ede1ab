"""Array namespaces: one statement of the physics serves NumPy and CasADi.

Arrays are ``(n_body, n_time)``, and columns never mix; with CasADi there is one column.
"""

import operator
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np

Array = Any
"""A NumPy array or a CasADi SX/MX/DM matrix."""
_SAME = ("sin", "cos", "sqrt", "log", "exp", "tanh", "sinh", "cosh")
_NUMPY = SimpleNamespace(
    **{name: getattr(np, name) for name in _SAME},
    arcsinh=np.arcsinh,
    where=np.where,
    abs=np.abs,
    arctan2=np.arctan2,
    matmul=operator.matmul,
    constant=np.asarray,
    cumsum=lambda a: np.cumsum(a, axis=0),
    sum_rows=lambda a: np.sum(a, axis=0, keepdims=True),
    stack=lambda rows: np.concatenate(rows, axis=0),
)


@cache
def _casadi() -> SimpleNamespace:
    import casadi

    return SimpleNamespace(
        **{name: getattr(casadi, name) for name in _SAME},
        arcsinh=casadi.asinh,
        where=casadi.if_else,
        abs=casadi.fabs,
        arctan2=casadi.atan2,
        matmul=lambda a, b: casadi.mtimes(casadi.DM(a), b),
        constant=casadi.DM,
        cumsum=casadi.cumsum,
        sum_rows=casadi.sum1,
        stack=lambda rows: casadi.vertcat(*rows),
    )


def namespace(*arrays: Array) -> SimpleNamespace:
    """CasADi's functions if any of the arrays is a CasADi matrix, else NumPy's.

    ``matmul`` takes a constant matrix on the left. ``where`` evaluates both sides, so the side that
    is not taken must be finite, with finite derivatives.
    """
    return _casadi() if any(type(a).__module__.startswith("casadi") for a in arrays) else _NUMPY
