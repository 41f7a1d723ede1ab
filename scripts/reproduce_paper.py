"""Reproduce everything the paper computes: ``python -m scripts.reproduce_paper``.

Writes results/paper/*.h5 (one file a part), figures as PNG and PDF, and results/paper.md, a table
with one row for every number the paper prints. Parts whose inputs have not changed since they were
computed are not computed again.

Source: S. Alben, "Efficient sliding locomotion with isotropic friction" (2019).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from colloc.system.environment import available_processes
from colloc.system.errors import CollocError
from scripts.paper import crawlers, map, pacing, static, three_link, waves
from scripts.paper.study import PaperStudy, Part

DELTA = 1e-4

PARTS = (
    Part(
        "connection",
        map.connection,
        settings={
            "delta": 1e-5,
            "resolutions": [16, 32, 64, 128],
            "keep": 64,
            "other_resolutions": [16, 32],
            "samples": 20000,
        },
        quick={"resolutions": [16, 32], "keep": 32, "other_resolutions": [16], "samples": 4000},
        units={"values": "face, angle 1, angle 2, ratio, (u, v, omega) per unit larger rate"},
    ),
    Part(
        "sweep",
        three_link.sweep,
        settings={"delta": DELTA, "steps": 74, "instants": 100, "sample_every": 50},
        quick={"steps": 24, "sample_every": 20},
        needs=("connection",),
        units={
            "A0": "rad",
            "A1": "rad",
            "B1": "rad",
            "distance_direct": "body lengths",
            "work_direct": "weight x length",
        },
    ),
    Part(
        "pacing",
        pacing.pacing,
        settings={
            "delta": DELTA,
            "sample_every": 10,
            "resolutions": [16, 32, 64],
            "relative": [1e-3, 1e-4, 1e-5, 1e-6],
        },
        quick={"sample_every": 4, "resolutions": [16, 32], "relative": [1e-4, 1e-5]},
        needs=("connection", "sweep"),
    ),
    Part(
        "plane",
        three_link.plane,
        settings={"delta": DELTA, "steps": 200, "instants": 100, "boundary": 361},
        quick={"steps": 50, "boundary": 91},
        needs=("connection",),
        units={"A1": "rad", "B1": "rad", "distance": "body lengths", "work": "weight x length"},
    ),
    Part(
        "optima",
        three_link.optima,
        settings={
            "delta": DELTA,
            "instants": 800,
            "directions": 121,
            "fractions": 61,
            "named_A0": [0.0, 1.1, 2.5],
        },
        quick={"instants": 400, "directions": 41, "fractions": 31},
        needs=("connection", "sweep"),
        units={
            "gaits": "rad",
            "position_error": "rad",
            "distance": "body lengths",
            "work": "weight x length",
        },
    ),
    Part(
        "delta",
        three_link.delta_influence,
        settings={"deltas": [1e-3, 1e-4, 1e-5, 1e-6, 1e-8], "random": 12, "seed": 7},
        quick={"deltas": [1e-4, 1e-6], "random": 3},
        needs=("sweep", "optima"),
    ),
    Part(
        "motions",
        three_link.motions,
        settings={"delta": DELTA, "instants": 4000},
        needs=("optima",),
        units={"D/speeds": "body lengths/period", "F/speeds": "body lengths/period"},
    ),
    Part("instant", three_link.worked_instant, settings={"deltas": [1e-4, 1e-6, 1e-8]}),
    Part(
        "static",
        static.static,
        settings={
            "delta": DELTA,
            "nodes": 73,
            "ratios": 41,
            "deltas": [1e-3, 1e-4, 1e-6, 1e-8],
            "samples": 40000,
            "seed": 1,
            "reach": 2e-3,
        },
        quick={"nodes": 37, "ratios": 9, "samples": 4000},
        units={"speed_0": "body lengths per unit larger rate"},
    ),
    Part(
        "flap",
        static.flap,
        settings={
            "lengths": [0.8, 0.1, 0.1],
            "openings": 61,
            "deltas": [1e-2, 1e-3, 1e-4, 1e-5, 1e-6],
            "example": 0.7,
        },
    ),
    Part(
        "waves",
        waves.waves,
        settings={
            "delta": DELTA,
            "default_intervals": 8,
            "intervals": {"5A": 24, "6A": 16, "6B": 16},
            "snapshots": 10,
        },
        quick={"default_intervals": 4, "intervals": {}, "snapshots": 6},
    ),
    Part(
        "wave_parameters",
        waves.wave_parameters,
        settings={
            "delta": DELTA,
            "steepness": [5, 10, 40, 100, 400],
            "amplitude_A": [1.1, 1.5],
            "mu_A": [3, 10, 1000],
            "coarse": [[12, 4], [25, 4], [50, 4]],
            "mu_B": [30, 1000, 10000],
            "amplitude_B": [0.7, 0.9, 1.1],
        },
        quick={
            "steepness": [10],
            "amplitude_A": [],
            "mu_A": [10],
            "coarse": [[25, 4]],
            "mu_B": [1000],
            "amplitude_B": [0.9],
        },
    ),
    Part(
        "crawlers",
        crawlers.crawlers,
        settings={
            "epsilons": [0.2, 0.1, 0.05, 0.02, 0.01, 0.005],
            "fit_below": 0.03,
            "intervals": 1,
            "shown": 0.1,
            "snapshots": 12,
        },
        quick={"epsilons": [0.02, 0.01], "snapshots": 2},
    ),
)


def study(folder: Path, *, quick: bool) -> PaperStudy:
    """The reproduction with its files in `folder`."""
    return PaperStudy(PARTS, folder, quick=quick)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m scripts.reproduce_paper", description=__doc__.split("\n")[0]
    )
    parser.add_argument(
        "--only",
        nargs="+",
        metavar="PART",
        help=f"parts to compute: {', '.join(p.name for p in PARTS)}",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="coarser grids, in about a minute; files go to paper-quick",
    )
    parser.add_argument(
        "--output", type=Path, default=Path("results"), help="folder for results (default: results)"
    )
    parser.add_argument(
        "--processes",
        type=int,
        default=available_processes(),
        help="processes (default: all processors)",
    )
    parser.add_argument("--force", action="store_true", help="compute even what is finished")
    parser.add_argument("--no-figures", action="store_true", help="leave the figures alone")
    options = parser.parse_args(arguments)
    name = "paper-quick" if options.quick else "paper"
    work = study(options.output / name, quick=options.quick)
    try:
        chosen = work.select(options.only or list(work.parts))
        for part in chosen:
            if work.finished(part) and not options.force:
                print(f"{part}: finished before")
                continue
            print(f"{part}: computing", flush=True)
            print(f"{part}: {work.compute(part, options.processes):.1f} s", flush=True)
        from scripts.paper.table import table as written_table

        table = options.output / f"{name}.md"
        table.write_text(written_table(work), encoding="utf-8")
        print(f"wrote {table}")
        if not options.no_figures:
            from scripts.paper import figures as figures_paper

            for path in figures_paper.draw_all(work, options.output / name):
                print(f"wrote {path}")
    except CollocError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
