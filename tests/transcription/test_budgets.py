"""Budgets of counts that no machine disturbs: iterations, evaluations, nonzeros, instructions.
Times are in benchmarks/.

A budget is the count measured when it was written plus a margin of a quarter; raise one only with a
reason.
"""

import numpy as np
import pytest

from colloc import Chain, Harmonic, Problem, ellipse, solve_balance
from colloc.numerics.repeated import least_squares_multipliers, quasi_definite_factors
from colloc.search.ipopt import Solver
from tests.shared.laws import coulomb
from tests.shared.stages import program_of


@pytest.mark.parametrize("formulation", ["implicit velocity", "full"])
def test_the_estimate_of_multipliers_is_stationary_and_its_fill_grows_with_the_mesh_only(
    formulation,
):
    """No symmetry: the net rotation couples all intervals."""
    fill = []
    for intervals in (20, 40):
        problem = Problem("p", ellipse(0.3, 1, 0.5), intervals=intervals, formulation=formulation)
        program = program_of(problem)
        solver = Solver(program)
        x = program.feasible(problem.gait.parameters(problem.guess), 0.1)
        jacobian, _ = solver.equality_jacobian(x, 0.1)
        gradient = np.random.default_rng(1).normal(size=jacobian.shape[1])
        left = gradient + jacobian.T @ least_squares_multipliers(jacobian, gradient)
        # what is left is orthogonal to every equation
        assert np.abs(jacobian @ left).max() < 1e-8 * np.abs(gradient).max()
        fill.append(quasi_definite_factors(jacobian).L.nnz)
    assert fill[1] < 2.3 * fill[0]


@pytest.mark.parametrize(
    ("law", "delta", "mean", "largest"),
    [
        ((1, 1, 1), 1e-1, 5.5, 12),
        ((1, 1, 1), 1e-4, 9.7, 24),
        ((1, 1, 1), 1e-12, 13.5, 80),
        ((1.7, 1, 1.3), 1e-4, 10, 30),
        ((0.5, 1, 5), 1e-4, 11, 34),
        ((10, 1, 1), 1e-4, 10, 150),
        ((10, 1, 1), 1e-12, 12.5, 140),
    ],
)
def test_steps_of_the_balance_solver(law, delta, mean, largest):
    rng = np.random.default_rng(0)
    angles, rates = rng.uniform(-np.pi, np.pi, (2, 2000)), rng.normal(size=(2, 2000))
    iterations = solve_balance(Chain(), coulomb(*law), angles, rates, delta).require().iterations
    assert iterations.mean() <= mean
    assert iterations.max() <= largest


@pytest.mark.parametrize(
    ("name", "iterations", "levels"), [("three_link", 65, 10), ("three_link_offset", 65, 10)]
)
def test_effort_of_a_solve(solved, name, iterations, levels):
    solution, _ = solved(name)
    assert sum(level.iterations for level in solution.history) <= iterations
    assert len(solution.history) <= levels
    assert solution.mesh.n <= 40


def test_balance_solves_an_iteration_asks_for():
    """Value, Jacobian and Hessian at one point share one solve of the balance."""
    stated = {"gait": Harmonic(1, "bilateral"), "formulation": "implicit velocity"}
    problem = Problem("p", ellipse(0.3, 1, 0.5), intervals=12, **stated)
    program = program_of(problem)
    x = program.feasible(problem.gait.parameters(problem.guess), 0.1)
    result = Solver(program).solve_within(x, 0.1, None, 1.0)
    assert result.optimal
    assert program.velocity.solves <= 1.5 * result.iterations + 6
