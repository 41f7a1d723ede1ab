"""Parts of the reproduction that concern smooth bodies: travelling and standing waves (figures 5
and 6)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from colloc.mechanics.friction import Friction
from colloc.smooth.balance import Motion
from colloc.smooth.prescribed_body import Wave
from scripts.models.period import measured_period, period
from scripts.models.smooth_record import snapshots
from scripts.paper.parallel import parallel_map
from scripts.paper.study import Arrays, Context

TRANSVERSE_EASY, ALONG_EASY = (
    Friction(mu_t=1, mu_f=100, mu_b=100),
    Friction(mu_t=100, mu_f=1, mu_b=1),
)
WAVES: dict[str, tuple[str, Friction]] = {
    "5A": ("triangular", TRANSVERSE_EASY),
    "5B": ("sine", ALONG_EASY),
    "6A": ("triangular", Friction()),
    "6B": ("sine", Friction()),
    "6C": ("standing", Friction()),
}
Task = tuple[str, dict, tuple[float, float, float], float, dict]
"""Kind of wave, its parameters, (mu_t, mu_f, mu_b), delta, and settings of the quadrature."""


_MADE = {"triangular": Wave("tanh", 1.3, 2.0), "sine": Wave(), "standing": Wave("standing")}


def _motion(kind: str, **parameters: Any) -> Motion:
    return replace(_MADE[kind], **parameters).prescribed()


def _wave(task: tuple[str, float, int]) -> dict:
    name, delta, intervals = task
    kind, friction = WAVES[name]
    made = measured_period(_motion(kind), friction, delta, intervals=intervals)
    return {
        "distance": made.d,
        "work": made.W,
        "efficiency": made.efficiency,
        "errors": np.array([made.errors[k] for k in ("d", "W", "efficiency")], dtype=float),
    }


def _view(task: tuple[str, float, int]) -> dict:
    name, delta, count = task
    kind, friction = WAVES[name]
    return snapshots(_motion(kind), friction, delta, count)._asdict()


def waves(context: Context) -> Arrays:
    """Distance, work and efficiency of the waves, with errors, and snapshots."""
    settings = context.settings
    tasks = [
        (name, settings["delta"], settings["intervals"].get(name, settings["default_intervals"]))
        for name in WAVES
    ]
    rows = parallel_map(_wave, tasks, processes=context.processes, label="waves")
    result: Arrays = {}
    for name, row in zip(WAVES, rows, strict=True):
        result |= {f"{name}/{key}": value for key, value in row.items()}
    views = parallel_map(
        _view,
        [(name, settings["delta"], settings["snapshots"]) for name in WAVES],
        processes=context.processes,
    )
    for name, view in zip(WAVES, views, strict=True):
        result |= {f"{name}/{key}": value for key, value in view.items()}
    return result


def _efficiency(task: Task) -> float:
    kind, parameters, (mu_t, mu_f, mu_b), delta, quadrature = task
    friction = Friction(mu_t=mu_t, mu_f=mu_f, mu_b=mu_b)
    return float(period(_motion(kind, **parameters), friction, delta, **quadrature).efficiency)


def wave_parameters(context: Context) -> Arrays:
    """Which parameters would give the efficiencies printed for waves A (0.93) and B (0.76): one
    changed at a time."""
    delta = context.settings["delta"]
    tasks: list[Task] = []
    names = []
    for steepness in context.settings["steepness"]:
        tasks.append(("triangular", {"steepness": steepness}, (1, 100, 100), delta, {}))
        names.append(f"A: steepness {steepness:g} instead of 20")
    for amplitude in context.settings["amplitude_A"]:
        tasks.append(("triangular", {"amplitude": amplitude}, (1, 100, 100), delta, {}))
        names.append(f"A: amplitude {amplitude:g} instead of 1.3")
    for mu in context.settings["mu_A"]:
        tasks.append(("triangular", {}, (1, mu, mu), delta, {}))
        names.append(f"A: mu_f = mu_b = {mu:g} instead of 100")
    for panels, order in context.settings["coarse"]:
        quadrature = {"panels": panels, "order": order, "quadrature_tolerance": 0.0}
        tasks.append(("triangular", {}, (1, 100, 100), delta, quadrature))
        names.append(
            f"A: printed parameters, arc length under-resolved ({panels} panels of {order} nodes)"
        )
    for mu in context.settings["mu_B"]:
        tasks.append(("sine", {}, (mu, 1, 1), delta, {}))
        names.append(f"B: mu_t = {mu:g} instead of 100")
    for amplitude in context.settings["amplitude_B"]:
        tasks.append(("sine", {"amplitude": amplitude}, (100, 1, 1), delta, {}))
        names.append(f"B: amplitude {amplitude:g} instead of 1")
    values = parallel_map(_efficiency, tasks, processes=context.processes, label="wave parameters")

    def missed(log_mu: float) -> float:
        return _efficiency(("sine", {}, (float(np.exp(log_mu)), 1, 1), delta, {})) - 0.76

    mu_for_B = float(np.exp(brentq(missed, np.log(300), np.log(2000), xtol=1e-3)))
    return {"names": np.array(names), "efficiency": np.array(values), "mu_t_for_B": mu_for_B}
