"""Parts of the reproduction that concern static friction (figures 4, 9, 10), travelling and
standing waves (5, 6), and concertina crawlers (13)."""

from __future__ import annotations

from functools import partial

import numpy as np

from colloc.mechanics.contact import crossing_depth
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.smooth.smooth_body import Wave
from problems import concertina, concertina_anisotropic
from scripts.continue_epsilon import Crawler, EpsilonPoint, delta_for, epsilon_point, fitted_orders
from scripts.models.period import measured_period, snapshots
from scripts.models.static_friction import (
    BODY,
    ISOTROPIC,
    SLOW,
    SYMMETRIC_CASES,
    WORKED_CASES,
    FlapBody,
    axial_force,
    flap_gap,
    flap_motion,
    held_link,
    kinetic_gap,
    slowest_link,
    symmetric_balance,
)
from scripts.paper.study import Arrays, Context, parallel_map

_CORNERS, _SINE = Wave("tanh", 1.3, 2.0), Wave()
WAVES = {
    "5A": (_CORNERS, Friction(mu_t=1, mu_f=100, mu_b=100)),
    "5B": (_SINE, Friction(mu_t=100, mu_f=1, mu_b=1)),
    "6A": (_CORNERS, ISOTROPIC),
    "6B": (_SINE, ISOTROPIC),
    "6C": (Wave("standing"), ISOTROPIC),
}
CRAWLERS = {
    "isotropic": Crawler.of(concertina.PROBLEM),
    "forward easiest": Crawler.of(concertina_anisotropic.PROBLEMS[0]),
    "transverse easiest": Crawler.of(concertina_anisotropic.PROBLEM),
}
"""The paper's crawler, one whose forward friction is smallest, and one with two bumps whose
transverse friction is."""
SHOWN = ("isotropic", "transverse easiest")


def _slice(
    ratio: float, leading: int, nodes: np.ndarray, delta: float
) -> tuple[np.ndarray, np.ndarray]:
    """Slowest speed and slowest link at all shapes, for one ratio of rates."""
    angles = np.stack(np.meshgrid(nodes, nodes, indexing="ij")).reshape(2, -1)
    rates = np.full_like(angles, ratio)
    rates[leading] = 1.0
    speed, link = slowest_link(angles, rates, delta)
    return speed.reshape(nodes.size, -1), link.reshape(nodes.size, -1)


def static(context: Context) -> Arrays:
    """Where a link is slower than 1e-3, for both leading rates; the worked and the symmetric cases
    as delta falls."""
    settings, delta = context.settings, context.settings["delta"]
    nodes = np.linspace(-np.pi, np.pi, settings["nodes"])
    ratios = np.linspace(-1, 1, settings["ratios"])
    result: Arrays = {"angles": nodes, "ratios": ratios, "threshold": SLOW, "delta": delta}
    for leading in (0, 1):
        solve = partial(_slice, leading=leading, nodes=nodes, delta=delta)
        label = f"static regions, rate {leading + 1} = 1"
        slices = parallel_map(solve, list(ratios), processes=context.processes, label=label)
        speed, link = zip(*slices, strict=True)
        result |= {f"speed_{leading}": np.stack(speed, -1), f"link_{leading}": np.stack(link, -1)}
    rng = np.random.default_rng(settings["seed"])
    angles = rng.uniform(-np.pi, np.pi, (2, settings["samples"]))
    angles = angles[:, crossing_depth(BODY, angles) < 1e-9]
    rates = rng.uniform(-1, 1, angles.shape)
    rates /= np.abs(rates).max(axis=0)
    slow = [(slowest_link(angles, rates, d)[0] < SLOW).mean() for d in settings["deltas"]]
    result |= {"fraction_deltas": np.array(settings["deltas"]), "fraction": np.array(slow)}
    result["samples"] = angles.shape[1]
    for figure, cases in (("worked", WORKED_CASES), ("symmetric", SYMMETRIC_CASES)):
        for case in cases:
            each = held_link(case)._asdict() | {"z": held_link(case, (delta,)).z[0]}
            each |= {"angles": np.array(case.angles), "rates": np.array(case.rates)}
            result |= {f"{figure}/{case.name}/{key}": value for key, value in each.items()}
    unknown = result["symmetric_velocity"] = np.linspace(-1.0, 1.0, 401) * settings["reach"]
    for case in SYMMETRIC_CASES:
        gap, key = kinetic_gap(case), f"symmetric/{case.name}"
        result |= {f"{key}/gap": np.array(gap), f"{key}/no_solution": gap.no_solution}
        for name, d in (("unbalanced", delta), ("kinetic", 1e-12)):
            result[f"{key}/{name}"] = symmetric_balance(case, unknown, d)
    return result


