"""The best gaits from both sides, by law of friction, limit of the joints, number of links and width.

python -m scripts.frontier [--laws 1 6] [--limits 2.5] [--links 3] [--widths 0] [--parts gait few] [--seconds 600]

One row for every law of friction, limit of the joint angles, number of links and width of the links; five parts a row. What is
done is kept: numbers in `results/curated/frontier.json`, gaits in `results/frontier/`. A run takes up what is missing, and
writes `results/curated/frontier.md` from all there is. `--seconds` begins no other part after so much processor time.

- gait: the best relaxed gait that travels through shapes, of either symmetry, and the best certified finite gait near it;
- few: the best certified polygon with 60 corners near it;
- small: the best gait of no size at one shape;
- loop: the best certified polygon of a short path near that shape;
- bound: the sampled upper bound; of a kept potential (`scripts.check_potential`) what a check finds, and the seconds are
  those of the check.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from colloc.bounds.infinitesimal import best_small_gait, small_gait
from colloc.bounds.recheck import largest_ratio
from colloc.bounds.sampled import Budget, efficiency_bound, usual_budget
from colloc.gaits.guesses import largest_factor
from colloc.gaits.polygon import Corners, Polygon
from colloc.gaits.problem import Problem
from colloc.gaits.relaxed import Relaxed
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import gap
from colloc.results.relaxation import Relaxation
from colloc.results.solution import SOLVED, Solution
from colloc.results.store import load, save
from colloc.search.relaxed import explore_relaxed, realised_solution
from colloc.search.solve import solve
from colloc.system.errors import CollocError, NotConvergedError
from scripts.check_potential import potentials
from scripts.few_corners import polygon_near
from scripts.frontier_rows import GAITS, Row, best_held, guaranteed_bound, put, read, room, row_of, smallest_bound

COEFFICIENTS = ((1, 1, 1), (1.7, 1, 1.3), (10, 1, 1), (0.5, 1, 5), (1, 1, 3), (3, 1, 1))
"""(mu_t, mu_f, mu_b)"""
DELTA, LEAST_EXTENT, FEW = 1e-5, 0.3, 60
"""At unit shape speed; range of the mean angles of what counts as a gait that travels [rad]; corners of a simple one."""
REPEATS, LIMITS = (1, 2, 4), (2.5, float(np.pi), 2.0)
"""Of the directions of a relaxed gait in the finite ones; of joint angles, those first that are most wanted."""
PARTS = ("gait", "few", "small", "loop", "bound")
SPEED, LOOP_DELTA = 0.02, 2e-5
"""Of small loops: least path over 2 pi [rad], and delta at unit shape speed."""
SYMMETRIES = ("both", "bilateral")
"""Of relaxed gaits: loops about the straight body have both; those to one side of it (10, 1, 1 and 3, 1, 1) have one."""
BUDGET, DIRECTED, COARSE = Budget(starts=150), (0, 1, 2), 5e-3
"""Of bounds for three links; where mu_b differs from mu_f these headings, as the second is worth 5 % at (0.5, 1, 5); there
bounds for more links, which have half as many unknowns again, do not come within 0.001 of their programs in six minutes."""
MORE = (1, 3)
"""Headings for four links and more where mu_b = mu_f: the third is worth 4 % at (3, 1, 1), and for five links."""
TABLE = Path("results/curated/frontier.md")
HEAD = """# The best gaits from both sides

