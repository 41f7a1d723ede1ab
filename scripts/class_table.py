"""Efficiency against class of gaits: python -m scripts.class_table [--friction 1,1,1] [--only WORD] [--seconds 60]

Solves one class after another, each from a few starts: optima of neighbouring classes (prolongation), hand-made ones, and
the best infinitesimal gaits. Resumable: attempts are kept in results/class_table.json and not repeated. Writes
results/curated/gait_classes.md and the figure beside it (--table only writes them, like python -m scripts.class_report).
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from colloc import Chain, Corners, FreePath, Friction, Harmonic, Polygon, Problem, ellipse
from colloc.errors import CollocError
from colloc.gait_fields import fields, gait_from
from colloc.infinitesimal import small_gait
from colloc.optimise import maximise_efficiency
from colloc.path_samples import path_length
from colloc.prolongation import delta_in
from colloc.replaced_file import replaced_file
from colloc.sampling import LATIN_HYPERCUBE, start_gait
from scripts.class_report import STORE, best, load, write

DELTA = 1e-4
"""At unit shape speed, for every class."""


class TooLong(Exception):
    """An attempt that took longer than it may."""


def rows(short: bool) -> dict[str, tuple[object, int, list[str]]]:
    """Classes by name: the class, mesh intervals, and where their searches start (names of rows, or of gaits)."""
    result: dict[str, tuple[object, int, list[str]]] = {}
    curvatures = (2, 8) if short else (1, 2, 4, 8, 16, 32)
    for before, k in zip((0, *curvatures), curvatures, strict=False):
        seeds = [f"curvature {before}"] if before else ["large loop"]
        seeds += ["small triangle"] if k >= 8 else ["middle loop"]
        result[f"curvature {k}"] = (FreePath(k, "bilateral"), 60 if k < 16 else 80, list(dict.fromkeys(seeds)))
    harmonics = (1, 2, 4) if short else range(1, 9)
    for n in harmonics:
        seeds = [f"harmonics {m}" for m in harmonics if m < n][-1:]
        seeds.append("large loop" if n == 1 else "curvature 8")
        seeds += [f"start {k}" for k in range(4)] if n == 2 and not short else []
        result[f"harmonics {n}"] = (Harmonic(n, "bilateral"), 30 + 6 * n, seeds)
    corners = (3, 4) if short else range(3, 9)
    for m in corners:
        nearest = f"curvature {curvatures[-1]}"
        for axis in ("corner",) if m % 2 else ("corner", "side"):
            before = [f"corners {m - 1}{'' if (m - 1) % 2 else ' ' + axis}"] if m > 3 else ["small triangle"]
            name = f"corners {m}{'' if m % 2 else ' ' + axis}"
            result[name] = (Polygon(m, "bilateral", axis), 10 * m, [*before, nearest])
        before = [f"corners {m - 1} free"] if m > 3 else ["best small gait"]
        result[f"corners {m} free"] = (Polygon(m, "none"), 10 * m, [*before, "fold"])
    return result


def named_gait(name: str, friction: Friction) -> object:
    """A start by name."""
    if name == "large loop":
        return ellipse(0, 2.8, 1.3)
    if name == "middle loop":
        return ellipse(0, 1.8, 1.2)
    if name == "small triangle":
        return Corners(np.array([[2.0, 2.9, 2.0], [-2.0, -2.0, -2.9]]))
    if name.startswith("start"):
        seeded = Problem("seeded", ellipse(0, 1, 1), gait=Harmonic(2, "bilateral"))
        return start_gait(seeded, LATIN_HYPERCUBE, 0, int(name.split()[1]))
    body, length = Chain(), 0.7
    if name == "fold":
        shape = np.array([3.0, -0.03])
    else:
        grid = [np.array([a, b]) for a in np.linspace(0.4, 2.8, 4) for b in np.linspace(-2.8, 2.8, 5)]
        shape = max(grid, key=lambda s: small_gait(body, friction, s, directions=36, headings=4).efficiency)
    return Corners(small_gait(body, friction, shape).path(shape, length))


def attempt(gait_class: object, guess: object, friction: Friction, intervals: int, seconds: float) -> dict:
    """One search, as plain numbers: status, and what the certificate says of the gait found."""
    begin = time.process_time()
    delta = delta_in(gait_class, guess, DELTA)

    def watch(level: object) -> None:
        if time.process_time() - begin > seconds:
            raise TooLong

    result: dict = {"status": "too long", "message": ""}
    try:
        stated = Problem(
            "class", guess, friction=friction, gait=gait_class, delta=delta, delta_start=100 * delta, intervals=intervals
        )
        solution = maximise_efficiency(stated, watch)
    except TooLong:
        pass
    except CollocError as error:
        result |= {"status": "error", "message": str(error)}
    else:
        result |= {"status": solution.status, "message": solution.message, "gait": fields(solution.gait)}
        if solution.certificate is not None:
            c = solution.certificate
            result |= {"efficiency": c.efficiency, "error": c.efficiency_error, "distance": c.distance, "work": c.work}
            result |= {"at zero delta": c.efficiency_at_zero_delta, "delta": delta, "length": path_length(solution.gait)}
            gap = next(check.value for check in c.checks if check.name == "replay gap")
            result |= {"replay gap": gap, "intervals": int(solution.mesh.n)}
    return result | {"cpu seconds": time.process_time() - begin}


def keep(friction: str, row: str, seed: str, result: dict) -> dict:
    """Adds an attempt to the store; what other runs have added meanwhile stays."""
    known = load()
    known.setdefault(friction, {}).setdefault(row, {})[seed] = result
    STORE.parent.mkdir(exist_ok=True)
    with replaced_file(STORE) as temporary:
        Path(temporary).write_text(json.dumps(known))
    return known


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--friction", default="1,1,1", help="mu_t,mu_f,mu_b")
    parser.add_argument("--only", default="", help="rows whose name contains this")
    parser.add_argument("--short", action="store_true", help="fewer classes")
    parser.add_argument("--seconds", type=float, default=60, help="processor time an attempt may take")
    parser.add_argument("--table", action="store_true", help="write the table and figure from what there is")
    options = parser.parse_args()
    if not options.table:
        friction = Friction(*(float(mu) for mu in options.friction.split(",")))
        for row, (gait_class, intervals, seeds) in rows(options.short).items():
            for seed in seeds if options.only in row else []:
                known = load().get(options.friction, {})
                if seed in known.get(row, {}):
                    continue
                found = best(known[seed]) if seed in known else None
                if seed in rows(options.short) and found is None:
                    continue
                guess = gait_from(found["gait"]) if found else named_gait(seed, friction)
                result = attempt(gait_class, guess, friction, intervals, options.seconds)
                keep(options.friction, row, seed, result)
                print(
                    f"{options.friction} {row:<18s} from {seed:<18s} {result['status']:<18s} "
                    f"{result.get('efficiency', np.nan):.6f} {result['cpu seconds']:6.1f} s {result['message'][:90]}",
                    flush=True,
                )
    write(load())


if __name__ == "__main__":
    main()
