"""Shared results: each problem file is solved once per test run."""

import signal
from functools import cache
from pathlib import Path

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
# a run in the background of a shell script ignores Ctrl-C, and so would the programs that the tests interrupt
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
ROOT = Path(__file__).resolve().parents[1]


@cache
def solved_problem(name):
    from colloc.gaits.problem_file import read_problem_file
    from colloc.search.global_search import STARTS
    from colloc.search.optimise import best_gait

    stated = read_problem_file(ROOT / "problems" / f"{name}.py")
    solution = best_gait(stated.problem, stated.starts or STARTS)
    solution.source = stated.source
    return solution, stated.reference


@pytest.fixture(scope="session")
def solved():
    """A function from the name of a problem file to (solution, reference)."""
    return solved_problem


@pytest.fixture(scope="session")
def three_link(solved):
    return solved("three_link")[0]


@pytest.fixture(scope="session")
def unsolved():
    """A function from a problem to a solution whose one level is the guess, in balance but not optimal."""
    return guess_in_balance


def guess_in_balance(problem):
    from colloc.collocation.transcription import transcribe
    from colloc.collocation.warm_start import feasible_point
    from colloc.results.solution import Solution
    from colloc.results.steps import Level
    from colloc.verification.replay import replay

    transcription = transcribe(problem)
    x = feasible_point(transcription, problem.gait.parameters(problem.guess), problem.delta)
    gait = problem.guess
    fine = replay(problem.body, problem.friction, lambda t: (gait.angles(t), gait.rates(t)), problem.delta, instants=200)
    zero = np.zeros(transcription.assembly.m)
    edges, measured = transcription.mesh.edges, (fine.efficiency, fine.distance, fine.work)
    level = Level(problem.delta, edges, x, 0 * x, zero, *measured, 1.0, 1.0, 0.0, "guess", False, 0, 0.0, 0.0)
    return Solution(problem, [level], message="only a guess.")
