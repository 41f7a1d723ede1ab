"""Is a certificate ever false, and do stated errors hold? Random problems are solved from one guess
and random gaits are measured; another program replays them.

    python -m benchmarks.audit --problems 1000 [--gaits 300] [--seconds 600]

*Problems*: three links, of equal or other lengths, with one harmonic and a symmetry or none; mu_t
from 0.1 to 30, mu_b up to five times mu_f; joints within pi, 2.5 or 2. Nothing of colloc is used in
the judgement (`benchmarks.independent_replay`, and a few lines here):

- efficiency, distance and work lie within the stated errors,
- the claimed efficiency is that of the motion, up to what a certificate lets pass (1e-4, and other
  balanced motions),
- the body does not turn, joints stay within their limit and links apart, no gait exceeds 1/min(mu).

*Gaits*: bodies of 3 to 6 links, laws of friction and gaits of 1 to 4 harmonics with the symmetries
that close their rotation. For efficiency, distance, work, and the efficiency for delta -> 0: how
often the stated error covers the true one.

What results/audit.jsonl and results/error_bars.jsonl hold already is not done again.
"""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.independent_replay import Crawler, Gait, Played, played, played_together
from benchmarks.tables import markdown_table
from colloc import Chain, Friction, Harmonic, Problem, solve
from colloc.gaits.harmonic import harmonics_within
from colloc.gaits.starts import LATIN_HYPERCUBE, start_gait
from colloc.results.checks import measure
from colloc.results.solution import SOLVED
from colloc.verification.adaptive_motion import Path as GaitPath
from scripts.program import add_to_record, command_line, read_record

SEED, GAIT_SEED = 1000, 24
DELTA, LIMIT = 1e-4, 1e-3  # of random gaits; the part of it that is as good as dry
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
    for row, seen in zip(rows, played_together(gaits, ACCURACY), strict=True):
        row["wrong"] = None if seen is None else wrong(row, seen)


def random_gait(number: int) -> tuple[Chain, Friction, GaitPath]:
    """Body, law and gait `number`; it depends on that number alone."""
    rng = np.random.default_rng([GAIT_SEED, number])
    links = int(rng.integers(3, 7))
    lengths = rng.uniform(0.5, 1.5, links)
    symmetry = str(rng.choice(["bilateral", "antipodal"]))
    if symmetry == "bilateral" or rng.random() < 0.3:
        lengths = lengths + lengths[::-1]
    lengths = lengths / lengths.sum()
    body = Chain((*lengths[:-1], 1.0 - lengths[:-1].sum()))
    mu_t, mu_b = 1.0, 1.0
    if rng.random() >= 0.3:
        mu_t = float(np.exp(rng.uniform(np.log(0.1), np.log(30))))
        mu_b = float(rng.choice([1, 3]))
    kind = harmonics_within(int(rng.integers(1, 5)), symmetry)
    size = kind.size(body.n_joint)
    gait = kind.member(rng.normal(0, rng.uniform(0.2, 1.0), size) / np.sqrt(size / 3), body.n_joint)
    return body, Friction(mu_t=mu_t, mu_f=1.0, mu_b=mu_b), gait


def stated(body: Chain, friction: Friction, path: GaitPath) -> dict[str, tuple[float, float]]:
    """Value and error of each quantity, as a certificate states them."""
    fine, known = measure(body, friction, path, DELTA)
    return {
        "efficiency": (fine.efficiency, known.efficiency_error),
        "distance": (fine.distance, known.errors["distance"]),
        "work": (fine.work, known.errors["work"]),
        "limit": (known.value_at_zero_delta, known.value_error_at_zero_delta),
    }


def compared(number: int) -> dict[str, list[float]]:
    """Stated value, stated error and the other program's value of each quantity of a random
    gait."""
    body, friction, path = random_gait(number)
    crawler = Crawler(body.lengths, (friction.mu_t, friction.mu_f, friction.mu_b))
    here, limit = (played(crawler, path, part * DELTA, ACCURACY) for part in (1.0, LIMIT))
    true = {name: getattr(here, name) for name in STATED} | {"limit": limit.efficiency}
    return {name: [*row, true[name]] for name, row in stated(body, friction, path).items()}


def coverage(rows: list[dict[str, list[float]]]) -> str:
    """A table of how often errors cover the true ones, and of stated over true errors."""
    table = []
    for name in rows[0]:
        value, error, true = np.array([row[name] for row in rows]).T
        off = np.abs(value - true)
        ratio = np.median(error / np.maximum(off, 1e-300))
        table.append([name, len(rows), int((off <= error).sum()), ratio, np.max(off / error)])
    head = "quantity", "cases", "covered", "stated / true, median", "worst true / stated"
    return markdown_table(head, table)


def summary(rows: list[dict[str, Any]]) -> str:
    """Counts, and every statement that is not so."""
    certified = [row for row in rows if row["status"] == SOLVED]
    compared = [row for row in certified if row["wrong"] is not None]
    false = Counter(name for row in compared for name in row["wrong"])
    stated = [{name: [*row[name], row["played"][name]] for name in STATED} for row in compared]
    return "\n".join(
        [
            f"{len(rows)} problems: {dict(Counter(row['status'] for row in rows))}",
            f"{len(compared)} certificates compared; the other program found no balance for "
            f"{len(certified) - len(compared)}",
            f"statements that are not so: {dict(false)}",
            *(f"  {row['number']}: {row['wrong']}" for row in compared if row["wrong"]),
            coverage(stated) if stated else "",
        ]
    )


def main() -> None:
    options = command_line(__doc__, problems=0, gaits=0, seconds=1e9, results=Path("results"))
    record, bars = options.results / "audit.jsonl", options.results / "error_bars.jsonl"
    rows = {row["number"]: row for row in read_record(record)}
    todo = [number for number in range(options.problems) if number not in rows]
    while todo and time.process_time() < options.seconds:
        now, todo = [solved(number) for number in todo[:BATCH]], todo[BATCH:]
        judged([row for row in now if row["status"] == SOLVED])
        add_to_record(record, now)
        rows |= {row["number"]: row for row in now}
        print(f"{len(rows)} problems, {time.process_time():.0f} s", flush=True)
    if rows:
        print(summary(list(rows.values())))
    done = {entry["name"]: entry["row"] for entry in read_record(bars)}
    for number in range(options.gaits):
        name = f"random-{number}"
        if name in done or time.process_time() > options.seconds:
            continue
        try:
            done[name] = compared(number)
        except ArithmeticError:  # the other program found no balance, and says so
            done[name] = None
        add_to_record(bars, [{"name": name, "row": done[name]}])
    if known := [row for row in done.values() if row is not None]:
        print(f"{len(known)} of {len(done)} random gaits compared\n\n{coverage(known)}")


if __name__ == "__main__":
    main()
