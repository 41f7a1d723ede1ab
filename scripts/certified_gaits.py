"""The best certified gaits of three equal links that other programs left under results/."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from colloc.gaits.gait_fields import gait_from
from colloc.gaits.harmonic import Fourier

_PHASES = np.arange(2000) / 2000


def best_efficiency(mu: tuple[float, ...], limit: float, folder: Path) -> float:
    """The largest efficiency among them whose joint angles keep within the limit, or NaN.

    Parameters
    ----------
    mu : (mu_t, mu_f, mu_b)
    limit : float
        Largest joint angle [rad].
    folder : Path
        Holds robustness.json (`benchmarks.robustness`) and class_table.json (`scripts.class_table`), or none of them.
    """
    within = [e for e, angle in (*_from_starts(mu, folder), *_from_classes(mu, folder)) if angle <= limit + 1e-6]
    return max(within, default=float("nan"))


def _from_starts(mu: tuple[float, ...], folder: Path) -> Iterator[tuple[float, float]]:
    path = folder / "robustness.json"
    for row in json.loads(path.read_text(encoding="utf-8"))["rows"] if path.exists() else []:
        if tuple(row["law"]) == tuple(mu) and row["optima"]:
            gait = Fourier(**{name: np.array(values) for name, values in row["best_gait"].items()})
            yield row["optima"][0][0], float(np.abs(gait.angles(_PHASES)).max())


def _from_classes(mu: tuple[float, ...], folder: Path) -> Iterator[tuple[float, float]]:
    path = folder / "class_table.json"
    known = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for attempts in known.get(",".join(f"{value:g}" for value in mu), {}).values():
        for attempt in attempts.values():
            if attempt["status"] == "solved":
                yield attempt["efficiency"], float(np.abs(gait_from(attempt["gait"]).angles(_PHASES)).max())
