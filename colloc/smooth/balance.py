"""Smooth bodies by their tangent angle Theta(s, t), and their balance on composite Gauss panels.

The rigid velocity ``z = (u, v, omega)`` is that of a *reference*, one of the panels' edges:
velocity of the point and rotation rate of the tangent there. Path integrals start at the reference
and rates are relative to it, so a stretch that keeps its shape moves with relative precision,
however slow it is. What `solve_smooth` takes and returns is that of the tail in the axes in which
Theta is measured, and the rotation rate of those axes.

At stick the velocity changes over lengths ~ delta / (rotation rate), and shapes may be sharp. So
`solve_smooth` halves panels whose integrals differ from those over their halves, and solves again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from scipy import sparse

from colloc.mechanics.balance import pull_back
from colloc.mechanics.damped_newton import State, groups, relative_delta, solve
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.numerics.schemes import scheme
from colloc.system.arguments import check_finite
from colloc.system.errors import NotConvergedError, ProblemError

TAIL, ANCHOR_MOVES = 0, 5
_MOST_PANELS, _REFINEMENTS = 600, 40
"""Panels of a time point, and halvings of a panel."""
_ROUNDING = 1e-15
Field = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Arc length ``(n_body, n_time)`` and phase ``(n_time,)`` to values ``(n_body, n_time)``."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A periodic motion Theta(s, t)."""

    angle: Field  # Theta [rad]
    rate: Field  # its time derivative [rad/period]
    breaks: Callable[[np.ndarray], np.ndarray] | None = None
    """Phase ``(n_time,)`` to arc lengths ``(n_break, n_time)`` where Theta is not smooth."""
    stages: tuple[float, ...] = (0.0, 1.0)
    """Phases from 0 to the end of the solved part, between which it is smooth in time."""
    antipodal: bool = False  # Theta(s, t + 1/2) = -Theta(s, t)

    def __post_init__(self) -> None:
        stages, end = self.stages, 0.5 if self.antipodal else 1.0
        if stages[0] != 0.0 or stages[-1] != end or min(np.diff(stages)) <= 0:
            raise ProblemError(f"motion.stages must ascend from 0 to {end:g}, not {stages}.")


@lru_cache(maxsize=1024)
def _panel_matrices(n: int, order: int) -> tuple[sparse.csc_matrix, ...]:
    """Nodes to panels, panels to nodes, and integrals from a panel's left end to its nodes."""
    unit, each = scheme(f"gauss-{order}"), sparse.identity(n, format="csc")
    return tuple(sparse.kron(each, part, "csc") for part in (unit.b, np.ones((order, 1)), unit.A))


@dataclass(frozen=True, eq=False)
class PanelGrid:
    """Gauss panels on the arc length, one column a time point (or a single column for all);
    properties of nodes are ``(n_panel * order, n_time)``."""

    edges: np.ndarray
    """Ascending from 0 to 1, ``(n_panel + 1, n_time)``; panels of width zero fill up columns that
    need fewer."""
    order: int = 8  # Gauss nodes a panel

    @property
    def n(self) -> int:
        return len(self.edges) - 1

    @property
    def widths(self) -> np.ndarray:
        """Width of the panel of each node."""
        return np.repeat(np.diff(self.edges, axis=0), self.order, axis=0)

    def _on_panels(self, unit: np.ndarray) -> np.ndarray:
        return np.tile(unit, self.n)[:, None] * self.widths

    @property
    def nodes(self) -> np.ndarray:
        left = np.repeat(self.edges[:-1], self.order, axis=0)
        return left + self._on_panels(scheme(f"gauss-{self.order}").c)

    @property
    def weights(self) -> np.ndarray:
        return self._on_panels(scheme(f"gauss-{self.order}").b)

    def to_edges(self, integrand: Array, reference: int) -> Array:
        """Integrals from edge `reference` to every edge, of an integrand times the widths."""
        edge, panel = np.arange(self.n + 1)[:, None], np.arange(self.n)
        path = np.where(panel >= reference, 1.0 * (panel < edge), -1.0 * (panel >= edge))
        matmul = namespace(integrand).matmul
        return matmul(path, matmul(_panel_matrices(self.n, self.order)[0], integrand))

    def integrate(self, integrand: Array, reference: int) -> Array:
        """The same up to the nodes."""
        matmul = namespace(integrand).matmul
        _, spread, inside = _panel_matrices(self.n, self.order)
        start = self.to_edges(integrand, reference)[: self.n, :]
        return matmul(spread, start) + matmul(inside, integrand)


