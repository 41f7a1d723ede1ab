"""Derivatives of implicit functions, ``dz/dy = -R_z^-1 R_y`` where R(z, y) = 0, by CasADi."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from colloc.numerics.arrays import Array


def implicit_derivatives(
    equations: Callable[[Array, Array, Array], tuple[list[Array], Array | None]], n_y: int, n_z: int
) -> Callable[[np.ndarray, np.ndarray, float], np.ndarray]:
    """A function of y ``(n_y, n_time)``, z ``(n_z, n_time)`` and a parameter: total derivatives
    ``(n_out, n_y, n_time)`` along y of outputs at the z that solve ``residual = 0``.

    equations: symbols y, z and the parameter to the outputs and the residual ``(n_z, 1)``; None
    where the outputs do not depend on z.
    """
    y, z, parameter = ca.SX.sym("y", n_y), ca.SX.sym("z", n_z), ca.SX.sym("parameter")
    outputs, residual = equations(y, z, parameter)
    out = ca.vertcat(*outputs)
    slope = ca.jacobian(out, y).T
    if residual is not None:
        adjoint = ca.solve(ca.jacobian(residual, z).T, ca.jacobian(out, z).T)
        slope -= ca.jacobian(residual, y).T @ adjoint
    flat = ca.vec(ca.densify(slope))
    # sharing subexpressions makes it no faster, and takes seconds for a body of many panels
    function: Any = ca.Function("derivatives", [y, z, parameter], [flat])

    def evaluate(y: np.ndarray, z: np.ndarray, parameter: float) -> np.ndarray:
        return np.asarray(function(y, z, parameter).full()).reshape(-1, n_y, y.shape[1])

    return evaluate
