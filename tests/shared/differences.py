"""Derivatives of a nonlinear program against central differences."""

import casadi as ca
import numpy as np


def assert_derivatives_are_differences(found, x, p, rtol, h=1e-6, seed=1):
    """Jacobian and Hessian of the Lagrangian of `colloc.numerics.repeated.Nlp`, near x, along a
    random direction."""
    rng = np.random.default_rng(seed)
    x = x + 1e-3 * rng.normal(size=x.size)
    direction = rng.normal(size=x.size)
    rows = ca.Function(
        "rows", [found.expressions["x"], found.expressions["p"]], [found.expressions["g"]]
    )
    jacobian = found.functions["jac_g"](x, p)[1]
    difference = np.array(rows(x + h * direction, p) - rows(x - h * direction, p)).ravel() / (2 * h)
    np.testing.assert_allclose(
        difference, np.array(jacobian @ direction).ravel(), atol=rtol * np.abs(difference).max()
    )
    lam = rng.normal(size=difference.size)
    upper = np.array(ca.DM(found.functions["hess_lag"](x, p, 1.3, lam)))
    hessian = upper + np.triu(upper, 1).T

    def gradient(point):
        own = np.array(found.functions["grad_f"](point, p)[1]).ravel()
        return 1.3 * own + np.array(found.functions["jac_g"](point, p)[1].T @ lam).ravel()

    difference = (gradient(x + h * direction) - gradient(x - h * direction)) / (2 * h)
    np.testing.assert_allclose(
        difference, hessian @ direction, atol=rtol * np.abs(difference).max()
    )