`python -m scripts.frontier`, taken up again and again. Joints within the limit; links of the width do not overlap,
links of none do not cross. *Gait*: the best certified finite gait that travels through shapes (its mean angles range
over at least 0.3 rad; by distance they could not be told apart, as a small gait run through often enough travels as
far), with its corners, its distance a period, the largest joint angle and how far its links stay *apart* [body
lengths], so how wide they may be; delta = 1e-5 at unit shape speed. What was found for a smaller limit counts for a
larger one too. *60 corners*: the best certified polygon with at most 60. *Relaxed*: what finite gaits near it tend
to, for delta -> 0. *Small gait*: the best gait of no size at one shape, for delta -> 0, and how far links are apart
there. *Small loop*: the best certified polygon near it, of a path of 0.126 rad, at delta = 2e-5. *Bound*: a sampled
one, with the number of its unknowns: it holds but for what lies between the samples; in brackets the program's value,
if climbs still found more than is tolerated above. *Guaranteed*: up to rounding, without samples, for delta -> 0
([how](../../docs/bound.md)). *Gap*: from the better of relaxed and small gait to the smallest bound that is valid for
the row, relative; 1 over the smallest coefficient is one for every body. CPU seconds of rows made at different times,
on different machines. A star: the relaxed gait's own certificate fails a check, so its value is not sharp. An empty
place has not been computed. What was found is a lower end: other starts may find better gaits. What a row of width 0
says of a gait holds for links of the widths 0.01 and 0.03 as well where the gait stays farther apart than these, and
its bound holds for any width: rows of other widths are those where something changes.

