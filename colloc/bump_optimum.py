"""Optimised bump crawlers: feasible starts, rounds within a trust region, independent replay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.bump_balance import balance_and_power, bump_instant, solve_bump
from colloc.bump_body import BumpBody
from colloc.bump_transcription import POSITION_SCALE, BumpTranscription, bump_mesh, piece_lengths, transcribe_bump
from colloc.friction import Friction
from colloc.layout import RADIANS
from colloc.mesh import Mesh
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


def _half_period(
    body: BumpBody, friction: Friction, mesh: Mesh, vertices: np.ndarray, delta: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orientation at the sites, distance and work at the edges (in bump widths) of given coordinates at the nodes."""
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
    _, quadrature = mesh.quadrature()
    there = theta[mesh.sites.ravel()]
    advance = np.cumsum(quadrature @ (np.cos(there) * z[0] - np.sin(there) * z[1]))
    return theta, np.append(0.0, advance), np.append(0.0, np.cumsum(quadrature @ power[0]))


def feasible_bump(transcription: BumpTranscription, vertices: np.ndarray, delta: float) -> np.ndarray:
    """Variables that satisfy the equations for given coordinates ``(body.n, n + 1)`` at `delta` (per period)."""
    layout = transcription.layout
    x = np.zeros(layout.n)
    x[layout.q] = vertices
    x[layout.piece] = np.mean(piece_lengths(vertices))
    x[layout.theta[0]], x[layout.distance[0]], x[layout.work[0]] = _half_period(
        transcription.body, transcription.friction, transcription.mesh, vertices, delta
    )
    return x


def _loss(body: BumpBody, friction: Friction, d: float, W: float) -> float:
    """Relative loss per region length, ``(W / (smallest coefficient d) - 1) / (2 epsilon)``; infinite if d <= 0."""
    return float((W / (friction.smallest * d) - 1) / (2 * body.epsilon)) if d > 0 else np.inf


def best_start(body: BumpBody, friction: Friction, candidates: list[np.ndarray], delta: float) -> np.ndarray:
    """The candidate coordinates at the nodes, each ``(body.n, n + 1)``, with the smallest loss."""

    def loss(vertices: np.ndarray) -> float:
        _, d, W = _half_period(body, friction, bump_mesh(vertices.shape[1] - 1), vertices, delta)
        return _loss(body, friction, d[-1], W[-1])

    return min(candidates, key=loss)


@dataclass(frozen=True, eq=False)
class BumpOptimum:
    """An optimised crawler.

    Attributes
    ----------
    vertices : (body.n, n + 1)
        Position and amplitudes at the nodes of half a period.
    losses : list of float
        Loss per region length at the start and after every accepted round, balance solved exactly.
    rounds : list of NlpResult
        What IPOPT returned in each round.
    """

    body: BumpBody
    friction: Friction
    delta: float
    vertices: np.ndarray
    losses: list[float]
    rounds: list[NlpResult]

    @property
    def efficiency(self) -> float:
        """Efficiency on the optimisation's own mesh; `replay` is the one to quote."""
        return 1.0 / (self.friction.smallest * (1.0 + 2 * self.body.epsilon * self.losses[-1]))

    def replay(self, delta: float | None = None, **settings: Any) -> Period:
        """Distance, work and efficiency by the general smooth-body solver on finer panels and time nodes.

        The regularisation is that of the optimisation unless a smaller one is given.
        """
        region = (0.5 - self.body.epsilon, 0.5 + self.body.epsilon)
        options: dict[str, Any] = {"intervals": 2, "nodes": 4, "panels": 8, "regions": (region,)} | settings
        return measured_period(self.body.motion(self.vertices), self.friction, delta or self.delta, **options)


def optimise_bump(
    body: BumpBody,
    friction: Friction,
    vertices: np.ndarray,
    delta: float,
    *,
    largest_angle: float = 1.5,
    rounds: int = 10,
    radius: float = 0.1,
    iterations: int = 25,
) -> BumpOptimum:
    """Minimise the loss from given coordinates at the nodes, in rounds within a trust region.

    Each round lets IPOPT move every coordinate by at most the radius, from a point that satisfies all equations. What
    comes back is judged by its own loss with the balance solved exactly; a worse one is dropped and the radius reduced.
    So the result is never worse than the start. The trust region is needed because a resting part that begins to slip
    costs a large part of the distance at once: the optimum lies close to that cliff.

    Parameters
    ----------
    body : BumpBody
    friction : Friction
    vertices : (body.n, n + 1)
    delta : float
        Regularisation speed, per period.
    largest_angle : float
        Bound on |Theta| [rad].
    rounds, iterations : int
        Number of rounds, and IPOPT's iterations in each.
    radius : float
        First radius [rad, and bump widths].
    """
    transcription = transcribe_bump(body, friction, vertices, largest_angle=largest_angle)
    layout = transcription.layout
    solver = Solver(transcription, {"max_iter": iterations, "theta_max_fact": 1e-3})

    def start(at: np.ndarray) -> tuple[np.ndarray, float]:
        x = feasible_bump(transcription, at, delta)
        return x, _loss(body, friction, x[layout.distance[0, -1]], x[layout.work[0, -1]])

    x, loss = start(vertices)
    losses, results = [loss], []
    for _ in range(rounds):
        result = solver.solve(x, delta, radius=radius)
        results.append(result)
        trial = np.clip(result.x[layout.q], transcription.lower[layout.q], transcription.upper[layout.q])
        new_x, new_loss = start(trial)
        slack = np.abs(body.angles(trial[1:])).max() - largest_angle
        if np.isfinite(new_loss) and new_x[layout.distance[0, -1]] > 0 and new_loss < losses[-1] and slack < 1e-6:
            x, radius = new_x, 1.5 * radius
            losses.append(new_loss)
        else:
            radius *= 0.3
            if radius < 1e-4:
                break
    return BumpOptimum(body, friction, delta, x[layout.q], losses, results)
