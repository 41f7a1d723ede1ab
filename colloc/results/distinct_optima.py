"""Symmetry images of gaits, and which gaits are one.

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

from __future__ import annotations

from itertools import product

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.problem import Problem
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law

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
    x = 2 * np.pi * np.arange(64 * n) / (64 * n)
    x = x[np.argmax((np.exp(1j * np.outer(x, k)) @ overlap).real)]
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


def are_one(a: tuple[float, Fourier], b: tuple[float, Fourier], body: Body, friction: Law) -> bool:
    """True if two gaits, each by its value and its path, are the same."""
    (one, path), (other, near) = a, b
    close = abs(one - other) <= SAME_VALUE * max(abs(one), abs(other))
    return close and distance(path, near, body, friction) < SAME_GAIT


def series_class(problem: Problem) -> Harmonic:
    return problem.gait.series(16)


def fourier_series(problem: Problem, gait: AnyGait) -> Fourier:
    return series_class(problem).through(gait)
