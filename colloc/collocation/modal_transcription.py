"""Direct collocation of harmonic gaits of a smooth body with a few bending modes.

Decision variables: gait parameters p; amplitudes of the modes and their rates at every point; the orientation theta of the
body's mean direction at every site; distance x and work W at every edge. The velocity is not a variable but the one that
balances the body (see `colloc.numerics.blocks.implicit_function`). Rates, velocities and delta are per radian of phase.
x is the displacement of the tail along a fixed direction: over a period that of every point of the body.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from colloc.collocation.balanced_velocity import BalancedVelocity
from colloc.collocation.layout import RADIANS, Layout
from colloc.collocation.point_equations import mean_square, minus_efficiency
from colloc.mechanics.friction import Friction
from colloc.numerics.blocks import Assembly, Block, LocalFunction, implicit_function
from colloc.numerics.constraint_rows import Group, equalities, gait_group, quadrature_group, rotation_groups, selector, stacked
from colloc.numerics.mesh import Mesh, uniform_mesh
from colloc.numerics.schemes import scheme
from colloc.smooth.modal_balance import modal_balance, solve_modal
from colloc.smooth.modal_body import ModalBody
from colloc.smooth.modal_problem import ModalProblem

OMEGA, ADVANCE, POWER = range(3)
"""Outputs of `modal_point`, per radian of phase."""
_PLACES = 13
"""Where on the body |Theta| is bounded."""


def modal_point(body: ModalBody, friction: Friction) -> LocalFunction:
    """Rotation rate, velocity of the tail along the lab's x, and power. Locals: theta, amplitudes, their rates."""
    theta, delta, z = ca.SX.sym("theta"), ca.SX.sym("delta"), ca.SX.sym("Z", 3)
    q, rates = ca.SX.sym("q", body.modes), ca.SX.sym("r", body.modes)
    force, power = modal_balance(body, friction, q, rates, z, delta)
    out = ca.vertcat(z[2], ca.cos(theta) * z[0] - ca.sin(theta) * z[1], power)
    return implicit_function("point", ca.vertcat(theta, q, rates), ca.SX(0, 1), z, delta, force, out)


