"""The tabulated velocity map: resolution against error, build time and look-ups: python -m benchmarks --only map_resolution

Errors are those of `scripts.models.velocity_map.map_error`: interpolated against directly solved tail velocities at random
shapes and rates (larger rate 1), the largest component of (u, v, omega/2). A look-up competes with a direct solve in a batch.
"""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path

from benchmarks.balance_solvers import random_instants
from benchmarks.tables import cpu_seconds, markdown_table
from colloc import Chain, Friction, solve_balance
from scripts.models.velocity_map import map_error, velocity_map

_LOOKUPS = 20_000


def report(quick: bool, folder: Path) -> str:
    """One row for every resolution, delta and order of interpolation."""
    angles, rates = random_instants(_LOOKUPS)
    rows = []
    for delta in (1e-1, 1e-4):
        for n_angle in (16, 32) if quick else (16, 32, 64):
            begin = time.process_time()
            table = velocity_map(Chain(), Friction(), delta, n_angle=n_angle, n_ratio=n_angle + 1)
            built = time.process_time() - begin
            for method in ("linear", "cubic"):
                error = map_error(table, method=method, samples=2000 if quick else 5000)
                per_second = _LOOKUPS / cpu_seconds(partial(table.tail_velocity, angles, rates, method=method))
                megabytes = table.values.nbytes / 1e6
                row = [f"{delta:g}", n_angle, n_angle + 1, method, error.largest, error.rms, error.median]
                rows.append([*row, built, megabytes, per_second])
    header = [
        "delta",
        "angles",
        "ratios",
        "interpolation",
        "worst error",
        "rms",
        "median",
        "build s",
        "MB",
        "look-ups a second",
    ]
    few = slice(0, 2000)
    direct = 2000 / cpu_seconds(lambda: solve_balance(Chain(), Friction(), angles[:, few], rates[:, few], 1e-4, tolerance=1e-9))
    return f"{markdown_table(header, rows)}\n\nDirect solves at delta = 1e-4, in batches of 2000: {direct:.2g} a second."
