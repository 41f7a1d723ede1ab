"""Whether the error estimate of a mesh bounds the true error: python -m benchmarks.error_control

Problems with various bodies, frictions, deltas, gaits, schemes and meshes are solved, and each
estimate (`colloc.verification.mesh_error`) is held against two references that are much finer:

- the *replay* of the same gait to 1e-9, which shares neither scheme nor mesh nor panels with
  collocation;
- the *optimum* that a refined solve of higher order finds from there (mesh tolerance 1e-7), by its
  own replay: this contains the error of the search, since a coarse mesh has its optimum elsewhere.

An estimate may be pessimistic, but not below half the true error. Outcomes are kept in
results/error_control.json, so an interrupted run goes on where it stopped. Writes
results/error_control.md.
"""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tables import cached
from colloc import Chain, Fourier, Friction, Harmonic, Problem, certify, ellipse
from colloc.dynamics.control_problem import control_problem
from colloc.results.solution import Solution
from colloc.search.explore import first_optimum
from colloc.search.solve import confirm_optimum
from colloc.verification.mesh_error import mesh_error
from colloc.verification.replay import replay
from scripts.program import command_line

OPTIMISM = 2.0
"""The estimate must be at least the true error divided by this."""
FLOOR = 3e-8
"""Relative accuracy of the references: errors below cannot be told."""


def one_harmonic(cos: list[float], sin: list[float]) -> Fourier:
    """A gait about the straight shape."""
    return Fourier(np.zeros(len(cos)), np.array(cos)[:, None], np.array(sin)[:, None])


FOUR = one_harmonic([1.2, 0.3, -1.2], [0.6, 0.6, 0.6])
SMALL_LOOP = Fourier(
    np.array([1.8, -1.8]),
    np.array([[0.3, -0.1], [-0.3, 0.1]]),
    np.array([[-0.4, -0.1], [-0.4, -0.1]]),
)
FIVE = one_harmonic([-0.6, 0.8, -0.8, 0.6], [-1.0, 1.2, 1.2, -1.0])
WAVE = one_harmonic([0.8, 0.0, -0.8], [0.0, 0.8, 0.0])
BILATERAL, ANTIPODAL = Harmonic(1, "bilateral"), Harmonic(1, "antipodal")
UNEQUAL = Chain((0.25, 0.45, 0.3))

USUAL: dict[str, Any] = {
    "body": Chain(),
    "mu": (1, 1, 1),
    "gait": BILATERAL,
    "guess": ellipse(0, 2.8, 1.2),
    "delta": 1e-4,
    "scheme": "gauss-3",
    "intervals": 24,
    "mesh_tolerance": 0.0,
}
LONG: dict[str, Any] = {"guess": ellipse(0, 1.5, 1.0), "gait": ANTIPODAL, "mu": (3, 1, 1)}
FOUR_LINKS, FIVE_LINKS = Chain((0.25,) * 4), Chain((0.2,) * 5)
TWO: dict[str, Any] = {"gait": Harmonic(2, "bilateral"), "guess": SMALL_LOOP}
CHANGES: dict[str, dict[str, Any]] = {
    "isotropic, coarse": {"intervals": 10},
    "isotropic": {},
    "isotropic, smooth": {"delta": 1e-1},
    "isotropic, 1e-2": {"delta": 1e-2, "scheme": "gauss-2", "intervals": 20},
    "isotropic, 1e-3": {"delta": 1e-3, "scheme": "radau-3", "intervals": 20},
    "isotropic, 1e-6": {"delta": 1e-6},
    "trapezoid": {"delta": 1e-3, "scheme": "trapezoid", "intervals": 80},
    "hermite-simpson": {"scheme": "hermite-simpson", "intervals": 30},
    "gauss-5": {"scheme": "gauss-5", "intervals": 12},
    "gauss-1": {"delta": 1e-3, "scheme": "gauss-1", "intervals": 80},
    "second optimum": {"guess": ellipse(1.1, 0.66, 1.1), "intervals": 16},
    "two harmonics": TWO,
    "three harmonics": {
        "gait": Harmonic(3, "bilateral"),
        "guess": ellipse(0, 2.6, 1.2),
        "scheme": "radau-5",
        "intervals": 20,
    },
    "no symmetry": {
        "gait": Harmonic(1),
        "guess": ellipse(0, 2.8, 1.25),
        "delta": 1e-3,
        "intervals": 30,
    },
    "antipodal": LONG | {"scheme": "gauss-2"},
    "(1.7, 1, 1.3)": {"mu": (1.7, 1, 1.3)},
    "(1.7, 1, 1.3) lobatto": {
        "mu": (1.7, 1, 1.3),
        "delta": 1e-3,
        "scheme": "hermite-simpson",
        "intervals": 20,
    },
    "(10, 1, 1)": {
        "mu": (10, 1, 1),
        "guess": ellipse(0, 1.0, 1.0),
        "scheme": "gauss-4",
        "intervals": 14,
    },
    "(0.5, 1, 5)": {
        "mu": (0.5, 1, 5),
        "guess": ellipse(0.3, 1.0, 0.5),
        "delta": 1e-3,
        "intervals": 20,
    },
    "two links": {
        "body": Chain((0.5, 0.5)),
        "mu": (1, 1, 5),
        "gait": ANTIPODAL,
        "guess": one_harmonic([1.0], [0.0]),
        "scheme": "gauss-2",
        "intervals": 10,
    },
    "unequal links": LONG | {"body": UNEQUAL, "delta": 1e-3, "scheme": "radau-2", "intervals": 30},
    "four links": {"body": FOUR_LINKS, "guess": FOUR, "intervals": 16},
    "four-link wave": {
        "body": FOUR_LINKS,
        "mu": (10, 1, 1),
        "gait": ANTIPODAL,
        "guess": WAVE,
        "intervals": 12,
    },
    "five links": {"body": FIVE_LINKS, "guess": FIVE, "intervals": 20},
    "refined to 1e-4": {"scheme": "gauss-2", "intervals": 20, "mesh_tolerance": 1e-4},
    "refined to 1e-6": {"intervals": 20, "mesh_tolerance": 1e-6},
    "refined, anisotropic": {
        "mu": (1.7, 1, 1.3),
        "scheme": "radau-3",
        "intervals": 20,
        "mesh_tolerance": 1e-5,
    },
    "refined, two harmonics": TWO | {"mesh_tolerance": 1e-5},
}
CASES = {name: USUAL | changes for name, changes in CHANGES.items()}


