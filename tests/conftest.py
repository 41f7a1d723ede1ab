"""Shared results: each problem file is solved once per test run."""

from functools import cache
from pathlib import Path

import matplotlib
import pytest

matplotlib.use("Agg")
ROOT = Path(__file__).resolve().parents[1]


@cache
def solved_problem(name):
    from colloc.optimise import maximise_efficiency
    from colloc.problem_file import read_problem_file

    stated = read_problem_file(ROOT / "problems" / f"{name}.py")
    solution = maximise_efficiency(stated.problem)
    solution.source = stated.source
    return solution, stated.reference


@pytest.fixture(scope="session")
def solved():
    """A function from the name of a problem file to (solution, reference)."""
    return solved_problem


@pytest.fixture(scope="session")
def three_link(solved):
    return solved("three_link")[0]