class Curve(NamedTuple):
    """A body seen from a reference; each ``(n_node, n_time)``: direction cosines of the tangent;
    tangential and normal motion of the nodes per rotation about the reference; their velocity while
    the reference is held; quadrature weights."""

    cos: Array
    sin: Array
    arm_s: Array
    arm_n: Array
    shape_s: Array
    shape_n: Array
    weight: Array


def curve(
    panels: PanelGrid, angle: Array, rate: Array, reference: int, reference_rate: Array
) -> Curve:
    """The curve of tangent angles and rates at the nodes, ``(n_node, n_time)``, seen from edge
    number `reference`, where Theta has the rate ``(1, n_time)`` (paper, eqs. x0, y0 and dtz0)."""
    xp, width = namespace(angle, rate), panels.widths
    c, s = xp.cos(angle), xp.sin(angle)
    turning = width * (rate - reference_rate)
    integrands = width * c, width * s, -turning * s, turning * c
    x, y, vx, vy = (panels.integrate(each, reference) for each in integrands)
    return Curve(
        c, s, x * s - y * c, x * c + y * s, vx * c + vy * s, vy * c - vx * s, panels.weights
    )


def node_velocity(body: Curve, z: Array) -> tuple[Array, Array]:
    """Tangential and normal velocity of the nodes when the reference moves with z."""
    u, v, omega = z[0:1, :], z[1:2, :], z[2:3, :]
    return (
        body.cos * u + body.sin * v + body.arm_s * omega + body.shape_s,
        body.cos * v - body.sin * u + body.arm_n * omega + body.shape_n,
    )


def force_density(body: Curve, tangential: Array, normal: Array) -> tuple[Array, Array, Array]:
    """Force per length in the axes of Theta, and its torque about the reference."""
    return (
        tangential * body.cos - normal * body.sin,
        tangential * body.sin + normal * body.cos,
        tangential * body.arm_s + normal * body.arm_n,
    )


def resultant(body: Curve, tangential: Array, normal: Array) -> Array:
    """Net force and torque about the reference ``(3, n_time)`` (paper, eq. ftb); of velocities
    that of the centre of mass."""
    xp = namespace(body.cos, tangential)
    parts = force_density(body, tangential, normal)
    return xp.stack([xp.sum_rows(body.weight * part) for part in parts])


