"""General tools and optimisers of SciPy on the same problem: python -m benchmarks.peer_table

The problem: isotropic three-link body, one bilateral harmonic, delta from 0.1 to 1e-4, 24 intervals
of three Radau points on half a period, the same random starts. Every tool has the best options that
were found for it. Those that solve the full program (rockit, YAPSS) use IPOPT with MUMPS and a
tolerance of 1e-9, and start every level from a motion that colloc's NumPy solver of the balance
makes feasible; JAX has a reduced problem of its own, SLSQP colloc's; Nelder-Mead solves balances by
`solve_balance` at the last delta only.

Every tool is a script under benchmarks/peers, written after that tool's own examples; the other
tools run in an environment of their own (benchmarks/peers/requirements.txt). All take turns, start
by start:

    python -m benchmarks.peers.interleave --peers peers-venv/bin/python

What that has not written to results/peers is taken from results/curated/benchmarks/peers. Writes
results/peers.png and .pdf, too: seconds against error, for all meshes that were run. A start
succeeds if the replay of its gait reaches one of the two certified optima to 1e-3. Joint limits
that hold at nodes only, as general tools impose them, are exceeded between nodes by some 3e-4 rad
at the best optimum; up to 2e-3 rad is forgiven here, not by colloc's certificate.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.peers.settings import INTERVALS
from benchmarks.tables import markdown_table
from benchmarks.work_precision import save_work_precision
from colloc import Chain, Friction, ellipse, replay
from scripts.models.ellipses import admissible
from scripts.program import command_line, read_record

OPTIMA = (0.260029678, 0.207595947)
"""Of problems/three_link.py and problems/three_link_offset.py with a `mesh_tolerance` of 1e-9, by
replays to 1e-9."""


class Tool(NamedTuple):
    """The file of a tool's runs, and the module and options that make them."""

    file: str
    command: list[str]


_COLLOC, _SLSQP = "benchmarks.peers.colloc_three_link", "benchmarks.peers.slsqp_three_link"
_ROCKIT = "benchmarks.peers.rockit_three_link"
CERTIFIED = "colloc, certified"
OWN = {
    CERTIFIED: Tool("colloc-refined.jsonl", [_COLLOC, "--refined"]),
    "colloc, same mesh": Tool("colloc.jsonl", [_COLLOC]),
    "SLSQP on colloc's functions": Tool("slsqp.jsonl", [_SLSQP]),
    "Nelder-Mead on solve_balance": Tool("nelder-mead.jsonl", ["benchmarks.peers.nelder_mead"]),
}
"""Run by this environment."""
OTHERS = {
    "rockit": Tool("rockit.jsonl", [_ROCKIT]),
    "rockit, forces lifted": Tool("rockit-lifted.jsonl", [_ROCKIT, "--lifted"]),
    "YAPSS": Tool("yapss.jsonl", ["benchmarks.peers.yapss_three_link"]),
    "JAX, starts side by side": Tool("jax.jsonl", ["benchmarks.peers.jax_three_link"]),
}
_WORDS = (
    "Processor seconds; what is built or compiled once stands apart. The ratio is to the certified "
    f'solve, "{CERTIFIED}"; that row alone has refinement and a certificate. All were '
    "run in turns, start by start (A B C A B C ...), one thread each, on a machine that others "
    "used: ratios count, seconds do not. SLSQP and Nelder-Mead use colloc's functions."
)
FOLDER = Path("results/peers")
_PLACES = (FOLDER, Path("results/curated/benchmarks/peers"))


def mesh_of(run: dict) -> int:
    """Intervals of half a period."""
    return run.get("intervals", INTERVALS)


def judged(run: dict) -> tuple[bool, float, float]:
    """Whether a run found an optimum, its claim over its replay less 1, and its replay over the
    nearest optimum less 1."""
    if "gait" not in run:
        return False, np.nan, np.nan
    gait = ellipse(*run["gait"])
    replayed = replay(Chain(), Friction(), gait, 1e-4, tolerance=1e-8).efficiency
    short = min((replayed / optimum - 1 for optimum in OPTIMA), key=abs)
    good = abs(short) < 1e-3 and admissible(Chain(), np.array(run["gait"])[:, None], slack=2e-3)[0]
    return good, run["efficiency"] / replayed - 1, short


class Tally(NamedTuple):
    """The runs of a tool with their verdicts (`judged`)."""

    runs: list[dict]
    verdicts: list[tuple[bool, float, float]]

    @property
    def seconds_an_optimum(self) -> float:
        """Processor seconds of all starts over the optima found; infinite if there are none."""
        found = sum(good for good, _, _ in self.verdicts)
        return sum(run["cpu"] for run in self.runs) / found if found else np.inf

    @property
    def median_seconds(self) -> float:
        return float(np.median([run["cpu"] for run in self.runs]))

    @property
    def median_error(self) -> float:
        """Of claim against replay and replay against optimum, which do not cancel; NaN if no start
        ends."""
        errors = [abs(claim) + abs(short) for _, claim, short in self.verdicts if claim == claim]
        return float(np.median(errors or [np.nan]))


def tallies() -> dict[str, dict[int, Tally]]:
    """The runs of each tool on each mesh, in results/peers or their curated copies."""
    judgements: dict[str, dict[int, Tally]] = {name: {} for name in {**OWN, **OTHERS}}
    for name, tool in {**OWN, **OTHERS}.items():
        runs = next(filter(None, (read_record(place / tool.file) for place in _PLACES)), [])
        for n in sorted(set(map(mesh_of, runs))):
            on_mesh = [run for run in runs if mesh_of(run) == n]
            judgements[name][n] = Tally(on_mesh, [judged(run) for run in on_mesh])
    return judgements


def row(name: str, tally: Tally, unit: float) -> list[object]:
    """A line of the table; `unit`: processor seconds an optimum that count as 1."""
    good = [k for k, verdict in enumerate(tally.verdicts) if verdict[0]]
    best = sum(abs(tally.runs[k]["efficiency"] / OPTIMA[0] - 1) < 5e-3 for k in good)
    cells: list[object] = [name, len(tally.runs), f"{len(good)} ({best} the best)"]
    cells += [f"{tally.runs[0]['build']:.1f}", tally.median_seconds, tally.seconds_an_optimum]
    return [*cells, f"{tally.seconds_an_optimum / unit:.2f}", tally.median_error]


def table(recorded: dict[str, dict[int, Tally]]) -> str:
    """The table; ratios are those of processor seconds an optimum to colloc's certified solve."""
    unit = recorded[CERTIFIED][INTERVALS].seconds_an_optimum
    rows = [row(name, on[INTERVALS], unit) for name, on in recorded.items() if INTERVALS in on]
    header = ["tool", "starts", "optima found", "s to build", "median s a start", "s an optimum"]
    header += ["ratio", "error of d/W"]
    return f"{markdown_table(header, rows)}\n\n{_WORDS}"


def main() -> None:
    output = command_line(__doc__, output=Path("results")).output
    recorded = tallies()
    print(table(recorded))
    curves = {
        name: np.array([(tally.median_seconds, tally.median_error) for tally in on.values()]).T
        for name, on in recorded.items()
        if len(on) > 1
    }
    refined = {CERTIFIED: curves.pop(CERTIFIED)}
    save_work_precision(output, "peers", curves, refined, "Three links: medians of starts")


if __name__ == "__main__":
    main()
