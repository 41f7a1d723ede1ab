"""Is a certificate ever false? Random problems are solved from one guess, and what is certified is
played by another program.

    python -m benchmarks.audit --problems 1000 [--seconds 600] [--again]

Three links, of equal or other lengths, with one harmonic and a symmetry or none; mu_t from 0.1 to
30, mu_b up to five times mu_f; joints within pi, 2.5 or 2. Nothing of colloc is used in the
judgement (`benchmarks.independent_replay`, and a few lines here):

- efficiency, distance and work lie within the stated errors,
- the claimed efficiency is that of the motion, up to what a certificate lets pass (1e-4, and other
  balanced motions),
- the body does not turn, joints stay within their limit and links apart, no gait exceeds 1/min(mu).

What the record has is not done again. With --again the gaits of the record are measured anew as a
certificate measures them, and their numbers and errors held against what the other program found
then.
"""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.independent_replay import Crawler, Gait, Played, played_together
from colloc import Chain, Friction, Harmonic, Problem, solve
from colloc.gaits.starts import LATIN_HYPERCUBE, start_gait
from colloc.results.measured import measured
from colloc.results.solution import SOLVED
from scripts.program import add_to_record, command_line, read_record

SEED = 1000
BATCH = 25
STATED = ("efficiency", "distance", "work")
ACCURACY = 1e-7
GAP, TURN, EXCESS = 1e-4, 1e-4, 1e-6
"""What a certificate lets pass: of the efficiency, of rotation times length over distance, of
angles [rad]."""
_PHASES = np.linspace(0, 1, 2001)


def random_problem(number: int) -> tuple[Problem, tuple[float, ...], tuple[float, float, float]]:
    """Problem `number`, which depends on that number alone; its lengths of links and
    coefficients."""
    rng = np.random.default_rng([SEED, number])
    symmetry = str(rng.choice(["bilateral", "antipodal", "none"]))
    lengths = np.ones(3) if rng.random() < 0.3 else rng.uniform(0.5, 1.5, 3)
    if symmetry == "bilateral":
        lengths = lengths + lengths[::-1]
    lengths = lengths / lengths.sum()
    links = (*map(float, lengths[:-1]), 1.0 - float(lengths[:-1].sum()))
    mu_t = 1.0 if rng.random() < 0.3 else float(np.exp(rng.uniform(np.log(0.1), np.log(30))))
    mu_b = 1.0 if rng.random() < 0.6 else float(rng.uniform(1, 5))
    limit = float(rng.choice([np.pi, 2.5, 2.0]))
    law, kind = Friction(mu_t=mu_t, mu_f=1.0, mu_b=mu_b), Harmonic(1, symmetry)
    problem = Problem(
        f"audit-{number}", body=Chain(links), friction=law, gait=kind, joint_limit=limit
    )
    return (
        problem.with_(guess=start_gait(problem, LATIN_HYPERCUBE, SEED, number)),
        links,
        (mu_t, 1.0, mu_b),
    )


def solved(number: int) -> dict[str, Any]:
    """What a search from the problem's guess says; with the gait and its certificate if there is
    one."""
    begin = time.process_time()
    problem, _, _ = random_problem(number)
    solution = solve(problem, 1)
    row: dict[str, Any] = {
        "number": number,
        "status": solution.status,
        "seconds": time.process_time() - begin,
    }
    if solution.status != SOLVED:
        return row | {
            "fails": [check.name for check in solution.certificate.failures] or solution.message
        }
    gait, certificate = solution.gait, solution.certificate
    ambiguity = next(check.value for check in certificate.checks if check.name == "one motion")
    return row | {
        "delta": solution.delta_per_period,
        "gait": [np.asarray(part).tolist() for part in (gait.mean, gait.cos, gait.sin)],
        "claimed": solution.efficiency,
        "ambiguity": ambiguity,
        "efficiency": [certificate.efficiency, certificate.efficiency_error],
        "distance": [certificate.distance, certificate.errors["distance"]],
        "work": [certificate.work, certificate.errors["work"]],
    }


