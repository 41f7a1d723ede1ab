"""Concertina crawlers followed to small bumps, delta falling along: distance, work and efficiency
against epsilon, with fitted orders: python -m scripts.continue_epsilon [problem file]

The regularisation has to fall with epsilon, because the speeds of the bump do: ``delta = delta_0
(epsilon/epsilon_0)^2`` keeps delta over the bump's speed falling too (paper, section VI).
"""

from __future__ import annotations

import runpy
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from colloc.gaits.problem import Problem
from colloc.mechanics.friction import Friction
from colloc.smooth.smooth_body import Concertina
from scripts.models.period import Period, measured_period, period
from scripts.program import command_line

DELTA_0, EPSILON_0 = 1e-4, 0.2


@dataclass(frozen=True)
class Crawler:
    """A concertina crawler and the friction it crawls on, whose work inside the bumps' regions is
    told apart."""

    body: Concertina
    friction: Friction = Friction()
    delta: float = 1e-6
    name: str = "concertina"

    @classmethod
    def of(cls, problem: Problem) -> Crawler:
        """The crawler of a problem."""
        assert isinstance(problem.body, Concertina)
        assert isinstance(problem.friction, Friction)
        return cls(problem.body, problem.friction, problem.delta, problem.name)

    def with_(self, **changes: Any) -> Crawler:
        """A copy with some fields changed, also those of the body."""
        own = {
            field.name: changes.pop(field.name) for field in fields(self) if field.name in changes
        }
        return replace(self, **({"body": replace(self.body, **changes)} | own))

    @property
    def bound(self) -> float:
        """No body is more efficient than this (paper, eq. lambdaupper)."""
        return 1.0 / self.friction.smallest

    def period(self, **settings: Any) -> Period:
        """Distance and work of one period; settings as for `scripts.models.period.period`."""
        settings["regions"] = self.body.regions
        return period(self.body.prescribed(), self.friction, self.delta, **settings)

    def measured_period(self, **settings: Any) -> Period:
        """The same with an error estimate, see `scripts.models.period.measured_period`."""
        settings["regions"] = self.body.regions
        return measured_period(self.body.prescribed(), self.friction, self.delta, **settings)


@dataclass(frozen=True)
class EpsilonPoint:
    """A crawler at one epsilon; `errors` are for d, W_inner, W_outer and efficiency, see
    `epsilon_point`."""

    epsilon: float
    delta: float
    d: float
    W_inner: float
    W_outer: float
    efficiency: float
    errors: dict[str, float]
    largest_creep: float


def delta_for(epsilon: float, delta_0: float = DELTA_0, epsilon_0: float = EPSILON_0) -> float:
    """Regularisation speed that belongs to epsilon."""
    return delta_0 * (epsilon / epsilon_0) ** 2


def epsilon_point(crawler: Crawler, *, intervals: int = 2, **settings: Any) -> EpsilonPoint:
    """The crawler's period with an error bar.

    The error is the difference from half the intervals and a lower panel order, plus the difference
    from a computation at four times delta, which bounds what a further decrease of delta would
    change as long as that is at most half of it.
    """
    fine = crawler.measured_period(intervals=intervals, **settings)
    softer = crawler.with_(delta=4 * crawler.delta).period(
        intervals=max(1, intervals // 2), **settings
    )
    coarse = crawler.period(intervals=max(1, intervals // 2), **settings)
    names = {"d": "d", "W_inner": "W_inner", "W_outer": "W", "efficiency": "efficiency"}
    errors = {
        name: float(fine.errors[source] + abs(getattr(softer, name) - getattr(coarse, name)))
        for name, source in names.items()
    }
    values = fine.d, fine.W_inner, fine.W_outer, fine.efficiency
    creep = float(fine.nodes.slowest.max())
    return EpsilonPoint(crawler.body.epsilon, crawler.delta, *values, errors, creep)


def fitted_order(epsilon: Any, value: Any) -> float:
    """Exponent p of the power law ``value ~ epsilon^p``, by least squares on logarithms."""
    return float(np.polyfit(np.log(epsilon), np.log(value), 1)[0])


def fitted_orders(points: list[EpsilonPoint], bound: float) -> dict[str, float]:
    """Orders of d, W_inner, W_outer and of the efficiency's distance from its bound."""
    epsilon = [p.epsilon for p in points]
    return {
        "d": fitted_order(epsilon, [p.d for p in points]),
        "W_inner": fitted_order(epsilon, [p.W_inner for p in points]),
        "W_outer": fitted_order(epsilon, [p.W_outer for p in points]),
        "1 - efficiency/bound": fitted_order(epsilon, [1 - p.efficiency / bound for p in points]),
    }


def main() -> None:
    study = runpy.run_path(
        str(command_line(__doc__, ("file", Path("problems/concertina.py"))).file)
    )
    for crawler in map(Crawler.of, study.get("PROBLEMS", (study["PROBLEM"],))):
        points = [
            epsilon_point(crawler.with_(epsilon=e, delta=delta_for(e))) for e in study["EPSILONS"]
        ]
        print(f"\n{crawler.name}: {crawler.friction}, bound {crawler.bound:g}")
        print("  epsilon    delta            d      W_inner      W_outer  efficiency       +-")
        for p in points:
            print(
                f"{p.epsilon:9.4g} {p.delta:8.1e} {p.d:12.6e} {p.W_inner:12.6e} "
                f"{p.W_outer:12.6e} {p.efficiency:11.7f} {p.errors['efficiency']:8.1e}"
            )
        small = [p for p in points if p.epsilon <= 0.02]
        orders = fitted_orders(small, crawler.bound).items()
        fitted = ", ".join(f"{name} {order:.3f}" for name, order in orders)
        print(f"orders (epsilon <= 0.02): {fitted}")


if __name__ == "__main__":
    main()
