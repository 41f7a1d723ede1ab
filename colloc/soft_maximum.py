r"""Minimising a maximum of convex functions by Newton's method on its smooth majorant.

``(1/beta) log sum_i exp(beta f_i)`` lies above ``max f_i``, by at most ``log(n)/beta``. Where many functions are nearly active,
as in a bound that equioscillates, a few Newton steps on it with growing beta reach what cutting planes need hundreds of rounds
for; the point it finds also keeps clear of the constraints, which a certificate can use.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse

from colloc.potential import Samples

_RIDGE = 1e-7
_NEGLIGIBLE = 18.0
_ARMIJO = 0.1
_FIRST_DAMPING, _SMALLEST_DAMPING, _LARGEST_DAMPING = 1e-2, 1e-6, 1e6


def soft_maximum(samples: Samples, free: np.ndarray, beta: float) -> float:
    """``(1/beta) log sum exp(beta ratio)`` over the samples, plus a ridge that ties coefficients no sample sees to zero."""
    ratio = samples.ratio(free)[0]
    top = ratio.max()
    return float(top + np.log(np.exp(beta * (ratio - top)).sum()) / beta + 0.5 * _RIDGE * free @ free)


def _model(samples: Samples, free: np.ndarray, beta: float) -> tuple[np.ndarray, np.ndarray]:
    """Gradient and Hessian of the soft maximum."""
    ratio, heading = samples.ratio(free)
    chosen = np.flatnonzero(beta * (ratio - ratio.max()) > -_NEGLIGIBLE)
    heading = heading[chosen]
    weight = np.exp(beta * (ratio[chosen] - ratio.max()))
    weight /= weight.sum()
    rows, _ = samples.rows(chosen, heading)
    gradient = rows.T @ weight
    hessian = beta * ((rows.T @ (sparse.diags(weight) @ rows)).toarray() - np.outer(gradient, gradient))
    # the maximum over heading bends too: f'' = -(d row/d theta)(d row/d theta)^T / (d2 f/d theta2)
    turned = samples.turned_rows(chosen, heading)
    bend = weight / np.maximum(-samples.heading_curvature(free, chosen, heading), 1e-3)
    hessian += (turned.T @ (sparse.diags(bend) @ turned)).toarray()
    return gradient + _RIDGE * free, hessian + _RIDGE * np.eye(free.size)


def minimise_soft_maximum(samples: Samples, free: np.ndarray, beta: float, tolerance: float, max_steps: int) -> np.ndarray:
    """Coefficients that minimise the soft maximum, to within about `tolerance`, from `free` on.

    Newton's method with Levenberg's damping, raised where a step fails and lowered where it succeeds.
    """
    value = soft_maximum(samples, free, beta)
    damping = _FIRST_DAMPING
    for _ in range(max_steps):
        gradient, hessian = _model(samples, free, beta)
        while damping < _LARGEST_DAMPING:
            step = -linalg.solve(hessian + damping * np.eye(free.size), gradient, assume_a="pos")
            slope = float(gradient @ step)
            new_value = soft_maximum(samples, free + step, beta)
            if new_value <= value + _ARMIJO * slope:
                break
            damping *= 10.0
        else:
            break
        gain, free, value = value - new_value, free + step, new_value
        damping = max(0.1 * damping, _SMALLEST_DAMPING)
        if gain < tolerance:
            break
    return free
