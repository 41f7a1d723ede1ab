"""What a certificate is: checks (what was measured, how much is allowed, what it means) and the numbers of the replay."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from colloc.gaits.objective import QUANTITIES


@dataclass(frozen=True)
class Check:
    """One line of a certificate: what was measured, the largest value allowed, and what it means."""

    name: str
    value: float
    threshold: float
    meaning: str

    @property
    def passed(self) -> bool:
        return bool(np.isfinite(self.value) and abs(self.value) <= self.threshold)

    def line(self) -> str:
        """For a terminal."""
        return (
            f"{'ok ' if self.passed else 'NO '} {self.name:<21s} {self.value:9.1e}  (<= {self.threshold:.0e})  {self.meaning}"
        )


_USUAL = {
    "value": "efficiency",
    "value_error": "efficiency_error",
    "value_at_zero_delta": "efficiency_at_zero_delta",
    "value_error_at_zero_delta": "error_at_zero_delta",
}


@dataclass(frozen=True)
class Certificate:
    """The verdict of an independent replay.

    Attributes
    ----------
    checks : tuple of Check
    efficiency, distance, work : float
        Of the replay, over one period, at the solution's delta.
    efficiency_error : float
        Error of that efficiency: what refining the replay changes, and what following another point of the body would
        (net rotation times the body's reach over the distance), and what the body's other balanced motions would, if any.
    efficiency_at_zero_delta : float
        Extrapolation of the replayed efficiency to delta = 0, with the gait held fixed.
    instants : int
        Instants of the replay in one period; 0 if there was none (see `UNCERTIFIED`).
    error_at_zero_delta : float
        Error of the extrapolation (`colloc.results.measured.extrapolated_limit`); NaN if an older file does not state it.
    distance_error, work_error : float
        The same of distance and work; NaN if an older file does not state it.
    value, value_error, value_at_zero_delta, value_error_at_zero_delta : float
        The same as of the efficiency, of the problem's objective; by default the efficiency's.
    rotation, length, driven_work : float
        Net rotation, and length of the path in shape space, of the period [rad]; work of the actuators where none takes energy
        back. NaN if an older file does not state it, or nobody asked.
    """

    checks: tuple[Check, ...]
    efficiency: float
    distance: float
    work: float
    efficiency_error: float
    efficiency_at_zero_delta: float
    instants: int
    error_at_zero_delta: float = float("nan")
    distance_error: float = float("nan")
    work_error: float = float("nan")
    value: float = float("nan")
    value_error: float = float("nan")
    value_at_zero_delta: float = float("nan")
    value_error_at_zero_delta: float = float("nan")
    rotation: float = float("nan")
    length: float = float("nan")
    driven_work: float = field(default=float("nan"), compare=False)

    def __post_init__(self) -> None:
        for name, usual in _USUAL.items():
            if np.isnan(getattr(self, name)):
                object.__setattr__(self, name, getattr(self, usual))

    def __repr__(self) -> str:
        if not self.replayed:
            return "<Certificate: nothing was replayed>"
        failed = ", ".join(check.name for check in self.failures)
        verdict = f"fails on {failed}" if failed else f"all {len(self.checks)} checks hold"
        return f"<Certificate: {verdict}; d/W = {self.efficiency:.6g} +- {self.efficiency_error:.0e}>"

    def __str__(self) -> str:
        return "\n".join(check.line() for check in self.checks)

    @property
    def period(self) -> dict[str, float]:
        """What the replayed period comes to, by the names of `colloc.gaits.objective.QUANTITIES`."""
        return {name: getattr(self, name) for name in QUANTITIES}

    @property
    def replayed(self) -> bool:
        """Whether there was a replay at all; if not, all numbers are NaN."""
        return bool(self.instants)

    @property
    def passed(self) -> bool:
        return all(check.passed for check in self.checks)

    def facts(self) -> dict[str, Any]:
        """All of it as plain numbers (JSON); what was not measured is left out."""
        numbers = {each.name: getattr(self, each.name) for each in fields(self) if each.name != "checks"}
        listed = {c.name: {"value": c.value, "threshold": c.threshold, "passed": c.passed} for c in self.checks}
        return {name: value for name, value in numbers.items() if not np.isnan(value)} | {
            "passed": self.passed,
            "checks": listed,
        }

    @property
    def failures(self) -> list[Check]:
        return [check for check in self.checks if not check.passed]


UNCERTIFIED = Certificate(
    (Check("replay", np.inf, 0.0, "not made, since the solve did not converge: nothing was checked"),),
    instants=0,
    **{each.name: np.nan for each in fields(Certificate) if each.name not in ("checks", "instants")},
)
"""Of a solve that did not converge: it fails, and says that nothing was checked."""
