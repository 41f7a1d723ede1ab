"""Growth of time and memory with mesh, links and harmonics: python -m benchmarks --only scaling

Each size runs in a process of its own: build the program, then solve one level (delta = 0.01) from a gait near an optimum
for at most 15 iterations, without refinement. Reported are processor seconds to build, wall-clock seconds an iteration of
IPOPT with their share of evaluations, wall-clock seconds outside IPOPT (multipliers of the eliminated equations, residuals of
the full program), and the largest resident memory. Variables are counted before the equations are eliminated.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from benchmarks.tables import markdown_table
from colloc import Chain, Harmonic, Problem
from colloc.gaits.control_problem import control_problem
from colloc.gaits.harmonic import Fourier
from colloc.pictures.style import BLUE, GREEN, ORANGE, save, styled, subplots


def problem_of(intervals: int, links: int, harmonics: int) -> Problem:
    """A bilateral problem of the given size, with a guess whose joints follow each other like a wave."""
    n = links - 1
    amplitude, lag = 2.4 / n, np.pi * (np.arange(n) - 0.5 * (n - 1)) / n
    # a bilateral gait has odd cosines and even sines in the joint number
    cos, sin = np.zeros((2, n, harmonics))
    cos[:, 0], sin[:, 0] = amplitude * np.sin(lag), amplitude * np.cos(lag)
    guess = Fourier(np.zeros(n), cos, sin)
    lengths = (1 / links,) * n + (1 - n / links,)
    return Problem("size", guess, body=Chain(lengths), gait=Harmonic(harmonics, "bilateral"), intervals=intervals, delta=0.01)


def peak_megabytes() -> float:
    """Largest resident memory of this program; `getrusage` would report that of the process it was forked from."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return next(float(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))


def measured(intervals: int, links: int, harmonics: int) -> dict[str, float]:
    """Build and solve one problem (run in a fresh process)."""
    from colloc.collocation.transcription import transcribe
    from colloc.collocation.warm_start import feasible_point
    from colloc.search.ipopt import Solver

    before = peak_megabytes()
    problem = problem_of(intervals, links, harmonics)
    begin = time.process_time()
    solver = Solver(transcribe(control_problem(problem)), {"max_iter": 15})
    built = time.process_time() - begin
    x = feasible_point(solver.transcription, problem.gait.parameters(problem.guess), 0.01)
    begin = time.perf_counter()
    result = solver.solve(x, 0.01)
    solving = time.perf_counter() - begin
    iterations = max(result.iterations, 1)
    return {
        "variables": x.size,
        "build": built,
        "iterations": result.iterations,
        "an iteration": result.seconds / iterations,
        "outside": max(solving - result.seconds, 0.0),
        "evaluations": result.evaluation_seconds / result.seconds,
        "imports MB": before,
        "MB": peak_megabytes(),
    }


def run(*size: int) -> dict[str, float]:
    code = f"import json; from benchmarks.scaling import measured; print(json.dumps(measured{size!r}))"
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    return json.loads(output.splitlines()[-1])


def report(quick: bool, folder: Path) -> str:
    """Three tables with fitted exponents, and a figure."""
    sweeps = {
        "intervals": [(n, 3, 1) for n in ((50, 200) if quick else (50, 100, 200, 400, 1000))],
        "links": [(40, n, 1) for n in ((3, 6) if quick else (3, 4, 6, 8, 10, 12))],
        "harmonics": [(40, 3, n) for n in ((1, 4) if quick else (1, 2, 4, 8, 16))],
    }
    parts, found = [], {}
    keys = ["variables", "build", "iterations", "an iteration", "outside", "evaluations", "MB"]
    for index, (name, sizes) in enumerate(sweeps.items()):
        runs = [run(*size) for size in sizes]
        n = np.array([size[index] for size in sizes], dtype=float)
        found[name] = (n, runs)
        rows = [[int(k), *(r[key] for key in keys)] for k, r in zip(n, runs, strict=True)]
        exponent = {key: np.polyfit(np.log(n), np.log([r[key] for r in runs]), 1)[0] for key in ("build", "an iteration")}
        header = [name, "variables", "build s", "iterations", "s an iteration", "s outside IPOPT", "share of evaluations", "MB"]
        text = f"fitted: build ~ n^{exponent['build']:.2f}, an iteration ~ n^{exponent['an iteration']:.2f}"
        parts.append(f"{markdown_table(header, rows)}\n\n{text}; imports alone {runs[0]['imports MB']:.0f} MB.")
    with styled():
        figure, axes = subplots(1, 3, figsize=(8.6, 3.0))
        for axis, (name, (n, runs)) in zip(axes, found.items(), strict=True):
            axis.loglog(n, [r["build"] for r in runs], "o-", color=ORANGE, label="build [s]")
            axis.loglog(n, [r["an iteration"] for r in runs], "s-", color=BLUE, label="an iteration [s]")
            axis.loglog(n, [r["MB"] / 1000 for r in runs], "^-", color=GREEN, label="memory [GB]")
            axis.set(xlabel=name)
            axis.set_xticks(n, [f"{size:g}" for size in n])
            axis.set_xticks([], minor=True)
        axes[0].legend(fontsize=7)
        save(figure, folder / "scaling")
    return "\n\n".join(parts)
