"""Which gaits are one, by their symmetry images; and two results side by side.

With X(s, t) the position of the body, the following map motions in balance to motions in balance
with the same distance and work. All are statements about joint angles q_j, counted from the tail, n
of them:

- *phase*   q_j(t + a), for every body and friction.
- *mirror*  -q_j(t), for every body and friction.
- *reversal*  q_j(-t), if mu_b = mu_f: velocities and forces change sign.
- *swap*    -q_(n+1-j)(t), the body named from its other end, if it reads the same from there and
  mu_b = mu_f.
- *reversed swap*  -q_(n+1-j)(-t), if the body reads the same from both ends, for *every* friction:
  X(1 - s, -t) has the opposite tangent and the opposite velocity, so every link slides forwards
  where it did and all forces change sign.

The last one is why a gait of bilateral symmetry closes its rotation whatever mu_b / mu_f is: it is
its own image, and the image turns the other way.
"""

import json
from contextlib import suppress
from itertools import count, product

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.results.motion import PHASES
from colloc.results.robot import in_si
from colloc.results.solution import Solution
from colloc.system.errors import ProblemError

Rows = list[tuple[str, str, str]]


def compare(a: Solution, b: Solution) -> tuple[Rows, Rows]:
    """Numbers of two results, and fields in which their problems differ: name and both values."""
    fields = _rows(_fields(a), _fields(b))
    changes = [(name, _part(x, y), _part(y, x)) for name, x, y in fields if x != y]
    return _rows(_numbers(a), _numbers(b)), changes


def _part(text: str, other: str) -> str:
    at = next(k for k in count(0, 40) if text[k:][:40] != other[k:][:40])
    return "..." * (at > 0) + text[at:][:44]


def _rows(one: dict[str, str], two: dict[str, str]) -> Rows:
    return [(name, one.get(name, "-"), two.get(name, "-")) for name in {**one, **two}]


def _fields(solution: Solution) -> dict[str, str]:
    texts, problem = dict[str, str](), solution.problem
    for name, value in problem.to_dict().items():
        parts = value if isinstance(value, dict) and name != "guess" else {"": value}
        named_parts = ((f"{name} {part}".strip(), x) for part, x in parts.items() if x is not None)
        texts |= {part: json.dumps(x) for part, x in named_parts}
    texts["guess"] = f"moves by {_degrees(problem.guess)} deg"
    with suppress(ProblemError):
        if problem.with_(guess=None).hash == problem.hash:
            del texts["guess"]  # nobody stated it
    return texts


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
        names = f"{what.name} and {other.name}"
        if other.name == what.name:
            names = f"{what.name} with other weights (idle power: by the robot)"
        return False, f"other objectives: {names}."
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


SAME_VALUE, SAME_GAIT = 1e-3, 0.05
"""Relative difference of values and root-mean-square distance [rad] of gaits that are one; the
objective is flat at its maximum, so the path is the laxer."""


def reversed_in_time(gait: Fourier) -> Fourier:
    """Gait q(-t)."""
    return Fourier(gait.mean, gait.cos, -gait.sin)


def swap_ends(gait: Fourier, body: Body) -> Fourier:
    """Gait with tail and head exchanged: -q_(n+1-j)(t) for chains."""
    return Fourier(*(body.reversal @ rows for rows in (gait.mean, gait.cos, gait.sin)))


def images(gait: Fourier, body: Body, friction: Law) -> list[Fourier]:
    """All symmetry images of a gait, up to the start phase."""
    result = []
    for mirror, reversal, swap in product((False, True), repeat=3):
        if (swap and body.reversal is None) or (reversal != swap and not friction.reversible):
            continue
        image = gait.mirrored if mirror else gait
        image = reversed_in_time(image) if reversal else image
        result.append(swap_ends(image, body) if swap else image)
    return result


def phase_distance(a: Fourier, b: Fourier) -> float:
    """Root-mean-square distance [rad] of two closed paths of joint angles, at the best relative
    start phase."""
    n = max(a.n_harmonic, b.n_harmonic)
    a, b = a.resize(n), b.resize(n)
    k = np.arange(1, n + 1)
    # sum over joints of conj(a_k) b_k: shifting b by phase x multiplies it by exp(i k x)
    overlap = np.sum((a.cos + 1j * a.sin) * (b.cos - 1j * b.sin), axis=0)
    sampled = np.fft.ifft(np.append(0.0, overlap), 64 * n).real
    x = 2 * np.pi * np.argmax(sampled) / (64 * n)
    for _ in range(6):
        wave = overlap * np.exp(1j * k * x)
        slope, curvature = float((1j * k * wave).real.sum()), float(-(k**2 * wave).real.sum())
        if curvature >= 0:
            break
        x -= slope / curvature
    shift = np.exp(1j * k * x)
    difference = (a.cos - 1j * a.sin) - (b.cos - 1j * b.sin) * shift
    return float(np.sqrt(np.sum((a.mean - b.mean) ** 2) + 0.5 * np.sum(np.abs(difference) ** 2)))


def distance(a: Fourier, b: Fourier, body: Body, friction: Law) -> float:
    """Root-mean-square distance [rad] modulo start phase and symmetries."""
    return min(phase_distance(a, image) for image in images(b, body, friction))


def are_one(problem: Problem, a: tuple[float, Fourier], b: tuple[float, Fourier]) -> bool:
    """True if two gaits, each by its value and its path, are the same."""
    (one, path), (other, other_path) = a, b
    close = abs(one - other) <= SAME_VALUE * max(abs(one), abs(other))
    return close and distance(path, other_path, problem.body, problem.law) < SAME_GAIT


def series_class(problem: Problem) -> Harmonic:
    return problem.gait.series(16)


def fourier_series(problem: Problem, gait: AnyGait) -> Fourier:
    return series_class(problem).through(gait)
