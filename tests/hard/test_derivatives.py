"""Jacobian and Hessian of every block of the nonlinear program against differences, at random and
at hard points.

Differences are central, of fourth order, with steps in proportion to delta, over which the law
changes.
"""

import casadi as ca
import numpy as np
import pytest
from cases import HARD

from colloc.collocation.point_equations import point_function
from colloc.collocation.transcription import transcribe
from colloc.gaits.control_problem import control_problem
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.problem import Problem
from colloc.mechanics.balance import instant
from colloc.mechanics.chain import Chain
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from tests.shared.laws import coulomb

STENCIL = ((1, 2 / 3), (-1, -2 / 3), (2, -1 / 12), (-2, 1 / 12))
THREE, FOUR = Chain(), Chain((0.2, 0.35, 0.3, 0.15))
STICK = [name for name in HARD if name.startswith(("stick", "symmetric"))]
FOLDS = [
    "both folded the same way",
    "both folded opposite ways",
    "tail folded back, opening only",
    "nearly folded",
]
STRAIGHT = [
    "straight body, both joints bend alike",
    "nearly straight",
    "second joint at 1e-9 of the first",
]


def derivative(function, x, step):
    """Fourth-order central differences of a vector function, ``(n_out, n)``."""
    columns = []
    for j in range(x.size):
        shift = np.zeros_like(x)
        shift[j] = step
        columns.append(sum(weight * function(x + k * shift) for k, weight in STENCIL) / step)
    return np.array(columns).T


def check(local, x, delta, step, parameters=None, tolerance=1e-6):
    """Jacobian and Hessian of a `LocalFunction` at x; `parameters` gives what depends on x (the
    solved velocity)."""
    given = parameters or (lambda at: np.zeros((local.n_parameter, 1)))

    def value(at):
        return np.array(local.value(at, given(at), delta)).ravel()

    def jacobian(at):
        dense = np.zeros((local.n_out, local.n_local))
        dense[local.jac_row, local.jac_col] = np.array(local.jacobian(at, given(at), delta)).ravel()
        return dense

    exact, found = jacobian(x), derivative(value, x, step)
    np.testing.assert_allclose(found, exact, atol=tolerance * np.abs(exact).max())
    weight = np.random.default_rng(5).normal(size=local.n_out)
    hessian = np.zeros((local.n_local, local.n_local))
    hessian[local.hess_row, local.hess_col] = np.array(
        local.hessian(x, given(x), delta, weight)
    ).ravel()
    hessian += np.triu(hessian, 1).T
    found = derivative(lambda at: jacobian(at).T @ weight, x, step)
    np.testing.assert_allclose(found, hessian, atol=tolerance * max(np.abs(hessian).max(), 1e-12))


def balanced_point(body, friction, angles, rates, delta, formulation):
    """Locals of a point in balance, theta first, and how the solved velocity follows them."""
    angles, rates = np.atleast_1d(angles)[:, None], np.atleast_1d(rates)[:, None]
    n = body.n_joint

    def solved(at):
        return solve_balance(
            body, friction, at[1 : 1 + n, None], at[1 + n : 1 + 2 * n, None], delta, tolerance=1e-14
        ).z

    z = solve_balance(body, friction, angles, rates, delta, tolerance=1e-13).require().z
    now = instant(body, friction, angles, rates, z, delta)
    forces = np.concatenate(now.force).ravel() if formulation == "full" else np.zeros(0)
    x = np.concatenate([[0.4], angles.ravel(), rates.ravel(), z.ravel(), forces])
    return x, solved if formulation == "implicit velocity" else None


@pytest.mark.parametrize("formulation", ["implicit velocity", "full"])
@pytest.mark.parametrize(
    ("body", "law"), [(THREE, (1, 1, 1)), (THREE, (1.7, 1, 1.3)), (FOUR, (10, 1, 3))], ids=str
)
def test_point_function_at_random_points(formulation, body, law):
    friction, rng = coulomb(*law), np.random.default_rng(6)
    local = point_function(formulation, body, friction)
    for delta in (0.3, 1e-2):
        for _ in range(2):
            angles, rates = rng.uniform(-2, 2, body.n_joint), rng.normal(size=body.n_joint)
            x, solved = balanced_point(body, friction, angles, rates, delta, formulation)
            if formulation == "full":
                x = x + 0.01 * rng.normal(size=x.size)
            check(
                local,
                x,
                delta,
                2e-3 * delta if formulation == "full" else 1e-2 * min(delta, 0.1),
                solved,
                2e-5,
            )


