"""A gait's motion in the lab frame, sampled over one period: where the joints and ends are, and how
fast they move."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_simpson

from colloc.mechanics.balance import instant
from colloc.mechanics.chain import Chain
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.verification.adaptive_motion import Path


class Record(NamedTuple):
    """A motion, with the net displacement along +x."""

    t: np.ndarray
    x: np.ndarray
    y: np.ndarray
    speeds: np.ndarray


def record(
    body: Chain, friction: Friction, path: Path, delta: float, instants: int = 2000
) -> Record:
    """Solve and integrate a gait over one period on `instants` + 1 phases (paper, section II)."""
    t = np.linspace(0.0, 1.0, instants + 1)
    angles, rates = path(t)
    z = solve_balance(body, friction, angles, rates, delta).require().z
    velocity = instant(body, friction, angles, rates, z, delta).velocity
    half = 0.5 * body.length_column() * velocity.w
    ends = np.hypot(velocity.vs, velocity.vn + half)
    speeds = np.concatenate([np.hypot(z[:1], z[1:2]), ends])

    theta = cumulative_simpson(z[2], x=t, initial=0.0)
    rate = (z[0] + 1j * z[1]) * np.exp(1j * theta)
    tail = cumulative_simpson(rate.real, x=t, initial=0.0) + 1j * cumulative_simpson(
        rate.imag, x=t, initial=0.0
    )
    x, y = body.joints(angles)
    lab = (tail + (x + 1j * y) * np.exp(1j * theta)) * np.exp(-1j * np.angle(tail[-1]))
    return Record(t, lab.real, lab.imag, speeds)


def third_slowest_dips(t: np.ndarray, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Phases in (0, 1) at which the third slowest of four ends is locally slowest, and that speed;
    slowest first.

    At these instants two of three links are almost static.
    """
    third = np.sort(speeds, axis=0)[2]
    inner = np.flatnonzero((third[1:-1] < third[:-2]) & (third[1:-1] <= third[2:])) + 1
    order = inner[np.argsort(third[inner], kind="stable")]
    return t[order], third[order]
