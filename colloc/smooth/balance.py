"""NumPy solver of the balance of smooth bodies, batched over instants, on panels that adapt to the
solution.

The velocity of the body at stick changes over lengths ~ delta / (rotation rate), and shapes may be
sharp. So after every solve each panel's integrals are compared with those over its two halves;
panels that differ by more than the tolerance are halved and the instant is solved again. The
iteration itself is that of `colloc.mechanics.damped_newton`; its references are the panel edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.mechanics.damped_newton import groups, relative_delta, solve, starting_state
from colloc.mechanics.law import Law
from colloc.smooth.batch import PanelBatch, PanelFields
from colloc.smooth.curve import Curve, PanelGrid, bending_power, mean_velocity, node_velocity
from colloc.smooth.motion import Motion
from colloc.system.arguments import check_finite
from colloc.system.errors import NotConvergedError, ProblemError

_MOST_PANELS, _REFINEMENTS = 600, 40
"""Of an instant, and halvings of a panel."""
_ROUNDING = 1e-15


@dataclass(frozen=True, eq=False)
class SmoothSolution:
    """A smooth body in balance, instant by instant; arrays of length n_time unless stated.

    Attributes
    ----------
    t : phases
    z : (3, n_time)
        Velocity of the tail in the axes of the frame in which Theta is measured, and the rotation
        rate of that frame.
    power : rate of work against friction
    centre : (2, n_time)
        Velocity of the centre of mass, in the same axes.
    force : (3, n_time)
        Net force and torque about the tail or, where the velocities were solved for, about the part
        at rest.
    bending_power : power of what bends the body; equals `power` in balance
    power_inside : the part of it done on the arcs `regions`
    slowest : smallest speed of a whole panel: how fast the part at stick creeps
    residual : largest net force or torque, in units as in `colloc.mechanics.damped_newton.State`
    quadrature_error : largest panel's difference from its halves, in force or power
    panels : panels used
    iterations : steps taken, over all refinements
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
        """This solution, or a `NotConvergedError` naming the instants that failed."""
        bad = np.flatnonzero(self.residual > self.tolerance)
        if bad.size:
            raise NotConvergedError(
                f"the smooth body did not balance at {bad.size} of {self.t.size} instants (first: "
                f"phase "
                f"{self.t[bad[0]]:.4f}, worst residual {self.residual[bad].max():.1e}); use a "
                f"larger delta."
            )
        return self


def _motion_fields(
    motion: Motion, t: np.ndarray, panels: PanelGrid, speed: np.ndarray | None = None
) -> tuple[PanelFields, np.ndarray]:
    """Theta and its rate on the panels of some instants, rates in units of the returned `speed`
    ``(n_time,)``."""
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


