"""NumPy solver of the balance of smooth bodies, batched over instants, on panels that adapt to the solution.

The velocity of the body at stick changes over lengths ~ delta / (rotation rate), and shapes may be sharp. So after every
solve each panel's integrals are compared with those over its two halves; panels that differ by more than the tolerance
are halved and the instant is solved again. The iteration itself is that of `colloc.damped_newton`; its references are
the panel edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.curve import Curve, Panels, curve, node_velocity, pulled_back, resultant
from colloc.damped_newton import solve, solve3, starting_state
from colloc.errors import NotConvergedError, ProblemError
from colloc.friction import Friction
from colloc.motion import Motion
from colloc.point_friction import density_jacobian, force_density, regularised_speed, secant_density

_MOST_PANELS = 600


@dataclass(frozen=True)
class SmoothSolution:
    """A smooth body in balance, instant by instant; arrays of length n_time unless stated.

    Attributes
    ----------
    t : phases
    z : (3, n_time)
        Velocity of the tail in the axes of the frame in which Theta is measured, and the rotation rate of that frame.
    power : rate of work against friction
    power_inside : the part of it done on the arc between the ends of `region`
    slowest : smallest speed of a whole panel: how fast the part at stick creeps
    residual : largest net force or torque over the largest coefficient
    quadrature_error : largest panel's difference from its halves, in force or power
    panels : panels used
    iterations : steps taken, over all refinements
    """

    t: np.ndarray
    z: np.ndarray
    power: np.ndarray
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
                f"the smooth body did not balance at {bad.size} of {self.t.size} instants (first: phase "
                f"{self.t[bad[0]]:.4f}, worst residual {self.residual[bad].max():.1e}); use a larger delta."
            )
        return self


class _Batch:
    """Instants on given panels that share a reference edge."""

    def __init__(self, fields: _Fields, friction: Friction, members: np.ndarray, reference: int) -> None:
        self.fields, self.friction, self.members, self.reference = fields, friction, members, reference
        panels = Panels(fields.panels.edges[:, members], fields.panels.order)
        self.edge_rate = fields.edge_rate[:, members]
        anchor_rate = self.edge_rate[reference : reference + 1]
        self.curve = np.stack(curve(panels, fields.angle[:, members], fields.rate[:, members], reference, anchor_rate))

    def evaluate(self, select: np.ndarray, z: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        body = Curve(*self.curve[:, :, select])
        vs, vn = node_velocity(body, z)
        force = resultant(body, *force_density(vs, vn, delta, self.friction))
        if self.friction.isotropic:
            merit = self.friction.mu_t * np.sum(body.weight * regularised_speed(vs, vn, delta), axis=0)
        else:
            merit = 0.5 * np.sum(force * force, axis=0)
        return np.stack([*body, vs, vn]), force, merit

    def step(self, state: np.ndarray, force: np.ndarray, delta: np.ndarray, newton: np.ndarray) -> np.ndarray:
        step = np.empty_like(force)
        for law, chosen in ((density_jacobian, newton), (secant_density, ~newton)):
            if chosen.any():
                vs, vn = state[7:, :, chosen]
                blocks = law(vs, vn, delta[:, chosen], self.friction)
                left = pulled_back(Curve(*state[:7, :, chosen]), blocks)
                matrix = np.array([[entry[0] for entry in row] for row in left]).transpose(2, 0, 1)
                step[:, chosen] = solve3(matrix, force[:, chosen])
        return step

    def edge_velocity(self, z: np.ndarray) -> np.ndarray:
        """Velocity and rotation rate of every edge, ``(3, n_edge, n)``, in the axes of Theta."""
        f, a = self.fields, self.reference
        path = f.panels.edge_path(a)
        width, angle = f.panels.widths[:, self.members], f.angle[:, self.members]
        turning = width * (f.rate[:, self.members] - self.edge_rate[a] + z[2])
        return np.stack(
            [
                z[0] - path @ (turning * np.sin(angle)),
                z[1] + path @ (turning * np.cos(angle)),
                z[2] + self.edge_rate - self.edge_rate[a],
            ]
        )

    def panel_speed(self, z: np.ndarray) -> np.ndarray:
        """Largest speed of a node in each panel, ``(n_panel, n)``; infinite for panels of width zero."""
        vs, vn = node_velocity(Curve(*self.curve), z)
        speed = np.hypot(vs, vn).reshape(self.fields.panels.n, -1, z.shape[1]).max(axis=1)
        return np.where(np.diff(self.fields.panels.edges[:, self.members], axis=0) > 0, speed, np.inf)

    def slowest(self, z: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        anchor = np.argmin(self.panel_speed(z), axis=0)
        return anchor, np.take_along_axis(self.edge_velocity(z), anchor[None, None], 1)[:, 0]


class _Fields:
    """Theta and its rate on the panels of some instants."""

    def __init__(self, motion: Motion, t: np.ndarray, panels: Panels) -> None:
        self.panels = panels
        nodes = panels.nodes
        self.angle, self.rate = motion.angle(nodes, t), motion.rate(nodes, t)
        self.edge_rate = motion.rate(panels.edges, t)


def _halves(edges: np.ndarray) -> np.ndarray:
    """Every panel cut in two."""
    fine = np.empty((2 * len(edges) - 1, edges.shape[1]))
    fine[::2], fine[1::2] = edges, 0.5 * (edges[1:] + edges[:-1])
    return fine


def _split(edges: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """The chosen panels ``(n_panel, n_time)`` cut in two; columns that need fewer edges end in panels of width zero."""
    middle = np.where(chosen, 0.5 * (edges[1:] + edges[:-1]), 1.0)
    fine = np.sort(np.concatenate([edges, middle]), axis=0)
    keep = 1 + int(np.max(np.sum(fine < 1.0, axis=0)))
    return fine[:keep]


def _integrals(batch: _Batch, z: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """Force, torque about the reference and power of every panel, ``(4, n_panel, n_time)``."""
    body = Curve(*batch.curve)
    vs, vn = node_velocity(body, z)
    fs, fn = force_density(vs, vn, delta, batch.friction)
    densities = (
        fs * body.cos - fn * body.sin,
        fs * body.sin + fn * body.cos,
        fs * body.arm_s + fn * body.arm_n,
        -(fs * vs + fn * vn),
    )
    panels = Panels(batch.fields.panels.edges[:, batch.members], batch.fields.panels.order)
    return np.stack([panels.panel_sums(density) for density in densities])


def solve_smooth(
    motion: Motion,
    friction: Friction,
    t: np.ndarray,
    delta: float,
    *,
    panels: int = 16,
    order: int = 8,
    quadrature_tolerance: float = 1e-10,
    tolerance: float = 1e-11,
    max_iterations: int = 2000,
    refinements: int = 40,
    region: tuple[float, float] = (0.0, 0.0),
    method: str = "auto",
) -> SmoothSolution:
    """Velocities that put a smooth body in force and torque balance at phases t.

    Parameters
    ----------
    motion : Motion
    friction : Friction
    t : (n_time,)
    delta : float
        Regularisation speed [body lengths per period], > 0.
    panels, order : int
        Equal panels to start from (besides the motion's breaks), and Gauss nodes a panel.
    quadrature_tolerance : float
        Largest difference in force, torque or power between a panel and its halves; 0 keeps the first panels.
    tolerance : float
        Largest net force or torque over the largest coefficient at which an instant counts as converged.
    max_iterations : int
        As in `colloc.fixed_point.solve_balance`.
    refinements : int
        Most halvings of a panel.
    region : (float, float)
        Arc whose power is reported separately; its ends should be breaks of the motion.
    method : {"auto", "newton", "fixed_point"}

    Raises
    ------
    ProblemError
        If delta is not positive or the tangent angle is not finite.
    """
    if not (np.isfinite(delta) and delta > 0):
        raise ProblemError(f"delta must be a positive finite number, not {delta!r}.")
    t = np.atleast_1d(np.asarray(t, dtype=float))
    n = t.size
    out = {name: np.zeros(n) for name in ("power", "power_inside", "slowest", "residual", "quadrature_error")}
    z_tail, n_panel, iterations = np.zeros((3, n)), np.zeros(n, dtype=int), np.zeros(n, dtype=int)

    active, edges = np.arange(n), motion.first_edges(t, panels)
    anchor, velocity = np.full(n, len(edges) // 2), np.zeros((3, n))
    for level in range(refinements + 1):
        grid = Panels(edges, order)
        fields = _Fields(motion, t[active], grid)
        speed = np.abs(fields.rate).max(axis=0)
        if not (np.isfinite(speed).all() and np.isfinite(fields.angle).all()):
            raise ProblemError("the motion's tangent angle and rate must be finite.")
        # work in units of the largest rate: the law is homogeneous once delta scales along
        speed[speed == 0] = 1.0
        fields.rate, fields.edge_rate = fields.rate / speed, fields.edge_rate / speed
        d = (delta / speed)[None]

        def make(members: np.ndarray, reference: int, fields: _Fields = fields) -> _Batch:
            return _Batch(fields, friction, members, reference)

        if level == 0:
            # one cheap pass finds what rests, so that the anchor is right before anything is judged
            state = starting_state(anchor, velocity / speed)
            solve(state, make, 1, np.maximum(d, 1e-3), 1e-6, max_iterations, method)
            for members, batch in _groups(state.anchor, make):
                state.anchor[members], state.velocity[:, members] = batch.slowest(state.velocity[:, members], d[:, members])
            state = starting_state(state.anchor, state.velocity)
        else:
            state = starting_state(anchor, velocity / speed)
        solve(state, make, 5, d, tolerance, max_iterations, method)
        iterations[active] += state.iterations
        velocity = state.velocity * speed

        split = np.zeros((grid.n, active.size), dtype=bool)
        for members, batch in _groups(state.anchor, make):
            chosen, z = active[members], state.velocity[:, members]
            whole = _integrals(batch, z, d[:, members])
            middle = 0.5 * (edges[1:, members] + edges[:-1, members])
            inside = (middle > region[0]) & (middle < region[1])
            out["power"][chosen] = whole[3].sum(axis=0) * speed[members]
            out["power_inside"][chosen] = np.sum(whole[3] * inside, axis=0) * speed[members]
            out["slowest"][chosen] = batch.panel_speed(z).min(axis=0) * speed[members]
            tail = batch.edge_velocity(z)[:, 0]
            tail[2] -= fields.edge_rate[0, members]
            z_tail[:, chosen] = tail * speed[members]
            error = _error(motion, friction, t[chosen], edges[:, members], batch, z, d[:, members], speed[members], whole)
            out["quadrature_error"][chosen] = error.max(axis=0)
            split[:, members] = error > quadrature_tolerance
        out["residual"][active] = state.residual
        n_panel[active] = np.sum(np.diff(edges, axis=0) > 0, axis=0)

        more = split.any(axis=0) & (n_panel[active] < _MOST_PANELS) & (state.residual <= tolerance)
        if quadrature_tolerance == 0 or level == refinements or not more.any():
            break
        anchor_at = np.take_along_axis(edges, state.anchor[None], 0)[:, more]
        active, velocity, edges = active[more], velocity[:, more], _split(edges[:, more], split[:, more])
        anchor = np.argmax(edges == anchor_at, axis=0)
    return SmoothSolution(t, z_tail, **out, panels=n_panel, iterations=iterations, tolerance=tolerance)


def _groups(anchor: np.ndarray, make):
    """Instants by anchor, with their batch."""
    for reference in np.unique(anchor):
        members = np.flatnonzero(anchor == reference)
        yield members, make(members, int(reference))


def _error(
    motion: Motion,
    friction: Friction,
    t: np.ndarray,
    edges: np.ndarray,
    batch: _Batch,
    z: np.ndarray,
    delta: np.ndarray,
    speed: np.ndarray,
    whole: np.ndarray,
) -> np.ndarray:
    """Largest difference of each panel's integrals from those over its halves at the same velocity, ``(n_panel, n_time)``."""
    fine = _Fields(motion, t, Panels(_halves(edges), batch.fields.panels.order))
    fine.rate, fine.edge_rate = fine.rate / speed, fine.edge_rate / speed
    halves = _integrals(_Batch(fine, friction, np.arange(t.size), 2 * batch.reference), z, delta)
    return np.abs(halves[:, ::2] + halves[:, 1::2] - whole).max(axis=0) / friction.largest