@dataclass(frozen=True, eq=False)
class ModalTranscription:
    """The nonlinear program of a smooth body; attributes as `colloc.collocation.transcription.Transcription`."""

    problem: ModalProblem
    mesh: Mesh
    layout: Layout
    assembly: Assembly
    lower: np.ndarray
    upper: np.ndarray
    constraint_lower: np.ndarray
    constraint_upper: np.ndarray
    groups: dict[str, slice]
    velocity: BalancedVelocity

    @property
    def lifted(self) -> bool:
        return False

    @property
    def speed_unit(self) -> float:
        return RADIANS

    def block_parameters(self, parameters: np.ndarray) -> list[np.ndarray]:
        """Instance parameters of all blocks, objective first; they do not change."""
        return [b.parameters for b in (self.assembly.objective, *self.assembly.blocks)]

    def shapes(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes and their rates per radian at the points, ``(modes, n_point)``."""
        modes, gait = self.problem.body.modes, self.problem.gait
        q = (gait.angle_matrix(self.mesh.times, modes) @ parameters).T
        return q, (gait.rate_matrix(self.mesh.times, modes) @ parameters).T / RADIANS

    def feasible_point(self, parameters: np.ndarray, delta: float) -> np.ndarray:
        """Variables that satisfy every equation but net rotation for a gait, at `delta` per period."""
        problem, mesh, layout = self.problem, self.mesh, self.layout
        x = np.zeros(layout.n)
        x[layout.parameters[:, 0]] = parameters
        x[layout.angles], x[layout.rates] = q, rates = self.shapes(parameters)
        z = solve_modal(problem.body, problem.friction, q, rates, delta / RADIANS).velocity
        power = modal_balance(problem.body, problem.friction, q, rates, z, delta / RADIANS).power
        state, rate = mesh.integration()
        theta = np.zeros(mesh.n_site)
        theta[1:] = spsolve(state[:, 1:].tocsc(), RADIANS * (rate @ z[2]))
        at_points = np.empty(mesh.n_point, dtype=int)
        at_points[mesh.points] = mesh.sites
        _, quadrature = mesh.quadrature()
        turned = np.exp(1j * theta[at_points]) * (z[0] + 1j * z[1])
        mirrored = problem.gait.symmetry == "antipodal"
        turn = -0.5 * theta[-1] if mirrored else -np.angle(np.sum(quadrature @ turned))
        x[layout.theta[0]] = theta + turn
        x[layout.distance[0, 1:]] = np.cumsum(RADIANS * (quadrature @ (turned * np.exp(1j * turn)).real))
        x[layout.work[0, 1:]] = np.cumsum(RADIANS * (quadrature @ power[0]))
        return x


def _layout(problem: ModalProblem, mesh: Mesh) -> Layout:
    modes = problem.body.modes
    sizes = {
        "parameters": (problem.gait.size(modes), 1),
        "theta": (1, mesh.n_site),
        "distance": (1, mesh.n + 1),
        "work": (1, mesh.n + 1),
        "angles": (modes, mesh.n_point),
        "rates": (modes, mesh.n_point),
        "z": (0, mesh.n_point),
        "forces": (0, mesh.n_point),
    }
    indices, start = {}, 0
    for name, (rows, columns) in sizes.items():
        indices[name] = start + np.arange(rows * columns).reshape(columns, rows).T
        start += rows * columns
    return Layout(n=start, **indices)


def transcribe_modal(problem: ModalProblem) -> ModalTranscription:
    """The nonlinear program of a smooth body on a uniform mesh."""
    mesh = uniform_mesh(scheme(problem.scheme), problem.intervals, problem.gait.fraction)
    layout, body, modes = _layout(problem, mesh), problem.body, problem.body.modes
    n, n_point = layout.n, mesh.n_point
    point = modal_point(body, problem.friction)
    n_out = point.n_out
    sites = np.empty(n_point, dtype=int)
    sites[mesh.points] = mesh.sites
    velocity = BalancedVelocity(partial(solve_modal, body, problem.friction), modes, n_point)

    def balanced(local: ca.MX, delta: ca.MX) -> ca.MX:
        return velocity(local[1 : 1 + modes, :], local[1 + modes :, :], delta)

    gather = np.concatenate([layout.theta[:, sites], layout.angles, layout.rates])
    blocks = {
        "point": (point, gather, np.empty((0, n_point)), balanced),
        "shape speed": (
            mean_square(ca.DM(problem.gait.mean_square_rate(modes) / RADIANS**2)),
            layout.parameters,
            np.empty((0, 1)),
            None,
        ),
    }
    state, rate = mesh.integration()
    pick = selector(np.arange(n_point) * n_out + OMEGA, n_out * n_point)
    places = np.kron(np.eye(n_point), body.modes_at(np.linspace(0.0, 1.0, _PLACES)))
    bound = np.full(len(places), problem.largest_angle)
    one = sparse.identity(1, format="csr")
    groups = [
        gait_group("angles", layout.angles, layout.parameters, problem.gait.angle_matrix(mesh.times, modes), n),
        gait_group("rates", layout.rates, layout.parameters, problem.gait.rate_matrix(mesh.times, modes) / RADIANS, n),
        equalities("orientation", state @ selector(layout.theta[0], n), {"point": (-RADIANS * rate @ pick).tocsr()}),
        *rotation_groups(problem.gait.symmetry, layout.theta[0], n),
        quadrature_group("distance", layout.distance, ADVANCE, n_out, mesh, n, RADIANS),
        quadrature_group("work", layout.work, POWER, n_out, mesh, n, RADIANS),
        Group(
            "tangent angle", -bound, bound, (sparse.csr_matrix(places) @ selector(layout.angles.ravel(order="F"), n)).tocsr()
        ),
        Group(
            "shape speed",
            np.array([problem.smallest_shape_speed**2]),
            np.array([np.inf]),
            sparse.csr_matrix((1, n)),
            {"shape speed": one},
        ),
    ]
    lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
    for start in (layout.distance[0, 0], layout.work[0, 0]):
        lower[start] = upper[start] = 0.0
    ends = np.array([[layout.distance[0, -1]], [layout.work[0, -1]]])
    rows = np.cumsum([0] + [g.m for g in groups])
    return ModalTranscription(
        problem,
        mesh,
        layout,
        Assembly(
            n,
            Block(minus_efficiency(), ends, one, np.empty((0, 1))),
            tuple(
                Block(function, where, stacked(groups, name, function.n_out * where.shape[1]), given, implicit)
                for name, (function, where, given, implicit) in blocks.items()
            ),
            sparse.vstack([g.linear for g in groups]).tocsr(),
        ),
        lower,
        upper,
        np.concatenate([g.lower for g in groups]),
        np.concatenate([g.upper for g in groups]),
        {g.name: slice(int(a), int(b)) for g, a, b in zip(groups, rows, rows[1:], strict=False)},
        velocity,
    )
