"""Parts of the reproduction that concern three-link bodies: the velocity map, sweeps, optima, what
delta changes, the best motions."""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.integrate import cumulative_simpson

from colloc.gaits.harmonic import ellipse
from colloc.mechanics.balance import instant
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.verification.replay import replay
from scripts.models.ellipses import (
    BODY,
    ISOTROPIC,
    GaitGrid,
    distinct_maxima,
    gait_grid,
    largest_amplitude,
    performance,
)
from scripts.paper.study import Arrays, Context, parallel_map


def face(ratio: float, leading: int, nodes: np.ndarray, delta: float) -> np.ndarray:
    """Tail velocities ``(3, n, n)`` at all shapes, one rate being 1 and the other the ratio."""
    angles = np.stack(np.meshgrid(nodes, nodes, indexing="ij")).reshape(2, -1)
    rates = np.full_like(angles, ratio)
    rates[leading] = 1.0
    z = solve_balance(BODY, ISOTROPIC, angles, rates, delta).require().z
    return z.reshape(3, nodes.size, nodes.size)


def faces_needed(friction: Friction, delta: float) -> int:
    """Faces of the square of rates that a map needs: two, or four where reversed rates do not
    reverse the velocity."""
    angles, rates = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 2, 20))
    ahead, back = (
        solve_balance(BODY, friction, angles, side * rates, delta).require().z for side in (1, -1)
    )
    return 2 if np.allclose(back, -ahead, rtol=0, atol=1e-8) else 4


def connection(context: Context) -> Arrays:
    """The paper's "connection": velocities over shapes and ratios of rates, on two faces of the
    square of rates. They are homogeneous of degree 1 in the rates, and change signs with them."""
    settings = context.settings
    nodes = 2 * np.pi * np.arange(settings["angles"]) / settings["angles"] - np.pi
    ratios, faces = np.linspace(-1, 1, settings["ratios"]), list[np.ndarray]()
    for leading in (0, 1):
        solve = partial(face, leading=leading, nodes=nodes, delta=settings["delta"])
        rows = parallel_map(solve, list(ratios), processes=context.processes, label="velocity map")
        faces.append(np.stack(rows, axis=-1))
    needed = faces_needed(Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3), settings["delta"])
    return {"angles": nodes, "ratios": ratios, "z": np.stack(faces), "anisotropic_faces": needed}


def _grid_arrays(grid: GaitGrid) -> Arrays:
    return {"A0": grid.A0, "A1": grid.A1, "B1": grid.B1, "inside": grid.inside}


def sweep(context: Context) -> Arrays:
    """All admissible ellipses on a grid, and the error of a sample of them."""
    settings, delta = context.settings, context.settings["delta"]
    grid = gait_grid(np.pi / settings["steps"])
    measured = partial(performance, delta, processes=context.processes, label="sweep")
    instants = settings["instants"]
    done = measured(grid.gaits, instants)
    each = slice(None, None, settings["sample_every"])
    fine = measured(grid.gaits[:, each], 16 * instants)
    error = np.abs(done.efficiency[each] - fine.efficiency)
    result = _grid_arrays(grid) | {"sample_error": error}
    for name in ("distance", "work", "efficiency"):
        result[name] = grid.unflattened(getattr(done, name))
    return result


def plane(context: Context) -> Arrays:
    """The plane A0 = 0 on a finer grid, and the lines on which the paper expects no motion."""
    settings, instants = context.settings, context.settings["instants"]
    measured = partial(performance, settings["delta"], processes=context.processes, label="A0 = 0")
    grid = gait_grid(np.pi / settings["steps"], A0=np.zeros(1))
    done, result = measured(grid.gaits, instants), _grid_arrays(grid)
    for name in ("distance", "work", "efficiency"):
        result[name] = grid.unflattened(getattr(done, name))[0]
    # largest distance along the boundary, where it is attained
    angle = np.linspace(0, 0.5 * np.pi, settings["boundary"])
    around = np.stack([0 * angle, np.cos(angle), np.sin(angle)])
    rim = largest_amplitude(np.zeros_like(angle), angle) * around
    fine, coarse = (measured(rim, n * instants) for n in (8, 4))
    # second order: the finer rule has a third of the difference
    error = np.abs(fine.distance - coarse.distance) / 3
    result |= {"rim": rim, "rim_distance": fine.distance, "rim_distance_error": error}
    # W at fixed amplitude in all directions
    radii = np.linspace(0.25, 2.0, 8)
    work = [measured(r * around, instants).work for r in radii]
    return result | {"circle_radius": radii, "circle_work": np.array(work)}