def case_problem(name: str) -> Problem:
    """The problem of a case."""
    stated = dict(CASES[name])
    friction = Friction(**dict(zip(("mu_t", "mu_f", "mu_b"), stated.pop("mu"), strict=True)))
    return Problem("error", friction=friction, **stated)


def outcome(problem: Problem) -> dict:
    """Estimate and true errors of one case; ``optimal`` is False if there is nothing to judge."""
    begin = time.process_time()
    solution = Solution(problem, confirm_optimum(first_optimum(problem, problem.guess)))
    if not solution.answer.optimal or solution.answer.delta != problem.delta:
        return {"optimal": False, "message": solution.message}
    gait, delta = solution.gait, problem.delta
    error = mesh_error(
        control_problem(problem), solution.mesh, gait, delta, max(problem.mesh_tolerance, 1e-6)
    )
    fine = replay(problem.body, problem.friction, gait, delta, tolerance=1e-9, most_instants=51200)
    seconds = time.process_time() - begin
    finer = problem.with_(
        guess=gait,
        delta_start=delta,
        scheme="gauss-5",
        intervals=max(problem.intervals, 24),
        mesh_tolerance=1e-7,
    )
    reference = Solution(finer, confirm_optimum(first_optimum(finer, finer.guess)))
    certificate = certify(reference.answer, tolerance=1e-8) if reference.answer.optimal else None
    if certificate is not None and certificate.efficiency < (1.0 - FLOOR) * fine.efficiency:
        # below the gait it started from: an optimum of another basin, not the reference of this one
        certificate = None
    return {
        "optimal": True,
        "scheme": solution.mesh.scheme.name,
        "intervals": solution.mesh.n,
        "efficiency": solution.efficiency,
        "estimate": error.estimate,
        "expected": error.total,
        "against replay": solution.efficiency / fine.efficiency - 1,
        "against optimum": None
        if certificate is None
        else solution.efficiency / certificate.efficiency - 1,
        "seconds": seconds,
    }


def held(result: dict, against: str) -> bool:
    """Whether the estimate is not optimistic by more than a factor `OPTIMISM`."""
    return max(abs(result[against]) - FLOOR, 0.0) <= OPTIMISM * result["estimate"]


def row(name: str, result: dict) -> str:
    """One line of the table."""
    case = CASES[name]
    if not result["optimal"]:
        return f"| {name} | not solved: {result['message']} |" + " |" * 9
    cells = [
        name,
        f"({', '.join(f'{mu:g}' for mu in case['mu'])})",
        f"{case['gait'].harmonics} {case['gait'].symmetry}",
        f"{case['delta']:.0e}",
        f"{result['scheme']} x {result['intervals']}",
        f"{result['estimate']:.1e}",
        f"{result['expected']:+.1e}",
    ]
    for against in ("against replay", "against optimum"):
        true = result[against]
        cells += (
            ["not found", ""]
            if true is None
            else [f"{true:+.1e}", f"{result['estimate'] / max(abs(true), FLOOR):.1f}"]
        )
    return "| " + " | ".join(cells) + " |"


HEADER = """# Estimated and true efficiency errors

Written by `python -m benchmarks.error_control`. All errors are relative. *Estimate*: what `verification.mesh_error` reports,
the magnitudes of all intervals added up. *Expected*: their signed sum, without linearisation. *Replay*: true error of the
collocated efficiency against a replay of the same gait. *Optimum*: against the optimum of a refined solve of higher order.
*Ratio*: estimate over magnitude of the true error (errors below 3e-8 count as 3e-8); at least 0.5 is required.

| case | friction | harmonics | delta | mesh | estimate | expected | replay | ratio | optimum | ratio |
|---|---|---|---|---|---|---|---|---|---|---|"""


def main() -> None:
    options = command_line(__doc__, output=Path("results"))
    options.output.mkdir(parents=True, exist_ok=True)
    cache, lines, results = options.output / "error_control.sqlite", [HEADER], []
    for name in CASES:
        problem = case_problem(name)
        results.append(cached(cache, problem.hash, partial(outcome, problem)))
        lines.append(row(name, results[-1]))
        print(lines[-1], flush=True)
    judged = [
        (r, a)
        for r in results
        if r["optimal"]
        for a in ("against replay", "against optimum")
        if r[a] is not None
    ]
    failed = sum(not held(*pair) for pair in judged)
    lines += [
        "",
        f"{len(judged)} comparisons over {len(CASES)} cases; optimistic by more than a factor 2: "
        f"{failed}.",
    ]
    (options.output / "error_control.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
