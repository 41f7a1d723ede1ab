"""Chains of 2 to 8 links: best efficiencies found, and time and memory against the number of links.

    python -m benchmarks.chains --starts 6

Every solve is certified (first-order conditions, independent replay, self-contact of all pairs between nodes) and kept in
results/chains.json, so an interrupted run goes on where it stopped. Writes results/chains.md.

Efficiencies: four and five equal links, bilateral gaits with 1 to 3 harmonics (or --harmonics), delta = 1e-4; the best of
some seeded Latin-hypercube starts and, from two harmonics on, of the best gait with one harmonic less.
Size: n equal links in a travelling wave, angle_j = 0.8 cos(2 pi (t - j/n)) as a guess, antipodal, mu_t = 10
and mu_f = 1 (mu_b = 5 for two links, which could not move otherwise); each solved in a process of its own.
"""

from __future__ import annotations

import argparse
import itertools
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from colloc import Chain, Fourier, Friction, Harmonic, Problem
from colloc.collocation.transcription import transcribe
from colloc.gaits.sampling import latin_hypercube_gait
from colloc.results.solution import Solution
from colloc.search.optimise import maximise_efficiency
from colloc.system.row_file import cached

LAWS = ((1, 1, 1), (3, 1, 1))
LINKS = (4, 5)
SIZES = (2, 3, 4, 5, 6, 7, 8)


def case_problem(links: int, law: tuple[float, float, float], harmonics: int) -> Problem:
    """A cell of the table; its guess only defines the class, starts are drawn."""
    joint = np.arange(links - 1) - 0.5 * (links - 2)
    guess = Fourier(np.zeros(links - 1), -0.3 * joint[:, None], np.full((links - 1, 1), 0.4))
    return Problem(
        name=f"chain-{links}-{'-'.join(f'{mu:g}' for mu in law)}-{harmonics}",
        body=Chain((1 / links,) * links),
        friction=Friction(*law),
        gait=Harmonic(harmonics, "bilateral"),
        guess=guess,
        intervals=24,
    )


def wave_problem(links: int) -> Problem:
    """A travelling wave on n equal links."""
    phase = 2 * np.pi * np.arange(links - 1) / links
    return Problem(
        name=f"wave-{links}",
        body=Chain((1 / links,) * links),
        friction=Friction(10, 1, 5 if links == 2 else 1),
        gait=Harmonic(1, "antipodal"),
        guess=Fourier(np.zeros(links - 1), 0.8 * np.cos(phase)[:, None], 0.8 * np.sin(phase)[:, None]),
        intervals=24,
    )


def outcome(problem: Problem) -> dict:
    """What the tables need of one solve."""
    begin = time.process_time()
    solution = maximise_efficiency(problem)
    return {
        "status": solution.status,
        "message": solution.message,
        "efficiency": solution.measured.efficiency,
        "distance": solution.measured.distance,
        "work": solution.measured.work,
        "cpu_seconds": time.process_time() - begin,
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "iterations": sum(level.iterations for level in solution.levels),
        "points": solution.mesh.n_point,
        "variables": int(solution.layout.n),
        "apart": pairs_apart(solution),
        "gait": {key: getattr(solution.gait, key).tolist() for key in ("mean", "cos", "sin")},
    }


def pairs_apart(solution: Solution) -> int:
    """How many pairs of links more than two apart had to be constrained: what the last level has more rows than without."""
    plain = transcribe(solution.problem.with_(scheme=solution.mesh.scheme.name), solution.last.edges)
    return (solution.last.lam_g.size - plain.assembly.m) // solution.mesh.n


def kept(cache: Path, label: str, problem: Problem, solve: Callable[[Problem], dict]) -> dict:
    """The outcome of a problem from the cache, or solved and put there."""
    return cached(cache, f"{label} {problem.hash}", lambda: solve(problem))


def best_of(outcomes: list[dict]) -> dict | None:
    """The certified outcome of largest efficiency."""
    solved = [o for o in outcomes if o["status"] == "solved"]
    return max(solved, key=lambda o: o["efficiency"]) if solved else None


