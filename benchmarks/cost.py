"""Where the time of a solve goes, as shares: python -m benchmarks --only cost

Every problem is solved once from its guess in a process of its own. All is processor time.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.tables import markdown_table
from colloc.gaits.problem_file import read_problem_file

PROBLEMS = ("three_link", "three_link_offset", "three_link_folded")
MODULES = (
    "numpy",
    "casadi",
    "colloc",
    "colloc.gaits.problem",
    "colloc.mechanics.fixed_point",
    "colloc.search.solve",
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

    from colloc.pictures.solution_figure import solution_figure
    from colloc.pictures.style import save as save_figure
    from colloc.results.solution import Solution
    from colloc.results.store import save
    from colloc.search.certify import certify
    from colloc.search.confirm import confirm
    from colloc.search.descend import descend
    from colloc.search.explore import begin_at
    from colloc.search.refine import refine

    lap("imports")
    problem = read_problem_file(Path("problems") / f"{name}.py").problem
    folder = Path(tempfile.mkdtemp())
    found = refine(descend(begin_at(problem, problem.guess)))
    lap("search in the reduced space")
    solution = Solution(problem, confirm(found))
    lap("full program by IPOPT")
    solution.certificate = certify(solution.answer)
    lap("certificate")
    save(solution, folder / "x.h5")
    lap("saving")
    save_figure(solution_figure(solution), folder / "x", ("png",))
    lap("figure")
    counts = {
        "(iterations of the search)": sum(step.iterations for step in found.history),
        "(IPOPT's iterations)": solution.answer.iterations,
    }
    return seconds | {what: float(count) for what, count in counts.items()}


def import_seconds(module: str) -> float:
    """Processor time of a fresh Python that imports a module, less one that imports nothing; the least of three."""

    def spent(code: str) -> float:
        command = [sys.executable, "-c", code + "\nimport time; print(time.process_time())"]
        return min(float(subprocess.run(command, capture_output=True, text=True, check=True).stdout) for _ in range(3))

    return spent(f"import {module}") - spent("pass")


def _anatomy_apart(name: str) -> dict[str, float]:
    """`anatomy` in a fresh process."""
    command = [sys.executable, "-c", f"import json; from benchmarks.cost import anatomy; print(json.dumps(anatomy({name!r})))"]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return json.loads(output.splitlines()[-1])


def report(quick: bool, folder: Path) -> str:
    """Shares of the parts of three solves, and import times."""
    columns = {name: _anatomy_apart(name) for name in (PROBLEMS[:1] if quick else PROBLEMS)}
    names = list(columns)
    parts = [part for part in columns[names[0]] if not part.startswith("(")]
    totals = {name: sum(columns[name][part] for part in parts) for name in names}
    rows = [[part, *(f"{columns[n][part]:.2f} ({columns[n][part] / totals[n]:.0%})" for n in names)] for part in parts]
    rows.append(["all", *(f"{totals[n]:.2f}" for n in names)])
    for extra in (part for part in columns[names[0]] if part.startswith("(")):
        rows.append([extra, *(f"{columns[n][extra]:.3g}" for n in names)])
    text = markdown_table(["part, seconds (share)", *names], rows)
    imports = [[module, import_seconds(module)] for module in MODULES]
    return f"{text}\n\n{markdown_table(['import', 'processor seconds'], imports)}"
