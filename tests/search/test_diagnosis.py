"""Failures are named in mechanical words, and redundant equations are found before a solve."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest

from colloc.collocation.transcription import transcribe
from colloc.collocation.warm_start import feasible_point
from colloc.gaits.bspline import Polygon
from colloc.gaits.control_problem import control_problem
from colloc.gaits.harmonic import Fourier, Harmonic, ellipse
from colloc.gaits.problem import Problem
from colloc.mechanics.bodies import FORMULATIONS
from colloc.mechanics.chain import Chain
from colloc.results.checks import UNCERTIFIED
from colloc.search import solve
from colloc.search.certify import GAP
from colloc.search.diagnosis import explanation, redundant_equations, row_meaning
from colloc.search.ipopt import Solver
from colloc.search.spaces import transcribed


def stated(**changes):
    return Problem(
        "p", ellipse(0.1, 1.4, 0.8), **{"gait": Harmonic(1, "none"), "intervals": 8, **changes}
    )


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_every_row_has_a_meaning_and_a_phase(formulation):
    transcription = transcribe(control_problem(stated(formulation=formulation)))
    phases = []
    for row in range(transcription.assembly.m):
        what, phase = row_meaning(transcription, row)
        assert what.startswith(("the ", "closure", "contact"))
        phases.append(phase)
    assert 0 <= min(phases) <= max(phases) <= 1


@pytest.mark.parametrize(
    ("gait", "links"),
    [
        (Polygon(6, "antipodal"), 4),
        (Polygon(4, "bilateral", "side"), 3),
        (Polygon(3, "none"), 3),
    ],
)
def test_every_row_of_a_path_has_a_meaning_of_its_own_and_a_phase(gait, links):
    guess = (
        ellipse(0.0, 1.0, 0.6)
        if links == 3
        else Fourier(np.zeros(3), [[0.8], [0.0], [-0.8]], [[0.5], [0.7], [0.5]])
    )
    problem = Problem("path", guess, Chain((1 / links,) * links), gait=gait, intervals=24)
    transcription = transcribed(problem)
    said = {row_meaning(transcription, row)[0] for row in range(transcription.assembly.m)}
    phases = [row_meaning(transcription, row)[1] for row in range(transcription.assembly.m)]
    assert min(phases) >= 0.0
    assert max(phases) <= gait.fraction + 1e-12
    assert not any(what.startswith("contact of") and "links" not in what for what in said)
    assert not said & set(transcription.groups)


def test_a_broken_balance_is_named_with_its_window():
    solver = Solver(
        transcribe(control_problem(stated(formulation="implicit velocity"))), {"max_iter": 0}
    )
    t = solver.transcription
    x = feasible_point(t, stated().gait.parameters(stated().guess), 0.1)
    x[t.layout.z[2, 10:13]] += 0.1
    result = solver.solve(x, 0.1)
    text = explanation(t, result, 0.1)
    assert "torque" in text or "balance" in text or "rotation" in text
    first, last, worst = map(
        float, re.search(r"between phases (.*) and (.*), worst at (0\.\d+)", text).groups()
    )
    assert first <= worst <= last < first + 0.3
    assert first < t.mesh.times[11] < last + 0.125
    assert "Try to" in text


def test_a_redundant_rotation_constraint_is_detected():
    problem = stated()
    solver = Solver(transcribe(control_problem(problem)))
    x = feasible_point(solver.transcription, problem.gait.parameters(problem.guess), 0.1)
    assert redundant_equations(solver, x, 0.1) == []
    # close the rotation twice
    t = transcribe(control_problem(problem))
    rows = t.groups["rotation"]
    linear = t.assembly.linear.tolil()
    linear[t.groups["angles"].start] = linear[rows.start]
    doubled = Solver(_with_linear(t, linear.tocsr()))
    assert redundant_equations(doubled, x, 0.1) == ["angles", "rotation"]


def test_the_search_for_redundant_equations_takes_time_in_proportion_to_the_mesh():
    """Its factors once filled the square of the mesh: 1,000 intervals took minutes and 30 GB."""
    problem = stated().with_(intervals=600)
    solver = Solver(transcribe(control_problem(problem)))
    x = feasible_point(solver.transcription, problem.gait.parameters(problem.guess), 0.1)
    begin = time.process_time()
    assert redundant_equations(solver, x, 0.1) == []
    assert time.process_time() - begin < 5.0  # 0.2 s; 20 s with factors that fill


def _with_linear(transcription, linear):
    return replace(transcription, assembly=replace(transcription.assembly, linear=linear))


def test_running_out_of_iterations_says_so():
    problem = stated(delta=0.05, delta_start=0.05)
    solver = Solver(transcribe(control_problem(problem)), {"max_iter": 2})
    x = feasible_point(solver.transcription, problem.gait.parameters(problem.guess), 0.05)
    text = explanation(solver.transcription, solver.solve(x, 0.05), 0.05)
    assert "after 2 iterations" in text
    assert np.char.find(text, "Maximum_Iterations") >= 0


def test_a_delta_that_rounding_hides_is_named():
    """At delta = 1e-10 the flagship's gradient is noise of 2e-6; at 1e-9 it is still told from
    zero."""
    problem = stated()
    solver = Solver(transcribe(control_problem(problem)), {"max_iter": 0})
    x = feasible_point(solver.transcription, problem.gait.parameters(problem.guess), 1e-10)
    result = solver.solve(x, 1e-10)
    result = replace(result, excess=np.zeros_like(result.excess))
    assert "at least 1e-09, below which rounding" in explanation(
        solver.transcription, result, 1e-10
    )
    assert "rounding" not in explanation(solver.transcription, result, 1e-9)


def test_rows_of_a_slope_have_a_meaning():
    transcription = transcribe(control_problem(stated(grade=0.1, towards=0.3)))
    meanings = {
        row_meaning(transcription, transcription.groups[name].start)[0]
        for name in ("heading", "across")
    }
    assert meanings == {
        "where the body points at the start",
        "the way across the direction that was asked for",
    }


def test_what_is_no_optimum_is_replayed_roughly(unsolved, monkeypatch):
    """It cannot be certified, and its mesh may ask for a replay of minutes."""
    asked = {}
    monkeypatch.setattr(
        solve, "certify", lambda answer, **settings: asked.update(settings) or UNCERTIFIED
    )
    solve.certified(unsolved(Problem("guess", gait=Harmonic(1, "bilateral"), delta=1e-2)).answer)
    assert asked == {"tolerance": GAP, "instants": 1600}
