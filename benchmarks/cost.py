"""Where the time of a solve goes, as shares: python -m benchmarks --only cost

Every problem is solved once in a process of its own, interpreted, and the first also with compiled derivatives. IPOPT's own
timing statistics give the linear algebra (MUMPS factorisation and back solves); the functions' time is CasADi's, split by
kind, with the balance solver inside them timed separately. What is left of IPOPT's time is its own overhead and the estimate
of multipliers. All is processor time.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from unittest import mock

from benchmarks.tables import markdown_table
from colloc.gaits.problem_file import read_problem_file
from colloc.numerics.machine_code import FOLDER, OFF, compiler
from colloc.search.compiled_problem import compile_problem

PROBLEMS = ("three_link", "three_link_offset", "three_link_folded")
MODULES = (
    "numpy",
    "casadi",
    "colloc",
    "colloc.gaits.problem",
    "colloc.mechanics.fixed_point",
    "colloc.search.optimise",
    "colloc.pictures.figure",
    "colloc.results.store",
)


def anatomy(name: str) -> dict[str, float]:
    """Seconds by part of one solve of a problem file, certificate and figure included (run in a fresh process)."""
    seconds: dict[str, float] = {}
    mark = time.process_time()

    def lap(part: str) -> None:
        nonlocal mark
        now = time.process_time()
        seconds[part] = seconds.get(part, 0.0) + now - mark
        mark = now

    from colloc.collocation.reduced_space import Condensed
    from colloc.pictures.figure import solution_figure
    from colloc.pictures.style import save as save_figure
    from colloc.results.certificate import certify
    from colloc.results.store import save
    from colloc.search import continuation, level_run, nlp

    lap("imports")
    problem = read_problem_file(Path("problems") / f"{name}.py").problem
    folder = Path(tempfile.mkdtemp())
    log = folder / "ipopt.txt"
    inside = {"balance solver": 0.0, "value": 0.0, "gradient": 0.0, "Jacobian": 0.0, "Hessian": 0.0, "linear algebra": 0.0}
    kinds = {"nlp_f": "value", "nlp_g": "value", "nlp_grad_f": "gradient", "nlp_jac_g": "Jacobian", "nlp_hess_l": "Hessian"}

    spent = {"IPOPT": 0.0, "build": 0.0}
    plain_balance = Condensed._balanced

    def timed_balance(self, *arguments):
        begin = time.process_time()
        result = plain_balance(self, *arguments)
        inside["balance solver"] += time.process_time() - begin
        return result

    class LoggedSolver(nlp.Solver):
        def __init__(self, transcription, options=None):
            begin = time.process_time()
            logging = {"print_timing_statistics": "yes", "output_file": str(log), "file_print_level": 5}
            super().__init__(transcription, {**(options or {}), **logging})
            spent["build"] += time.process_time() - begin

        def _solver(self, iterations):
            begin = time.process_time()
            solver = super()._solver(iterations)
            spent["build"] += time.process_time() - begin
            return solver

        def _solve_within(self, x, delta, multipliers, radius, iterations):
            solver = self._solver(iterations)
            begin = time.process_time()
            result = super()._solve_within(x, delta, multipliers, radius, iterations)
            spent["IPOPT"] += time.process_time() - begin
            stats = solver.stats()
            for key, kind in kinds.items():
                inside[kind] += stats.get(f"t_proc_{key}", 0.0)
            text = log.read_text(encoding="utf-8")
            for part in ("LinearSystemFactorization", "LinearSystemBackSolve", "LinearSystemStructureConverterInit"):
                found = re.search(rf"{part}\.*:\s+(\S+)\s+\(sys:", text)
                inside["linear algebra"] += float(found.group(1)) if found else 0.0
            return result

    with (
        mock.patch.object(Condensed, "_balanced", timed_balance),
        mock.patch.object(continuation, "Solver", LoggedSolver),
        mock.patch.object(level_run, "Solver", LoggedSolver),
    ):
        solution = continuation.continue_delta(problem)
    lap("search")
    solution.certificate = certify(solution)
    lap("verification")
    save(solution, folder / "x.h5")
    lap("saving")
    save_figure(solution_figure(solution), folder / "x", ("png",))
    lap("figure")

    functions = inside["value"] + inside["gradient"] + inside["Jacobian"] + inside["Hessian"]
    seconds["build"] = spent["build"]
    seconds["warm starts, refinement"] = max(seconds.pop("search") - spent["build"] - spent["IPOPT"], 0.0)
    seconds |= {f"IPOPT: {kind}": value for kind, value in inside.items() if kind != "balance solver"}
    seconds["IPOPT: overhead"] = max(spent["IPOPT"] - functions - inside["linear algebra"], 0.0)
    seconds["(balance solver inside IPOPT)"] = inside["balance solver"]
    seconds["(iterations)"] = float(sum(level.iterations for level in solution.levels))
    return seconds


def import_seconds(module: str) -> float:
    """Processor time of a fresh Python that imports a module, less one that imports nothing; the least of three."""

    def spent(code: str) -> float:
        command = [sys.executable, "-c", code + "\nimport time; print(time.process_time())"]
        return min(float(subprocess.run(command, capture_output=True, text=True, check=True).stdout) for _ in range(3))

    return spent(f"import {module}") - spent("pass")


def _anatomy_apart(name: str, code: str) -> dict[str, float]:
    """`anatomy` in a fresh process that looks for compiled code in the folder `code`."""
    command = [sys.executable, "-c", f"import json; from benchmarks.cost import anatomy; print(json.dumps(anatomy({name!r})))"]
    environment = {**os.environ, FOLDER: code}
    output = subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout
    return json.loads(output.splitlines()[-1])


def report(quick: bool, folder: Path) -> str:
    """Shares of the parts of three solves, and import times."""
    columns = {name: _anatomy_apart(name, OFF) for name in (PROBLEMS[:1] if quick else PROBLEMS)}
    if compiler() is not None:
        with tempfile.TemporaryDirectory() as code, mock.patch.dict(os.environ, {FOLDER: code}):
            compile_problem(read_problem_file(Path("problems") / f"{PROBLEMS[0]}.py").problem)
            columns[f"{PROBLEMS[0]}, compiled"] = _anatomy_apart(PROBLEMS[0], code)
    names = list(columns)
    parts = [part for part in columns[names[0]] if not part.startswith("(")]
    totals = {name: sum(columns[name][part] for part in parts) for name in names}
    rows = [[part, *(f"{columns[n][part]:.2f} ({columns[n][part] / totals[n]:.0%})" for n in names)] for part in parts]
    rows.append(["all", *(f"{totals[n]:.2f}" for n in names)])
    for extra in ("(balance solver inside IPOPT)", "(iterations)"):
        rows.append([extra, *(f"{columns[n][extra]:.3g}" for n in names)])
    shares = []
    for n in names:
        own = {part: s for part, s in columns[n].items() if part.startswith("IPOPT")}
        functions = sum(s for part, s in own.items() if not part.endswith(("overhead", "algebra")))
        shares.append(f"{n} {functions / sum(own.values()):.0%}")
    text = markdown_table(["part, seconds (share)", *names], rows)
    text += f"\n\nEvaluations as a share of IPOPT's time (target: at most a quarter): {', '.join(shares)}."
    imports = [[module, import_seconds(module)] for module in MODULES]
    return f"{text}\n\n{markdown_table(['import', 'processor seconds'], imports)}"
