"""Parts of the reproduction that concern static friction: regions, worked and symmetric cases, the
flap body."""

from __future__ import annotations

from functools import partial

import numpy as np

from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from scripts.models.flap import FlapBody, axial_force, flap_gap, flap_motion
from scripts.models.static_friction import (
    SLOW,
    SYMMETRIC_CASES,
    WORKED_CASES,
    Case,
    at_rates,
    held_link,
    kinetic_gap,
    slowest_link,
    symmetric_balance,
)
from scripts.paper.parallel import parallel_map
from scripts.paper.study import Arrays, Context

BODY, ISOTROPIC = Chain(), Friction()


def _slice(
    ratio: float, leading: int, nodes: np.ndarray, delta: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slowest speed, slowest link and admissibility at all shapes, for one ratio of rates."""
    a1, a2 = (a.ravel() for a in np.meshgrid(nodes, nodes, indexing="ij"))
    angles, rates = np.stack([a1, a2]), np.empty((2, a1.size))
    rates[leading], rates[1 - leading] = 1.0, ratio
    z = solve_balance(BODY, ISOTROPIC, angles, rates, delta).require().z
    speed, link = slowest_link(BODY, ISOTROPIC, angles, rates, z, delta)
    shape = (nodes.size, nodes.size)
    return (
        speed.reshape(shape),
        link.reshape(shape),
        (crossing_depth(BODY, angles) < 1e-9).reshape(shape),
    )


def static(context: Context) -> Arrays:
    """Where a link is slower than 1e-3, for both leading rates; the worked and the symmetric cases
    as delta falls."""
    settings, delta = context.settings, context.settings["delta"]
    nodes = np.linspace(-np.pi, np.pi, settings["nodes"])
    ratios = np.linspace(-1, 1, settings["ratios"])
    result: Arrays = {"angles": nodes, "ratios": ratios, "threshold": SLOW, "delta": delta}
    for leading in (0, 1):
        solve = partial(_slice, leading=leading, nodes=nodes, delta=delta)
        rows = parallel_map(
            solve,
            list(ratios),
            processes=context.processes,
            label=f"static regions, rate {leading + 1} = 1",
        )
        speed, link, inside = (np.stack(a, axis=-1) for a in zip(*rows, strict=True))
        result |= {f"speed_{leading}": speed, f"link_{leading}": link}
    result["inside"] = inside[:, :, 0]
    rng = np.random.default_rng(settings["seed"])
    angles = rng.uniform(-np.pi, np.pi, (2, settings["samples"]))
    angles = angles[:, crossing_depth(BODY, angles) < 1e-9]
    rates = rng.uniform(-1, 1, angles.shape)
    rates /= np.abs(rates).max(axis=0)
    fractions = []
    for d in settings["deltas"]:
        z = solve_balance(BODY, ISOTROPIC, angles, rates, d).require().z
        fractions.append((slowest_link(BODY, ISOTROPIC, angles, rates, z, d)[0] < SLOW).mean())
    result |= {
        "fraction_deltas": np.array(settings["deltas"]),
        "fraction": np.array(fractions),
        "samples": angles.shape[1],
    }

    for figure, cases in (("worked", WORKED_CASES), ("symmetric", SYMMETRIC_CASES)):
        for case in cases:
            held = held_link(BODY, ISOTROPIC, case)
            z, _ = at_rates(BODY, ISOTROPIC, case, delta)
            key = f"{figure}/{case.name}"
            result |= {
                f"{key}/angles": np.array(case.angles),
                f"{key}/rates": np.array(case.rates),
                f"{key}/what": case.what,
                f"{key}/z": z[:, 0],
                f"{key}/delta": held.delta,
                f"{key}/link": held.link,
                f"{key}/speed": held.speed,
                f"{key}/density": held.density,
                f"{key}/couple": held.couple,
            }
    unknown = np.linspace(-1.0, 1.0, 401) * settings["reach"]
    result["symmetric_velocity"] = unknown
    for case in SYMMETRIC_CASES:
        result |= _gap_arrays(case, unknown, delta)
    return result


def _gap_arrays(case: Case, unknown: np.ndarray, delta: float) -> Arrays:
    gap = kinetic_gap(BODY, ISOTROPIC, case)
    key = f"symmetric/{case.name}"
    return {
        f"{key}/gap": np.array(gap),
        f"{key}/no_solution": gap.no_solution,
        f"{key}/unbalanced": symmetric_balance(BODY, ISOTROPIC, case, unknown, delta),
        f"{key}/kinetic": symmetric_balance(BODY, ISOTROPIC, case, unknown, 1e-12),
    }


def flap(context: Context) -> Arrays:
    """The flap body of figure 4: kinetic friction has no solution at any opening, and what delta
    gives."""
    settings = context.settings
    body = FlapBody(tuple(settings["lengths"]))
    openings = np.linspace(0.05, 0.5 * np.pi - 0.05, settings["openings"])
    gaps = [flap_gap(body, ISOTROPIC, o, 1.0) for o in openings]
    result: Arrays = {
        "lengths": np.array(body.lengths),
        "openings": openings,
        "gap": np.array(gaps),
        "no_solution": np.array([g.no_solution for g in gaps]),
    }
    deltas = np.array(settings["deltas"])
    angles, rates = flap_motion(openings, np.ones_like(openings))
    solved = [solve_balance(body, ISOTROPIC, angles, rates, d).require() for d in deltas]
    fraction = np.array([g.fraction for g in gaps])
    V = np.linspace(-2e-3, 2e-3, 801)
    result |= {
        "deltas": deltas,
        "V_over_delta": np.array([s.z[0] / d for s, d in zip(solved, deltas, strict=True)]),
        "sideways": np.array([np.abs(s.z[1:]).max() for s in solved]),
        "limit": fraction / np.sqrt(1 - fraction**2),
        "example": settings["example"],
        "example_V": V,
        "example_force": np.array(
            [axial_force(body, ISOTROPIC, settings["example"], 1.0, V, d) for d in (1e-4, 1e-12)]
        ),
    }
    return result
