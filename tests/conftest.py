"""Shared results: each problem file is solved once per test run, whatever the number of workers."""

import os

# before NumPy is loaded: the workers use all processors already, and threads of theirs would only
# wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import pickle
import signal
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from filelock import FileLock

matplotlib.use("Agg")
# a run in the background of a script ignores Ctrl-C, and so would programs that tests interrupt
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def once(tmp_path_factory):
    """From (name, make) to what `make()` returns: one worker makes it, the others read its file."""
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "once"
    folder.mkdir(exist_ok=True)
    known = {}

    def made(name, make):
        if name not in known:
            file = folder / f"{name}.pickle"
            with FileLock(f"{file}.lock"):
                if file.exists():
                    known[name] = pickle.loads(file.read_bytes())
                else:
                    known[name] = make()
                    file.write_bytes(pickle.dumps(known[name]))
        return known[name]

    return made


@pytest.fixture(scope="session")
def solved(once):
    """A function from the name of a problem file to (solution, reference)."""

    def result(name):
        from colloc.gaits.problem_file import read_problem_file
        from colloc.search.solve import solve

        stated = read_problem_file(ROOT / "problems" / f"{name}.py")

        def made():
            solution = solve(stated.problem, stated.starts)
            solution.source = stated.source
            return solution

        return once(name, made), stated.reference

    return result


@pytest.fixture(scope="session")
def three_link(solved):
    return solved("three_link")[0]


@pytest.fixture(scope="session")
def unsolved():
    """A function from a problem to a solution that is its guess, in balance but not optimal."""
    return guess_in_balance


def guess_in_balance(problem):
    from colloc.results.answer import Answer
    from colloc.results.solution import Solution
    from colloc.verification.replay import replay
    from tests.shared.stages import program_of

    program = program_of(problem)
    parameters = program.control.admissible.parameters(problem.guess)
    x = program.feasible(parameters, problem.delta)
    gait, mesh, x = program.member(x), program.mesh, x[: program.layout.n]
    fine = replay(problem.body, problem.friction, gait, problem.delta, instants=200)
    measured = {"value": fine.efficiency, "distance": fine.distance, "work": fine.work}
    off = {"kkt_error": 1.0, "violation": 1.0, "complementarity": 0.0, "optimal": False}
    effort = {"status": "guess", "iterations": 0, "seconds": 0.0}
    at = problem, gait, problem.delta, mesh.edges, mesh.scheme.name, x
    answer = Answer(*at, 0 * x, np.zeros_like(program.row_lower), **measured, **off, **effort)
    return Solution(problem, answer, message="only a guess.")
