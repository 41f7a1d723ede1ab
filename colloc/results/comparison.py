"""Two results side by side: whether they are one optimum, their numbers, and what their problems
differ in."""

from __future__ import annotations

import json

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.objective import EFFICIENCY
from colloc.results.distinct_optima import SAME_GAIT, SAME_VALUE, distance, fourier_series
from colloc.results.motion import PHASES
from colloc.results.robot import in_si
from colloc.results.solution import Solution

Rows = list[tuple[str, str, str]]


def compare(a: Solution, b: Solution) -> tuple[Rows, Rows]:
    """Numbers of two results, and fields in which their problems differ: name and both values."""
    fields = _rows(_fields(a), _fields(b))
    changes = [(name, f"{x:.44}", f"{y:.44}") for name, x, y in fields if x != y]
    return _rows(_numbers(a), _numbers(b)), changes


def _rows(one: dict[str, str], two: dict[str, str]) -> Rows:
    return [(name, one.get(name, "-"), two.get(name, "-")) for name in {**one, **two}]


def _fields(solution: Solution) -> dict[str, str]:
    texts: dict[str, str] = {}
    for name, value in solution.problem.to_dict().items():
        parts = value if isinstance(value, dict) and name != "guess" else {"": value}
        texts |= {f"{name} {part}".strip(): json.dumps(x) for part, x in parts.items()}
    return texts | {"guess": f"moves by {_degrees(solution.problem.guess)} deg"}


def _degrees(gait: AnyGait) -> str:
    return ", ".join(f"{x:.0f}" for x in np.degrees(np.ptp(gait.motor_gait.angles(PHASES), axis=1)))


def _numbers(solution: Solution) -> dict[str, str]:
    answer, certificate, measured = solution.answer, solution.certificate, solution.measured
    replayed, si = certificate.replayed, in_si(solution)
    error = f" +- {certificate.efficiency_error:.0e}" if replayed else " (not replayed)"
    numbers = {
        "status": solution.status,
        "objective": solution.problem.objective.name,
        "value": f"{measured.value:.6f}",
        "  error": f"{certificate.value_error:.0e}" if replayed else "-",
        "efficiency": f"{measured.efficiency:.6f}{error}",
        "  at delta -> 0": f"{certificate.efficiency_at_zero_delta:.6f}" if replayed else "-",
        "distance d": f"{measured.distance:.6f}",
        "work W": f"{measured.work:.6f}",
    }
    if si:
        numbers["speed [cm/s]"] = f"{100 * si['speed_m_per_s']:.4g}"
    if "energy_J_per_m" in si:
        numbers["energy [J/m]"] = f"{si['energy_J_per_m']:.4g}"
    return numbers | {
        "moves by [deg]": _degrees(solution.gait),
        "delta": f"{answer.delta:.1e}",
        "intervals": str(answer.edges.size - 1),
        "iterations": str(sum(step.iterations for step in solution.history)),
        "seconds": f"{solution.seconds:.1f}",
    }


def gait_distance(a: Solution, b: Solution) -> float | None:
    """R.m.s. distance [rad] of two gaits of a body, minimised over phase and symmetries."""
    if a.problem.body != b.problem.body:
        return None
    law = b.problem.law if a.problem.law.reversible else a.problem.law
    first, second = (fourier_series(each.problem, each.gait) for each in (a, b))
    return distance(first, second, a.problem.body, law)


def verdict(a: Solution, b: Solution) -> tuple[bool, str]:
    """True if two results are the same optimum, and a sentence."""
    what, other = a.problem.objective, b.problem.objective
    if other != what:
        return False, f"other objectives: {what.name} and {other.name}."
    values = [each.measured.value for each in (a, b)]
    difference = abs(values[0] - values[1]) / max(*map(abs, values), 1e-300)
    values_of = "efficiencies" if what == EFFICIENCY else f"values of {what.name}"
    differ = f"{values_of} differ by {100 * difference:.3g} %"
    apart = gait_distance(a, b)
    if apart is None:
        return False, f"other bodies; {differ}."
    same = difference <= SAME_VALUE and apart < SAME_GAIT
    angles = f"joint angles by {apart:.3g} rad (root mean square)"
    return same, f"{'the same optimum' if same else 'different'}: {differ}, {angles}."
