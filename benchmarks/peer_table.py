"""General tools and a derivative-free search on the same problem: python -m benchmarks --only peer_table

The problem: isotropic three-link body, one bilateral harmonic, delta from 0.1 to 1e-4, 24 intervals of three Radau points on
half a period, IPOPT with MUMPS and a tolerance of 1e-9, the same random starts, the same feasible motion to start from.
Every tool is a script under benchmarks/peers, written after that tool's own examples; the other tools run in an environment
of their own (benchmarks/peers/requirements.txt), and their runs are read from files:

    peers-venv/bin/python -m benchmarks.peers.rockit_three_link --starts 20 --tuned > results/peers/rockit-tuned.jsonl
    peers-venv/bin/python -m benchmarks.peers.yapss_three_link --starts 20 --tuned > results/peers/yapss-tuned.jsonl

and the same without --tuned into rockit.jsonl and yapss.jsonl. What is not in results/peers is taken from
results/curated/benchmarks/peers; colloc and Nelder-Mead are run if there is neither. A start succeeds if the replay of its
gait reaches one of the two certified optima to 1e-3. Joint limits that hold at nodes only, as general tools impose them, are
exceeded between nodes by some 3e-4 rad at the best optimum; up to 2e-3 rad is forgiven here, not by colloc's certificate.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from benchmarks.tables import markdown_table
from colloc import Chain, Friction, ellipse, replay
from scripts.models.ellipses import admissible

OPTIMA = (0.260030, 0.207596)
"""Certified by problems/three_link.py and problems/three_link_offset.py."""
_COLLOC = "benchmarks.peers.colloc_three_link"
OWN = {
    "colloc, defaults": ("colloc-refined.jsonl", [_COLLOC, "--refined"]),
    "colloc, defaults, compiled": ("colloc-refined-compiled.jsonl", [_COLLOC, "--refined", "--compiled"]),
    "colloc, same mesh": ("colloc.jsonl", [_COLLOC]),
    "colloc, same mesh, compiled": ("colloc-compiled.jsonl", [_COLLOC, "--compiled"]),
    "Nelder-Mead": ("nelder-mead.jsonl", ["benchmarks.peers.nelder_mead"]),
}
OTHERS = {
    "rockit, default IPOPT": "rockit.jsonl",
    "rockit, tuned IPOPT": "rockit-tuned.jsonl",
    "YAPSS, default IPOPT": "yapss.jsonl",
    "YAPSS, tuned IPOPT": "yapss-tuned.jsonl",
}
_PLACES = (Path("results/peers"), Path("results/curated/benchmarks/peers"))


def recorded(name: str) -> list[dict]:
    """The runs in a file of results/peers, or its curated copy; none if there is neither."""
    for place in _PLACES:
        if (place / name).exists():
            return [json.loads(line) for line in (place / name).read_text(encoding="utf-8").splitlines()]
    return []


def judged(run: dict) -> tuple[bool, float, float]:
    """Whether a run found an optimum, its claim over its replay less 1, and its replay over the nearest optimum less 1."""
    if "gait" not in run or not admissible(Chain(), np.array(run["gait"])[:, None], slack=2e-3)[0]:
        return False, np.nan, np.nan
    gait = ellipse(*run["gait"])
    replayed = replay(Chain(), Friction(), lambda t: (gait.angles(t), gait.rates(t)), 1e-4).efficiency
    short = min((replayed / optimum - 1 for optimum in OPTIMA), key=abs)
    return abs(short) < 1e-3, run["efficiency"] / replayed - 1, short


def row(name: str, runs: list[dict]) -> list[object]:
    """A line of the table."""
    verdicts = [judged(run) for run in runs]
    good = [k for k, verdict in enumerate(verdicts) if verdict[0]]
    cpu = np.array([run["cpu"] for run in runs])
    best = sum(abs(runs[k]["efficiency"] / OPTIMA[0] - 1) < 5e-3 for k in good)
    cells: list[object] = [name, len(runs), f"{len(good)} ({best} the best)", float(np.median(cpu))]
    if not good:
        return [*cells, "-", "-", "-"]
    claim, short = (float(np.median([abs(verdicts[k][i]) for k in good])) for i in (1, 2))
    return [*cells, float(cpu.sum() / len(good)), claim, short]


def report(quick: bool, folder: Path) -> str:
    """The table, and how many times faster the best of ours is than the best of the others."""
    rows = []
    for name, (file, command) in OWN.items():
        if not recorded(file):
            starts = 2 if quick else 3 if name == "Nelder-Mead" else 20
            run = [sys.executable, "-m", *command, "--starts", str(starts)]
            output = subprocess.run(run, capture_output=True, text=True, check=True).stdout
            _PLACES[0].mkdir(parents=True, exist_ok=True)
            (_PLACES[0] / file).write_text(output, encoding="utf-8")
        rows.append(row(name, recorded(file)))
    rows += [row(name, runs) for name, file in OTHERS.items() if (runs := recorded(file))]
    header = ["tool", "starts", "optima found", "median s a start", "s an optimum", "claim against replay", "short of optimum"]
    text = markdown_table(header, rows)
    missing = [name for name, file in OTHERS.items() if not recorded(file)]
    if missing:
        text += f"\n\nNot recorded: {', '.join(missing)}."
    measured = [r[4] for r in rows if not str(r[0]).startswith("colloc") and isinstance(r[4], float)]
    ours = [(r[0], r[4]) for r in rows if str(r[0]).startswith("colloc") and isinstance(r[4], float)]
    if measured and ours:
        ratios = ", ".join(f"{min(measured) / seconds:.1f} times as much as {name}" for name, seconds in ours)
        text += f"\n\nProcessor seconds an optimum: the best of the others takes {ratios}. Compiling is included (first start)."
    return text