def path_of(gait: list) -> Any:
    """Joint angles and rates of a harmonic gait by its coefficients."""
    mean, cos, sin = (np.array(part) for part in gait)

    def path(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        phase = 2 * np.pi * t
        c, s = np.cos(phase), np.sin(phase)
        return mean[:, None] + cos * c + sin * s, 2 * np.pi * (sin * c - cos * s)

    return path


def crossing(lengths: tuple[float, ...], angles: np.ndarray) -> np.ndarray:
    """Whether the first of three links cuts the last one, ``(n,)``."""
    along = [np.ones(angles.shape[1], dtype=complex)]
    for angle in angles:
        along.append(along[-1] * np.exp(1j * angle))
    a, b = lengths[0] * along[0], lengths[2] * along[2]
    # tail link from -a to 0, head link from `between` to between + b
    between = lengths[1] * along[1]

    def side(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return (p.conj() * q).imag

    # ends of the head link on both sides of the tail link
    first = side(a, between) * side(a, between + b) < 0
    return first & (side(b, -between) * side(b, -between - a) < 0)


def outside(row: dict[str, Any]) -> dict[str, float]:
    """Which stated errors are too small, with by how many times."""
    off = {
        f"error of {name}": abs(row[name][0] - row["played"][name]) / row[name][1]
        for name in STATED
    }
    return {name: size for name, size in off.items() if size > 1}


def measured_again(row: dict[str, Any]) -> dict[str, Any]:
    """A row of the record with the numbers that its gait is certified with now."""
    problem, _, _ = random_problem(row["number"])
    known = measured(problem.body, problem.friction, path_of(row["gait"]), row["delta"])
    fine = known.fine
    row = row | {
        "efficiency": [fine.efficiency, known.efficiency.error],
        "distance": [fine.distance, known.errors["distance"]],
        "work": [fine.work, known.errors["work"]],
    }
    others = {name: size for name, size in row["wrong"].items() if not name.startswith("error of")}
    return row | {"wrong": outside(row) | others}


def wrong(row: dict[str, Any], played: Played) -> dict[str, float]:
    """What a certificate says and is not so, with by how much."""
    problem, links, coefficients = random_problem(row["number"])
    row["played"] = {name: getattr(played, name) for name in STATED}
    gap = abs(row["claimed"] / played.efficiency - 1) - row["ambiguity"]
    angles = path_of(row["gait"])(_PHASES)[0]
    statements = {
        "efficiency": (gap, GAP),
        "rotation": (abs(played.rotation) / played.distance, TURN),
        "joint limit": (np.abs(angles).max() - problem.joint_limit, EXCESS),
        "self-contact": (float(crossing(links, angles * (1 - 1e-5)).any()), 0.5),
        "1/min(mu)": (played.efficiency * min(coefficients), 1 + EXCESS),
    }
    return outside(row) | {
        name: float(value) for name, (value, allowed) in statements.items() if not value <= allowed
    }


def judged(rows: list[dict[str, Any]]) -> None:
    """Adds to the certified rows what the other program finds, and what is wrong."""
    gaits = []
    for row in rows:
        _, links, coefficients = random_problem(row["number"])
        gaits.append(Gait(Crawler(links, coefficients), path_of(row["gait"]), row["delta"]))
    for row, played in zip(rows, played_together(gaits, ACCURACY), strict=True):
        row["wrong"] = None if played is None else wrong(row, played)


def summary(rows: list[dict[str, Any]]) -> str:
    """Counts, and every statement that is not so."""
    certified = [row for row in rows if row["status"] == SOLVED]
    compared = [row for row in certified if row["wrong"] is not None]
    lines = [
        f"{len(rows)} problems: {dict(Counter(row['status'] for row in rows))}",
        f"{len(compared)} certificates compared; the other program found no balance for "
        f"{len(certified) - len(compared)}",
        f"statements that are not so: "
        f"{dict(Counter(name for row in compared for name in row['wrong']))}",
    ]
    for name in STATED:
        stated = np.array([row[name][1] for row in compared])
        true = np.array([abs(row[name][0] - row["played"][name]) for row in compared])
        size = np.array([row["played"][name] for row in compared])
        ratio = f"stated / true error, median {np.median(stated / np.maximum(true, 1e-300)):.1f}"
        lines.append(
            f"{name}: within its error {np.mean(true <= stated):.2%}; {ratio}; largest relative "
            f"{max(true / size):.1e}"
        )
    lines += [f"  {row['number']}: {row['wrong']}" for row in compared if row["wrong"]]
    return "\n".join(lines)


def main() -> None:
    options = command_line(
        __doc__,
        problems=1000,
        first=0,
        record=Path("results/audit.jsonl"),
        seconds=1e9,
        again=False,
    )
    rows = {row["number"]: row for row in read_record(options.record)}
    if options.again:
        rows = {
            number: measured_again(row) if row.get("wrong") is not None else row
            for number, row in rows.items()
        }
        add_to_record(options.record, rows.values(), anew=True)
        options.problems = 0
    todo = [number for number in range(options.first, options.problems) if number not in rows]
    while todo and time.process_time() < options.seconds:
        now, todo = [solved(number) for number in todo[:BATCH]], todo[BATCH:]
        judged([row for row in now if row["status"] == SOLVED])
        add_to_record(options.record, now)
        rows |= {row["number"]: row for row in now}
        print(f"{len(rows)} problems, {time.process_time():.0f} s", flush=True)
    print(summary(list(rows.values())))


if __name__ == "__main__":
    main()
