"""Failures are named in mechanical words."""

import re
from dataclasses import replace

import numpy as np
import pytest

from colloc import Harmonic, ModalBody, Problem, ellipse
from colloc.mechanics.bodies import FORMULATIONS
from colloc.search.ipopt import Solver, explanation, row_meaning
from tests.shared.stages import program_of


def stated(**changes):
    fields = {"guess": ellipse(0.1, 1.4, 0.8), "gait": Harmonic(1), "intervals": 8} | changes
    return Problem("p", **{name: value for name, value in fields.items() if value is not None})


@pytest.mark.parametrize(
    "changes",
    [
        *({"formulation": formulation} for formulation in FORMULATIONS),
        {"froude": 0.1, "grade": 0.1},
        {"power_limit": 0.3, "at_least": {"distance": 0.1}},
        {"body": ModalBody(3), "guess": None, "gait": Harmonic(1, "antipodal")},
    ],
    ids=str,
)
def test_every_row_has_a_meaning_and_a_phase(changes):
    program = program_of(stated(**changes))
    phases = []
    for row in range(program.row_lower.size):
        what, phase = row_meaning(program, row)
        assert what.startswith(("the ", "closure", "contact", "where ", "a value "))
        phases.append(phase)
    assert 0 <= min(phases) <= max(phases) <= 1


@pytest.mark.parametrize(
    ("formulation", "variable"), [("full", "spins"), ("implicit velocity", "z")]
)
def test_a_broken_balance_is_named_with_its_window(formulation, variable):
    program = program_of(stated(formulation=formulation))
    solver = Solver(program, {"max_iter": 0})
    x = program.feasible(stated().gait.parameters(stated().guess), 0.1)
    x[getattr(program.layout, variable)[-1, 10:13]] += 0.1
    result = solver.solve_within(x, 0.1, None, np.inf)
    text = explanation(program, result, 0.1)
    assert any(word in text for word in ("torque", "balance", "rotation", "rate", "friction"))
    first, last, worst = map(
        float, re.search(r"between phases (.*) and (.*), worst at (0\.\d+)", text).groups()
    )
    assert first <= worst <= last < first + 0.3
    assert first < program.mesh.times[11] < last + 0.125
    assert "Try to" in text


def test_a_delta_that_rounding_hides_is_named():
    """At delta = 1e-10 the flagship's gradient is noise of 2e-6; at 1e-9 it is still told from
    zero."""
    problem = stated()
    program = program_of(problem)
    x = program.feasible(problem.gait.parameters(problem.guess), 1e-10)
    result = Solver(program, {"max_iter": 0}).solve_within(x, 1e-10, None, np.inf)
    result = replace(result, excess=np.zeros_like(result.excess))
    assert "at least 1e-09, below which rounding" in explanation(program, result, 1e-10)
    assert "rounding" not in explanation(program, result, 1e-9)
