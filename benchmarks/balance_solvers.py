"""Solvers of the balance: solves per second on one core against residual: python -m benchmarks --only balance_solvers

Compared are `colloc.solve_balance` (damped Newton with safeguards), its two ingredients alone (undamped choices:
"newton", and the paper's "fixed point", batched over instants like ours), and scipy.optimize.root called once an instant
on a residual with 12 Gauss points a link, as a newcomer would write it. Only instants that reach the residual asked for
count as solved. Velocities are held against 40-digit Newton iterations on textbook antiderivatives.
"""

from __future__ import annotations

import time
from pathlib import Path

import mpmath as mp
import numpy as np
from scipy.optimize import root

from benchmarks.reference import balanced_velocity
from benchmarks.tables import markdown_table
from colloc import Chain, Friction, solve_balance
from colloc.pictures.style import BLUE, GREEN, ORANGE, VERMILION, save, styled, subplots

BODY = Chain()
LAWS = ((1, 1, 1), (1.7, 1, 1.3), (10, 1, 1), (0.5, 1, 5))
OURS, NEWTON, FIXED, ROOT = "solve_balance", "Newton alone", "fixed point alone", "scipy root loop"
METHOD = {OURS: "auto", NEWTON: "newton", FIXED: "fixed_point"}
COLOUR = {OURS: BLUE, NEWTON: GREEN, FIXED: ORANGE, ROOT: VERMILION}
MARKER = {OURS: "o", NEWTON: "^", FIXED: "s", ROOT: "x"}
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