@pytest.mark.parametrize("formulation", ["implicit velocity", "full"])
@pytest.mark.parametrize("names", [STICK, FOLDS, STRAIGHT], ids=["stick", "folds", "straight"])
def test_point_function_at_hard_points(formulation, names):
    for k, (law, delta) in enumerate((((1, 1, 1), 1e-3), ((1.7, 1, 1), 1e-4))):
        friction = coulomb(*law)
        local = point_function(formulation, THREE, friction)
        for name in names[k::2]:
            x, solved = balanced_point(THREE, friction, *HARD[name], delta, formulation)
            check(local, x, delta, (0.01 if formulation == "full" else 0.1) * delta, solved, 2e-4)


@pytest.mark.parametrize("formulation", ["implicit velocity", "full"])
def test_point_function_where_nothing_moves(formulation):
    """Frozen joints, everything at rest: friction is linear there, with a finite slope mu /
    delta."""
    friction, delta = Friction(mu_t=3, mu_f=1, mu_b=1), 1e-2
    local = point_function(formulation, THREE, friction)
    x, solved = balanced_point(THREE, friction, (0.7, -0.4), (0.0, 0.0), delta, formulation)
    check(local, x, delta, 1e-2 * delta, solved, 1e-5)


def other_blocks():
    """Every block but the point function, by name, from a transcription of three unequal links."""
    guess = Fourier([0.2, -0.1], [[0.8, 0.1], [-0.5, 0.2]], [[0.1, 0.3], [0.6, -0.2]])
    problem = Problem("p", guess, body=Chain((0.3, 0.45, 0.25)), gait=Harmonic(2), intervals=8)
    chain = transcribe(control_problem(problem)).assembly
    chain_names = ["joint 1", "joint 2", "links (left)", "links (right)", "shape speed"]
    yield "objective", chain.objective
    yield from zip(chain_names, chain.blocks[1:], strict=True)


@pytest.mark.parametrize(("name", "block"), [pytest.param(n, b, id=n) for n, b in other_blocks()])
def test_every_other_block(name, block):
    rng = np.random.default_rng(9)
    for instance in range(0, block.n_instance, 3):
        own = block.parameters[:, instance : instance + 1]
        x = rng.normal(size=block.function.n_local) + (3.0 if "objective" in name else 0.0)
        check(block.function, x, 1e-3, 1e-3, lambda at, own=own: own, 1e-8)


@pytest.mark.parametrize(
    "angles",
    [(np.pi, np.pi / 2), (2 * np.pi / 3, 2 * np.pi / 3), (np.pi, 0.0), (0.0, 0.0)],
    ids=str,
)
def test_contact_at_its_corners(angles):
    """The smoothed minimum bends within 1e-3 rad of the corner; its derivatives hold there too."""
    from colloc.mechanics.contact import crossing_bounds

    q = ca.SX.sym("q", 2)
    bounds = crossing_bounds(THREE, q)
    value, slope = ca.Function("c", [q], [bounds]), ca.Function("d", [q], [ca.jacobian(bounds, q)])
    found = derivative(lambda at: np.array(value(at)).ravel(), np.array(angles), 1e-5)
    np.testing.assert_allclose(found, np.array(slope(np.array(angles))), atol=1e-8)


@pytest.mark.parametrize("vs", [0.0, 0.3])
def test_second_derivative_where_a_link_does_not_turn(vs):
    """I0 in the rotation rate at w = 0: -l^3 (a^2 - 2 vn^2) / (12 r^5), by expanding the integrand;
    an even function."""
    from colloc.mechanics.link_friction import link_moments

    w = ca.SX.sym("w")
    length, vn, delta = 0.4, 0.05, 0.1
    I0 = link_moments(ca.SX(vs), ca.SX(vn), w, length, delta).I0
    second = float(ca.Function("s", [w], [ca.hessian(I0, w)[0]])(0.0))
    a2 = vs**2 + delta**2
    r = np.sqrt(a2 + vn**2)
    assert second == pytest.approx(-(length**3) * (a2 - 2 * vn**2) / (12 * r**5), rel=1e-12)
