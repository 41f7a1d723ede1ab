"""How dependable the search is: random starts for six friction laws, with and without an imposed
symmetry.

    python -m benchmarks.robustness --starts 100
    python -m benchmarks.robustness --starts 4 --harmonics 3
    python -m benchmarks.robustness --starts 12 --harmonics 3 --lengths 0.2 0.5 0.3 --symmetries
    none

For every case: the share of starts that reach a certified optimum (first-order conditions and an
independent fine replay) at delta = 1e-4 and, followed from there, at 1e-6; the median processor
time of a start (certificate included); every failure and why; the best optimum and the share of
starts that found it; and a second replay of every distinct optimum that shares neither grid nor
start phase with the certificate's. Latin-hypercube starts, seed 0; one harmonic and three equal
links unless asked otherwise.

Both symmetries are valid for every friction law: a bilateral gait closes its rotation for any mu_b
/ mu_f (`colloc.results.distinct_optima`), and the second half of an antipodal one is its first half
mirrored, for any friction.

The cases take turns, a few starts at a time, and every start is stored in results/robustness/ as
soon as it is done: an interrupted run goes on where it stopped, and the tables in
results/robustness.md and .json are even at any time.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from colloc import Chain, Friction, Harmonic, Problem
from colloc.gaits.harmonic import Fourier, harmonics_within, shift_phase
from colloc.gaits.starts import LATIN_HYPERCUBE, on_speed_floor
from colloc.results.archive import Archive, StartName, open_archive, save_archive
from colloc.results.distinct_optima import basins
from colloc.results.outcome import Outcome, counts
from colloc.results.solution import SOLVED
from colloc.studies.multistart import process_pool, run_starts
from colloc.system.versions import versions
from colloc.verification.replay import replay
from scripts.program import command_line

Laws = tuple[tuple[float, float, float], ...]
LAWS: Laws = ((1, 1, 1), (1.7, 1, 1.3), (10, 1, 1), (0.5, 1, 5), (1, 1, 3), (3, 1, 1))
SYMMETRIES = ("none", "bilateral", "antipodal")
INTERVALS = {"none": 40, "bilateral": 20, "antipodal": 20}
DELTA, SMALL_DELTA, NEXT_DELTA = 1e-4, 1e-6, 4e-3
TURN = 5
TIME_LIMIT = 600.0
REPLAY_INSTANTS, PHASE, CONTRADICTED = 7000, 0.2345, 3e-4
"""The second replay: another grid, begun at another phase. It contradicts a certificate if the
efficiencies differ by more than this relative amount: three times the certificate's own tolerance,
since this grid is a fixed one."""


class Table(NamedTuple):
    """What all cases of a table have in common."""

    body: Chain = Chain()
    harmonics: int = 1

    def gait_class(self, symmetry: str) -> Harmonic:
        return harmonics_within(self.harmonics, symmetry)

    @property
    def words(self) -> str:
        """The class of gaits, whatever its symmetry."""
        return f"harmonics: {self.harmonics}"

    @property
    def suffix(self) -> str:
        """Of its files; none for the published one."""
        parts = [] if self.harmonics == 1 else [f"{self.harmonics}-harmonics"]
        parts += (
            []
            if self.body == Chain()
            else ["-".join(f"{length:g}" for length in self.body.lengths)]
        )
        return "".join(f"-{part}" for part in parts)


PUBLISHED = Table()


def case_problem(
    law: tuple[float, float, float],
    symmetry: str,
    delta: float,
    delta_start: float,
    table: Table = PUBLISHED,
) -> Problem:
    """One cell of the table."""
    stated = Problem(
        name="robustness-"
        + "-".join(f"{mu:g}" for mu in law)
        + f"-{symmetry}-{delta:g}{table.suffix}",
        body=table.body,
        friction=Friction(mu_t=law[0], mu_f=law[1], mu_b=law[2]),
        gait=table.gait_class(symmetry),
        delta=delta,
        delta_start=delta_start,
    )
    return stated.with_(intervals=INTERVALS[symmetry]) if table.harmonics == 1 else stated


def stored(problem: Problem, folder: Path) -> Archive:
    """The archive of a case as far as it got."""
    return open_archive(problem, folder / f"{problem.name}.h5")


def pool(workers: int) -> Executor:
    """One worker needs no process of its own."""
    return ThreadPoolExecutor(1) if workers == 1 else process_pool(workers)


def advance(
    law: tuple[float, float, float],
    symmetry: str,
    most: int,
    workers: int,
    folder: Path,
    table: Table,
) -> None:
    """Bring a case to starts 0 to `most` - 1 at both deltas."""
    first = stored(case_problem(law, symmetry, DELTA, 0.1, table), folder)
    second = stored(case_problem(law, symmetry, SMALL_DELTA, NEXT_DELTA, table), folder)
    settings: dict = {"workers": workers, "time_limit": TIME_LIMIT, "executor": pool}
    _complete(first, most, lambda missing: run_starts(first.problem, missing, **settings))
    # what did not reach the larger delta counts as failed at the smaller one, for the same reason
    failed = {
        n: o for n, o in first.outcomes.items() if o.status != SOLVED and n not in second.outcomes
    }
    second.add(
        {
            name: replace(outcome, cpu_seconds=0.0, seconds=0.0, iterations=0)
            for name, outcome in failed.items()
        }
    )
    known = {k: o.gait for k, o in first.of_search(LATIN_HYPERCUBE, 0).items()}
    _complete(
        second, most, lambda missing: run_starts(second.problem, missing, known=known, **settings)
    )


def _complete(archive: Archive, most: int, run: Callable) -> None:
    missing = [k for k in range(most) if StartName(LATIN_HYPERCUBE, 0, k) not in archive.outcomes]
    for outcome in run(missing):
        archive.add({StartName(LATIN_HYPERCUBE, 0, outcome.start): outcome})
    save_archive(archive, "benchmarks/robustness.py")


def contradiction(problem: Problem, outcome: Outcome) -> float:
    """Relative difference of a certified efficiency from a replay on another grid, begun at another
    phase (paths: the same)."""
    gait = shift_phase(outcome.gait, PHASE) if isinstance(outcome.gait, Fourier) else outcome.gait
    again = replay(
        problem.body, problem.friction, gait, problem.delta,
        instants=REPLAY_INSTANTS, most_instants=REPLAY_INSTANTS,
    )  # fmt: skip
    return float(outcome.efficiency / again.efficiency - 1)


def row(archive: Archive) -> dict:
    """What the table says about a case."""
    problem, outcomes = archive.problem, list(archive.of_search(LATIN_HYPERCUBE, 0).values())
    found = basins(problem, outcomes)
    return {
        "law": [getattr(problem.friction, mu) for mu in ("mu_t", "mu_f", "mu_b")],
        "symmetry": problem.gait.symmetry,
        "delta": problem.delta,
        "starts": len(outcomes),
        "certified": sum(o.status == SOLVED for o in outcomes) / len(outcomes),
        "median_cpu_seconds": float(np.median([o.cpu_seconds for o in outcomes])),
        "counts": counts(outcomes),
        "failures": {
            str(o.start): f"{o.status}: {o.message}" for o in outcomes if o.status != SOLVED
        },
        "optima": [[b.best.efficiency, b.frequency] for b in found],
        "on_speed_floor": [on_speed_floor(problem, b.best.gait) for b in found],
        "replay_differences": [contradiction(problem, b.best) for b in found],
        "best_gait": {k: np.asarray(v).tolist() for k, v in vars(found[0].best.gait).items()}
        if found
        else None,
    }


def markdown(rows: list[dict], asked: int, command: str, table: Table = PUBLISHED) -> str:
    """The tables for people."""
    lines = [
        "# Robustness of the search over gaits",
        "",
        f"{table.body.describe()}; {table.words}; Latin-hypercube starts (seed 0). Written by "
        f"`{command}`.",
        "Certified: first-order conditions and an independent fine replay agree. Time: processor "
        "time of one start,",
        "certificate included, on a core of a busy machine;",
        "at the smaller delta that of going on from the result at the larger one. Replay: largest "
        "relative difference of the",
        "distinct optima's efficiencies from a second replay, on another grid and from another "
        "phase. On the floor: optima",
        "that are as slow as smallest_shape_speed = 0.1 allows; that bound, not mechanics, decides "
        "their size.",
    ]
    if min(r["starts"] for r in rows) < asked:
        lines += [
            "",
            "The run was interrupted: the third column says how many starts are done. The same "
            "command goes on.",
        ]
    for delta in (DELTA, SMALL_DELTA):
        here = [r for r in rows if r["delta"] == delta]
        if not here:
            continue
        everything = sum(r["certified"] * r["starts"] for r in here) / sum(
            r["starts"] for r in here
        )
        lines += [
            "",
            f"## delta = {delta:g}: {everything:.1%} of {sum(r['starts'] for r in here)} starts "
            f"certified",
            "",
            "| (mu_t, mu_f, mu_b) | symmetry | starts | certified | median s | best d/W | found by "
            "| optima | replay "
            "| failures |",
            "|---|---|---|---|---|---|---|---|---|---|",
        ]
        for r in here:
            best, share = r["optima"][0] if r["optima"] else (float("nan"), 0.0)
            failures = (
                ", ".join(f"{n} {s}" for s, n in r["counts"].items() if s != SOLVED) or "none"
            )
            law = ", ".join(f"{mu:g}" for mu in r["law"])
            floor = sum(r["on_speed_floor"])
            optima = f"{len(r['optima'])}" + (f" ({floor} on the floor)" if floor else "")
            replayed = max((abs(d) for d in r["replay_differences"]), default=float("nan"))
            replay_word = f"{replayed:.0e}" + (" CONTRADICTED" if replayed > CONTRADICTED else "")
            lines.append(
                f"| ({law}) | {r['symmetry']} | {r['starts']} | {r['certified']:.0%} | "
                f"{r['median_cpu_seconds']:.1f} "
                f"| {best:.5f} | {share:.0%} | {optima} | {replay_word} | {failures} |"
            )
        lines += ["", "Starts that fail:", ""]
        failed = [(r, start, text) for r in here for start, text in r["failures"].items()]
        lines += [
            f"- {tuple(r['law'])}, {r['symmetry']}, start {start}: {text}"
            for r, start, text in failed
        ] or ["none"]
    return "\n".join(lines) + "\n"


def write_tables(
    laws: Laws,
    symmetries: list[str],
    asked: int,
    folder: Path,
    output: Path,
    command: str,
    table: Table,
) -> None:
    """results/robustness.md and .json from the archives."""
    archives = [
        stored(
            case_problem(law, symmetry, delta, 0.1 if delta == DELTA else NEXT_DELTA, table), folder
        )
        for delta, symmetry, law in product((DELTA, SMALL_DELTA), symmetries, laws)
    ]
    rows = [row(archive) for archive in archives if archive.outcomes]
    (output / f"robustness{table.suffix}.md").write_text(
        markdown(rows, asked, command, table), encoding="utf-8"
    )
    record = {"command": command, "versions": versions(), "rows": rows}
    (output / f"robustness{table.suffix}.json").write_text(
        json.dumps(record, indent=1) + "\n", encoding="utf-8"
    )


def main() -> None:
    options = command_line(
        __doc__,
        starts=100,
        workers=1,
        symmetries=[*SYMMETRIES],
        harmonics=1,
        laws=len(LAWS),
        lengths=[float],
        output=Path("results"),
        tables=False,
    )
    folder = options.output / "robustness"
    table = Table(Chain(tuple(options.lengths)) if options.lengths else Chain(), options.harmonics)
    laws = LAWS[: options.laws]
    command = f"python -m benchmarks.robustness --starts {options.starts}"
    if options.harmonics != 1:
        command += f" --harmonics {options.harmonics}"
    if len(laws) < len(LAWS):
        command += f" --laws {len(laws)}"
    if options.lengths:
        command += f" --lengths {' '.join(f'{length:g}' for length in options.lengths)}"
    if tuple(options.symmetries) != SYMMETRIES:
        command += f" --symmetries {' '.join(options.symmetries)}"
    turns = [] if options.tables else [*range(TURN, options.starts, TURN), options.starts]
    for most in turns:
        for symmetry, law in product(options.symmetries, laws):
            advance(law, symmetry, most, options.workers, folder, table)
            print(f"{most} starts of {law}, {symmetry}", flush=True)
    write_tables(
        laws, list(options.symmetries), options.starts, folder, options.output, command, table
    )


if __name__ == "__main__":
    main()