def random_instants(count: int, seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Angles over all of shape space and rates with the larger one 1."""
    rng = np.random.default_rng(seed)
    angles, rates = rng.uniform(-np.pi, np.pi, (2, count)), rng.uniform(-1, 1, (2, count))
    return angles, rates / np.abs(rates).max(axis=0)


def newcomers_residual(z: np.ndarray, angles: np.ndarray, rates: np.ndarray, delta: float, law: tuple) -> np.ndarray:
    """Force and torque of a three-link body about its tail, by a loop over links with 12 Gauss points each."""
    mu_t, mu_f, mu_b = law
    x = y = phi = 0.0
    vx, vy, w = z
    total = np.zeros(3)
    for link in range(3):
        if link:
            phi, w = phi + angles[link - 1], w + rates[link - 1]
        c, s = np.cos(phi), np.sin(phi)
        r = (_NODES + 1) / 6
        px, py = x + r * c, y + r * s
        ux, uy = vx - w * r * s, vy + w * r * c
        along, across = ux * c + uy * s, uy * c - ux * s
        speed = np.sqrt(along**2 + across**2 + delta**2)
        fs = -np.where(along > 0, mu_f, mu_b) * along / speed * _WEIGHTS / 6
        fn = -mu_t * across / speed * _WEIGHTS / 6
        fx, fy = fs * c - fn * s, fs * s + fn * c
        total += [fx.sum(), fy.sum(), (px * fy - py * fx).sum()]
        x, y = x + c / 3, y + s / 3
        vx, vy = vx - w * s / 3, vy + w * c / 3
    return total


def root_loop(angles: np.ndarray, rates: np.ndarray, delta: float, law: tuple, tolerance: float) -> np.ndarray:
    """Residual that scipy.optimize.root (hybrid Powell) reaches at each instant from rest, ``(n_time,)``."""
    residual = np.empty(angles.shape[1])
    for k in range(residual.size):
        found = root(newcomers_residual, np.zeros(3), args=(angles[:, k], rates[:, k], delta, law), tol=tolerance)
        residual[k] = np.abs(found.fun).max() / max(law)
    return residual


def measured(name: str, law: tuple, delta: float, tolerance: float, count: int) -> tuple[float, float, float]:
    """Solved instants per second of processor time, the share solved, and the largest residual of those."""
    angles, rates = random_instants(count)
    begin = time.process_time()
    if name == ROOT:
        residual = root_loop(angles, rates, delta, law, 0.1 * tolerance)
    else:
        solved = solve_balance(
            BODY, Friction(*law), angles, rates, delta, tolerance=tolerance, method=METHOD[name], max_iterations=2000
        )
        residual = solved.residual
    spent = time.process_time() - begin
    good = residual <= tolerance
    return float(good.sum() / spent), float(good.mean()), float(residual[good].max(initial=0.0))


def velocity_error(law: tuple, delta: float, tolerance: float, count: int) -> float:
    """Largest error of the anchor's velocity over some instants, against 40 digits."""
    angles, rates = random_instants(count)
    solved = solve_balance(BODY, Friction(*law), angles, rates, delta, tolerance=tolerance)
    worst = 0.0
    for k in range(count):
        anchor, z = int(solved.anchor[k]), solved.anchor_velocity[:, k].tolist()
        exact = balanced_velocity(BODY.lengths, law, angles[:, k].tolist(), rates[:, k].tolist(), delta, anchor, z)
        worst = max(worst, *(abs(float(e - mp.mpf(v))) for e, v in zip(exact, z, strict=True)))
    return worst


def batch_sizes(quick: bool) -> str:
    """How the cost of an instant falls with the size of the batch."""
    rows = []
    for count in (1, 10, 100, 1000) if quick else (1, 10, 100, 1000, 10_000):
        repeats = max(1, 2000 // count)
        angles, rates = random_instants(count)
        begin = time.process_time()
        for _ in range(repeats):
            solve_balance(BODY, Friction(), angles, rates, 1e-4, tolerance=1e-9)
        rows.append([count, (count * repeats) / (time.process_time() - begin)])
    single = measured(ROOT, (1, 1, 1), 1e-4, 1e-9, 100)[0]
    text = markdown_table(["instants at once", "solves per second"], rows)
    return f"{text}\n\nscipy.optimize.root, one at a time: {single:.3g} solves per second."


def report(quick: bool, folder: Path) -> str:
    """Solves per second at residual 1e-9 over delta and friction; against residual; accuracy; batch sizes."""
    deltas = [10.0**-k for k in ((1, 4, 8, 12) if quick else (1, 2, 4, 6, 8, 12))]
    laws = LAWS[:2] if quick else LAWS
    names = (OURS, NEWTON, FIXED, ROOT)
    batch = 200 if quick else 300
    counts = {OURS: batch, NEWTON: batch, FIXED: batch, ROOT: 20}
    rows: list[list[object]] = []
    ratios: dict[str, list[float]] = {ROOT: [], FIXED: []}
    for law in laws:
        for delta in deltas:
            found = {name: measured(name, law, delta, 1e-9, counts[name]) for name in names}
            faster = {n: found[OURS][0] / found[n][0] for n in ratios if found[n][0]}
            rows.append([law, f"{delta:.0e}", *(f"{found[n][0]:.3g} ({found[n][1]:.0%})" for n in names)])
            rows[-1] += [faster.get(n, "none solved") for n in ratios]
            if delta == 1e-4:
                for n, ratio in faster.items():
                    ratios[n].append(ratio)
    header = ["friction (t, f, b)", "delta", *names, "ours / root", "ours / fixed point"]
    parts = ["Solved instants per second to a residual of 1e-9 (share solved):\n\n" + markdown_table(header, rows)]
    curves = {
        (name, delta): [measured(name, (1, 1, 1), delta, tol, counts[name]) for tol in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)]
        for name in names
        for delta in ((1e-4,) if quick else (1e-2, 1e-4, 1e-8))
    }
    _figure(curves, folder)
    accuracy = [
        [law, f"{delta:.0e}", *(velocity_error(law, delta, tol, 8 if quick else 15) for tol in (1e-5, 1e-8, 1e-11))]
        for law in laws
        for delta in ((1e-4, 1e-12) if quick else (1e-1, 1e-4, 1e-8, 1e-12))
    ]
    header = ["friction (t, f, b)", "delta", "tolerance 1e-5", "1e-8", "1e-11"]
    parts.append("Largest error of the velocity against 40 digits:\n\n" + markdown_table(header, accuracy))
    parts.append("Isotropic, delta = 1e-4, residual 1e-9:\n\n" + batch_sizes(quick))
    targets = ", ".join(f"{min(values):.0f} to {max(values):.0f} times the {name}" for name, values in ratios.items() if values)
    parts.append(f"At delta = 1e-4 in batches of {batch}: {targets} (targets: 20 times root, 5 times the fixed point).")
    return "\n\n".join(parts)


def _figure(curves: dict, folder: Path) -> None:
    deltas = sorted({delta for _, delta in curves}, reverse=True)
    with styled():
        figure, axes = subplots(1, len(deltas), figsize=(2.9 * len(deltas) + 0.6, 3.2), sharey=True, squeeze=False)
        for axis, delta in zip(axes[0], deltas, strict=True):
            for (name, at), points in curves.items():
                some = [(r, s) for s, share, r in points if share > 0.5 and r > 0]
                if at == delta and some:
                    axis.loglog(*zip(*some, strict=True), color=COLOUR[name], marker=MARKER[name], ms=4, label=name)
            axis.set(xlabel="largest residual", title=f"delta = {delta:.0e}")
        axes[0][0].set_ylabel("solves per second, one core")
        axes[0][0].legend(fontsize=7)
        save(figure, folder / "balance_solvers")
