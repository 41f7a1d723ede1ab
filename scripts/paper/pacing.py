"""Part of the reproduction: what the map route costs in efficiency, and what its treatment of delta
changes.

The map holds delta relative to the larger joint rate, so along a gait its regularisation speed
follows the pace. A direct solve at the same relative delta separates that from the error of
interpolation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.mechanics.fixed_point import solve_balance
from scripts.models.sweep import Route, performance
from scripts.models.velocity_map import STENCILS, velocity_map
from scripts.paper.map import BODY, ISOTROPIC, stored_map
from scripts.paper.study import Arrays, Context


@dataclass(frozen=True)
class PacedRoute(Route):
    """Direct solves at a regularisation speed of `relative` times the larger joint rate, as in the
    map."""

    relative: float = 1e-5

    def tail_velocity(self, angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
        larger = np.abs(rates).max(axis=0)
        solved = solve_balance(
            self.body, self.friction, angles, rates / larger, self.relative, tolerance=1e-8
        )
        return solved.require().z * larger


def pacing(context: Context) -> Arrays:
    """Efficiency errors of the map route by resolution and stencil, and differences made by
    relative delta."""
    settings, delta = context.settings, context.settings["delta"]
    known = stored_map(context.needed["connection"])
    gaits = context.needed["sweep"]["sample"][:, :: settings["sample_every"]]
    gaits = gaits[:, np.hypot(*gaits[1:]) > 0.2]
    direct = performance(Route(BODY, ISOTROPIC, delta, known), gaits)
    result: Arrays = {
        "gaits": gaits,
        "resolutions": np.array(settings["resolutions"]),
        "methods": np.array(list(STENCILS)),
    }

    errors = []
    for n in settings["resolutions"]:
        made = velocity_map(
            BODY, ISOTROPIC, known.delta, n_angle=n, n_ratio=n + 1, processes=context.processes
        )
        routes = [Route(BODY, ISOTROPIC, delta, made, direct=False, method=m) for m in STENCILS]
        errors.append(
            [np.abs(performance(r, gaits).efficiency - direct.efficiency).max() for r in routes]
        )
    result["route_error"] = np.array(errors)

    paced = [
        performance(PacedRoute(BODY, ISOTROPIC, delta, relative=r), gaits)
        for r in settings["relative"]
    ]
    result["relative"] = np.array(settings["relative"])
    result["paced_efficiency_change"] = np.array(
        [np.abs(p.efficiency - direct.efficiency).max() for p in paced]
    )
    result["paced_distance_change"] = np.array(
        [np.abs(p.distance - direct.distance).max() for p in paced]
    )
    return result
