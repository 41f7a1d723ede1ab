"""Part of the reproduction on concertina crawlers (figure 13)."""

from __future__ import annotations

from functools import partial

import numpy as np

from problems import concertina, concertina_anisotropic
from scripts.models.epsilon_study import (
    Crawler,
    EpsilonPoint,
    delta_for,
    epsilon_point,
    fitted_orders,
)
from scripts.models.smooth_record import snapshots
from scripts.paper.parallel import parallel_map
from scripts.paper.study import Arrays, Context

CRAWLERS = {
    "isotropic": Crawler.of(concertina.PROBLEM),
    "forward easiest": Crawler.of(concertina_anisotropic.PROBLEMS[0]),
    "transverse easiest": Crawler.of(concertina_anisotropic.PROBLEM),
}
"""The paper's crawler, one whose forward friction is smallest, and one with two bumps whose
transverse friction is."""

SHOWN = ("isotropic", "transverse easiest")


def _point(task: tuple[str, float], *, intervals: int) -> EpsilonPoint:
    name, epsilon = task
    return epsilon_point(
        CRAWLERS[name].with_(epsilon=epsilon, delta=delta_for(epsilon)), intervals=intervals
    )


def crawlers(context: Context) -> Arrays:
    """Distance, work inside and outside the bumps, and efficiency as epsilon falls; snapshots at
    the ends of stages."""
    settings = context.settings
    epsilons = settings["epsilons"]
    tasks = [(name, epsilon) for name in CRAWLERS for epsilon in epsilons]
    solve = partial(_point, intervals=settings["intervals"])
    points = parallel_map(solve, tasks, processes=context.processes, label="crawlers")
    result: Arrays = {"epsilon": np.array(epsilons)}
    for i, (name, crawler) in enumerate(CRAWLERS.items()):
        mine = points[i * len(epsilons) : (i + 1) * len(epsilons)]
        for key in ("delta", "d", "W_inner", "W_outer", "efficiency"):
            result[f"{name}/{key}"] = np.array([getattr(p, key) for p in mine])
        for key in ("d", "W_inner", "W_outer", "efficiency"):
            result[f"{name}/error_{key}"] = np.array([p.errors[key] for p in mine])
        small = [p for p in mine if p.epsilon <= settings["fit_below"]]
        for key, order in fitted_orders(small, crawler.bound).items():
            result[f"{name}/order/{key.replace('/', ' over ')}"] = order
        result[f"{name}/bound"] = crawler.bound
        if name not in SHOWN:
            continue
        shown = crawler.with_(epsilon=settings["shown"], delta=delta_for(settings["shown"]))
        made = snapshots(
            shown.body.prescribed(), shown.friction, shown.delta, settings["snapshots"], panels=200
        )
        result |= {f"{name}/t": made.t, f"{name}/x": made.x, f"{name}/y": made.y}
    return result
