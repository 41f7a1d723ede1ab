"""The balance of smooth bodies on Gauss panels.

At stick the velocity changes over lengths ~ delta / (rotation rate), and shapes may be sharp. So
`solve_smooth` compares each panel's integrals with those over its halves, halves panels that differ
by more than the tolerance and solves again. The iteration is that of
`colloc.mechanics.damped_newton`; its references are the panel edges.

Velocities ``z = (u, v, omega)``, ``(3, n_time)``, are those of the tail, in the axes in which Theta
is measured, and the rotation rate of those axes. In a batch, and at an anchor, omega is the
rotation rate of the tangent there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from colloc.mechanics.balance import pull_back
from colloc.mechanics.damped_newton import (
    Evaluated,
    MakeBatch,
    State,
    groups,
    relative_delta,
    solve,
    starting_state,
)
from colloc.mechanics.law import Law
from colloc.smooth.curve import (
    Curve,
    PanelGrid,
    bending_power,
    curve,
    mean_velocity,
    node_velocity,
    resultant,
)
from colloc.smooth.motion import Motion
from colloc.system.arguments import check_finite
from colloc.system.errors import NotConvergedError, ProblemError

TAIL, ANCHOR_MOVES = 0, 5
_MOST_PANELS, _REFINEMENTS = 600, 40
"""Panels of a time point, and halvings of a panel."""
_ROUNDING = 1e-15


class PanelFields(NamedTuple):
    """Tangent angle and its rate at the nodes ``(n_node, n_time)``, and the rate at the edges
    ``(n_panel + 1, n_time)``."""

    panels: PanelGrid
    angle: np.ndarray
    rate: np.ndarray
    edge_rate: np.ndarray


class PanelBatch:
    """Time points that share a reference edge, as `colloc.mechanics.damped_newton.Batch`."""

    def __init__(
        self, fields: PanelFields, friction: Law, members: np.ndarray, reference: int
    ) -> None:
        grid, *rows = fields
        self.panels = grid if grid.fixed else PanelGrid(grid.edges[:, members], grid.order)
        self.angle, self.rate, self.edge_rate = (row[:, members] for row in rows)
        self.friction, self.reference = friction, reference
        anchor_rate = self.edge_rate[reference : reference + 1]
        now = curve(self.panels, self.angle, self.rate, reference, anchor_rate)
        self.curve = now._replace(weight=np.broadcast_to(now.weight, self.angle.shape))

    def evaluate(self, select: np.ndarray, z: np.ndarray, delta: np.ndarray) -> Evaluated:
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
        path, anchor_rate = self.panels.edge_path(self.reference), self.edge_rate[self.reference]
        turning = self.panels.widths * (self.rate - anchor_rate + z[2])
        return np.stack(
            [
                z[0] - path @ (turning * np.sin(self.angle)),
                z[1] + path @ (turning * np.cos(self.angle)),
                z[2] + self.edge_rate - anchor_rate,
            ]
        )

    def tail_velocity(self, z: np.ndarray) -> np.ndarray:
        tail = self.edge_velocity(z)[:, TAIL]
        tail[2] -= self.edge_rate[TAIL]
        return tail

    def node_speed(self, z: np.ndarray) -> np.ndarray:
        return np.hypot(*node_velocity(self.curve, z))

    def panel_speed(self, z: np.ndarray) -> np.ndarray:
        """Largest speed of a node in each panel, ``(n_panel, n)``; infinite for panels of width
        zero."""
        speed = self.node_speed(z).reshape(self.panels.n, -1, z.shape[1]).max(axis=1)
        return np.where(np.diff(self.panels.edges, axis=0) > 0, speed, np.inf)

    def forces(self, z: np.ndarray, delta: np.ndarray | float) -> tuple[np.ndarray, ...]:
        """Tangential and normal velocity of the nodes, and force per length there."""
        vs, vn = node_velocity(self.curve, z)
        return vs, vn, *self.friction.density(vs, vn, delta)

    def panel_sums(
        self, vs: np.ndarray, vn: np.ndarray, fs: np.ndarray, fn: np.ndarray
    ) -> np.ndarray:
        """Force, torque about the reference and power of every panel, ``(4, n_panel, n)``."""
        body = self.curve
        densities = (
            fs * body.cos - fn * body.sin,
            fs * body.sin + fn * body.cos,
            fs * body.arm_s + fn * body.arm_n,
            -(fs * vs + fn * vn),
        )
        return np.stack([self.panels.panel_sums(density) for density in densities])

    def motion(self, z: np.ndarray, delta: np.ndarray | float) -> tuple[np.ndarray, ...]:
        """Velocity of the centre ``(2, n)``, `panel_sums`, and power of what bends the body
        ``(n,)``."""
        vs, vn, fs, fn = self.forces(z, delta)
        bending = bending_power(self.panels, self.curve, fs, fn, self.rate)
        return mean_velocity(self.curve, vs, vn), self.panel_sums(vs, vn, fs, fn), bending


@dataclass(frozen=True, eq=False)
class SmoothSolution:
    """A smooth body in balance; arrays of length n_time unless stated.

    t: phases. z: tail velocities ``(3, n_time)``. power: dissipated by friction. centre: velocity
    of the centre of mass ``(2, n_time)``. force: net force and torque about the tail or, where the
    velocities were solved for, about the part at rest ``(3, n_time)``. bending_power: of what bends
    the body; equals `power` in balance. power_inside: the part of it done on the arcs `regions`.
    slowest: smallest speed of a whole panel. residual: as of `BalanceSolution`. quadrature_error:
    largest panel's difference from its halves, in force or power. panels: number used. iterations:
    steps over all refinements.
    """

    t: np.ndarray
    z: np.ndarray
    power: np.ndarray
    centre: np.ndarray
    force: np.ndarray
    bending_power: np.ndarray
    power_inside: np.ndarray
    slowest: np.ndarray
    residual: np.ndarray
    quadrature_error: np.ndarray
    panels: np.ndarray
    iterations: np.ndarray
    tolerance: float

    def require(self) -> SmoothSolution:
        """This solution, or a `NotConvergedError` naming the time points that failed."""
        bad = np.flatnonzero(self.residual > self.tolerance)
        if bad.size:
            raise NotConvergedError(
                f"the smooth body did not balance at {bad.size} of {self.t.size} instants (first: "
                f"phase "
                f"{self.t[bad[0]]:.4f}, worst residual {self.residual[bad].max():.1e}); use a "
                f"larger delta."
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

    panels, order: equal panels to start from, besides the motion's breaks, and Gauss nodes a panel.
    quadrature_tolerance: largest difference in force, torque or power between a panel and its
    halves; 0 keeps the first panels. regions: arcs whose power is reported separately; their ends
    should be breaks. method: "auto", "newton" or "fixed_point". grid: panels that are the same at
    all times, instead of such that adapt. start: tail velocities ``(3, n_time)`` to start from;
    slide: to slide with, instead of those that balance. Others as of `solve_balance`.
    """
    check_finite(positive=True, delta=delta)
    t = np.atleast_1d(np.asarray(t, dtype=float))
    n = t.size
    z, centre, force = np.zeros((3, n)), np.zeros((2, n)), np.zeros((3, n))
    power, bending, inside, slowest, residual, error = np.zeros((6, n))
    used, steps = np.zeros((2, n), dtype=int)
    active, edges = np.arange(n), motion.first_edges(t, panels) if grid is None else grid.edges
    anchor, velocity = np.full(n, len(edges) // 2), np.zeros((3, n))
    tail = start if slide is None else slide
    if tail is not None:
        anchor, velocity = np.full(n, TAIL), tail.copy()
        velocity[2] += motion.rate(np.zeros((1, n)), t)[0]
    for level in range(_REFINEMENTS + 1):
        # work in units of the largest rate: the law is homogeneous once delta scales along
        unit = np.ones(active.size) if friction.degree is None else None
        panel_grid = PanelGrid(edges, order) if grid is None else grid
        fields, speed = _motion_fields(motion, t[active], panel_grid, unit)
        d, make = relative_delta(delta, speed), partial(PanelBatch, fields, friction)
        state = starting_state(anchor, velocity / speed)
        if slide is not None:
            state.residual[:] = 0.0
        else:
            if level == 0 and tail is None:
                state = _with_slowest_anchors(state, make, d, max_iterations, method)
            solve(state, make, ANCHOR_MOVES, d, tolerance, max_iterations, method)
        velocity, split = state.velocity * speed, np.zeros((len(edges) - 1, active.size), bool)
        for reference, members in groups(state.anchor):
            batch, moved = make(members, reference), state.velocity[:, members]
            at, dry, fast = active[members], d[:, members], speed[members]
            spent = fast ** (1.0 + (friction.degree or 0.0))
            middle = 0.5 * (batch.panels.edges[1:] + batch.panels.edges[:-1])
            is_inside = np.zeros(middle.shape, dtype=bool)
            for low, high in regions:
                is_inside |= (middle > low) & (middle < high)
            mean, sums, bent = batch.motion(moved, dry)
            z[:, at], centre[:, at] = batch.tail_velocity(moved) * fast, mean * fast
            force[:, at], power[at] = sums[:3].sum(axis=1) * spent / fast, sums[3].sum(0) * spent
            inside[at], bending[at] = (sums[3] * is_inside).sum(axis=0) * spent, bent * spent
            slow = batch.panel_speed(moved).min(axis=0)
            slowest[at] = slow * fast
            if grid is not None:
                continue
            missed = _panel_error(motion, t[at], batch, moved, dry, fast)
            error[at] = missed.max(axis=0)
            # two stretches at rest know each other's velocity to rounding only: no refinement
            # beats that
            floor = _ROUNDING * batch.node_speed(moved).max(axis=0) / (dry[0] + slow)
            split[:, members] = missed > quadrature_tolerance + floor
        steps[active] += state.iterations
        residual[active] = state.residual
        used[active] = np.sum(np.diff(edges, axis=0) > 0, axis=0)

        more = split.any(axis=0) & (used[active] < _MOST_PANELS) & (state.residual <= tolerance)
        if grid is not None or quadrature_tolerance == 0 or level == _REFINEMENTS or not more.any():
            break
        anchor_at = np.take_along_axis(edges, state.anchor[None], 0)[:, more]
        active, velocity = active[more], velocity[:, more]
        edges = _split(edges[:, more], split[:, more])
        anchor = np.argmax(edges == anchor_at, axis=0)
    return SmoothSolution(
        t, z, power, centre, force, bending, inside, slowest, residual, error, used, steps,
        tolerance,
    )  # fmt: skip


def _with_slowest_anchors(
    state: State, make: MakeBatch, delta: np.ndarray, max_iterations: int, method: str
) -> State:
    """A cheap pass finds what rests, so that the anchor is right before anything is judged."""
    solve(state, make, 1, np.maximum(delta, 1e-3), 1e-6, max_iterations, method)
    for reference, at in groups(state.anchor):
        batch = make(at, reference)
        state.anchor[at], state.velocity[:, at] = batch.slowest(state.velocity[:, at], delta[:, at])
    return starting_state(state.anchor, state.velocity)


def _motion_fields(
    motion: Motion, t: np.ndarray, panels: PanelGrid, speed: np.ndarray | None = None
) -> tuple[PanelFields, np.ndarray]:
    """Theta and its rate on panels, rates in units of the returned `speed` ``(n_time,)``."""
    nodes = panels.nodes
    angle, rate = motion.angle(nodes, t), motion.rate(nodes, t)
    if not (np.isfinite(rate).all() and np.isfinite(angle).all()):
        raise ProblemError("the motion's tangent angle and rate must be finite.")
    if speed is None:
        speed = np.abs(rate).max(axis=0)
        speed[speed == 0] = 1.0
    return PanelFields(panels, angle, rate / speed, motion.rate(panels.edges, t) / speed), speed


def _split(edges: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """The chosen panels ``(n_panel, n_time)`` cut in two; columns that need fewer edges end in
    panels of width zero."""
    middle = np.where(chosen, 0.5 * (edges[1:] + edges[:-1]), 1.0)
    fine = np.sort(np.concatenate([edges, middle]), axis=0)
    keep = 1 + int(np.max(np.sum(fine < 1.0, axis=0)))
    return fine[:keep]


def _panel_error(
    motion: Motion,
    t: np.ndarray,
    batch: PanelBatch,
    z: np.ndarray,
    delta: np.ndarray,
    speed: np.ndarray,
) -> np.ndarray:
    """Difference of each panel from its two halves, ``(n_panel, n_time)``.

    Every panel is taken as a body that moves with its left end, so that an error is charged to the
    panel that makes it. Compared are force, torque and power, and the velocity of the right end in
    units of the speed of the slowest panel, which decides the friction there.
    """
    friction, edges = batch.friction, batch.panels.edges
    left, right = edges[:-1].ravel(), edges[1:].ravel()
    slow = delta[0] + batch.panel_speed(z).min(axis=0)
    t, speed, dry, slow = (np.tile(a, len(edges) - 1) for a in (t, speed, delta[0], slow))
    start = batch.edge_velocity(z)[:, :-1].reshape(3, -1)
    results = []
    for cuts in ([left, right], [left, 0.5 * (left + right), right]):
        grid = PanelGrid(np.stack(cuts), batch.panels.order)
        fields, _ = _motion_fields(motion, t, grid, speed)
        one = PanelBatch(fields, friction, np.arange(t.size), 0)
        sums = one.panel_sums(*one.forces(start, dry)).sum(axis=1)
        end = one.edge_velocity(start)[:2, -1] / slow
        results.append(np.concatenate([sums / friction.largest, end]))
    return np.abs(results[1] - results[0]).max(axis=0).reshape(len(edges) - 1, -1)
