"""Certificates: checks, the numbers of the replay, and how a gait is measured by replays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from colloc.gaits.objective import EFFICIENCY, QUANTITIES, Objective, Period
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.verification.adaptive_motion import Path, Replay
from colloc.verification.replay import replay

BACKLASH = "backlash"
"""Name of the check that fails for a gait too small for the problem's robot."""


@dataclass(frozen=True)
class Check:
    """A line of a certificate: the measured value, the largest one allowed, and the meaning."""

    name: str
    value: float
    threshold: float
    meaning: str

    @property
    def passed(self) -> bool:
        return bool(np.isfinite(self.value) and abs(self.value) <= self.threshold)

    @property
    def share(self) -> float:
        """Part of the tolerance that is used, by which the summary (`summary.txt`) sorts."""
        return abs(self.value) / max(self.threshold, 1e-300)

    def line(self) -> str:
        return (
            f"{'ok ' if self.passed else 'NO '} {self.name:<21s} {self.value:9.1e}  (<= "
            f"{self.threshold:.0e})  {self.meaning}"
        )


@dataclass(frozen=True)
class Certificate(Period):
    """The verdict of an independent replay, with the quantities of the period at the solution's
    delta, and extrapolated to delta = 0 with the gait held fixed.

    Errors hold what refining the replay changes, what following another point of the body would
    (net rotation times the body's reach over the distance), and what the body's other balanced
    motions would, so that `others` is empty.
    """

    checks: tuple[Check, ...]
    instants: int  # of the replay in one period; 0 if there was none (see `UNCERTIFIED`)
    efficiency_error: float
    efficiency_at_zero_delta: float
    error_at_zero_delta: float
    value: float  # of the problem's objective
    value_error: float
    value_at_zero_delta: float
    value_error_at_zero_delta: float
    dry: tuple[float, float] | None = None  # bounds of the efficiency without any delta, if asked
    # parts of the errors of value, efficiency, distance and work due to samples of a gait
    of_samples: tuple[float, ...] | None = None

    def __repr__(self) -> str:
        if not self.replayed:
            return "<Certificate: nothing was replayed>"
        failed = ", ".join(check.name for check in self.failures)
        verdict = f"fails on {failed}" if failed else f"all {len(self.checks)} checks passed"
        return (
            f"<Certificate: {verdict}; d/W = {self.efficiency:.6g} +- {self.efficiency_error:.0e}>"
        )

    def __str__(self) -> str:
        return "\n".join(check.line() for check in self.checks)

    @property
    def replayed(self) -> bool:
        """False if there was no replay; then all numbers are NaN."""
        return bool(self.instants)

    @property
    def passed(self) -> bool:
        return all(check.passed for check in self.checks)

    @property
    def numbers(self) -> dict[str, float]:
        errors = {f"{name}_error": error for name, error in self.errors.items()}
        return {
            **self.values,
            **errors,
            "efficiency": self.efficiency,
            **{name: getattr(self, name) for name in NUMBERS},
        }

    def with_samples(self, errors: tuple[float, ...] | None) -> Certificate:
        """The certificate with errors of samples added to (value, efficiency, distance, work)."""
        if errors is None or not self.replayed:
            return self
        value, efficiency, *totals = errors
        pairs = zip(("distance", "work"), totals, strict=True)
        return replace(
            self,
            errors={**self.errors, **{name: self.errors[name] + error for name, error in pairs}},
            value_error=self.value_error + value,
            value_error_at_zero_delta=self.value_error_at_zero_delta + value,
            efficiency_error=self.efficiency_error + efficiency,
            error_at_zero_delta=self.error_at_zero_delta + efficiency,
            of_samples=errors,
        )

    @property
    def by_replay(self) -> Certificate:
        """The certificate with the errors of the replay alone."""
        if self.of_samples is None:
            return self
        errors = tuple(-error for error in self.of_samples)
        return replace(self.with_samples(errors), of_samples=None)

    def facts(self) -> dict[str, Any]:
        """Plain numbers (JSON)."""
        listed = {
            c.name: {"value": c.value, "threshold": c.threshold, "passed": c.passed}
            for c in self.checks
        }
        dry = {} if self.dry is None else {"dry_efficiency": list(self.dry)}
        samples = {} if self.of_samples is None else {"errors_of_samples": list(self.of_samples)}
        return self.numbers | dry | samples | {"passed": self.passed, "checks": listed}

    @property
    def failures(self) -> list[Check]:
        return [check for check in self.checks if not check.passed]

    @property
    def missed(self) -> str:
        """The values that fail, and what is allowed."""
        each = (f"{c.name} {c.value:.1e} (allowed {c.threshold:.0e})" for c in self.failures)
        return ", ".join(each)


