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
from typing import Any

from colloc.system.environment import available_processes
from colloc.system.errors import CollocError
from scripts.paper import scenes, three_link
from scripts.paper.study import PaperStudy, Part

DELTA = {"delta": 1e-4}
_SWEPT = {"A0": "rad", "A1": "rad", "B1": "rad"}
_MEASURED = {"distance": "body lengths", "work": "weight x length"}

PARTS = (
    Part(
        "connection",
        three_link.connection,
        settings={"delta": 1e-5, "angles": 64, "ratios": 65},
        quick={"angles": 32, "ratios": 33},
        units={"z": "(u, v, omega) per unit larger rate: face, component, angles, ratio"},
    ),
    Part(
        "sweep",
        three_link.sweep,
        settings=DELTA | {"steps": 74, "instants": 100, "sample_every": 50},
        quick={"steps": 24, "sample_every": 20},
        units=_SWEPT | _MEASURED,
    ),
    Part(
        "plane",
        three_link.plane,
        settings=DELTA | {"steps": 200, "instants": 100, "boundary": 361},
        quick={"steps": 50, "boundary": 91},
        units=_SWEPT | _MEASURED,
    ),
    Part(
        "optima",
        three_link.optima,
        settings=DELTA
        | {"instants": 800, "directions": 121, "fractions": 61, "named_A0": [0.0, 1.1, 2.5]},
        quick={"instants": 400, "directions": 41, "fractions": 31},
        needs=("sweep",),
        units={"gaits": "rad", "position_error": "rad", **_MEASURED},
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
        settings=DELTA | {"instants": 4000},
        needs=("optima",),
        units={"D/speeds": "body lengths/period", "F/speeds": "body lengths/period"},
    ),
    Part("instant", three_link.worked_instant, settings={"deltas": [1e-4, 1e-6, 1e-8]}),
    Part(
        "static",
        scenes.static,
        settings=DELTA
        | {"nodes": 73, "ratios": 41, "samples": 40000, "seed": 1, "reach": 2e-3}
        | {"deltas": [1e-3, 1e-4, 1e-6, 1e-8]},
        quick={"nodes": 37, "ratios": 9, "samples": 4000},
        units={"speed_0": "body lengths per unit larger rate"},
    ),
    Part(
        "flap",
        scenes.flap,
        settings={"lengths": [0.8, 0.1, 0.1], "openings": 61, "example": 0.7}
        | {"deltas": [1e-2, 1e-3, 1e-4, 1e-5, 1e-6]},
    ),
    Part(
        "waves",
        scenes.waves,
        settings=DELTA
        | {"default_intervals": 8, "intervals": {"5A": 24, "6A": 16, "6B": 16}, "snapshots": 10},
        quick={"default_intervals": 4, "intervals": {}, "snapshots": 6},
    ),
    Part(
        "crawlers",
        scenes.crawlers,
        settings={"epsilons": [0.2, 0.1, 0.05, 0.02, 0.01, 0.005], "fit_below": 0.03}
        | {"intervals": 1, "shown": 0.1, "snapshots": 12},
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
    names, processes = [part.name for part in PARTS], available_processes()
    stated: dict[str, dict[str, Any]] = {
        "only": {"nargs": "+", "metavar": "PART", "help": f"parts to compute: {', '.join(names)}"},
        "quick": {"action": "store_true", "help": "coarse, in minutes; files go to paper-quick"},
        "output": {"type": Path, "default": Path("results"), "help": "folder for results"},
        "processes": {"type": int, "default": processes, "help": "by default all processors"},
        "force": {"action": "store_true", "help": "compute even what is finished"},
        "no-figures": {"action": "store_true", "help": "leave the figures alone"},
    }
    for name, option in stated.items():
        parser.add_argument(f"--{name}", **option)
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
        from scripts.paper.rows import table as written_table

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
