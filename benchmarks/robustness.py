"""How dependable the search is: random starts for six friction laws, with and without an imposed symmetry.

    python benchmarks/robustness.py --starts 100 --workers 2

For every case: the share of starts that reach a certified optimum (first-order conditions and an independent fine
replay), the median processor time of a start (certificate included), how often each way of failing occurs, the best
optimum and the share of starts that found it. One harmonic, Latin-hypercube starts, final delta 1e-4 unless --delta says
otherwise. Every case keeps an archive in results/robustness/, so an interrupted run goes on where it stopped. Writes
results/robustness.md and results/robustness.json.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from colloc import Friction, Harmonic, Problem, ellipse
from colloc.basins import basins, counts
from colloc.campaign import run_starts
from colloc.sampling import LATIN_HYPERCUBE
from colloc.solution import SOLVED, versions
from colloc.store_archive import Archive, load_archive, save_archive

LAWS = ((1, 1, 1), (1.7, 1, 1.3), (10, 1, 1), (0.5, 1, 5), (1, 1, 3), (3, 1, 1))
SYMMETRIES = ("none", "bilateral", "antipodal")
INTERVALS = {"none": 40, "bilateral": 20, "antipodal": 20}
TIME_LIMIT = 120.0


def case_problem(law: tuple[float, float, float], symmetry: str, delta: float, delta_start: float) -> Problem:
    """One cell of the table."""
    return Problem(
        name="robustness-" + "-".join(f"{mu:g}" for mu in law) + f"-{symmetry}-{delta:g}",
        friction=Friction(*law),
        gait=Harmonic(1, symmetry),
        guess=ellipse(0.0 if symmetry == "antipodal" else 0.3, 1.0, 0.5),
        delta=delta,
        delta_start=delta_start,
        intervals=INTERVALS[symmetry],
    )


def completed_archive(problem: Problem, starts: int, workers: int, folder: Path) -> Archive:
    """The archive of a case with all starts done; only what is missing is solved."""
    path = folder / f"{problem.name}.h5"
    archive = Archive(problem, LATIN_HYPERCUBE, 0, "benchmarks/robustness.py")
    if path.exists() and load_archive(path).problem.hash == problem.hash:
        archive = load_archive(path)
    missing = [k for k in range(starts) if k not in archive.outcomes]
    for outcome in run_starts(problem, missing, workers=workers, time_limit=TIME_LIMIT):
        archive.outcomes[outcome.start] = outcome
        save_archive(archive, path)
    return archive


def row(archive: Archive, starts: int) -> dict:
    """What the table says about a case."""
    outcomes = [o for o in archive.ordered() if o.start < starts]
    found = basins(archive.problem, outcomes)
    friction = archive.problem.friction
    return {
        "law": [friction.mu_t, friction.mu_f, friction.mu_b],
        "symmetry": archive.problem.gait.symmetry,
        "starts": len(outcomes),
        "certified": sum(o.status == SOLVED for o in outcomes) / len(outcomes),
        "median_cpu_seconds": float(np.median([o.cpu_seconds for o in outcomes])),
        "counts": counts(outcomes),
        "failures": {str(o.start): f"{o.status}: {o.message}" for o in outcomes if o.status != SOLVED},
        "optima": [[b.best.efficiency, b.frequency] for b in found],
        "best_gait": {k: getattr(found[0].best.gait, k).tolist() for k in ("mean", "cos", "sin")} if found else None,
    }


def markdown(rows: list[dict], delta: float, delta_start: float, command: str) -> str:
    """The table for people."""
    lines = [
        "# Robustness of the search over gaits",
        "",
        f"One harmonic, Latin-hypercube starts (seed 0), delta {delta_start:g} to {delta:g}. Written by `{command}`.",
        "Certified: first-order conditions and an independent fine replay agree. Time: processor time of one start,",
        "certificate included, on one core that other work shared, so it is an upper estimate.",
        "",
        "| (mu_t, mu_f, mu_b) | symmetry | starts | certified | median s | best d/W | found by | optima | failures |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        best, share = r["optima"][0] if r["optima"] else (float("nan"), 0.0)
        failures = ", ".join(f"{n} {s}" for s, n in r["counts"].items() if s != SOLVED) or "none"
        law = ", ".join(f"{mu:g}" for mu in r["law"])
        lines.append(
            f"| ({law}) | {r['symmetry']} | {r['starts']} | {r['certified']:.0%} | {r['median_cpu_seconds']:.1f} "
            f"| {best:.5f} | {share:.0%} | {len(r['optima'])} | {failures} |"
        )
    lines += ["", "## Starts that fail", ""]
    for r in rows:
        for start, text in r["failures"].items():
            lines.append(f"- {tuple(r['law'])}, {r['symmetry']}, start {start}: {text}")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description="Success rates over random starts; see the top of this file.")
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--delta", type=float, default=1e-4)
    parser.add_argument("--delta-start", type=float, default=0.1)
    parser.add_argument("--symmetries", nargs="+", choices=SYMMETRIES, default=SYMMETRIES)
    parser.add_argument("--output", type=Path, default=Path("results"))
    options = parser.parse_args()
    stem = "robustness" if options.delta == 1e-4 else f"robustness_{options.delta:g}"
    command = f"python benchmarks/robustness.py --starts {options.starts} --delta {options.delta:g}"
    command += f" --delta-start {options.delta_start:g} --symmetries {' '.join(options.symmetries)}"
    rows = []
    for symmetry in options.symmetries:
        for law in LAWS:
            problem = case_problem(law, symmetry, options.delta, options.delta_start)
            rows.append(
                row(completed_archive(problem, options.starts, options.workers, options.output / "robustness"), options.starts)
            )
            text = markdown(rows, options.delta, options.delta_start, command)
            print(text.split("## Starts")[0].splitlines()[-2], flush=True)
            (options.output / f"{stem}.md").write_text(text, encoding="utf-8")
            record = {"command": command, "versions": versions(), "rows": rows}
            (options.output / f"{stem}.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
