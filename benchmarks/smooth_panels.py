"""Smooth bodies: panels and order against error, adaptive panels, and the chain: python -m benchmarks --only smooth_panels

A sine wave (the paper's figure 5B) at five phases, isotropic and with mu_t = 100. The reference integrates position,
velocity, force, torque and power along the body as one ordinary differential equation with SciPy's DOP853 (tolerance 1e-13)
and finds the balance by Newton's method with difference quotients: no panels, no Gauss points.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.tables import cpu_seconds, markdown_table
from colloc import Chain, Friction, solve_balance
from colloc.mechanics.balance import instant, total_power
from colloc.pictures.style import BLUE, GREEN, ORANGE, VERMILION, save, styled, subplots
from colloc.smooth.balance import solve_smooth
from colloc.smooth.motion import Motion, sine_wave

PHASES = np.array([0.03, 0.11, 0.2, 0.31, 0.44])
MOTION = sine_wave()
ORDERS = {"4 nodes a panel": 4, "8 nodes a panel": 8, "12 nodes a panel": 12}
CHAIN, ADAPTIVE = "chain of links", "adaptive panels"
COLOURS = dict(zip((*ORDERS, CHAIN, ADAPTIVE), (ORANGE, BLUE, GREEN, "#999999", VERMILION), strict=True))
MARKERS = {CHAIN: "s", ADAPTIVE: "x"}


def loads(motion: Motion, friction: Friction, t: float, z: np.ndarray, delta: float) -> np.ndarray:
    """Net force, torque about the tail and power at phase t for tail velocity z, by integration along the body."""
    when = np.array([t])

    def field(f: Callable[[np.ndarray, np.ndarray], np.ndarray], s: float) -> float:
        return float(f(np.array([[s]]), when).item())

    turn = z[2] - field(motion.rate, 0.0)

    def along(s: float, state: np.ndarray) -> list[float]:
        x, y, vx, vy = state[:4]
        angle, w = field(motion.angle, s), field(motion.rate, s) + turn
        c, sn = np.cos(angle), np.sin(angle)
        vs, vn = vx * c + vy * sn, vy * c - vx * sn
        r = np.sqrt(vs * vs + vn * vn + delta * delta)
        fs, fn = -(friction.mu_f if vs > 0 else friction.mu_b) * vs / r, -friction.mu_t * vn / r
        fx, fy = fs * c - fn * sn, fs * sn + fn * c
        return [c, sn, -w * sn, w * c, fx, fy, x * fy - y * fx, -(fs * vs + fn * vn)]

    start = np.array([0.0, 0.0, z[0], z[1], 0.0, 0.0, 0.0, 0.0])
    return solve_ivp(along, (0, 1), start, method="DOP853", rtol=1e-13, atol=1e-14, max_step=0.02).y[4:, -1]


def reference_power(friction: Friction, delta: float) -> np.ndarray:
    """Power at the balance, ``(n_phase,)``, found from a coarse velocity by Newton's method on `loads`."""
    start = solve_smooth(MOTION, friction, PHASES, delta, quadrature_tolerance=1e-6).require()
    result = np.empty(PHASES.size)
    for k, t in enumerate(PHASES):
        # z of `solve_smooth` is relative to the frame of Theta; here rotation is that of the tail's tangent
        z = start.z[:, k] + [0, 0, MOTION.rate(np.zeros((1, 1)), PHASES[k : k + 1]).item()]
        for _ in range(3):
            here = loads(MOTION, friction, t, z, delta)
            h = 1e-4 * delta
            slope = np.array([(loads(MOTION, friction, t, z + h * e, delta) - here)[:3] / h for e in np.eye(3)]).T
            z = z - np.linalg.solve(slope, here[:3])
        result[k] = loads(MOTION, friction, t, z, delta)[3]
    return result


