"""The part of the reproduction that makes the velocity map and measures its error."""

from __future__ import annotations

import time

import numpy as np

from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from scripts.models.velocity_map import STENCILS, VelocityMap, map_error, velocity_map
from scripts.paper.study import Arrays, Context

BODY, ISOTROPIC = Chain(), Friction()
OTHERS = {
    "anisotropic": (Chain(), Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)),
    "unequal links": (Chain((0.25, 0.45, 0.3)), Friction()),
}
"""Snake-like coefficients (paper, introduction), which need four faces, and a body without
symmetry."""


def connection(context: Context) -> Arrays:
    """The velocity map, and its error against direct solves as a function of resolution."""
    settings = context.settings
    errors, seconds = [], []
    for n in settings["resolutions"]:
        start = time.perf_counter()
        label = f"velocity map {n}"
        made = velocity_map(
            BODY,
            ISOTROPIC,
            settings["delta"],
            n_angle=n,
            n_ratio=n + 1,
            processes=context.processes,
            label=label,
        )
        seconds.append(time.perf_counter() - start)
        for method in STENCILS:
            e = map_error(made, method=method, samples=settings["samples"])
            errors.append((e.largest, e.rms, e.median))
        if n == settings["keep"]:
            kept = made
    result: Arrays = {
        "values": kept.values,
        "delta": kept.delta,
        "resolutions": np.array(settings["resolutions"]),
        "methods": np.array(list(STENCILS)),
        "errors": np.array(errors).reshape(-1, len(STENCILS), 3),
        "seconds": np.array(seconds),
    }
    for name, (body, friction) in OTHERS.items():
        rows = []
        for n in settings["other_resolutions"]:
            made = velocity_map(
                body,
                friction,
                settings["delta"],
                n_angle=n,
                n_ratio=n + 1,
                processes=context.processes,
            )
            e = map_error(made, samples=settings["samples"])
            rows.append((e.largest, e.rms, e.median))
        result[f"other/{name}/errors"] = np.array(rows)
        result[f"other/{name}/faces"] = made.values.shape[0]
    result["other/resolutions"] = np.array(settings["other_resolutions"])
    return result


def stored_map(arrays: Arrays) -> VelocityMap:
    """The velocity map that `connection` kept."""
    return VelocityMap(BODY, ISOTROPIC, float(arrays["delta"]), arrays["values"])
