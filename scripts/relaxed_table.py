"""Relaxed gaits and finite ones near them, for six coefficient sets and three joint limits, beside bounds and small gaits.

python -m scripts.relaxed_table [--out results] [--limits 2.5 3.14159265 2.0] [--symmetry both] [--starts 8] [--pieces 60]

Resumable: every solution is kept in the folder's `relaxed/`; a repeated run takes up where the last one stopped, and writes
`relaxed_table.md` from what there is. Bounds and small gaits are those of `results/curated/bound_table.md`.
"""

from __future__ import annotations

import argparse
import time
from itertools import product
from pathlib import Path

import numpy as np

from colloc.gaits.problem import Problem
from colloc.gaits.relaxed import Relaxed
from colloc.mechanics.friction import Friction
from colloc.results.relaxed_solution import RelaxedSolution
from colloc.results.relaxed_store import load_relaxed, save_relaxed
from colloc.search.relaxed_search import best_relaxed_gait, relaxed_gaits
from scripts.bound_table import COEFFICIENTS

DELTA, LEAST_EXTENT, FEW, PIECES = 1e-5, 0.3, 60, (6, 8, 10)
"""At unit shape speed; range of the mean angles of what counts as a gait that travels [rad]; corners of a simple one, and
pieces of the part that is solved, of the relaxed gaits that it is made from."""
NEARLY_DRY = 4e-4
BOUNDS = Path("results/curated/bound_table.md")
HEAD = """# Relaxed gaits and finite ones near them: three equal links

`{command}`. The best relaxed gait that the starts lead to, of those whose mean joint angles
range over at least 0.3 rad; delta = 1e-5 at unit shape speed. *Gait*: the best certified finite gait, its corners, its
distance a period and the largest joint angle. *60 corners*: the best certified polygon with 60. *Relaxed*: what finite gaits
tend to, for delta -> 0. *Small gait*: the best infinitesimal gait, and *bound*: the smallest sampled bound valid for this
limit; both of [bound_table.md](bound_table.md). *Gap*: of the relaxed gait to the bound, relative. CPU seconds on a loaded
machine. A star: the relaxed gait's own certificate fails a check (constraint violation above 1e-8), so its value is not sharp.
Few starts: what is found are lower ends, and a polygon may beat the relaxed gait of another basin.

| mu_t, mu_f, mu_b | limit | gait | corners | distance | angle | 60 corners | relaxed | small gait | bound | gap | CPU s |
|---|---|---|---|---|---|---|---|---|---|---|---|
"""


def known_bounds() -> dict[tuple[tuple[float, ...], float], tuple[float, float]]:
    """(bound, small gait) by coefficients and limit, from the table of bounds; a bound for a larger limit holds too."""
    found: dict[tuple[tuple[float, ...], float], tuple[float, float]] = {}
    least: dict[tuple[float, ...], float] = {}
    for line in BOUNDS.read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) < 8 or not cells[0][:1].isdigit():
            continue
        mu = tuple(float(m) for m in cells[0].split(","))
        least[mu] = min(least.get(mu, np.inf), float(cells[3]))
        found[mu, round(float(cells[1]), 2)] = (least[mu], float(cells[6]))
    return found


def solved(
    mu: tuple[float, ...], limit: float, symmetry: str, starts: int, pieces: int, first: tuple, folder: Path
) -> RelaxedSolution:
    """The solution in the folder, or a new one."""
    name = "-".join(f"{m:g}" for m in (*mu, limit)) + f"-{symmetry}"
    path = folder / f"{name}.h5"
    if path.exists():
        return load_relaxed(path)
    problem = Problem(
        "relaxed-" + name, friction=Friction(*mu), gait=Relaxed(3, symmetry), delta=DELTA, joint_limit=limit, intervals=pieces
    )
    begin = time.process_time()
    solution = best_relaxed_gait(problem, starts, first=first, least_extent=LEAST_EXTENT)
    solution.seconds = time.process_time() - begin
    save_relaxed(solution, path)
    return solution