def optima(context: Context) -> Arrays:
    """Local maxima of the efficiency, refined; the best gait at each A0 the paper names."""
    settings, delta, swept = context.settings, context.settings["delta"], context.needed["sweep"]
    gaits = np.stack(np.meshgrid(swept["A0"], swept["A1"], swept["B1"], indexing="ij"))
    maxima = distinct_maxima(delta, swept["efficiency"], gaits, settings["instants"])
    result = {
        "gaits": np.array([each.gait for each in maxima]),
        "position_error": np.array([each.position_error for each in maxima]),
        "at_contact": np.array([each.at_contact for each in maxima]),
        "relative_error": np.array([each.replay.error for each in maxima]),
        **{
            name: np.array([getattr(each.replay, name) for each in maxima])
            for name in ("distance", "work", "efficiency")
        },
    }
    # over directions and fractions of the boundary
    directions = np.linspace(0.02, 0.5 * np.pi - 0.02, settings["directions"])
    fractions, best = np.linspace(0.4, 1.0, settings["fractions"]), []
    d, f = (a.ravel() for a in np.meshgrid(directions, fractions, indexing="ij"))
    for A0 in settings["named_A0"]:
        amplitude, centre = f * largest_amplitude(np.full_like(d, A0), d), np.full_like(d, A0)
        line = np.stack([centre, amplitude * np.cos(d), amplitude * np.sin(d)])
        efficiency = performance(delta, line, 400).efficiency
        top = int(efficiency.argmax())
        best.append([*line[1:, top], efficiency[top]])
    return result | {"named_A0": np.array(settings["named_A0"]), "named_best": np.array(best)}


def _replayed(task: tuple[tuple[float, float, float], float]) -> tuple[float, float, float]:
    gait, delta = ellipse(*task[0]), task[1]
    done = replay(BODY, ISOTROPIC, lambda t: (gait.angles(t), gait.rates(t)), delta)
    return done.distance, done.work, done.efficiency


def delta_influence(context: Context) -> Arrays:
    """How distance, work and efficiency of the maxima, in their order, and of random gaits change
    with delta."""
    settings, swept = context.settings, context.needed["sweep"]
    grid = GaitGrid(*(swept[name] for name in ("A0", "A1", "B1", "inside")))
    chosen = np.random.default_rng(settings["seed"]).choice(
        grid.gaits.shape[1], settings["random"], replace=False
    )
    some = [gait for gait in grid.gaits[:, chosen].T if np.hypot(*gait[1:]) > 0.3]
    gaits = [tuple(gait) for gait in [*context.needed["optima"]["gaits"], *some]]
    tasks = [(gait, delta) for gait in gaits for delta in settings["deltas"]]
    rows = parallel_map(_replayed, tasks, processes=context.processes, label="influence of delta")
    values: np.ndarray = np.array(rows).reshape(len(gaits), len(settings["deltas"]), 3)
    deltas = np.array(settings["deltas"])
    return {"gaits": np.array(gaits), "deltas": deltas, "distance_work_efficiency": values}


def motions(context: Context) -> Arrays:
    """The two best gaits in detail: speeds of the link ends, and where they are in the lab frame
    with the displacement along +x (paper, section II, figure 12)."""
    settings, found = context.settings, context.needed["optima"]
    t, result = np.linspace(0.0, 1.0, settings["instants"] + 1), Arrays()
    for name, A0 in (("D", 0.0), ("F", 1.1)):
        index = int(np.argmin(np.abs(found["gaits"][:, 0] - A0)))
        gait = ellipse(*found["gaits"][index])
        angles, rates = gait.angles(t), gait.rates(t)
        z = solve_balance(BODY, ISOTROPIC, angles, rates, settings["delta"]).require().z
        velocity = instant(BODY, ISOTROPIC, angles, rates, z, settings["delta"]).velocity
        ends = np.hypot(velocity.vs, velocity.vn + 0.5 * BODY.length_column() * velocity.w)
        theta = cumulative_simpson(z[2], x=t, initial=0.0)
        rate = (z[0] + 1j * z[1]) * np.exp(1j * theta)
        x, y = cumulative_simpson(
            [rate.real, rate.imag], x=t, initial=0.0
        )  # SciPy 1.13: no complex
        tail = x + 1j * y
        x, y = BODY.joints(angles)
        lab = (tail + (x + 1j * y) * np.exp(1j * theta)) * np.exp(-1j * np.angle(tail[-1]))
        speeds = np.concatenate([np.hypot(z[:1], z[1:2]), ends])
        parts = {"t": t, "speeds": speeds, "x": lab.real, "y": lab.imag, "index": index}
        result |= {f"{name}/{key}": value for key, value in parts.items()}
    return result


def third_slowest_dips(t: np.ndarray, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Phases in (0, 1) at which the third slowest of four ends is locally slowest, and that speed;
    slowest first.

    At these instants two of three links are almost static.
    """
    third = np.sort(speeds, axis=0)[2]
    inner = np.flatnonzero((third[1:-1] < third[:-2]) & (third[1:-1] <= third[2:])) + 1
    order = inner[np.argsort(third[inner], kind="stable")]
    return t[order], third[order]


def worked_instant(context: Context) -> Arrays:
    """The instant of figure 3: angles 39 and -113 degrees, rates -0.56 and 1."""
    angles, rates = np.deg2rad([[39.0], [-113.0]]), np.array([[-0.56], [1.0]])
    deltas = np.array(context.settings["deltas"])
    z = [solve_balance(BODY, ISOTROPIC, angles, rates, d).require().z[:, 0] for d in deltas]
    return {"angles": angles[:, 0], "rates": rates[:, 0], "deltas": deltas, "z": np.array(z)}