def _panel_integrals(
    body: Curve, vs: np.ndarray, vn: np.ndarray, fs: np.ndarray, fn: np.ndarray, panels: PanelGrid
) -> np.ndarray:
    """Force, torque about the reference and power of every panel, ``(4, n_panel, n_time)``, from
    its nodes' velocities and forces per length."""
    densities = (
        fs * body.cos - fn * body.sin,
        fs * body.sin + fn * body.cos,
        fs * body.arm_s + fn * body.arm_n,
        -(fs * vs + fn * vn),
    )
    return np.stack([panels.panel_sums(density) for density in densities])


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
    slide: np.ndarray | None = None,
) -> SmoothSolution:
    """Velocities that put a smooth body in force and torque balance at phases t.

    Parameters
    ----------
    motion : Motion
    friction : Law
    t : (n_time,)
    delta : float
        Regularisation speed [body lengths per period], > 0.
    panels, order : int
        Equal panels to start from (besides the motion's breaks), and Gauss nodes a panel.
    quadrature_tolerance : float
        Largest difference in force, torque or power between a panel and its halves; 0 keeps the
        first panels.
    tolerance : float
        Largest net force or torque over the largest coefficient at which an instant counts as
        converged.
    max_iterations : int
        As in `colloc.mechanics.fixed_point.solve_balance`.
    regions : tuple of (float, float)
        Arcs whose power is reported separately; their ends should be breaks of the motion.
    method : {"auto", "newton", "fixed_point"}
    slide : (3, n_time), optional
        Tail velocities to slide with, in the place of those that balance.

    Raises
    ------
    ProblemError
        If delta is not positive or the tangent angle is not finite.
    """
    check_finite(positive=True, delta=delta)
    t = np.atleast_1d(np.asarray(t, dtype=float))
    n = t.size
    out = {
        name: np.zeros(n)
        for name in (
            "power",
            "bending_power",
            "power_inside",
            "slowest",
            "residual",
            "quadrature_error",
        )
    }
    out["centre"], out["force"] = np.zeros((2, n)), np.zeros((3, n))
    z_tail, n_panel, iterations = np.zeros((3, n)), np.zeros(n, dtype=int), np.zeros(n, dtype=int)

    active, edges = np.arange(n), motion.first_edges(t, panels)
    anchor, velocity = np.full(n, len(edges) // 2), np.zeros((3, n))
    if slide is not None:
        anchor, velocity = np.zeros(n, dtype=int), slide.copy()
        velocity[2] += motion.rate(np.zeros((1, n)), t)[0]
    for level in range(_REFINEMENTS + 1):
        grid = PanelGrid(edges, order)
        # work in units of the largest rate: the law is homogeneous once delta scales along
        unit = np.ones(active.size) if friction.degree is None else None
        fields, speed = _motion_fields(motion, t[active], grid, unit)
        d, spent = relative_delta(delta, speed), speed ** (1.0 + (friction.degree or 0.0))

        def make(members: np.ndarray, reference: int, fields: PanelFields = fields) -> PanelBatch:
            return PanelBatch(fields, friction, members, reference)

        if slide is not None:
            state = starting_state(anchor, velocity / speed)
            state.residual[:] = 0.0
        elif level == 0:
            # one cheap pass finds what rests, so that the anchor is right before anything is judged
            state = starting_state(anchor, velocity / speed)
            solve(state, make, 1, np.maximum(d, 1e-3), 1e-6, max_iterations, method)
            for reference, members in groups(state.anchor):
                batch = make(members, reference)
                state.anchor[members], state.velocity[:, members] = batch.slowest(
                    state.velocity[:, members], d[:, members]
                )
            state = starting_state(state.anchor, state.velocity)
        else:
            state = starting_state(anchor, velocity / speed)
        if slide is None:
            solve(state, make, 5, d, tolerance, max_iterations, method)
        iterations[active] += state.iterations
        velocity = state.velocity * speed

        split = np.zeros((grid.n, active.size), dtype=bool)
        for reference, members in groups(state.anchor):
            batch = make(members, reference)
            chosen, z = active[members], state.velocity[:, members]
            own, body = PanelGrid(edges[:, members], order), Curve(*batch.curve)
            vs, vn = node_velocity(body, z)
            fs, fn = friction.density(vs, vn, d[:, members])
            whole = _panel_integrals(body, vs, vn, fs, fn, own)
            out["centre"][:, chosen] = mean_velocity(body, vs, vn) * speed[members]
            out["bending_power"][chosen] = (
                bending_power(own, body, fs, fn, fields.rate[:, members]) * spent[members]
            )
            middle = 0.5 * (edges[1:, members] + edges[:-1, members])
            inside = sum(
                ((middle > a) & (middle < b) for a, b in regions),
                np.zeros(middle.shape, dtype=bool),
            )
            out["force"][:, chosen] = whole[:3].sum(axis=1) * (spent / speed)[members]
            out["power"][chosen] = whole[3].sum(axis=0) * spent[members]
            out["power_inside"][chosen] = np.sum(whole[3] * inside, axis=0) * spent[members]
            out["slowest"][chosen] = batch.panel_speed(z).min(axis=0) * speed[members]
            tail = batch.edge_velocity(z)[:, 0]
            tail[2] -= fields.edge_rate[0, members]
            z_tail[:, chosen] = tail * speed[members]
            error = _panel_error(
                motion, friction, t[chosen], batch, z, d[:, members], speed[members]
            )
            out["quadrature_error"][chosen] = error.max(axis=0)
            # two stretches at rest know each other's velocity to rounding only: no refinement beats
            # that
            floor = (
                _ROUNDING
                * batch.largest_speed(z)
                / (d[0, members] + batch.panel_speed(z).min(axis=0))
            )
            split[:, members] = error > quadrature_tolerance + floor
        out["residual"][active] = state.residual
        n_panel[active] = np.sum(np.diff(edges, axis=0) > 0, axis=0)

        more = split.any(axis=0) & (n_panel[active] < _MOST_PANELS) & (state.residual <= tolerance)
        if quadrature_tolerance == 0 or level == _REFINEMENTS or not more.any():
            break
        anchor_at = np.take_along_axis(edges, state.anchor[None], 0)[:, more]
        active, velocity, edges = (
            active[more],
            velocity[:, more],
            _split(edges[:, more], split[:, more]),
        )
        anchor = np.argmax(edges == anchor_at, axis=0)
    return SmoothSolution(
        t, z_tail, **out, panels=n_panel, iterations=iterations, tolerance=tolerance
    )


def _panel_error(
    motion: Motion,
    friction: Law,
    t: np.ndarray,
    batch: PanelBatch,
    z: np.ndarray,
    delta: np.ndarray,
    speed: np.ndarray,
) -> np.ndarray:
    """How far each panel is from its two halves, ``(n_panel, n_time)``.

    Every panel is taken as a body of its own that moves with its left end, so that an error is
    charged to the panel that makes it. Compared are force, torque and power, and the velocity
    handed on to the right end in units of the speed of the slowest panel, because that is what
    decides the friction there.
    """
    edges = batch.fields.panels.edges[:, batch.members]
    left, right = edges[:-1].ravel(), edges[1:].ravel()
    n_panel = len(edges) - 1
    many = (
        np.tile(a, n_panel)
        for a in (t, speed, delta[0], delta[0] + batch.panel_speed(z).min(axis=0))
    )
    t_many, speed_many, delta_many, slow_many = many
    start = batch.edge_velocity(z)[:, :-1].reshape(3, -1)
    results = []
    for cuts in ([left, right], [left, 0.5 * (left + right), right]):
        fields, _ = _motion_fields(
            motion, t_many, PanelGrid(np.stack(cuts), batch.fields.panels.order), speed_many
        )
        one = PanelBatch(fields, friction, np.arange(t_many.size), 0)
        velocity = node_velocity(Curve(*one.curve), start)
        force = friction.density(*velocity, delta_many)
        integrals = _panel_integrals(Curve(*one.curve), *velocity, *force, fields.panels).sum(
            axis=1
        )
        end = one.edge_velocity(start)[:2, -1] / slow_many
        results.append(np.concatenate([integrals / friction.largest, end]))
    return np.abs(results[1] - results[0]).max(axis=0).reshape(n_panel, t.size)