class PanelBatch:
    """Time points `members` that share a reference edge, a batch of
    `colloc.mechanics.damped_newton`; rows as of `_fields`."""

    def __init__(
        self,
        panels: PanelGrid,
        rows: tuple[np.ndarray, ...],
        friction: Law,
        members: np.ndarray,
        reference: int,
    ) -> None:
        fixed = panels.edges.shape[1] == 1
        self.panels = panels if fixed else PanelGrid(panels.edges[:, members], panels.order)
        self.angle, self.rate, self.edge_rate = (row[:, members] for row in rows)
        self.friction, self.reference = friction, reference
        now = curve(self.panels, self.angle, self.rate, reference, self.edge_rate[[reference]])
        self.curve = now._replace(weight=np.broadcast_to(now.weight, self.angle.shape))

    def evaluate(
        self, select: np.ndarray, z: np.ndarray, delta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Nodes ``(9, n_node, n)``, curve, then velocity; net force and potential at z."""
        body, potential = Curve(*(row[:, select] for row in self.curve)), None
        vs, vn = node_velocity(body, z)
        force = resultant(body, *self.friction.density(vs, vn, delta))
        if self.friction.associated:
            density = self.friction.density_potential(vs, vn, delta)
            potential = (body.weight * density).sum(axis=0)
        return np.stack([*body, vs, vn]), force, potential

    def matrix(self, nodes: np.ndarray, delta: np.ndarray, *, newton: bool) -> np.ndarray:
        c, s, arm_s, arm_n, *_, weight, vs, vn = nodes
        law = self.friction.density_jacobian if newton else self.friction.density_secant
        G = np.array(((c, s, arm_s), (-s, c, arm_n)))
        return pull_back(G, weight * np.array(law(vs, vn, delta)))

    def slowest(self, z: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        anchor = np.argmin(self.panel_speed(z), axis=0)
        return anchor, np.take_along_axis(self.edge_velocity(z), anchor[None, None], 1)[:, 0]

    def edge_velocity(self, z: np.ndarray) -> np.ndarray:
        """Velocity and rotation rate of every edge, ``(3, n_edge, n)``, in the axes of Theta."""
        turned = self.edge_rate - self.edge_rate[self.reference]
        turning = self.panels.widths * (self.rate - self.edge_rate[self.reference] + z[2])
        parts = -turning * np.sin(self.angle), turning * np.cos(self.angle)
        ways = (self.panels.to_edges(part, self.reference) for part in parts)
        return np.stack([*ways, turned]) + z[:, None]

    def panel_speed(self, z: np.ndarray) -> np.ndarray:
        """Largest speed of a node in each panel; infinite for panels of width zero."""
        speed = np.hypot(*node_velocity(self.curve, z)).reshape(self.panels.n, -1, z.shape[1])
        return np.where(np.diff(self.panels.edges, axis=0) > 0, speed.max(axis=1), np.inf)

    def panel_sums(self, z: np.ndarray, delta: np.ndarray | float) -> np.ndarray:
        """Force, torque about the reference and power of every panel, ``(4, n_panel, n)``."""
        body, panels = self.curve, self.panels
        vs, vn = node_velocity(body, z)
        fs, fn = self.friction.density(vs, vn, delta)
        densities = *force_density(body, fs, fn), -(fs * vs + fn * vn)
        weighted = (panels.weights * density for density in densities)
        return np.stack([row.reshape(panels.n, panels.order, -1).sum(axis=1) for row in weighted])

    def bending_power(self, z: np.ndarray, delta: np.ndarray | float) -> np.ndarray:
        """Power of what bends the body ``(n,)``, the work of the moment of all force F ahead of s
        on the curvature: by parts ``-int (n . F) dTheta/dt ds``."""
        body, panels = self.curve, self.panels
        force = self.friction.density(*node_velocity(body, z), delta)
        along = force_density(body, *force)[:2]
        ahead_x, ahead_y = (-panels.integrate(panels.widths * f, panels.n) for f in along)
        across = body.cos * ahead_y - body.sin * ahead_x
        return -(body.weight * self.rate * across).sum(axis=0)


@dataclass(frozen=True, eq=False)
class SmoothSolution:
    """A smooth body in balance; arrays of length n_time unless stated."""

    t: np.ndarray  # phases
    tolerance: float
    z: np.ndarray  # tail velocities (3, n_time)
    centre: np.ndarray  # velocity of the centre of mass (2, n_time)
    force: np.ndarray  # net force and torque about the tail, or the part at rest, (3, n_time)
    power: np.ndarray  # dissipated by friction
    bending_power: np.ndarray  # of what bends the body; equals `power` in balance
    power_inside: np.ndarray  # `power` on the arcs `regions`
    slowest: np.ndarray  # smallest speed of a whole panel
    residual: np.ndarray  # as of `BalanceSolution`
    iterations: np.ndarray

    def require(self) -> SmoothSolution:
        """This solution, or a `NotConvergedError` naming the time points that failed."""
        bad = np.flatnonzero(self.residual > self.tolerance)
        if bad.size:
            raise NotConvergedError(
                f"the smooth body did not balance at {bad.size} of {self.t.size} time points "
                f"(first: phase {self.t[bad[0]]:.4f}, worst residual "
                f"{self.residual[bad].max():.1e}); use a larger delta."
            )
        return self


def solve_smooth(
    motion: Motion,
    friction: Law,
    t: np.ndarray,
    delta: float,
    *,
    panels: int = 16,
    order: int = 8,
    quadrature_tolerance: float = 1e-10,
    tolerance: float = 1e-11,
    max_iterations: int = 2000,
    regions: tuple[tuple[float, float], ...] = (),
    method: str = "auto",
    grid: PanelGrid | None = None,
    start: np.ndarray | None = None,
    slide: np.ndarray | None = None,
) -> SmoothSolution:
    """Velocities that put a smooth body in force and torque balance at phases t ``(n_time,)``.

    The first panels end at the motion's breaks; a `grid` is the same at all times. `regions` are
    arcs whose power is reported separately. Tail velocities ``(3, n_time)``: `start` to start from;
    `slide` to slide with, instead of those that balance. Others as of `solve_balance`.
    """
    check_finite(positive=True, delta=delta)
    t = np.atleast_1d(np.asarray(t, dtype=float))
    n, active = t.size, np.arange(t.size)
    vectors, numbers = np.zeros((3, 3, n)), np.zeros((5, n))
    steps, (z, force, centre), (power, bending, inside, slowest, residual) = (
        np.zeros(n, dtype=int), vectors, numbers,
    )  # fmt: skip
    if grid is not None:
        edges = grid.edges
    else:
        edges = np.repeat(np.linspace(0.0, 1.0, panels + 1)[:, None], n, axis=1)
        if motion.breaks is not None:
            breaks = np.clip(motion.breaks(t), 0.0, 1.0)
            edges = np.sort(np.concatenate([edges, breaks]), axis=0)
    anchor, velocity = np.full(n, len(edges) // 2), np.zeros((3, n))
    first = start if slide is None else slide
    if first is not None:
        anchor, velocity = np.full(n, TAIL), first.copy()
        velocity[2] += motion.rate(np.zeros((1, n)), t)[0]
    for level in range(_REFINEMENTS + 1):
        # work in units of the largest rate: the law is homogeneous once delta scales along
        unit = np.ones(active.size) if friction.degree is None else None
        now = PanelGrid(edges, order) if grid is None else grid
        rows, speed = _fields(motion, t[active], now, unit)
        d, batch_of = relative_delta(delta, speed), partial(PanelBatch, now, rows, friction)
        state = State(anchor, velocity / speed)
        if slide is not None:
            state.residual[:] = 0.0
        else:
            if level == 0 and first is None:
                # a cheap pass finds what rests: the anchor is right before anything is judged
                solve(state, batch_of, 1, np.maximum(d, 1e-3), 1e-6, max_iterations, method)
                for reference, at in groups(state.anchor):
                    slow = batch_of(at, reference).slowest(state.velocity[:, at], d[:, at])
                    state.anchor[at], state.velocity[:, at] = slow
                state = State(state.anchor, state.velocity)
            solve(state, batch_of, ANCHOR_MOVES, d, tolerance, max_iterations, method)
        velocity, split = state.velocity * speed, np.zeros((len(edges) - 1, active.size), bool)
        middle = 0.5 * (edges[1:] + edges[:-1])
        for reference, members in groups(state.anchor):
            batch, moved = batch_of(members, reference), state.velocity[:, members]
            at, dry, fast = active[members], d[:, members], speed[members]
            spent = fast ** (1.0 + (friction.degree or 0.0))
            sums, slides = batch.panel_sums(moved, dry), node_velocity(batch.curve, moved)
            tail = batch.edge_velocity(moved)[:, TAIL]
            tail[2] -= batch.edge_rate[TAIL]
            z[:, at], centre[:, at] = tail * fast, resultant(batch.curve, *slides) * fast
            force[:, at], power[at] = sums[:3].sum(axis=1) * spent / fast, sums[3].sum(0) * spent
            places = middle if grid is not None else middle[:, members]
            held = (sums[3] * ((places > low) & (places < high)) for low, high in regions)
            inside[at] = sum(part.sum(axis=0) * spent for part in held)
            bending[at] = batch.bending_power(moved, dry) * spent
            least = batch.panel_speed(moved).min(axis=0)
            slowest[at] = least * fast
            if grid is None:
                missed = _panel_error(motion, t[at], batch, moved, dry, fast)
                # two stretches at rest know each other's velocity to rounding only: no refinement
                # beats that
                floor = _ROUNDING * np.hypot(*slides).max(axis=0) / (dry[0] + least)
                split[:, members] = missed > quadrature_tolerance + floor
        steps[active] += state.iterations
        residual[active] = state.residual
        used = np.sum(np.diff(edges, axis=0) > 0, axis=0)
        more = split.any(axis=0) & (used < _MOST_PANELS) & (state.residual <= tolerance)
        if level == _REFINEMENTS or not more.any():
            break
        anchor_at = np.take_along_axis(edges, state.anchor[None], 0)[:, more]
        active, velocity = active[more], velocity[:, more]
        # columns that need fewer edges end in panels of width zero
        halves = np.where(split[:, more], middle[:, more], 1.0)
        edges = np.sort(np.concatenate([edges[:, more], halves]), axis=0)
        edges = edges[: 1 + int(np.max(np.sum(edges < 1.0, axis=0)))]
        anchor = np.argmax(edges == anchor_at, axis=0)
    return SmoothSolution(
        t, tolerance, z, centre[:2], force, power, bending, inside, slowest, residual, steps
    )


def _fields(
    motion: Motion, t: np.ndarray, panels: PanelGrid, speed: np.ndarray | None = None
) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Theta and its rate at the nodes, its rate at the edges; rates in units of the returned
    `speed` ``(n_time,)``."""
    nodes = panels.nodes
    angle, rate = motion.angle(nodes, t), motion.rate(nodes, t)
    if not (np.isfinite(rate).all() and np.isfinite(angle).all()):
        raise ProblemError("the motion's tangent angle and rate must be finite.")
    if speed is None:
        speed = np.abs(rate).max(axis=0)
        speed[speed == 0] = 1.0
    return (angle, rate / speed, motion.rate(panels.edges, t) / speed), speed


def _panel_error(
    motion: Motion,
    t: np.ndarray,
    batch: PanelBatch,
    z: np.ndarray,
    delta: np.ndarray,
    speed: np.ndarray,
) -> np.ndarray:
    """Difference of each panel, as a body that moves with its left end, from its two halves,
    ``(n_panel, n_time)``: in force, torque and power, and in the velocity of the right end in units
    of the speed of the slowest panel, which decides the friction there."""
    edges = batch.panels.edges
    left, right = edges[:-1].ravel(), edges[1:].ravel()
    slow = delta[0] + batch.panel_speed(z).min(axis=0)
    t, speed, dry, slow = (np.tile(a, len(edges) - 1) for a in (t, speed, delta[0], slow))
    start = batch.edge_velocity(z)[:, :-1].reshape(3, -1)
    results = []
    for cuts in ([left, right], [left, 0.5 * (left + right), right]):
        grid = PanelGrid(np.stack(cuts), batch.panels.order)
        rows, _ = _fields(motion, t, grid, speed)
        one = PanelBatch(grid, rows, batch.friction, np.arange(t.size), 0)
        sums = one.panel_sums(start, dry).sum(axis=1)
        end = one.edge_velocity(start)[:2, -1] / slow
        results.append(np.concatenate([sums / batch.friction.largest, end]))
    return np.abs(results[1] - results[0]).max(axis=0).reshape(len(edges) - 1, -1)
