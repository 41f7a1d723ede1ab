"""Efficiency against class of gaits: python -m scripts.class_table [--links 3] [--friction 1,1,1] [--only WORD] [--seconds 60]

Solves one class after another, each from a few starts: optima of neighbouring classes and of fewer links (prolongation),
random gaits, hand-made ones, and the best infinitesimal gaits; `scripts.class_rows` lists them. Resumable: attempts are kept
in results/class_table.json (class_table_4.json for four links) and not repeated. Writes results/curated/gait_classes.md
(gait_classes_4.md) and the figure beside it (--table only writes them, like python -m scripts.class_report).
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from colloc import Friction, Problem
from colloc.gaits.gait_fields import AnyGait, fields, gait_from
from colloc.gaits.path_samples import path_length
from colloc.gaits.starts import delta_in, laid_into, over_links, prolonged
from colloc.results.solution import Solution
from colloc.search.solve import solve
from colloc.system.errors import CollocError
from colloc.system.replaced_file import replaced_file
from scripts.class_report import DELTA, best, load, store, write
from scripts.class_rows import FEWER, Row, equal_links, named_gait, rows

SMALLER = 0.1
"""Factor in delta where it changes the efficiency by more than a certificate allows."""
FAR = 100.0
"""A search from a gait that is no optimum begins at so many times the final delta."""


class TooLong(Exception):
    """An attempt that took longer than it may."""


def attempt(row: Row, links: int, friction: Friction, guess: AnyGait, known: float | None, seconds: float) -> dict:
    """One search, as plain numbers: status, and what the certificate says of the gait found.

    `known` is the efficiency of the guess if that is an optimum of a class with as many links. Where delta is found to matter
    too much, as it does to gaits that are as small as they may be, the search goes on at the delta that belongs to the
    length of the path found, then at `SMALLER` times that.
    """
    begin = time.process_time()

    def watch(level: object) -> None:
        if time.process_time() - begin > seconds:
            raise TooLong

    result: dict = {"status": "too long", "message": ""}
    try:
        delta = delta_in(row.gait_class, guess, DELTA)
        body = equal_links(links)
        start = laid_into(row.gait_class, guess, body)
        stated = Problem("class", start, body, friction, row.gait_class, delta, FAR * delta, intervals=row.intervals)
        if known is None:
            solution = solve(stated, 1, progress=watch)
        else:
            solution = solve(prolonged(stated, guess, row.gait_class), 1, progress=watch)
        for unit in (DELTA, SMALLER * DELTA):
            less, at = delta_in(row.gait_class, solution.gait, unit), solution.problem.delta
            if less < 0.5 * at and delta_matters(solution):
                solution = solve(stated.with_(guess=solution.gait, delta=less, delta_start=at), 1, progress=watch)
    except TooLong:
        pass
    except CollocError as error:
        result |= {"status": "error", "message": str(error)}
    else:
        result |= {"status": solution.status, "message": solution.message, "gait": fields(solution.gait)}
        if solution.certificate.replayed:
            c = solution.certificate
            result |= {"efficiency": c.efficiency, "error": c.efficiency_error, "distance": c.distance, "work": c.work}
            result |= {"at zero delta": c.efficiency_at_zero_delta, "delta": solution.problem.delta}
            gap = next(check.value for check in c.checks if check.name == "replay gap")
            result |= {"replay gap": gap, "intervals": int(solution.mesh.n), "length": path_length(solution.gait)}
    return result | {"cpu seconds": time.process_time() - begin, "seed": known}


def delta_matters(solution: Solution) -> bool:
    """Whether the certificate says that delta changes the efficiency by too much."""
    return any(c.name.startswith("delta") for c in solution.certificate.failures)


def keep(links: int, friction: str, row: str, seed: str, result: dict) -> None:
    """Adds an attempt to the store; what other runs have added meanwhile stays."""
    known = load(links)
    known.setdefault(friction, {}).setdefault(row, {})[seed] = result
    store(links).parent.mkdir(exist_ok=True)
    with replaced_file(store(links)) as temporary:
        Path(temporary).write_text(json.dumps(known))


def attempts_left(
    listed: dict[str, Row], links: int, friction: str, only: str
) -> Iterator[tuple[str, str, AnyGait, float | None]]:
    """Rows and starts not tried yet whose start is known by now (rows that come later may make more of them known).

    Starts from other rows are tried again when these have improved.
    """
    for row, (_, _, seeds) in listed.items():
        for seed in seeds if only in row else []:
            tried = load(links).get(friction, {}).get(row, {}).get(seed)
            if tried is not None and seed not in listed:
                continue
            found = guess(listed, links, friction, row, seed)
            if found is not None and (tried is None or better(found[1], tried.get("seed", np.inf))):
                yield row, seed, *found


def better(efficiency: float | None, known: float | None) -> bool:
    """Whether the optimum that is a start has improved since it was last tried."""
    return efficiency is not None and known is not None and efficiency > known * (1 + 1e-4)


def guess(listed: dict[str, Row], links: int, friction: str, row: str, seed: str) -> tuple[AnyGait, float | None] | None:
    """A start and, if it is an optimum of a class with as many links, its efficiency; None as long as it is not known."""
    law = Friction(*(float(mu) for mu in friction.split(",")))
    if seed == FEWER:
        fewer = best(load(links - 1).get(friction, {}).get(row, {}))
        chains = equal_links(links - 1), equal_links(links)
        return None if fewer is None else (over_links(gait_from(fewer["gait"]), *chains), None)
    if seed not in listed:
        return named_gait(seed, links, law, listed[row].gait_class), None
    found = best(load(links).get(friction, {}).get(seed, {}))
    return None if found is None else (gait_from(found["gait"]), found["efficiency"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, default=3, help="equal links, 3 or more (default: 3)")
    parser.add_argument("--friction", default="1,1,1", help="mu_t,mu_f,mu_b")
    parser.add_argument("--only", default="", help="rows whose name contains this")
    parser.add_argument("--short", action="store_true", help="fewer classes (of three links)")
    parser.add_argument("--seconds", type=float, default=60, help="processor time an attempt may take")
    parser.add_argument("--table", action="store_true", help="write the table and figure from what there is")
    options = parser.parse_args()
    if options.links < 3:
        parser.error("--links must be at least 3.")
    links, friction = options.links, Friction(*(float(mu) for mu in options.friction.split(",")))
    listed = {} if options.table else rows(links, options.short)
    while left := next(attempts_left(listed, links, options.friction, options.only), None):
        row, seed, start, known = left
        result = attempt(listed[row], links, friction, start, known, options.seconds)
        keep(links, options.friction, row, seed, result)
        print(
            f"{options.friction} {row:<18s} from {seed:<18s} {result['status']:<18s} "
            f"{result.get('efficiency', np.nan):.6f} {result['cpu seconds']:6.1f} s {result['message'][:90]}",
            flush=True,
        )
    write(links, load(links))


if __name__ == "__main__":
    main()