def chain_power(friction: Friction, delta: float, n: int) -> np.ndarray:
    """Power of a chain of n links whose directions are those of the curve at the links' middles."""
    s = ((np.arange(n) + 0.5) / n)[:, None] * np.ones((1, PHASES.size))
    body = Chain((1 / n,) * (n - 1) + (1 - (n - 1) / n,))
    angles, rates = np.diff(MOTION.angle(s, PHASES), axis=0), np.diff(MOTION.rate(s, PHASES), axis=0)
    solved = solve_balance(body, friction, angles, rates, delta).require()
    now = instant(body, friction, angles, rates, solved.z, delta)
    return total_power(now.velocity, now.force)[0]


def milliseconds(work: Callable[[], object]) -> float:
    """Processor time of a solve of all phases, an instant."""
    return 1e3 * cpu_seconds(work, 0.02) / PHASES.size


def report(quick: bool, folder: Path) -> str:
    """Relative error of the power against panels, order and tolerance, with time an instant; and a figure."""
    cases = [(Friction(), 1e-2), (Friction(100, 1, 1), 1e-3)]
    cases += [] if quick else [(Friction(), 1e-4)]
    panels = (4, 8, 16, 32) if quick else (2, 4, 8, 16, 32, 64)
    parts, curves = [], []
    for friction, delta in cases:
        exact = reference_power(friction, delta)

        def error(power: np.ndarray, exact: np.ndarray = exact) -> float:
            return float(np.max(np.abs(power / exact - 1)))

        solve = partial(solve_smooth, MOTION, friction, PHASES, delta)
        rows: list[list[object]] = []
        lines: dict[str, list[tuple[int, float]]] = {}
        for name, order in ORDERS.items():
            fixed = [partial(solve, panels=n, order=order, quadrature_tolerance=0.0) for n in panels]
            errors = [error(work().power) for work in fixed]
            lines[name] = [(n * order, e) for n, e in zip(panels, errors, strict=True)]
            rows.append([name, *errors, milliseconds(fixed[-1])])
        chains = [error(chain_power(friction, delta, 4 * n)) for n in panels]
        lines[CHAIN] = [(4 * n, e) for n, e in zip(panels, chains, strict=True)]
        rows.append(["chain, 4 links a panel", *chains, ""])
        adaptive: list[list[object]] = []
        lines[ADAPTIVE] = []
        for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
            work = partial(solve, quadrature_tolerance=tolerance)
            found = work()
            most, missed = int(found.panels.max()), error(found.power)
            adaptive.append([f"{tolerance:.0e}", missed, most, milliseconds(work)])
            lines[ADAPTIVE].append((8 * most, missed))
        title = f"({friction.mu_t:g}, {friction.mu_f:g}, {friction.mu_b:g}), delta = {delta:g}"
        header = ["uniform panels", *map(str, panels), "ms an instant, last"]
        text = markdown_table(["tolerance", "error", "panels", "ms an instant"], adaptive)
        parts.append(f"{title}: largest relative error of the power.\n\n{markdown_table(header, rows)}\n\nAdaptive:\n\n{text}")
        curves.append((title, lines))
    _figure(curves, folder)
    return "\n\n".join(parts)


def _figure(curves: list, folder: Path) -> None:
    with styled():
        figure, axes = subplots(1, len(curves), figsize=(3.1 * len(curves), 3.2), squeeze=False)
        for axis, (title, lines) in zip(axes[0], curves, strict=True):
            for name, points in lines.items():
                axis.loglog(*zip(*points, strict=True), color=COLOURS[name], marker=MARKERS.get(name, "o"), ms=4, label=name)
            axis.set(xlabel="nodes (or links) on the body", title=title)
            axis.set_xticks([10, 30, 100, 300], labels=["10", "30", "100", "300"])
            axis.minorticks_off()
        axes[0][0].set_ylabel("relative error of the power")
        axes[0][0].legend(fontsize=7)
        save(figure, folder / "smooth_panels")
