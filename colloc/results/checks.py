"""Certificates: checks, and the numbers of the replay."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from colloc.gaits.objective import QUANTITIES
from colloc.gaits.period import Period

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
        """Part of the tolerance that is used."""
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
        return replace(
            self.with_samples(tuple(-error for error in self.of_samples)), of_samples=None
        )

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
