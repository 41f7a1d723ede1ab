"""Parts of the reproduction that concern three-link bodies: sweeps, optima, and what delta
changes."""

from __future__ import annotations

import time

import numpy as np

from colloc.gaits.harmonic import ellipse
from colloc.mechanics.fixed_point import solve_balance
from colloc.verification.adaptive_motion import Path
from colloc.verification.replay import replay
from scripts.models.ellipses import GaitGrid, gait_grid, largest_amplitude
from scripts.models.motion_record import record
from scripts.models.sweep import Route, distinct_maxima, performance
from scripts.models.velocity_map import STENCILS
from scripts.paper.map import BODY, ISOTROPIC, stored_map
from scripts.paper.parallel import parallel_map
from scripts.paper.study import Arrays, Context


def _grid_arrays(grid: GaitGrid) -> Arrays:
    return {"A0": grid.A0, "A1": grid.A1, "B1": grid.B1, "inside": grid.inside}


def sweep(context: Context) -> Arrays:
    """All admissible ellipses on a grid, through the map and directly, with the errors of both."""
    settings, delta = context.settings, context.settings["delta"]
    known = stored_map(context.needed["connection"])
    grid = gait_grid(BODY, np.pi / settings["steps"])
    gaits, result = grid.gaits, _grid_arrays(grid)
    mapped, direct = (
        Route(BODY, ISOTROPIC, delta, known, direct=False),
        Route(BODY, ISOTROPIC, delta, known),
    )
    found = {}
    for name, route in (("mapped", mapped), ("direct", direct)):
        start = time.perf_counter()
        found[name] = performance(
            route,
            gaits,
            instants=settings["instants"],
            processes=context.processes,
            label=f"sweep, {name}",
        )
        result[f"seconds_{name}"] = time.perf_counter() - start
        result[f"distance_{name}"] = grid.unflattened(found[name].distance)
        result[f"work_{name}"] = grid.unflattened(found[name].work)
        result[f"efficiency_{name}"] = grid.unflattened(found[name].efficiency)
    sample = gaits[:, :: settings["sample_every"]]
    fine = performance(
        direct,
        sample,
        instants=16 * settings["instants"],
        processes=context.processes,
        label="sweep, fine",
    )
    result["sample"], result["sample_efficiency"] = sample, fine.efficiency
    for name in found:
        result[f"sample_error_{name}"] = np.abs(
            found[name].efficiency[:: settings["sample_every"]] - fine.efficiency
        )
    by_method = [
        np.abs(
            performance(Route(BODY, ISOTROPIC, delta, known, False, m), sample).efficiency
            - fine.efficiency
        ).max()
        for m in STENCILS
    ]
    result["sample_error_by_method"] = np.array(by_method)
    return result


def plane(context: Context) -> Arrays:
    """The plane A0 = 0 on a finer grid, directly, and the lines on which the paper expects no
    motion."""
    settings = context.settings
    known = stored_map(context.needed["connection"])
    route = Route(BODY, ISOTROPIC, settings["delta"], known)
    grid = gait_grid(BODY, np.pi / settings["steps"], A0=np.zeros(1))
    done = performance(
        route,
        grid.gaits,
        instants=settings["instants"],
        processes=context.processes,
        label="plane A0 = 0",
    )
    result = _grid_arrays(grid)
    result |= {
        "distance": grid.unflattened(done.distance)[0],
        "work": grid.unflattened(done.work)[0],
        "efficiency": grid.unflattened(done.efficiency)[0],
    }
    # largest distance along the boundary, where it is attained
    angle = np.linspace(0, 0.5 * np.pi, settings["boundary"])
    radius = largest_amplitude(BODY, np.zeros_like(angle), angle)
    rim = np.stack([0 * angle, radius * np.cos(angle), radius * np.sin(angle)])
    rim_done, rim_coarse = (
        performance(route, rim, instants=n * settings["instants"], processes=context.processes)
        for n in (8, 4)
    )
    result |= {"rim": rim, "rim_distance": rim_done.distance, "rim_work": rim_done.work}
    # second order: the finer rule has a third of the difference
    result["rim_distance_error"] = np.abs(rim_done.distance - rim_coarse.distance) / 3
    # W at fixed amplitude in all directions
    radii = np.linspace(0.25, 2.0, 8)
    circles = np.stack([np.stack([0 * angle, r * np.cos(angle), r * np.sin(angle)]) for r in radii])
    work = [performance(route, circle, instants=settings["instants"]).work for circle in circles]
    result |= {"circle_radius": radii, "circle_work": np.array(work)}
    return result


def _line_maximum(
    route: Route, A0: float, direction: np.ndarray, fractions: np.ndarray
) -> np.ndarray:
    """(A1, B1, efficiency) of the best gait with a given A0 over a grid of directions and fractions
    of the boundary."""
    d, f = (a.ravel() for a in np.meshgrid(direction, fractions, indexing="ij"))
    amplitude = f * largest_amplitude(BODY, np.full_like(d, A0), d)
    gaits = np.stack([np.full_like(d, A0), amplitude * np.cos(d), amplitude * np.sin(d)])
    efficiency = performance(route, gaits, instants=400).efficiency
    best = int(efficiency.argmax())
    return np.array([*gaits[1:, best], efficiency[best]])