"""
COLUMNS = (
    "mu_t, mu_f, mu_b", "limit", "links", "width", "gait", "corners", "distance", "angle", "apart", "60 corners", "relaxed",
    "small gait", "its apart", "small loop", "bound", "unknowns", "guaranteed", "gap", "CPU s",
)  # fmt: skip


def relaxation(path: Path) -> Relaxation:
    """The relaxed gait of a kept solution, and the finite ones near it."""
    found = load(path).relaxed
    assert found is not None
    return found


def finite(body: Chain, solution: Solution, seconds: float) -> dict[str, Any]:
    """What the table says of a solution."""
    assert solution.relaxed is not None
    best, relaxed = solution.relaxed.best, solution.relaxed.certificate
    return {
        "efficiency": best.certificate.efficiency,
        "passed": best.certificate.passed,
        "corners": best.corners,
        "distance": best.certificate.distance,
        "angle": float(np.abs(best.gait.corners).max()),
        "apart": float(gap(body, best.gait.angles(np.linspace(0.0, 1.0, 20001))).min()),
        "relaxed": relaxed.efficiency_at_zero_delta,
        "sharp": relaxed.passed,
        "seconds": seconds,
    }


def nearest(row: Row) -> list[Row]:
    """The rows with as many links whose gaits are kept, one a law, of the nearest limit; the nearest laws first."""

    def distance(other: Row) -> tuple[float, float]:
        return float(np.abs(np.log(np.divide(row.mu, other.mu))).sum()), abs(row.limit - other.limit)

    rows = {row_of(key)[0] for key in read() if key.endswith(" gait")}
    kept = sorted((r for r in rows if r.links == row.links and r.file("gait").exists()), key=distance)
    return list({r.mu: r for r in reversed(kept)}.values())[::-1]


def gait(row: Row, starts: int) -> dict[str, Any]:
    """The best relaxed gait that travels, begun also from two kept ones of the nearest laws, both ways round: a gait may travel
    backwards where mu_b exceeds mu_f."""
    begin = time.process_time()
    near = [relaxation(other.file("gait")).gait.mean.realised() for other in nearest(row)[:2]]
    senses = (1,) if row.friction.reversible else (1, -1)
    first = [replace(one, corners=one.corners[:, ::sense]) for one in near for sense in senses]
    ends = []
    for symmetry in SYMMETRIES:
        problem = Problem(
            f"frontier-{row.name}", body=row.body, friction=row.friction, gait=Relaxed(row.links, symmetry), delta=DELTA,
            joint_limit=row.limit,
        )  # fmt: skip
        with suppress(NotConvergedError):
            ends.append(explore_relaxed(problem, starts, first=tuple(first), least_extent=LEAST_EXTENT).optima[0])
    travel = [end for end in ends if end.gait.extent >= LEAST_EXTENT]
    if not travel:
        raise NotConvergedError("no start led to a gait that travels.")
    solution = realised_solution(min(travel, key=lambda end: end.objective), REPEATS)
    save(solution, row.file("gait"))
    return finite(row.body, solution, time.process_time() - begin)


def few(row: Row, starts: int) -> dict[str, Any]:
    """The best polygon of a few corners near the relaxed gait of the row."""
    begin, near = time.process_time(), row.file("gait")
    solution = polygon_near(load(near).problem, relaxation(near).gait, FEW)
    save(solution, row.file("few"))
    return finite(row.body, solution, time.process_time() - begin)


def small(row: Row, starts: int) -> dict[str, Any]:
    """The best gait of no size."""
    begin = time.process_time()
    best, shape = best_small_gait(row.body, row.friction, row.limit)
    return {"efficiency": best.efficiency, "shape": shape.tolist(), "seconds": time.process_time() - begin}


def loop(row: Row, starts: int) -> dict[str, Any]:
    """The best polygon of a short path, begun about the shape of the best gait of no size, where links keep their width."""
    begin, friction = time.process_time(), row.friction
    shape = np.array(read()[f"{row.name} small"]["shape"])
    path = small_gait(row.body, friction, shape).path(shape, 1.2 * 2 * np.pi * SPEED)
    inside = min(1.0, largest_factor(row.body, row.limit, Corners(path).angles(np.linspace(0.0, 1.0, 401))))
    problem = Problem(
        f"frontier-{row.name}-loop", Corners(inside * path), row.body, friction, Polygon(path.shape[1]), LOOP_DELTA,
        100 * LOOP_DELTA, row.limit, SPEED, intervals=30,
    )  # fmt: skip
    solution = solve(problem, 1)
    save(solution, row.file("loop"))
    certificate = solution.certificate
    return {
        "efficiency": certificate.efficiency, "passed": solution.status == SOLVED, "distance": certificate.distance,
        "gap": float(gap(row.body, solution.gait.angles(np.linspace(0.0, 1.0, 20001))).min()),
        "seconds": time.process_time() - begin,
    }  # fmt: skip


def bound(row: Row, starts: int) -> dict[str, Any]:
    """The sampled bound: that of a kept potential, looked for anew, or a new one."""
    begin = time.process_time()
    for domain, space, free, program in potentials():
        if (domain.body, domain.friction) == (row.body, row.friction) and abs(domain.joint_limit - row.limit) < 1e-9:
            top = largest_ratio(domain, space, free)[0]
            seconds = time.process_time() - begin
            return {"sampled": top, "floor": program, "converged": True, "unknowns": space.size, "seconds": seconds}
    friction = row.friction
    budget = BUDGET if row.links <= 3 else usual_budget(row.body)
    if friction.reversible and row.links > 3:
        budget = replace(budget, harmonics=MORE)
    if not friction.reversible:
        budget = replace(budget, harmonics=DIRECTED) if row.links <= 3 else replace(budget, tolerance=COARSE)
    found = efficiency_bound(row.body, friction, row.limit, budget=budget)
    return {
        "sampled": found.sampled, "floor": found.floor, "converged": found.converged, "unknowns": len(found.coefficients),
        "seconds": found.seconds,
    }  # fmt: skip


COMPUTE: dict[str, Callable[[Row, int], dict[str, Any]]] = {
    "gait": gait,
    "few": few,
    "small": small,
    "loop": loop,
    "bound": bound,
}


def asked(options: argparse.Namespace) -> Iterator[Row]:
    """The rows, those first that are most wanted."""
    laws = [COEFFICIENTS[k - 1] for k in options.laws]
    for links, width, limit, mu in product(options.links, options.widths, options.limits, laws):
        yield Row(tuple(map(float, mu)), limit, links, width)


def wanted(row: Row, part: str, known: dict) -> bool:
    """Whether a part can be computed and is not known."""
    possible = {"few": row.file("gait").exists(), "loop": f"{row.name} small" in known}
    return f"{row.name} {part}" not in known and possible.get(part, True)


def line(row: Row, known: dict) -> str:
    """A row of the table."""
    parts = {part: known.get(f"{row.name} {part}", {}) for part in PARTS}
    travels, simple, still = (best_held(row, part, known) for part in ("gait", "few", "small"))
    loops, above = parts["loop"], parts["bound"]

    def value(of: dict, key: str, form: str = ".4f", mark: str = "") -> str:
        return f"{of[key]:{form}}{mark}" if key in of else ""

    refused = " (not certified)"
    ends = [travels.get("relaxed", -np.inf), still.get("efficiency", -np.inf)]
    least, guaranteed = smallest_bound(row, known), guaranteed_bound(row)
    apart = f"{100 * (1 - max(ends) / least):.1f} %" if np.isfinite(max(ends)) else ""
    program = "" if above.get("converged", True) else f" ({above['floor']:.4f})"
    cells = [
        ", ".join(f"{m:g}" for m in row.mu), f"{row.limit:.4g}", str(row.links), f"{row.width:g}",
        value(travels, "efficiency", mark="" if travels.get("passed") else refused), value(travels, "corners", "d"),
        value(travels, "distance", ".3f"), value(travels, "angle", ".3f"), value(travels, "apart", ".3f"),
        value(simple, "efficiency", mark="" if simple.get("passed") else refused),
        value(travels, "relaxed", mark="" if travels.get("sharp") else "*"), value(still, "efficiency"),
        f"{room(row, still)[1]:.3f}" if still else "", value(loops, "efficiency", mark="" if loops.get("passed") else refused),
        value(above, "sampled", mark=program), value(above, "unknowns", "d"),
        f"{guaranteed:g}" if np.isfinite(guaranteed) else "", apart,
        f"{sum(part.get('seconds', 0.0) for part in parts.values()):.0f}",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def rows_of(known: dict) -> list[Row]:
    """The rows of the six laws of which something is known, in the order of the table."""
    order = {tuple(map(float, mu)): k for k, mu in enumerate(COEFFICIENTS)}
    rows = {row_of(key)[0] for key in known}
    return sorted((row for row in rows if row.mu in order), key=lambda r: (r.links, r.width, r.limit, order[r.mu]))


def compute_missing(rows: Iterable[Row], parts: Iterable[str], starts: int, seconds: float) -> None:
    """Compute and keep what can be and is not known; begin nothing after so much processor time."""
    GAITS.mkdir(parents=True, exist_ok=True)
    for row, part in product(rows, parts):
        if time.process_time() < seconds and wanted(row, part, read()):
            try:
                put(f"{row.name} {part}", COMPUTE[part](row, starts))
            except CollocError as error:
                print(f"{row.name}, {part}: {error}")
                continue
            print(part, line(row, read()), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--laws", type=int, nargs="+", default=[1, 2, 3, 4, 5, 6], choices=range(1, 7), metavar="N")
    parser.add_argument("--limits", type=float, nargs="+", default=LIMITS)
    parser.add_argument("--links", type=int, nargs="+", default=[3, 4, 5])
    parser.add_argument("--widths", type=float, nargs="+", default=[0.0, 0.01, 0.03])
    parser.add_argument("--parts", nargs="+", default=list(PARTS), choices=PARTS)
    parser.add_argument("--starts", type=int, default=4, help="of relaxed gaits, beside the one found for equal coefficients")
    parser.add_argument("--seconds", type=float, default=np.inf)
    options = parser.parse_args()
    compute_missing(asked(options), options.parts, options.starts, options.seconds)
    known = read()
    lines = [f"| {' | '.join(COLUMNS)} |", "|" + "---|" * len(COLUMNS), *(line(row, known) for row in rows_of(known))]
    TABLE.write_text(HEAD + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
