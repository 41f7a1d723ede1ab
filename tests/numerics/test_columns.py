"""Rows of a program evaluated from NumPy's memory, against CasADi's own values and Jacobian of the
same program."""

import casadi as ca
import numpy as np
import pytest
from scipy import sparse

from colloc import Chain, FreePath, Friction, Polygon, Problem
from colloc.collocation.path_geometry import path_geometry
from colloc.gaits.control_problem import control_problem
from colloc.numerics.blocks import Assembly, Block, local_function, oracles
from colloc.numerics.columns import ChosenRows, ColumnFunction


def test_a_function_of_columns_takes_any_number_of_them():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    function = ColumnFunction(ca.Function("f", [x, y], [ca.vertcat(x[0] * y, x[1] + y)]))
    for n in (1, 5, 3):
        xs, ys = np.random.default_rng(n).normal(size=(2, n)), np.arange(n)[None] + 1.0
        np.testing.assert_array_equal(function(xs, ys), [xs[0] * ys[0], xs[1] + ys[0]])


@pytest.mark.parametrize(
    ("body", "gait"),
    [
        (Chain((0.3, 0.2, 0.2, 0.3)), FreePath(2.0, "antipodal")),
        (Chain(), FreePath(2.0)),
        (Chain(), Polygon(6)),
    ],
    ids=["three joints", "two joints", "polygon"],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_chosen_rows_are_those_of_the_program(body, gait, seed):
    """Every other row, at a point that keeps none of them."""
    problem, rng = (
        Problem("rows", body=body, friction=Friction(mu_t=2, mu_f=1, mu_b=1), gait=gait),
        np.random.default_rng(seed),
    )
    rows = path_geometry(control_problem(problem), problem.guess).rows
    x = rng.uniform(0.5, 1.5, rows.linear.shape[1])
    given = [block.parameters for block in rows.blocks]
    local = ca.SX.sym("x")
    square = local_function("square", local, ca.SX(0, 1), ca.SX.sym("delta"), local**2)
    objective = Block(
        square, np.zeros((1, 1), dtype=int), sparse.eye(1, format="csr"), np.empty((0, 1))
    )
    program = oracles(Assembly(x.size, objective, rows.blocks, rows.linear))
    values, jacobian = program.options["jac_g"](
        x, program.parameter_vector(0.0, [objective.parameters, *given])
    )
    kept = np.arange(seed % 2, rows.lower.size, 2)
    chosen = ChosenRows(rows.linear, rows.blocks, kept, given)
    np.testing.assert_allclose(chosen.values(x), values.full().ravel()[kept], rtol=0, atol=1e-13)
    np.testing.assert_allclose(chosen.slopes(x), jacobian.full()[kept], rtol=0, atol=1e-12)
