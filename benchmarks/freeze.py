"""Values, errors, iterations and times of all problem files and of the zoos, as what "the same" means.

python -m benchmarks.freeze                     solve all, write benchmarks/freeze.json
python -m benchmarks.freeze --against 4         solve every fourth, print what moved
python -m benchmarks.freeze --against 1 --only files
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from benchmarks import zoo
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import read_problem_file
from colloc.results.solution import SOLVED
from colloc.search.solve import solve
from scripts.program import command_line

FROZEN = Path(__file__).with_suffix(".json")
FILES = Path(__file__).parents[1] / "problems"
ZOOS: dict[str, tuple[Callable[[int], Problem], int]] = {
    "zoo": (zoo.zoo_problem, 100),
    "feet": (zoo.feet_problem, 30),
    "paced": (zoo.paced_problem, 20),
    "modes": (zoo.modal_problem, 10),
    "laws": (zoo.law_problem, 10),
}
SAME = 1e-7
"""Relative difference of values that is none, beside their stated errors."""


def cases(only: str) -> Iterator[tuple[str, Callable[[], tuple[Problem, int | None]]]]:
    """Names, and what makes the problem and its number of starts."""
    for path in sorted(FILES.glob("*.py")) if only in ("", "files") else ():
        if path.stem != "__init__":

            def of_file(path: Path = path) -> tuple[Problem, int | None]:
                read = read_problem_file(str(path))
                return read.problem, read.starts

            yield path.stem, of_file
    for family, (make, count) in ZOOS.items():
        for number in range(count) if only in ("", family) else ():
            yield f"{family}-{number}", lambda make=make, k=number: (make(k), None)  # type: ignore[misc]


def solved(make: Callable[[], tuple[Problem, int | None]]) -> dict[str, Any]:
    """One row."""
    begin = time.process_time()
    try:
        problem, starts = make()
        solution = solve(problem, starts)
    except Exception as error:  # an error is a row, too
        return {"status": f"{type(error).__name__}: {error}"[:200], "seconds": 0.0}
    certificate = solution.certificate
    return {
        "status": solution.status,
        "value": solution.value,
        "error": certificate.value_error,
        "iterations": [step.iterations for step in solution.history],
        "seconds": round(time.process_time() - begin, 2),
        "checks": sorted(check.name for check in certificate.checks),
    }


def moved(old: dict[str, Any], new: dict[str, Any]) -> str:
    """What of a row is no longer the same, or nothing."""
    said = []
    if old["status"] != new["status"]:
        said.append(f"{old['status']} -> {new['status']}")
    if "value" in old and "value" in new:
        allowed = SAME * abs(old["value"]) + (old["error"] or 0.0) + (new["error"] or 0.0)
        if not abs(new["value"] - old["value"]) <= allowed:
            said.append(f"{old['value']:.8g} -> {new['value']:.8g}")
        if new["checks"] != old["checks"]:
            said.append(f"checks {sorted(set(old['checks']) ^ set(new['checks']))}")
    return "; ".join(said)


def main() -> None:
    """Freeze, or compare."""
    options = command_line(__doc__, against=int, only="", output=FROZEN)
    rows = json.loads(FROZEN.read_text(encoding="utf-8")) if FROZEN.exists() else {}
    ratios, differing = [], 0
    for k, (name, make) in enumerate(cases(options.only)):
        if options.against and k % options.against:
            continue
        new = solved(make)
        if not options.against:
            rows[name] = new
            options.output.write_text(json.dumps(rows, indent=0) + "\n", encoding="utf-8")
        elif name in rows:
            said = moved(rows[name], new)
            differing += bool(said)
            ratios.append(new["seconds"] / max(rows[name]["seconds"], 1e-9))
            print(f"{name:24s} {new['seconds']:7.2f} s ({ratios[-1]:.2f})  {said}", flush=True)
        else:
            print(f"{name:24s} {new['seconds']:7.2f} s  new: {new}", flush=True)
    if ratios:
        ratios.sort()
        print(f"{differing} of {len(ratios)} moved; median of times {ratios[len(ratios) // 2]:.2f}")
    solved_count = sum(row["status"] == SOLVED for row in rows.values())
    print(f"{solved_count} of {len(rows)} solved in the file")


if __name__ == "__main__":
    main()