def flap(context: Context) -> Arrays:
    """The flap body of figure 4: kinetic friction has no solution at any opening, and what delta
    gives."""
    settings = context.settings
    body, deltas = FlapBody(tuple(settings["lengths"])), np.array(settings["deltas"])
    openings = np.linspace(0.05, 0.5 * np.pi - 0.05, settings["openings"])
    gaps = [flap_gap(body, opening) for opening in openings]
    z = [solve_balance(body, ISOTROPIC, *flap_motion(openings), d).require().z for d in deltas]
    fraction, V = np.array([gap.fraction for gap in gaps]), np.linspace(-2e-3, 2e-3, 801)
    force = [axial_force(body, settings["example"], V, d) for d in (1e-4, 1e-12)]
    return {
        "lengths": np.array(body.lengths),
        "openings": openings,
        "gap": np.array(gaps),
        "no_solution": np.array([gap.no_solution for gap in gaps]),
        "deltas": deltas,
        "V_over_delta": np.array([each[0] / d for each, d in zip(z, deltas, strict=True)]),
        "limit": fraction / np.sqrt(1 - fraction**2),
        "example": settings["example"],
        "example_V": V,
        "example_force": np.array(force),
    }


def _wave(task: tuple[str, int], delta: float, count: int) -> Arrays:
    """Distance, work and efficiency of a wave, with errors, and snapshots."""
    name, intervals = task
    wave, friction = WAVES[name]
    motion = wave.prescribed()
    made = measured_period(motion, friction, delta, intervals=intervals)
    result = {"distance": made.d, "work": made.W, "efficiency": made.efficiency}
    errors = np.array([made.errors[key] for key in ("d", "W", "efficiency")])
    return result | {"errors": errors} | snapshots(motion, friction, delta, count)._asdict()


def waves(context: Context) -> Arrays:
    settings = context.settings
    solve = partial(_wave, delta=settings["delta"], count=settings["snapshots"])
    tasks = [
        (name, settings["intervals"].get(name, settings["default_intervals"])) for name in WAVES
    ]
    rows = parallel_map(solve, tasks, processes=context.processes, label="waves")
    pairs = zip(WAVES, rows, strict=True)
    return {f"{name}/{key}": value for name, row in pairs for key, value in row.items()}


def _point(task: tuple[str, float], *, intervals: int) -> EpsilonPoint:
    name, epsilon = task
    crawler = CRAWLERS[name].with_(epsilon=epsilon, delta=delta_for(epsilon))
    return epsilon_point(crawler, intervals=intervals)


def crawlers(context: Context) -> Arrays:
    """Distance, work inside and outside the bumps, and efficiency as epsilon falls; snapshots at
    the ends of stages."""
    settings, epsilons = context.settings, context.settings["epsilons"]
    tasks = [(name, epsilon) for name in CRAWLERS for epsilon in epsilons]
    solve = partial(_point, intervals=settings["intervals"])
    points = parallel_map(solve, tasks, processes=context.processes, label="crawlers")
    result: Arrays = {"epsilon": np.array(epsilons)}
    for i, (name, crawler) in enumerate(CRAWLERS.items()):
        mine = points[i * len(epsilons) : (i + 1) * len(epsilons)]
        for key in ("d", "W_inner", "W_outer", "efficiency"):
            result[f"{name}/{key}"] = np.array([getattr(p, key) for p in mine])
            result[f"{name}/error_{key}"] = np.array([p.errors[key] for p in mine])
        small = [p for p in mine if p.epsilon <= settings["fit_below"]]
        for key, order in fitted_orders(small, crawler.bound).items():
            result[f"{name}/order/{key.replace('/', ' over ')}"] = order
        result[f"{name}/bound"] = crawler.bound
        if name in SHOWN:
            shown = crawler.with_(epsilon=settings["shown"], delta=delta_for(settings["shown"]))
            motion, count = shown.body.prescribed(), settings["snapshots"]
            made = snapshots(motion, shown.friction, shown.delta, count, panels=200)
            result |= {f"{name}/{key}": value for key, value in made._asdict().items()}
    return result