NUMBERS = tuple(each.name for each in fields(Certificate) if each.type in ("int", "float"))
UNCERTIFIED = Certificate(
    values=dict.fromkeys(QUANTITIES, np.nan),
    errors=dict.fromkeys(("distance", "work"), np.nan),
    others={},
    checks=(
        Check(
            "replay", np.inf, 0.0, "not made, since the solve did not converge: nothing was checked"
        ),
    ),
    **(dict.fromkeys(NUMBERS, np.nan) | {"instants": 0}),  # type: ignore[arg-type]
)
"""Certificate of a solve that did not converge."""


PARTS_OF_DELTA = (1.0, 0.1, 0.01)
_DECADE = PARTS_OF_DELTA[1]
_SLOWEST = 0.9  # ratio of the two changes, at most, from which a limit is extrapolated
_FEWER = 4  # factor on the first instants of replays at smaller deltas


def extrapolated_limit(values: Sequence[float], errors: Sequence[float]) -> tuple[float, float]:
    """Limit for delta -> 0 of one gait's value, and its error, from its values at delta, delta/10
    and delta/100 and their own errors, ``(3,)``.

    Regularisation acts like c delta at leading order, so a ninth of the last change remains;
    sticking links act like delta log delta, and gaits of the size of delta like delta squared, with
    any signs. So the error is that ninth again; or more where the two changes fall off more slowly;
    and no less than what is left of a linear part of the first change that other parts hide in the
    second.
    """
    first, second = values[1] - values[0], values[2] - values[1]
    linear = _DECADE / (1 - _DECADE)
    falloff = min(abs(second) / max(abs(first), 1e-300), _SLOWEST)
    rest = max(max(linear, falloff / (1 - falloff)) * abs(second), linear * _DECADE * abs(first))
    error = (1 + linear) * errors[2] + linear * errors[1]
    return float(values[2] + linear * second), float(rest + error)


def measure(
    body: Body,
    friction: Law,
    path: Path,
    delta: float,
    *,
    objective: Objective = EFFICIENCY,
    rotation: float | None = 0.0,
    instants: int = 1600,
    run: Callable[..., Replay] = replay,
    **how: Any,
) -> tuple[Replay, Certificate]:
    """Measure a path by replays at delta, delta/10 and delta/100, given the prescribed rotation;
    other arguments are those of the replay `run`. The first replay, and a certificate without
    checks."""
    replays: list[Replay] = []
    smoothed = friction.regularised or any(each.depends_on_delta for each in objective.integrals)
    for part in PARTS_OF_DELTA if smoothed else PARTS_OF_DELTA[:1]:
        how |= {"objective": objective, "turn": rotation or 0.0, "instants": instants}
        if replays:
            how |= {"guess": replays[-1], "instants": max(2 * (instants // (2 * _FEWER)), 4)}
        replays.append(run(body, friction, path, part * delta, **how))
    fine, numbers = replays[0], dict[str, Any]()
    for name, of_limit, aim in (
        ("value", "value_error_at_zero_delta", objective),
        ("efficiency", "error_at_zero_delta", EFFICIENCY),
    ):
        values, errors = [aim(each.values) for each in replays], list[float]()
        for value, each in zip(values, replays, strict=True):
            shift = {"distance": astray(each, rotation)}
            error = each.error if aim == each.objective else each.error_of(aim)
            error += float(aim.relative_error(each.values, shift))
            errors.append(abs(value) * (error + each.ambiguity_of(aim)))
        limit = extrapolated_limit(values, errors) if smoothed else (values[0], errors[0])
        numbers[f"{name}_error"] = errors[0]
        numbers[f"{name}_at_zero_delta"], numbers[of_limit] = limit
    bounds = {name: fine.errors[name] + fine.others.get(name, 0.0) for name in ("distance", "work")}
    bounds["distance"] += astray(fine, rotation)
    numbers |= {"value": fine.value, "instants": fine.instants}
    return fine, Certificate(fine.values, bounds, others={}, checks=(), **numbers)


def astray(replayed: Replay, rotation: float | None) -> float:
    """Change of the distance with the point of the body that is followed, by rotation beyond the
    prescribed one."""
    return 0.0 if rotation is None else abs(replayed.rotation - rotation) * replayed.lever
