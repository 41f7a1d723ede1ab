"""Jacobian and Hessian of every block of the nonlinear program against differences, at random and
at hard points.

Differences are central, of fourth order, with steps in proportion to delta, over which the law
changes.
"""

from functools import lru_cache

import casadi as ca
import numpy as np
import pytest
from cases import HARD

from colloc import Chain, Friction, Problem, solve_balance
from colloc.mechanics.balance import instant
from tests.shared.mechanics import coulomb
from tests.shared.stages import program_of

STENCIL = ((1, 2 / 3), (-1, -2 / 3), (2, -1 / 12), (-2, 1 / 12))
THREE = Chain()
STICK = [name for name in HARD if name.startswith(("stick", "symmetric"))]
FOLDS = ["both folded the same way", "both folded opposite ways", "nearly folded"]
FOLDS.insert(2, "tail folded back, opening only")
STRAIGHT = ["straight body, both joints bend alike", "nearly straight"]
STRAIGHT.append("second joint at 1e-9 of the first")


def derivative(function, x, step):
    """Fourth-order central differences of a vector function, ``(n_out, n)``."""
    columns = []
    for j in range(x.size):
        shift = np.zeros_like(x)
        shift[j] = step
        columns.append(sum(weight * function(x + k * shift) for k, weight in STENCIL) / step)
    return np.array(columns).T


def check(function, x, given, delta, step, solved=None, tolerance=1e-6):
    """Jacobian and Hessian of a `LocalFunction` at x; `solved` gives what it is solved for."""
    value, slope, curvature, on_slope, on_curvature = function.functions

    def jacobian(*at):
        return ca.DM(on_slope, slope(*at).full().ravel().tolist()).full()

    def hessian(*at):
        return ca.triu2symm(ca.DM(on_curvature, curvature(*at).full().ravel().tolist())).full()

    def at(x):
        return [x, given, delta, *([] if solved is None else [solved(x)])]

    exact = np.array(jacobian(*at(x)))
    found = derivative(lambda x: np.array(value(*at(x))).ravel(), x, step)
    np.testing.assert_allclose(found, exact, atol=tolerance * np.abs(exact).max())
    weights = np.random.default_rng(5).normal(size=function.out.shape[0])
    exact = np.array(hessian(*at(x), weights))
    found = derivative(lambda x: np.array(jacobian(*at(x))).T @ weights, x, step)
    np.testing.assert_allclose(found, exact, atol=tolerance * max(np.abs(exact).max(), 1e-12))


@lru_cache
def functions(body, friction, formulation):
    """The repeated function of a contact, or of a point with the velocity map."""
    problem = Problem("p", None, body, friction, formulation=formulation, intervals=8)
    repeated = program_of(problem).repeated
    return next(each for each in repeated if each.function.local.shape[0] >= 7)


def check_point(body, friction, angles, rates, delta, formulation, *, step, tolerance):
    """At all links of a point in balance, or at the point."""
    angles, rates = np.atleast_1d(angles)[:, None], np.atleast_1d(rates)[:, None]
    n, repeated = body.n_joint, functions(body, friction, formulation)
    function = repeated.function

    def solved(at):
        q, r = at[1 : 1 + n, None], at[1 + n : 1 + 2 * n, None]
        return solve_balance(body, friction, q, r, delta, tolerance=1e-14).z

    z = solve_balance(body, friction, angles, rates, delta, tolerance=1e-13).require().z
    if formulation != "full":
        x = np.concatenate([[0.4], angles.ravel(), rates.ravel(), z.ravel()])
        check(function, x, np.empty(0), delta, step, solved, tolerance)
        return
    now = instant(body, friction, angles, rates, z, delta)
    for link in range(body.n_link):
        phi = 0.4 + np.arctan2(now.posture.sin[link, 0], now.posture.cos[link, 0])
        vs, vn, w = (part[link, 0] for part in now.velocity)
        c, s = np.cos(phi), np.sin(phi)
        forces = [part[link, 0] for part in now.force]
        x = np.array([phi, w, vs * c - vn * s, vs * s + vn * c, *forces])
        given = repeated.values[:, repeated.gather.shape[1] // body.n_link * link]
        check(function, x, given, delta, step, None, tolerance)


@pytest.mark.parametrize("formulation", ["implicit velocity", "full"])
@pytest.mark.parametrize("names", [STICK, FOLDS, STRAIGHT], ids=["stick", "folds", "straight"])
def test_point_function_at_hard_points(formulation, names):
    for k, (law, delta) in enumerate((((1, 1, 1), 1e-3), ((1.7, 1, 1), 1e-4))):
        for name in names[k::2]:
            step = (0.01 if formulation == "full" else 0.1) * delta
            at = THREE, coulomb(*law), *HARD[name], delta, formulation
            check_point(*at, step=step, tolerance=2e-4)


@pytest.mark.parametrize("formulation", ["implicit velocity", "full"])
def test_point_function_where_nothing_moves(formulation):
    """Joints frozen, everything at rest: friction is linear, with a finite slope mu / delta."""
    friction, delta = Friction(mu_t=3, mu_f=1, mu_b=1), 1e-2
    at = THREE, friction, (0.7, -0.4), (0.0, 0.0), delta, formulation
    check_point(*at, step=1e-2 * delta, tolerance=1e-5)
