"""General tools and optimisers of SciPy on the same problem: python -m benchmarks.peer_table

The problem: isotropic three-link body, one bilateral harmonic, delta from 0.1 to 1e-4, 24 intervals
of three Radau points on half a period, the same random starts. Every tool has the best options that
were found for it. Those that solve the full program (rockit, YAPSS) use IPOPT with MUMPS and a
tolerance of 1e-9, and start every level from a motion that colloc's NumPy solver of the balance
makes feasible; SLSQP works on colloc's reduced functions; Nelder-Mead solves balances by
`solve_balance` at the last delta only.

Every tool is a script under benchmarks/peers, written after that tool's own examples; the other
tools run in an environment of their own (benchmarks/peers/requirements.txt). All take turns, start
by start:

    python -m benchmarks.peers.interleave --peers peers-venv/bin/python

What that has not written to results/peers is taken from results/curated/benchmarks/peers. A start
succeeds if the replay of its gait reaches one of the two certified optima to 1e-3. Joint limits
that hold at nodes only, as general tools impose them, are exceeded between nodes by some 3e-4 rad
at the best optimum; up to 2e-3 rad is forgiven here, not by colloc's certificate.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.tables import markdown_table
from colloc import Chain, Friction, ellipse, replay
from scripts.models.ellipses import admissible
from scripts.program import command_line

OPTIMA = (0.260030, 0.207596)
"""Certified by problems/three_link.py and problems/three_link_offset.py."""


class Tool(NamedTuple):
    """The file of a tool's runs, and the module and options that make them."""

    file: str
    command: list[str]


_COLLOC, _SLSQP = "benchmarks.peers.colloc_three_link", "benchmarks.peers.slsqp_three_link"
_ROCKIT, _YAPSS = "benchmarks.peers.rockit_three_link", "benchmarks.peers.yapss_three_link"
CERTIFIED = "colloc, defaults"
OWN = {
    CERTIFIED: Tool("colloc-refined.jsonl", [_COLLOC, "--refined"]),
    "colloc, same mesh": Tool("colloc.jsonl", [_COLLOC]),
    "SLSQP on colloc's reduced functions": Tool("slsqp.jsonl", [_SLSQP]),
    "Nelder-Mead on solve_balance": Tool("nelder-mead.jsonl", ["benchmarks.peers.nelder_mead"]),
}
"""Run by this environment."""
OTHERS = {
    "rockit, default IPOPT": Tool("rockit.jsonl", [_ROCKIT]),
    "rockit, tuned IPOPT": Tool("rockit-tuned.jsonl", [_ROCKIT, "--tuned"]),
    "YAPSS, default IPOPT": Tool("yapss.jsonl", [_YAPSS]),
    "YAPSS, tuned IPOPT": Tool("yapss-tuned.jsonl", [_YAPSS, "--tuned"]),
}
RECORDED_ONCE = ("rockit, default IPOPT", "YAPSS, default IPOPT")
"""Not run by `benchmarks.peers.interleave` unless asked for: most starts fail, each after its time
limit."""
_WORDS = (
    "Processor seconds, transcription and compiling included (first start). The ratio is to the "
    "certified solve, "
    f'"{CERTIFIED}"; the rows of that name alone have refinement and a certificate. All rows with '
    f"a ratio were run in turns, "
    "start by start (A B C A B C ...), one thread each, on a machine that others used: ratios "
    "count, seconds do not. SLSQP and "
    "Nelder-Mead use colloc's functions."
)
FOLDER = Path("results/peers")
_PLACES = (FOLDER, Path("results/curated/benchmarks/peers"))


def recorded(name: str) -> list[dict]:
    """The runs in a file of results/peers, or its curated copy; none if there is neither."""
    for place in _PLACES:
        if (place / name).exists():
            return [
                json.loads(line) for line in (place / name).read_text(encoding="utf-8").splitlines()
            ]
    return []


def judged(run: dict) -> tuple[bool, float, float]:
    """Whether a run found an optimum, its claim over its replay less 1, and its replay over the
    nearest optimum less 1."""
    if "gait" not in run or not admissible(Chain(), np.array(run["gait"])[:, None], slack=2e-3)[0]:
        return False, np.nan, np.nan
    gait = ellipse(*run["gait"])
    replayed = replay(Chain(), Friction(), gait, 1e-4).efficiency
    short = min((replayed / optimum - 1 for optimum in OPTIMA), key=abs)
    return abs(short) < 1e-3, run["efficiency"] / replayed - 1, short


class Tally(NamedTuple):
    """The runs of a tool with their verdicts (`judged`)."""

    runs: list[dict]
    verdicts: list[tuple[bool, float, float]]

    @property
    def seconds_an_optimum(self) -> float:
        """Processor seconds of all starts over the optima found; infinite if there are none."""
        found = sum(good for good, _, _ in self.verdicts)
        return sum(run["cpu"] for run in self.runs) / found if found else np.inf


def row(name: str, tally: Tally, unit: float) -> list[object]:
    """A line of the table; `unit`: processor seconds an optimum that count as 1."""
    good = [k for k, verdict in enumerate(tally.verdicts) if verdict[0]]
    best = sum(abs(tally.runs[k]["efficiency"] / OPTIMA[0] - 1) < 5e-3 for k in good)
    median = float(np.median([run["cpu"] for run in tally.runs]))
    cells: list[object] = [name, len(tally.runs), f"{len(good)} ({best} the best)", median]
    if not good:
        return [*cells, "-", "-", "-", "-"]
    claim, short = (float(np.median([abs(tally.verdicts[k][i]) for k in good])) for i in (1, 2))
    seconds = tally.seconds_an_optimum
    return [
        *cells,
        seconds,
        f"{seconds / unit:.2f}" if name not in RECORDED_ONCE else "(other day)",
        claim,
        short,
    ]


def table() -> str:
    """The table; ratios are those of processor seconds an optimum to colloc's certified solve."""
    runs = {name: recorded(tool.file) for name, tool in {**OWN, **OTHERS}.items()}
    tallies = {
        name: Tally(found, [judged(run) for run in found]) for name, found in runs.items() if found
    }
    unit = tallies[CERTIFIED].seconds_an_optimum
    rows = [row(name, tally, unit) for name, tally in tallies.items()]
    header = ["tool", "starts", "optima found", "median s a start", "s an optimum", "ratio"]
    header += ["claim against replay", "short of optimum"]
    text = markdown_table(header, rows)
    if missing := [name for name in runs if name not in tallies]:
        text += f"\n\nNot recorded: {', '.join(missing)}."
    return f"{text}\n\n{_WORDS}"


def main() -> None:
    command_line(__doc__)
    print(table())


if __name__ == "__main__":
    main()
