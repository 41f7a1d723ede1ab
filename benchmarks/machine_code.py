"""What compiling the derivatives costs and gains: python -m benchmarks --only machine_code

Evaluations at the points of a mesh, interpreted and compiled, for chains of 2 to 5 links; then random starts of the robustness
table's cases without symmetry, interpreted and compiled. Each measurement is made in a process of its own, with an empty
folder of code. Processor time; evaluations are the least of several repetitions, starts the median.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.robustness import DELTA, LATIN_HYPERCUBE, LAWS, TIME_LIMIT, case_problem
from benchmarks.tables import markdown_table
from colloc import Chain, Friction, Harmonic, Problem, ellipse
from colloc.collocation.point_equations import balance_steps, point_function
from colloc.gaits.harmonic import Fourier
from colloc.gaits.problem import CONDENSED
from colloc.numerics.machine_code import BALANCE_ONLY, FOLDER, compiler
from colloc.results.solution import SOLVED
from colloc.search.compiled_problem import compile_problem
from colloc.studies.campaign import run_start

POINTS, REPETITIONS = 120, 30
LAW = Friction(1.7, 1, 1.3)


def evaluations(links: int, compiled: bool) -> dict[str, float]:
    """Milliseconds of each function at `POINTS` points, and the seconds it took to compile them."""
    body = Chain((1 / links,) * links)
    begin = os.times()
    if compiled:
        n = links - 1
        guess = ellipse(0.3, 1.0, 0.5) if n == 2 else Fourier(np.zeros(n), np.eye(n)[:, :1] + 0.1, np.full((n, 1), 0.2))
        compile_problem(Problem("any", body=body, friction=LAW, gait=Harmonic(1), guess=guess))
    end = os.times()
    point = point_function(CONDENSED, body, LAW)
    rng, n_joint = np.random.default_rng(0), links - 1
    local, z = rng.normal(size=(4 + 2 * n_joint, POINTS)), rng.normal(size=(3, POINTS))
    deltas, weights = np.full((1, POINTS), 1e-3), rng.normal(size=(5, POINTS))
    angles, rates = local[1 : 1 + n_joint], local[1 + n_joint : 1 + 2 * n_joint]
    calls = {
        "value": (point.value.map(POINTS), (local, z, deltas)),
        "Jacobian": (point.jacobian.map(POINTS), (local, z, deltas)),
        "Hessian": (point.hessian.map(POINTS), (local, z, deltas, weights)),
        "steps on the balance": (balance_steps(body, LAW).map(POINTS), (angles, rates, z, deltas)),
    }
    result = {"compile": sum(end[:4]) - sum(begin[:4])}
    for name, (function, arguments) in calls.items():
        times = []
        for _ in range(REPETITIONS):
            mark = time.process_time()
            function(*arguments)
            times.append(1e3 * (time.process_time() - mark))
        result[name] = min(times)
    return result


def starts(law: tuple[float, float, float], count: int, compiled: bool) -> dict[str, list]:
    """Seconds and efficiencies of starts 1 to `count` of a law, certificate included."""
    problem = case_problem(law, "none", DELTA, 0.1)
    if compiled:
        compile_problem(problem)
    run_start(problem, LATIN_HYPERCUBE, 0, 0, TIME_LIMIT)  # loads and builds what later starts share
    outcomes = [run_start(problem, LATIN_HYPERCUBE, 0, k, TIME_LIMIT) for k in range(1, count + 1)]
    return {
        "seconds": [o.cpu_seconds for o in outcomes],
        "efficiencies": [o.efficiency for o in outcomes],
        "solved": [o.status == SOLVED for o in outcomes],
    }


def _apart(call: str, code: str) -> dict:
    command = [sys.executable, "-c", f"import json; from benchmarks.machine_code import *; print(json.dumps({call}))"]
    output = subprocess.run(command, capture_output=True, text=True, check=True, env={**os.environ, FOLDER: code}).stdout
    return json.loads(output.splitlines()[-1])


def report(quick: bool, folder: Path) -> str:
    """Tables of evaluations and of whole starts."""
    if compiler() is None:
        return "No C compiler was found."
    rows = []
    for links in (3,) if quick else (2, 3, 4, 5):
        with tempfile.TemporaryDirectory() as code:
            plain, compiled = _apart(f"evaluations({links}, False)", BALANCE_ONLY), _apart(f"evaluations({links}, True)", code)
        times = [f"{plain[k]:.2f} / {compiled[k]:.2f} ({plain[k] / compiled[k]:.0f}x)" for k in plain if k != "compile"]
        rows.append([links, f"{compiled['compile']:.1f}", *times])
    names = ["value", "Jacobian", "Hessian", "steps on the balance"]
    text = f"Interpreted / compiled, milliseconds for {POINTS} points; the compiler's own seconds, once.\n\n"
    text += markdown_table(["links", "compiling s", *names], rows)

    rows = []
    count = 4 if quick else 9
    for law in LAWS[:1] if quick else LAWS:
        with tempfile.TemporaryDirectory() as code:
            plain = _apart(f"starts({law}, {count}, False)", BALANCE_ONLY)
            compiled = _apart(f"starts({law}, {count}, True)", code)
        a, b = np.median(plain["seconds"]), np.median(compiled["seconds"])
        same = "yes" if plain["efficiencies"] == compiled["efficiencies"] else "no"
        solved = f"{sum(compiled['solved'])} of {count}"
        rows.append([str(law), f"{a:.2f}", f"{b:.2f}", f"{a / b:.1f}", solved, same])
    text += f"\n\nRandom starts 1 to {count} of one harmonic without symmetry at delta = {DELTA:g}, certificate included.\n\n"
    heads = ["(mu_t, mu_f, mu_b)", "median s, interpreted", "median s, compiled", "ratio", "certified", "same digits"]
    return text + markdown_table(heads, rows)