def polygon(many: RelaxedSolution, folder: Path) -> RelaxedSolution:
    """A polygon of a few corners: the relaxed gait on few pieces, realised once, then optimised as the polygon that it is."""
    path = folder / f"{many.problem.name.removeprefix('relaxed-')}-{FEW}.h5"
    if path.exists():
        return load_relaxed(path)
    problem, sides, found = many.problem, round(FEW * many.problem.gait.fraction), []
    begin = time.process_time()
    for directions, pieces in product((2, 3), PIECES):
        coarse = problem.with_(gait=Relaxed(directions, problem.gait.symmetry), intervals=pieces)
        relaxed = relaxed_gaits(coarse, 0, first=(many.relaxed.mean.realised(),), least_extent=LEAST_EXTENT)[0].gait
        alone = relaxed.unmixed()
        if len(alone.durations) > sides:  # then without loops
            alone = relaxed.mean
        # at a large delta it would fall back to what polygons without loops do
        stated = problem.with_(gait=Relaxed(1, relaxed.symmetry), intervals=sides, delta_start=NEARLY_DRY)
        found.append(best_relaxed_gait(stated, 0, (1,), first=(alone,), least_extent=LEAST_EXTENT))
    best = max(found, key=lambda solution: solution.measured.efficiency)
    best.seconds = time.process_time() - begin
    save_relaxed(best, path)
    return best


def row(
    mu: tuple[float, ...], limit: float, many: RelaxedSolution, few: RelaxedSolution, known: tuple[float, float] | None
) -> str:
    """A line of the table."""
    best, angle = many.best, np.abs(many.gait.corners).max()
    relaxed = many.certificate.efficiency_at_zero_delta
    star = "" if many.certificate.passed else "*"
    bound = "" if known is None else f"{known[0]:.4f}"
    gap = "" if known is None else f"{100 * (1 - relaxed / known[0]):.1f} %"
    gait, simple = (f"{s.measured.efficiency:.4f}" + ("" if s.measured.passed else " (not certified)") for s in (many, few))
    return (
        f"| {mu[0]:g}, {mu[1]:g}, {mu[2]:g} | {limit:.4g} | {gait} | {best.corners} | {best.certificate.distance:.3f} "
        f"| {angle:.3f} | {simple} | {relaxed:.4f}{star} | {'' if known is None else f'{known[1]:.4f}'} | {bound} | {gap} "
        f"| {many.seconds + few.seconds:.0f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results"))
    parser.add_argument("--limits", type=float, nargs="+", default=[2.5, float(np.pi), 2.0])
    parser.add_argument("--symmetry", default="both")
    parser.add_argument("--starts", type=int, default=8, help="beside the gait found for equal coefficients")
    parser.add_argument("--pieces", type=int, default=60, help="of the part of the period that is solved")
    parser.add_argument("--seconds", type=float, default=np.inf, help="begin no new row after so much processor time")
    options = parser.parse_args()
    stated = [f"--{name} {getattr(options, name)}" for name in ("symmetry", "starts", "pieces")]
    command = " ".join(["python -m scripts.relaxed_table --limits", *(f"{each:.9g}" for each in options.limits), *stated])
    folder = options.out / "relaxed"
    folder.mkdir(parents=True, exist_ok=True)
    known, rows = known_bounds(), []
    for limit in options.limits:
        first: tuple = ()
        for mu in [tuple(map(float, each)) for each in COEFFICIENTS]:
            if time.process_time() > options.seconds:
                break
            many = solved(mu, limit, options.symmetry, options.starts, options.pieces, first, folder)
            if len(set(mu)) == 1:
                first = (many.relaxed.mean.realised(),)
            rows.append(row(mu, limit, many, polygon(many, folder), known.get((mu, round(limit, 2)))))
            print(rows[-1], flush=True)
    (options.out / "relaxed_table.md").write_text(HEAD.format(command=command) + "\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
