"""Do the stated errors of motions with inertia and of replays on slopes hold?

    python -m benchmarks.stated_errors --number 100 --seed 1 [--kind motions | slopes |
    certificates]

Random chains of 2 to 5 links, frictions, paces and smooth gaits, to random tolerances: played with
inertia as `colloc.replay` does, on slopes as a replay does, and measured with inertia as a
certificate does, at 1e-6. For distance, work, rotation and efficiency: how often the true error is
larger than the stated one, and how many times at most. The references are runs whose steps may err
a hundred times less than the least of these errors; they state none themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from benchmarks.tables import markdown_table
from colloc import Chain, Fourier, Friction, NotConvergedError, replay
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.regime import Regime
from colloc.results.checks import measure
from colloc.verification.differential_motion import GaitOnSlope, GaitWithInertia
from colloc.verification.replay import replayer
from scripts.program import command_line

FINER, LEAST = 1e-2, 1e-11
"""Error of the references' steps over the least of the errors that are stated, and the least:
rounding is larger."""
QUANTITIES = "distance", "work", "rotation", "efficiency"


class Case(NamedTuple):
    """A gait to be played, and how accurately."""

    body: Chain
    friction: Friction
    gait: Fourier
    delta: float
    froude: float
    grade: float
    tolerance: float


class Row(NamedTuple):
    """What is stated of the quantities, by how much it may be wrong, and what is true; ``(4,)``
    each."""

    values: np.ndarray
    errors: np.ndarray
    true: np.ndarray


def random_case(seed: int, number: int) -> Case:
    """Case `number`, which depends on that number and the seed alone."""
    rng = np.random.default_rng([seed, number])
    n = int(rng.integers(2, 6))
    lengths = rng.uniform(0.5, 1.5, n)
    lengths /= lengths.sum()
    mu = 10.0 ** rng.uniform(-1.5, 0.5) * np.exp(rng.normal(0.0, 0.5, 3) * (rng.random() < 0.7))
    order = int(rng.integers(1, 4))
    fading = 1.0 / np.arange(1, order + 1) ** 1.5
    cos, sin = rng.normal(0.0, rng.uniform(0.2, 0.9), (2, n - 1, order)) * fading
    gait = Fourier(rng.normal(0.0, 0.3, n - 1), cos, sin, theta=float(rng.uniform(-np.pi, np.pi)))
    delta, froude, tolerance = 10.0 ** rng.uniform([-3.5, -3.0, -6.0], [-1.5, 2.0, -3.0])
    grade = rng.uniform(0.02, 0.6) * float(mu.min())
    return Case(
        Chain(tuple(lengths)),
        Friction(**dict(zip(("mu_t", "mu_f", "mu_b"), map(float, mu), strict=True))),
        gait,
        delta,
        froude,
        grade,
        tolerance,
    )


def _row(values: Any, errors: Any, true: Any) -> Row:
    def four(period: Any) -> np.ndarray:
        return np.array([*(period[name] for name in QUANTITIES[:-1]), EFFICIENCY(period)])

    stated = [
        *(errors[name] for name in QUANTITIES[:-1]),
        EFFICIENCY.relative_error(values, errors) * abs(EFFICIENCY(values)),
    ]
    return Row(four(values), np.array(stated), four(true))


def _finer(errors: Any) -> float:
    return max(FINER * min(errors[name] for name in QUANTITIES[:-1]), LEAST)


def _true_motion(case: Case, near: np.ndarray, aim: float) -> dict[str, float]:
    """By Newton's method, until rounding hides how its steps become smaller."""
    played, before = GaitWithInertia(*case[:4], froude=case.froude, breaks=()), np.inf
    per_start = np.eye(3) - played.rough_period(near).slopes[:3]
    while True:
        states = played.run(near, aim).states
        step = np.linalg.solve(per_start, states[:3, -1] - near)
        if (size := np.abs(step).max()) < aim or size > 0.5 * before:
            return played.totals(states)
        near, before = near + step, size


def motion(case: Case) -> Row:
    """Played with inertia."""
    level = case._replace(gait=Fourier(case.gait.mean, case.gait.cos, case.gait.sin))
    ran = replay(*level[:4], froude=level.froude, tolerance=case.tolerance)
    return _row(ran.values, ran.errors, _true_motion(level, ran.states[:3, 0], _finer(ran.errors)))


def slope(case: Case) -> Row:
    """On a slope."""
    on = GaitOnSlope(*case[:4], Regime(grade=case.grade), ())
    ran = replayer(Regime(grade=case.grade))(*case[:4], tolerance=case.tolerance)
    states = on.integrate(np.array([case.gait.theta]), _finer(ran.errors), 1e-3).states
    theta, climb, _, spent, *_ = states[:, -1] - states[:, 0]
    return _row(
        ran.values,
        ran.errors,
        {"distance": climb, "work": spent + case.grade * climb, "rotation": theta},
    )


def certificate(case: Case) -> Row:
    """Measured as a certificate does."""
    level = case._replace(gait=Fourier(case.gait.mean, case.gait.cos, case.gait.sin))
    fine, known = measure(*level[:4], rotation=None, run=replayer(Regime(froude=case.froude)))
    played = GaitWithInertia(*level[:4], froude=case.froude, breaks=())
    start = played.momenta(fine.tail_velocity(np.zeros(1)))
    return _row(
        fine.values,
        {**fine.errors, **known.errors},
        _true_motion(level, start, _finer(fine.errors)),
    )


KINDS: dict[str, Callable[[Case], Row]] = {
    "motions": motion,
    "slopes": slope,
    "certificates": certificate,
}


def summary(rows: list[Row]) -> str:
    """A table of how often errors are exceeded, how many times at most, and stated over true ones
    in the median."""
    values, errors, true = (np.array(part) for part in zip(*rows, strict=True))
    off = np.abs(values - true)
    with np.errstate(divide="ignore"):
        times = off / errors
    table = [
        [
            name,
            str(len(rows)),
            str((times[:, k] > 1).sum()),
            f"{times[:, k].max():.2g}",
            f"{1 / np.median(times[:, k]):.2g}",
        ]
        for k, name in enumerate(QUANTITIES)
    ]
    some = int((times > 1).any(axis=1).sum())
    return markdown_table(
        ["quantity", "cases", "exceeded", "worst true / stated", "stated / true, median"], table
    ) + (f"\nany of them: {some} of {len(rows)}\n")


def main() -> None:
    options = command_line(__doc__, number=100, first=0, seed=1, kind=[*KINDS])
    for kind in options.kind or KINDS:
        rows, refused = [], 0
        for number in range(options.first, options.first + options.number):
            try:
                rows.append(KINDS[kind](random_case(options.seed, number)))
            except NotConvergedError:  # said, and no error stated
                refused += 1
                continue
            if (times := np.abs(rows[-1].values - rows[-1].true) / rows[-1].errors).max() > 1:
                print(f"  {kind} {number}: true / stated {times.round(2)}", flush=True)
        print(f"{kind}, {refused} not converged:\n\n{summary(rows)}", flush=True)


if __name__ == "__main__":
    main()