def case_rows(cache: Path, starts: int, most_harmonics: int) -> Iterator[tuple[tuple, str]]:
    """Rows of the table of efficiencies with their sorting keys; few harmonics first."""
    before: dict[tuple, dict] = {}
    for harmonics, law, links in itertools.product(range(1, most_harmonics + 1), LAWS, LINKS):
        problem = case_problem(links, law, harmonics)
        guesses = [(f"start {k}", latin_hypercube_gait(problem, 0, k)) for k in range(starts)]
        if (law, links) in before:
            guesses.append(("one harmonic less", Fourier(**before[law, links]["gait"])))
        outcomes = [kept(cache, f"{problem.name} {label}", problem.with_(guess=guess), outcome) for label, guess in guesses]
        best = best_of(outcomes)
        if best is not None:
            before[law, links] = best
        certified = sum(o["status"] == "solved" for o in outcomes)
        values = (best["efficiency"], best["distance"], best["work"]) if best else (np.nan,) * 3
        found = sum(o["status"] == "solved" and abs(o["efficiency"] / values[0] - 1) < 1e-4 for o in outcomes)
        apart, seconds = max(o["apart"] for o in outcomes), np.median([o["cpu_seconds"] for o in outcomes])
        row = (
            f"| {links} | ({', '.join(f'{mu:g}' for mu in law)}) | {harmonics} | {values[0]:.5f} | {values[1]:.4f} "
            f"| {values[2]:.4f} | {len(outcomes)} | {certified} | {found} | {apart} | {seconds:.1f} |"
        )
        print(row, flush=True)
        yield (law, links, harmonics), row


def run_sizes(cache: Path) -> list[str]:
    """Rows of the table of time and memory."""
    rows = []
    for links in SIZES:
        o = kept(cache, f"wave {links}", wave_problem(links), in_own_process)
        rows.append(
            f"| {links} | {(links - 1) * (links - 2) // 2} | {o['status']} | {o['efficiency']:.5f} | {o['distance']:.4f} "
            f"| {o['points']} | {o['variables']} | {o['iterations']} | {o['cpu_seconds']:.1f} | {o['megabytes']:.0f} |"
        )
        print(rows[-1], flush=True)
    return rows


def in_own_process(problem: Problem) -> dict:
    """The outcome of a travelling wave, with memory measured in a fresh process."""
    command = [sys.executable, "-m", "benchmarks.chains", "--wave", str(problem.body.n_link)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description="Chains of 2 to 8 links; see the top of this file.")
    parser.add_argument("--starts", type=int, default=6)
    parser.add_argument("--harmonics", type=int, default=3, help="1 to this many (default: 3)")
    parser.add_argument("--output", type=Path, default=Path("results"))
    parser.add_argument("--wave", type=int, metavar="LINKS", help="solve one travelling wave and print JSON")
    options = parser.parse_args()
    if options.wave:
        print(json.dumps(outcome(wave_problem(options.wave))))
        return
    options.output.mkdir(parents=True, exist_ok=True)
    cache = options.output / "chains.sqlite"
    sizes = run_sizes(cache)
    rows: dict[tuple, str] = {}
    for key, row in case_rows(cache, options.starts, options.harmonics):
        rows[key] = row
        (options.output / "chains.md").write_text(document(options.starts, [rows[k] for k in sorted(rows)], sizes))


def document(starts: int, cases: list[str], sizes: list[str]) -> str:
    """Both tables; rows appear as they are finished."""
    return "\n".join(
        [
            "# Chains of links",
            "",
            f"Written by `python -m benchmarks.chains --starts {starts}`; the command goes on with rows that are missing.",
            "Equal links, delta = 1e-4, mesh tolerance 3e-5. Every efficiency is that of an independent replay, of a solution",
            "whose certificate holds: self-contact of all pairs of links is checked between nodes. Seconds: processor time of",
            "one solve, certificate included, on a core that other work shared.",
            "",
            "## Best efficiencies found, bilateral gaits",
            "",
            "These are the best of few starts, so lower bounds on the best gait of their class. Apart: the most pairs of",
            "links more than two apart that a start had to constrain.",
            "",
            "| links | (mu_t, mu_f, mu_b) | harmonics | d/W | d | W | starts | certified | found best | apart | median s |",
            "|---|---|---|---|---|---|---|---|---|---|---|",
            *cases,
            "",
            "## Time and memory against the number of links",
            "",
            "Antipodal travelling wave, one harmonic, friction (10, 1, 1); (10, 1, 5) for two links. Pairs: those that",
            "are not neighbours. Memory: peak of the process, libraries included.",
            "",
            "| links | pairs | status | d/W | d | points | variables | iterations | CPU s | MB |",
            "|---|---|---|---|---|---|---|---|---|---|",
            *sizes,
            "",
        ]
    )


if __name__ == "__main__":
    main()
