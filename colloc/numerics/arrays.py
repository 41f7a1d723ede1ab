"""The array namespace that lets one statement of the physics serve NumPy and CasADi.

A kernel asks ``xp = namespace(*arrays)`` and then uses arithmetic and the few functions below.
Every array is two-dimensional, ``(n_body, n_time)``: rows are links (or joints), columns are
instants, and columns never mix. With CasADi a kernel is built for one instant, ``(n_body, 1)``, and
mapped over the mesh by the caller.
"""

from __future__ import annotations

import operator
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

Array = Any
"""A NumPy array or a CasADi SX/MX/DM matrix."""


_SAME = ("sin", "cos", "sqrt", "log", "exp", "tanh", "sinh", "cosh")
"""What NumPy and CasADi call alike."""


def _numpy_namespace() -> SimpleNamespace:
    return SimpleNamespace(
        **{name: getattr(np, name) for name in _SAME},
        arcsinh=np.arcsinh,
        where=np.where,
        abs=np.abs,
        arctan2=np.arctan2,
        matmul=operator.matmul,
        sum_rows=lambda a: np.sum(a, axis=0, keepdims=True),
        stack=lambda rows: np.concatenate(rows, axis=0),
        columns=lambda entries: np.stack(entries, axis=-1),
    )


def _casadi_namespace(casadi: ModuleType) -> SimpleNamespace:
    return SimpleNamespace(
        **{name: getattr(casadi, name) for name in _SAME},
        arcsinh=casadi.asinh,
        where=casadi.if_else,
        abs=casadi.fabs,
        arctan2=casadi.atan2,
        matmul=lambda a, b: casadi.mtimes(casadi.DM(a), b),
        sum_rows=casadi.sum1,
        stack=lambda rows: casadi.vertcat(*rows),
        columns=lambda entries: casadi.horzcat(*entries),
    )


_NUMPY = _numpy_namespace()
_CASADI: list[SimpleNamespace] = []


def namespace(*arrays: Array) -> SimpleNamespace:
    """The functions to apply to `arrays`: CasADi's if any of them is a CasADi matrix, else NumPy's.

    ``matmul(a, b)`` takes a constant NumPy or SciPy sparse matrix on the left; ``where(condition,
    a, b)`` evaluates both sides, so the side that is not taken must still be finite, with finite
    derivatives.
    """
    if not any(type(a).__module__.startswith("casadi") for a in arrays):
        return _NUMPY
    if not _CASADI:
        import casadi

        _CASADI.append(_casadi_namespace(casadi))
    return _CASADI[0]