def optima(context: Context) -> Arrays:
    """Local maxima of the efficiency, refined; the best gait at each A0 the paper names."""
    settings = context.settings
    known = stored_map(context.needed["connection"])
    route = Route(BODY, ISOTROPIC, settings["delta"], known)
    swept = context.needed["sweep"]
    gaits = np.stack(np.meshgrid(swept["A0"], swept["A1"], swept["B1"], indexing="ij"))
    maxima = distinct_maxima(
        route, swept["efficiency_direct"], gaits, instants=settings["instants"]
    )
    result: Arrays = {
        "gaits": np.array([(m.A0, m.A1, m.B1) for m in maxima]),
        "position_error": np.array([m.position_error for m in maxima]),
        "at_contact": np.array([m.at_contact for m in maxima]),
        "distance": np.array([m.replay.distance for m in maxima]),
        "work": np.array([m.replay.work for m in maxima]),
        "efficiency": np.array([m.replay.efficiency for m in maxima]),
        "relative_error": np.array([m.replay.error for m in maxima]),
        "rotation": np.array([m.replay.rotation for m in maxima]),
    }
    direction = np.linspace(0.02, 0.5 * np.pi - 0.02, settings["directions"])
    fractions = np.linspace(0.4, 1.0, settings["fractions"])
    named = np.array(settings["named_A0"])
    result["named_A0"] = named
    result["named_best"] = np.array([_line_maximum(route, a, direction, fractions) for a in named])
    return result


def _path(A0: float, A1: float, B1: float) -> Path:
    gait = ellipse(A0, A1, B1)
    return lambda t: (gait.angles(t), gait.rates(t))


def _replayed(task: tuple[tuple[float, float, float], float]) -> tuple[float, float, float]:
    gait, delta = task
    done = replay(BODY, ISOTROPIC, _path(*gait), delta)
    return done.distance, done.work, done.efficiency


def delta_influence(context: Context) -> Arrays:
    """How distance, work and efficiency of the maxima, in their order, and of random gaits change
    with delta."""
    settings = context.settings
    rng = np.random.default_rng(settings["seed"])
    gaits = [tuple(g) for g in context.needed["optima"]["gaits"]]
    inside = context.needed["sweep"]
    chosen = rng.choice(np.flatnonzero(inside["inside"]), settings["random"], replace=False)
    axes = np.meshgrid(inside["A0"], inside["A1"], inside["B1"], indexing="ij")
    some = np.stack([a.ravel()[chosen] for a in axes]).T
    gaits += [tuple(g) for g in some if np.hypot(*g[1:]) > 0.3]
    tasks = [(gait, delta) for gait in gaits for delta in settings["deltas"]]
    rows = parallel_map(_replayed, tasks, processes=context.processes, label="influence of delta")
    return {
        "gaits": np.array(gaits),
        "deltas": np.array(settings["deltas"]),
        "distance_work_efficiency": np.array(rows).reshape(len(gaits), len(settings["deltas"]), 3),
    }


def motions(context: Context) -> Arrays:
    """The two best gaits in detail: end-point speeds, paths and snapshots (figure 12)."""
    settings, found = context.settings, context.needed["optima"]
    result: Arrays = {}
    order = [int(np.argmin(np.abs(found["gaits"][:, 0] - a))) for a in (0.0, 1.1)]
    for name, index in zip("DF", order, strict=True):
        made = record(
            BODY, ISOTROPIC, _path(*found["gaits"][index]), settings["delta"], settings["instants"]
        )
        result |= {
            f"{name}/t": made.t,
            f"{name}/speeds": made.speeds,
            f"{name}/x": made.x,
            f"{name}/y": made.y,
            f"{name}/index": index,
        }
    return result


def worked_instant(context: Context) -> Arrays:
    """The instant of figure 3: angles 39 and -113 degrees, rates -0.56 and 1."""
    angles = np.deg2rad(np.array([[39.0], [-113.0]]))
    rates = np.array([[-0.56], [1.0]])
    deltas = np.array(context.settings["deltas"])
    solved = [solve_balance(BODY, ISOTROPIC, angles, rates, d).require() for d in deltas]
    speeds = [BODY.velocity(BODY.posture(angles), rates, s.z) for s in solved]
    return {
        "angles": angles[:, 0],
        "rates": rates[:, 0],
        "deltas": deltas,
        "z": np.concatenate([s.z.T for s in solved]),
        "link_vs_vn_w": np.array([np.concatenate(v)[:, 0].reshape(3, 3) for v in speeds]),
        "residual": np.array([s.residual[0] for s in solved]),
    }
