"""An objective is one expression: the same value, gradient and symbol for all who ask, and nothing
of a file is executed."""

import pickle

import casadi as ca
import numpy as np
import pytest

from colloc import Harmonic, Objective, Problem, ProblemError
from colloc.gaits.gait_fields import statement_hash
from colloc.gaits.objective import DRIVEN, EFFICIENCY, NAMED, QUANTITIES, SPEED, TURNING

PERIOD = dict(zip(QUANTITIES, (0.31, 1.3, 0.7, 8.0, 1.5, 3.0), strict=True))
EXPRESSIONS = [*NAMED, "distance / (work + 0.1 * length)", "2 * distance - 0.01 * work**2"]


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_values_gradients_and_symbols_agree(text):
    objective = Objective(text)
    symbols = {name: ca.SX.sym(name) for name in QUANTITIES}
    expression = objective(symbols)
    inputs = ca.vertcat(*symbols.values())
    function = ca.Function("f", [inputs], [expression, ca.gradient(expression, inputs)])
    value, gradient = (np.array(a).ravel() for a in function([PERIOD[name] for name in symbols]))
    assert objective(PERIOD) == pytest.approx(value[0], rel=1e-14)
    partials = objective.partials(PERIOD)
    assert tuple(partials) == objective.uses
    np.testing.assert_allclose([partials.get(name, 0.0) for name in symbols], gradient, rtol=1e-13)


def test_gradients_of_every_operation_are_those_of_differences():
    text, h = "sqrt(distance) * abs(rotation - 1) / length**-1 + 3 - (2 - work) / +work", 1e-6
    objective = Objective(text)
    for name, slope in objective.partials(PERIOD).items():
        up, down = (objective(PERIOD | {name: PERIOD[name] + side * h}) for side in (1, -1))
        assert slope == pytest.approx((up - down) / (2 * h), rel=1e-8)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').remove('x')", "distance.real", "distance if work else 0", "lambda: 1",
        "distance**work", "True * work", "speeed", "distance /", "", "f'{work}'", "distance / 0",
        "9**9**9 * distance", "-distance", "work < 2", "abs(1, 2)", "1 + " * 200 + "distance",
        "-" * 450 + "distance",
    ],
)  # fmt: skip
def test_what_is_no_expression_of_a_period_is_refused(text):
    with pytest.raises(ProblemError, match="objective"):
        Objective(text)


def test_an_expression_that_is_known_has_its_name():
    assert Objective("distance/work") == EFFICIENCY == Objective("efficiency")
    assert Objective("distance / length") == SPEED
    assert Objective("1 / (work / distance)").name == "1 / (work / distance)"


def test_the_power_of_friction_that_an_objective_is_proportional_to():
    assert (EFFICIENCY.degree, SPEED.degree, TURNING.degree, DRIVEN.degree) == (-1, 0, -1, -1)
    assert Objective("distance / work**0.5").degree == -0.5
    assert Objective("distance / (work + length)").degree is None


def test_what_is_usual_is_not_stated_so_a_problem_has_one_hash():
    problem = Problem("h1", gait=Harmonic(1, "bilateral"))
    same = problem.with_(objective="distance / work", rotation=0.0, at_least={})
    assert same.hash == problem.hash
    assert "objective" not in problem.to_dict()


def test_a_problem_with_an_objective_comes_back_from_its_statement():
    asked = {"objective": Objective("rotation / work", "turn"), "at_least": {"speed": 0.01}}
    problem = Problem("turning", gait=Harmonic(2), rotation=None, **asked)
    again = Problem.from_dict(problem.to_dict())
    assert again.objective == problem.objective
    assert again.rotation is None
    assert again.at_least == ((SPEED, 0.01),)
    assert pickle.loads(pickle.dumps(problem)).hash == problem.hash  # as it goes to other processes
    assert again.hash == problem.hash == statement_hash(problem.to_dict())
    assert again.hash != problem.with_(at_least={}).hash


@pytest.mark.parametrize("expression", ["work", "-work", "1 / work", "rotation / work"])
def test_the_error_of_a_value_is_relative_to_its_magnitude_whatever_its_sign(expression):
    period = {"distance": 0.4, "work": 2.0, "rotation": -0.3, "length": 7.0, "driven_work": 2.0}
    assert Objective(expression).relative_error(period, {"work": 0.1}) == pytest.approx(0.05)
