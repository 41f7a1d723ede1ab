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

# name, body, friction, gait class, guess, delta, scheme, intervals, mesh tolerance
# fmt: off
CASES = (
    ("isotropic, coarse", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-4, "gauss-3", 10,
    0.0),
    ("isotropic", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-4, "gauss-3", 24, 0.0),
    ("isotropic, smooth", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-1, "gauss-3", 24,
    0.0),
    ("isotropic, 1e-2", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-2, "gauss-2", 20,
    0.0),
    ("isotropic, 1e-3", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-3, "radau-3", 20,
    0.0),
    ("isotropic, 1e-6", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-6, "gauss-3", 24,
    0.0),
    ("trapezoid", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-3, "trapezoid", 80, 0.0),
    ("hermite-simpson", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-4,
    "hermite-simpson", 30, 0.0),
    ("gauss-5", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-4, "gauss-5", 12, 0.0),
    ("gauss-1", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-3, "gauss-1", 80, 0.0),
    ("second optimum", Chain(), (1, 1, 1), BILATERAL, ellipse(1.1, 0.66, 1.1), 1e-4, "gauss-3", 16,
    0.0),
    ("two harmonics", Chain(), (1, 1, 1), Harmonic(2, "bilateral"), SMALL_LOOP, 1e-4, "gauss-3",
    24, 0.0),
    ("three harmonics", Chain(), (1, 1, 1), Harmonic(3, "bilateral"), ellipse(0, 2.6, 1.2), 1e-4,
    "radau-5", 20, 0.0),
    ("no symmetry", Chain(), (1, 1, 1), Harmonic(1), ellipse(0, 2.8, 1.25), 1e-3, "gauss-3", 30,
    0.0),
    ("antipodal", Chain(), (3, 1, 1), ANTIPODAL, ellipse(0, 1.5, 1.0), 1e-4, "gauss-2", 24, 0.0),
    ("(1.7, 1, 1.3)", Chain(), (1.7, 1, 1.3), BILATERAL, ellipse(0, 2.8, 1.2), 1e-4, "gauss-3", 24,
    0.0),
    ("(1.7, 1, 1.3) lobatto", Chain(), (1.7, 1, 1.3), BILATERAL, ellipse(0, 2.8, 1.2), 1e-3,
    "hermite-simpson", 20, 0.0),
    ("(10, 1, 1)", Chain(), (10, 1, 1), BILATERAL, ellipse(0, 1.0, 1.0), 1e-4, "gauss-4", 14, 0.0),
    ("(0.5, 1, 5)", Chain(), (0.5, 1, 5), BILATERAL, ellipse(0.3, 1.0, 0.5), 1e-3, "gauss-3", 20,
    0.0),
    ("two links", Chain((0.5, 0.5)), (1, 1, 5), ANTIPODAL, one_harmonic([1.0], [0.0]), 1e-4,
    "gauss-2", 10, 0.0),
    ("unequal links", UNEQUAL, (3, 1, 1), ANTIPODAL, ellipse(0, 1.5, 1.0), 1e-3, "radau-2", 30,
    0.0),
    ("four links", Chain((0.25,) * 4), (1, 1, 1), BILATERAL, FOUR, 1e-4, "gauss-3", 16, 0.0),
    ("four-link wave", Chain((0.25,) * 4), (10, 1, 1), ANTIPODAL, WAVE, 1e-4, "gauss-3", 12, 0.0),
    ("five links", Chain((0.2,) * 5), (1, 1, 1), BILATERAL, FIVE, 1e-4, "gauss-3", 20, 0.0),
    ("refined to 1e-4", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-4, "gauss-2", 20,
    1e-4),
    ("refined to 1e-6", Chain(), (1, 1, 1), BILATERAL, ellipse(0, 2.8, 1.2), 1e-4, "gauss-3", 20,
    1e-6),
    ("refined, anisotropic", Chain(), (1.7, 1, 1.3), BILATERAL, ellipse(0, 2.8, 1.2), 1e-4,
    "radau-3", 20, 1e-5),
    ("refined, two harmonics", Chain(), (1, 1, 1), Harmonic(2, "bilateral"), SMALL_LOOP, 1e-4,
    "gauss-3", 24, 1e-5),
)  # fmt: skip


def case_problem(index: int) -> Problem:
    """The problem of a case."""
    _, body, friction, gait, guess, delta, scheme, intervals, tolerance = CASES[index]
    return Problem(
        f"error-{index}",
        guess,
        body,
        Friction(mu_t=friction[0], mu_f=friction[1], mu_b=friction[2]),
        gait,
        delta,
        intervals=intervals,
        scheme=scheme,
        mesh_tolerance=tolerance,
    )


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


def row(index: int, result: dict) -> str:
    """One line of the table."""
    name, _, friction, gait, _, delta, *_ = CASES[index]
    if not result["optimal"]:
        return f"| {name} | not solved: {result['message']} |" + " |" * 9
    optimum = result["against optimum"]
    ratio = result["estimate"] / max(abs(result["against replay"]), FLOOR)
    last = (
        "not found |"
        if optimum is None
        else f"{optimum:+.1e} | {result['estimate'] / max(abs(optimum), FLOOR):.1f}"
    )
    return (
        f"| {name} | ({', '.join(f'{mu:g}' for mu in friction)}) | {gait.harmonics} "
        f"{gait.symmetry} | {delta:.0e} "
        f"| {result['scheme']} x {result['intervals']} | {result['estimate']:.1e} | "
        f"{result['expected']:+.1e} "
        f"| {result['against replay']:+.1e} | {ratio:.1f} | {last} |"
    )


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
    for index in range(len(CASES)):
        problem = case_problem(index)
        results.append(cached(cache, problem.hash, partial(outcome, problem)))
        lines.append(row(index, results[-1]))
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
