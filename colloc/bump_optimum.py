"""Optimised bump crawlers: feasible starts, continuation in delta and epsilon, independent replay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from colloc.bump_balance import balance_and_power, bump_instant, solve_bump
from colloc.bump_body import BumpBody
from colloc.bump_transcription import POSITION_SCALE, BumpTranscription
from colloc.errors import NotConvergedError
from colloc.layout import RADIANS
from colloc.nlp import NlpResult, Solver
from colloc.smooth_period import Period, measured_period


def prescribed_vertices(body: BumpBody, amplitude: float, n: int) -> np.ndarray:
    """The first half period of `colloc.concertina`'s one-bump crawler as `n` pieces of equal length, ``(body.n, n + 1)``."""
    corners = np.zeros((body.n, 4))
    corners[0], corners[2] = (-body.reach, -body.reach, body.reach, body.reach), (0.0, amplitude, amplitude, 0.0)
    steps = np.diff(corners) * np.append(POSITION_SCALE, np.ones(body.modes))[:, None]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=0))])
    place = np.linspace(0.0, along[-1], n + 1)
    # the nearest vertices move onto the corners, so that the motion is the crawler's exactly
    for corner in along[1:-1]:
        place[np.argmin(np.abs(place - corner))] = corner
    return np.stack([np.interp(place, along, row) for row in corners])


def feasible_bump(transcription: BumpTranscription, vertices: np.ndarray, delta: float) -> np.ndarray:
    """Variables that satisfy the equations for given coordinates ``(body.n, n + 1)`` at `delta` (per period)."""
    body, friction, mesh, layout = (getattr(transcription, k) for k in ("body", "friction", "mesh", "layout"))
    x = np.zeros(layout.n)
    x[layout.q] = vertices
    steps = np.diff(vertices) * np.append(POSITION_SCALE, np.ones(body.modes))[:, None]
    x[layout.piece] = np.mean(np.linalg.norm(steps, axis=0))
    interval, tau = np.repeat(np.arange(mesh.n), mesh.scheme.s), np.tile(mesh.scheme.c, mesh.n)
    q = (1 - tau) * vertices[:, interval] + tau * vertices[:, interval + 1]
    rates = (vertices[:, interval + 1] - vertices[:, interval]) / mesh.h[interval]
    z = solve_bump(body, friction, q, rates, delta / RADIANS).velocity
    slow = delta / RADIANS / body.width
    _, power = balance_and_power(body, friction, bump_instant(body, friction, q, rates, z, slow), slow)
    state, rate = mesh.integration()
    theta = np.zeros(mesh.n_site)
    theta[1:] = np.linalg.solve(state[:, 1:].toarray(), body.width * (rate @ z[2]))
    theta -= 0.5 * theta[-1]
    x[layout.theta[0]] = theta
    _, quadrature = mesh.quadrature()
    there = theta[mesh.sites.ravel()]
    x[layout.distance[0, 1:]] = np.cumsum(quadrature @ (np.cos(there) * z[0] - np.sin(there) * z[1]))
    x[layout.work[0, 1:]] = np.cumsum(quadrature @ power[0])
    return x


@dataclass(frozen=True, eq=False)
class BumpOptimum:
    """An optimised crawler: its polygon of amplitudes, IPOPT's result, and the independent replay."""

    body: BumpBody
    vertices: np.ndarray
    delta: float
    x: np.ndarray
    result: NlpResult
    replay: Period | None


def optimise_bump(
    transcription: BumpTranscription,
    vertices: np.ndarray,
    deltas: tuple[float, ...],
    *,
    replay: bool = True,
    options: dict[str, object] | None = None,
    verbose: bool = False,
) -> BumpOptimum:
    """Maximise efficiency from given amplitudes, through falling deltas (per period), and replay the result.

    Raises
    ------
    NotConvergedError
        If no delta could be solved to optimality.
    """
    solver = Solver(cast(Any, transcription), options)
    x = feasible_bump(transcription, vertices, deltas[0])
    multipliers, best = None, None
    for delta in deltas:
        result = solver.solve(x, delta, multipliers)
        if verbose:
            print(delta, result.status, result.iterations, f"{result.seconds:.1f}s", result.objective, result.kkt_error,
                  result.violation, flush=True)  # fmt: skip
        if result.violation > 1e-6:
            break
        x, multipliers, best = result.x, (result.lam_x, result.lam_g), (delta, result)
    if best is None:
        raise NotConvergedError(f"no delta from {deltas[0]:g} was solved (violation {result.violation:.1e}); start larger.")
    delta, result = best
    found = transcription.vertices(x)
    body = transcription.body
    played = None
    if replay:
        region = (0.5 - body.epsilon, 0.5 + body.epsilon)
        played = measured_period(
            body.motion(found), transcription.friction, delta, intervals=2, nodes=4, regions=(region,), panels=8
        )
    return BumpOptimum(body, found, delta, x, result, played)
