"""Optimised bump crawlers: feasible starts, continuation in delta, independent replay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from colloc.collocation.bump_transcription import POSITION_SCALE, BumpTranscription, bump_mesh, piece_lengths, transcribe_bump
from colloc.collocation.layout import RADIANS
from colloc.mechanics.friction import Friction
from colloc.numerics.mesh import Mesh
from colloc.results.checks import Check
from colloc.search.nlp import OPTIMAL_TOLERANCE, NlpResult, Solver
from colloc.smooth.bump_balance import balance_and_power, bump_instant, solve_bump
from colloc.smooth.bump_body import BumpBody
from colloc.smooth.period import Period, measured_period
from colloc.system.errors import NotConvergedError

FIRST_RADIUS, NEXT_RADIUS = 0.2, 0.1
"""Trust region of every coordinate [rad, and bump widths], at the first level and later ones."""
ROUGH, ROUGH_ABOVE = {"panels": 4, "order": 6}, 2.5
"""Quadrature of the bump at levels above so many times the last delta: they only have to come near, at a third of the cost."""
OPTIONS: dict[str, object] = {"theta_max_fact": 0.1, "tol": 1e-7, "alpha_red_factor": 0.2, "watchdog_shortened_iter_trigger": 3}
"""Half the processor time of a tight leash (theta_max_fact 1e-3) at epsilon = 0.1; with no leash the last level fails."""
GAP, ANGLE = 1e-3, 5e-3
"""Largest values that pass. GAP is that of chains times ten: fixed panels on the bump resolve its stick to this only."""


def prescribed_vertices(body: BumpBody, amplitude: float, n: int) -> np.ndarray:
    """The first half period of `smooth.concertina`'s one-bump crawler as `n` pieces of equal length, ``(body.n, n + 1)``."""
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


def best_start(body: BumpBody, friction: Friction, candidates: list[np.ndarray], delta: float, nodes: int = 3) -> np.ndarray:
    """The candidate coordinates at the nodes, each ``(body.n, n + 1)``, with the smallest loss."""

    def loss(vertices: np.ndarray) -> float:
        _, d, W = _half_period(body, friction, bump_mesh(vertices.shape[1] - 1, nodes), vertices, delta)
        return float((W[-1] / (friction.smallest * d[-1]) - 1) / (2 * body.epsilon)) if d[-1] > 0 else np.inf

    return min(candidates, key=loss)


@dataclass(frozen=True, eq=False)
class BumpOptimum:
    """An optimised crawler.

    Attributes
    ----------
    delta : float
        The last regularisation at which first-order conditions hold; the crawler is the optimum there.
    vertices : (body.n, n + 1)
        Position and amplitudes at the nodes of half a period.
    nodes : int
        Gauss points on each piece.
    loss : float
        Loss per region length, see `colloc.collocation.bump_transcription`.
    levels : list of (float, NlpResult)
        Every delta that was tried, and what IPOPT returned.
    """

    body: BumpBody
    friction: Friction
    delta: float
    vertices: np.ndarray
    nodes: int
    loss: float
    levels: list[tuple[float, NlpResult]]

    @property
    def efficiency(self) -> float:
        """Efficiency on the optimisation's own mesh; `replay` is the one to quote."""
        return 1.0 / (self.friction.smallest * (1.0 + 2 * self.body.epsilon * self.loss))

    def replay(self, delta: float | None = None, **settings: Any) -> Period:
        """Distance, work and efficiency by the general smooth-body solver on finer panels and time nodes.

        The regularisation is that of the optimisation unless a smaller one is given.
        """
        region = (0.5 - self.body.epsilon, 0.5 + self.body.epsilon)
        options: dict[str, Any] = {"intervals": 2, "nodes": 4, "panels": 8, "regions": (region,)} | settings
        return measured_period(self.body.motion(self.vertices), self.friction, delta or self.delta, **options)

    def checks(self, largest_angle: float) -> tuple[Check, ...]:
        """What a claim of optimality rests on; the replay shares no mesh, panel or balance solver with the optimisation."""
        result, period = next(r for d, r in reversed(self.levels) if d == self.delta and r.optimal), self.replay()
        x = np.linspace(-1.0, 1.0, 401)
        angles = self.body.modes_at(x)[0] @ self.vertices[1:]
        outside = max(float(np.abs(self.vertices[0]).max()) - self.body.reach, 0.0)
        return (
            Check("KKT error", max(result.kkt_error, result.complementarity), OPTIMAL_TOLERANCE, "gradient of the Lagrangian"),
            Check("constraint violation", result.violation, OPTIMAL_TOLERANCE, "largest violated equation or bound"),
            Check("replay gap", self.efficiency / period.efficiency - 1, GAP, "collocated over replayed efficiency, less 1"),
            Check("replay error", period.errors["efficiency"] / period.efficiency, GAP, "relative, from a coarser replay"),
            Check("region", outside, OPTIMAL_TOLERANCE, "excess of the bump's position [bump widths]"),
            Check("tangent angle", max(float(np.abs(angles).max()) - largest_angle, 0.0), ANGLE, "excess between nodes [rad]"),
        )


def optimise_bump(
    body: BumpBody,
    friction: Friction,
    vertices: np.ndarray,
    delta: float,
    *,
    delta_start: float | None = None,
    largest_angle: float = 1.5,
    nodes: int = 3,
    iterations: int = 300,
) -> BumpOptimum:
    """Minimise the loss from given coordinates at the nodes, by continuation in delta.

    A resting part that begins to slip costs a large part of the distance at once: at small delta the optimum lies close to
    that cliff and IPOPT makes no headway from a poor start. At a larger delta the cliff is a slope. So delta is halved from
    `delta_start`, every level from the optimum before, moving by at most a trust region at a time. The result is the last
    level whose first-order conditions hold.

    Parameters
    ----------
    body : BumpBody
    friction : Friction
    vertices : (body.n, n + 1)
    delta : float
        Regularisation speed to go down to, per period.
    delta_start : float, optional
        By default 4 times that.
    largest_angle : float
        Bound on |Theta| [rad].
    nodes : int
        Gauss points on each piece; two are few enough for the optimum to exploit their quadrature error.
    iterations : int
        IPOPT's iterations within a trust region.

    Raises
    ------
    NotConvergedError
        If not even the first level converges.
    """

    def prepared(body: BumpBody) -> tuple[BumpTranscription, Solver[BumpTranscription]]:
        transcription = transcribe_bump(body, friction, vertices, nodes=nodes, largest_angle=largest_angle)
        return transcription, Solver(transcription, OPTIONS | {"max_iter": iterations})

    now, radius, reached, loss = delta_start or 4 * delta, FIRST_RADIUS, np.inf, np.inf
    levels: list[tuple[float, NlpResult]] = []
    rough = now > ROUGH_ABOVE * delta
    transcription, solver = prepared(replace(body, **ROUGH) if rough else body)
    while True:
        now = max(now, delta)
        if rough and now <= ROUGH_ABOVE * delta:
            rough, (transcription, solver) = False, prepared(body)
        result = solver.solve(feasible_bump(transcription, vertices, now), now, radius=radius)
        levels.append((now, result))
        if not result.optimal:
            break
        vertices, loss, reached, radius = result.x[transcription.layout.q], result.objective, now, NEXT_RADIUS
        if now <= delta:
            break
        now *= 0.5
    if np.isinf(reached):
        raise NotConvergedError(
            f"the crawler's first level, delta = {now:.2g}, did not converge (KKT error {result.kkt_error:.1e}); "
            "give a larger delta_start."
        )
    return BumpOptimum(body, friction, reached, vertices, nodes, loss, levels)
