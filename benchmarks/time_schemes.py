"""Collocation schemes on one gait: error of d/W against points and time: python -m benchmarks --only time_schemes

The gait is held fixed (no optimisation), so that only the discretisation in time is measured. The reference integrates
orientation, path and work by SciPy's adaptive DOP853 (tolerance 1e-11 at delta = 1, 1e-9 at 1e-4, 1e-7 there with --quick),
with the balance solved anew at every stage; errors below a few times the tolerance are its own and no part of fitted orders.
At delta = 1 the motion is smooth and every scheme shows its order; at delta = 1e-4 links stick and slip, the integrand has
kinks, and uniform meshes of any scheme converge like second order. `mesh_tolerance` shows what refinement does about it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.tables import cpu_seconds, markdown_table
from colloc import Chain, Friction, Harmonic, Problem, ellipse, solve_balance
from colloc.collocation.transcription import transcribe
from colloc.collocation.warm_start import feasible_point
from colloc.gaits.control_problem import control_problem
from colloc.gaits.harmonic import Fourier
from colloc.mechanics.balance import instant, total_power
from colloc.pictures.style import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, save, styled, subplots

GAIT = ellipse(0, 2.85, 1.29)
SCHEMES = ("trapezoid", "hermite-simpson", "gauss-2", "gauss-3", "gauss-5", "radau-3")
COLOURS = dict(zip(SCHEMES, ("#999999", SKY, GREEN, BLUE, PURPLE, ORANGE), strict=True))


def adaptive_efficiency(gait: Fourier, delta: float, tolerance: float = 1e-11) -> float:
    """d/W of a gait of the isotropic three-link body by adaptive integration in time."""
    body, friction = Chain(), Friction()

    def rate(t: float, state: np.ndarray) -> list[float]:
        when = np.array([t])
        angles, rates = gait.angles(when), gait.rates(when)
        solved = solve_balance(body, friction, angles, rates, delta, tolerance=1e-12)
        now = instant(body, friction, angles, rates, solved.z, delta)
        cx, cy = (c.item() for c in body.centre_velocity(now.posture, now.velocity))
        c, s = np.cos(state[0]), np.sin(state[0])
        power = total_power(now.velocity, now.force).item()
        return [solved.z[2, 0], c * cx - s * cy, s * cx + c * cy, power]

    # a maximal step keeps the error control from stepping over a stick phase
    run = solve_ivp(rate, (0, 1), np.zeros(4), method="DOP853", rtol=tolerance, atol=tolerance, max_step=0.05)
    _, x, y, work = run.y[:, -1]
    return float(np.hypot(x, y) / work)


def collocated(name: str, intervals: int, delta: float) -> tuple[float, int, float]:
    """d/W, points, and processor seconds of solving the balance at all points of a uniform mesh on half a period."""
    problem = Problem("scheme", GAIT, gait=Harmonic(1, "bilateral"), scheme=name, intervals=intervals, delta=delta)
    transcription = transcribe(control_problem(problem))
    parameters = problem.gait.parameters(GAIT)
    x = feasible_point(transcription, parameters, delta)
    layout = transcription.layout
    seconds = cpu_seconds(lambda: feasible_point(transcription, parameters, delta), at_least=0.01)
    efficiency = x[layout.distance[0, -1]] / x[layout.work[0, -1]]
    return float(efficiency), transcription.mesh.n_point, seconds


def fitted_order(points: list[int], errors: list[float], floor: float) -> float | str:
    """Slope of the errors above the floor, the coarsest mesh left out where two others remain."""
    above = [(n, error) for n, error in zip(points, errors, strict=True) if error > floor]
    n, error = np.array(above[1:] if len(above) > 2 else above).reshape(-1, 2).T
    return float(-np.polyfit(np.log(n), np.log(error), 1)[0]) if n.size > 1 else "-"


def report(quick: bool, folder: Path) -> str:
    """Tables of relative error against intervals for three deltas, and a figure against points."""
    deltas = (1.0, 1e-4)
    intervals = (8, 16, 32) if quick else (6, 12, 24, 48, 96)
    parts, curves = [], {}
    for delta in deltas:
        tolerance = 1e-11 if delta == 1.0 else 1e-7 if quick else 1e-9
        reference = adaptive_efficiency(GAIT, delta, tolerance)
        rows = []
        for name in SCHEMES:
            runs = [collocated(name, n, delta) for n in intervals]
            errors = [abs(e / reference - 1) for e, _, _ in runs]
            curves[delta, name] = [(points, seconds, error) for (_, points, seconds), error in zip(runs, errors, strict=True)]
            rows.append([name, *errors, fitted_order([r[1] for r in runs], errors, 10 * tolerance), 1e3 * runs[-1][2]])
        header = ["scheme", *(f"{n} intervals" for n in intervals), "fitted order", "ms at the last"]
        parts.append(f"delta = {delta:g}, reference d/W = {reference:.9f}:\n\n{markdown_table(header, rows)}")
    with styled():
        figure, axes = subplots(1, len(deltas), figsize=(3.0 * len(deltas), 3.2), squeeze=False)
        for axis, delta in zip(axes[0], deltas, strict=True):
            for name in SCHEMES:
                points, _, missed = zip(*curves[delta, name], strict=True)
                axis.loglog(points, np.maximum(missed, 1e-15), color=COLOURS[name], marker="o", ms=3, label=name)
            n = np.array([30, 300])
            axis.loglog(n, 3.0 * n**-2.0, color=VERMILION, ls=":", lw=1, label="second order")
            axis.set(xlabel="points on half a period", title=f"delta = {delta:g}")
        axes[0][0].set_ylabel("relative error of d/W")
        axes[0][0].legend(fontsize=7, loc="lower left")
        save(figure, folder / "time_schemes")
    return "\n\n".join(parts)
