"""Direct collocation of bump crawlers: position and modal amplitudes at the nodes are decision variables.

Decision variables: coordinates q of the bump at every edge of the mesh (a straight piece between neighbours, the pieces'
lengths in a fixed proportion: that fixes the pace); the body's orientation theta at every site; distance x and work W at
every edge. The velocity at every Gauss point is the one that balances the body, from the NumPy solver, with first and
second derivatives by the implicit function theorem (as the formulation "map" of `collocation.point_equations`): where straight
parts stick, the balance as a constraint is a step, the velocity it implies is not. Only the first half period is solved, its
mirror image is the second.

Minimised is ``(W / (smallest coefficient x) - 1) / (2 epsilon)``, the relative loss per region length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.collocation.balanced_velocity import BalancedVelocity
from colloc.collocation.layout import RADIANS
from colloc.mechanics.friction import Friction
from colloc.numerics.blocks import Assembly, Block, LocalFunction, implicit_function, local_function
from colloc.numerics.mesh import Mesh, uniform_mesh
from colloc.numerics.schemes import scheme
from colloc.smooth.bump_balance import balance_and_power, bump_instant, solve_bump
from colloc.smooth.bump_body import BumpBody

POSITION_SCALE = 1.3
"""What a bump's shift by its own width counts, against radians of amplitude, in the length of a piece."""


ANGLES = 95
"""Places along the bump at which its tangent angle is bounded: modes of low degree exceed the bound little in between."""


@dataclass(frozen=True, eq=False)
class BumpLayout:
    """Index arrays of the variables, ``(n_component, n_position)``; `parameters` are those a trust region bounds: all q."""

    parameters: np.ndarray
    q: np.ndarray
    piece: np.ndarray
    theta: np.ndarray
    distance: np.ndarray
    work: np.ndarray
    n: int


def _layout(body: BumpBody, mesh: Mesh) -> BumpLayout:
    sizes = {
        "q": (body.n, mesh.n + 1),
        "piece": (1, 1),
        "theta": (1, mesh.n_site),
        "distance": (1, mesh.n + 1),
        "work": (1, mesh.n + 1),
    }
    indices, start = {}, 0
    for name, (rows, columns) in sizes.items():
        indices[name] = start + np.arange(rows * columns).reshape(columns, rows).T
        start += rows * columns
    return BumpLayout(parameters=indices["q"].reshape(-1, 1), n=start, **indices)


def bump_point(body: BumpBody, friction: Friction, h: float) -> LocalFunction:
    """Rotation rate, rate of distance and power at a point, as functions of the coordinates alone.

    Locals: coordinates at both ends of the interval, theta. Instance parameters: the point's place tau in the interval,
    0 to 1, and the velocity Z that balances it.
    """
    q0, q1, z = (ca.SX.sym(name, size) for name, size in (("q0", body.n), ("q1", body.n), ("Z", 3)))
    theta, tau, delta = (ca.SX.sym(name) for name in ("theta", "tau", "delta"))
    q, rates, slow = (1 - tau) * q0 + tau * q1, (q1 - q0) / h, delta / body.width
    balance, power = balance_and_power(body, friction, bump_instant(body, friction, q, rates, z, slow), slow)
    out = ca.vertcat(z[2], ca.cos(theta) * z[0] - ca.sin(theta) * z[1], power)

    y = ca.vertcat(q0, q1, theta)
    return implicit_function("bump", y, tau, z, delta, balance, out)


def _piece_length(n: int) -> LocalFunction:
    """Squared length of a piece of the polygon less its share (an instance parameter) of the common one."""
    ends, piece, ratio = ca.SX.sym("q", 2 * n), ca.SX.sym("piece"), ca.SX.sym("ratio")
    step = ca.vertcat(POSITION_SCALE * (ends[n] - ends[0]), ends[n + 1 :] - ends[1:n])
    return local_function(
        "piece", ca.vertcat(ends, piece), ratio, ca.SX.sym("delta"), ca.dot(step, step) - (ratio * piece) ** 2
    )


def bump_mesh(n: int, nodes: int = 2) -> Mesh:
    """`n` intervals with `nodes` Gauss points each on half a period, in radians of phase."""
    return uniform_mesh(scheme(f"gauss-{nodes}"), n, np.pi)


def piece_lengths(vertices: np.ndarray) -> np.ndarray:
    """Lengths of the pieces of a polygon in q, ``(n,)``."""
    steps = np.diff(vertices)
    return np.sqrt((POSITION_SCALE * steps[0]) ** 2 + np.sum(steps[1:] ** 2, axis=0))


def _loss(body: BumpBody, friction: Friction) -> LocalFunction:
    state = ca.SX.sym("xW", 2)
    loss = (state[1] / (friction.smallest * state[0]) - 1) / (2 * body.epsilon)
    return local_function("loss", state, ca.SX(0, 1), ca.SX.sym("delta"), loss)


@dataclass(frozen=True, eq=False)
class BumpTranscription:
    """The nonlinear program of a bump crawler; attributes as `colloc.collocation.transcription.Transcription`."""

    body: BumpBody
    friction: Friction
    mesh: Mesh
    layout: BumpLayout
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

    def vertices(self, x: np.ndarray) -> np.ndarray:
        """Position and amplitudes at the nodes, ``(body.n, n + 1)``."""
        return x[self.layout.q]


def transcribe_bump(
    body: BumpBody,
    friction: Friction,
    guess: np.ndarray,
    *,
    nodes: int = 2,
    largest_angle: float = 1.5,
    smallest_piece: float = 0.02,
) -> BumpTranscription:
    """The nonlinear program of a crawler that starts straight.

    Parameters
    ----------
    body : BumpBody
    friction : Friction
    guess : (body.n, n + 1)
        Coordinates at the nodes; it fixes how many pieces half a period has, and their lengths relative to each other.
    nodes : int
        Gauss points on each piece.
    largest_angle : float
        Bound on |Theta| at `ANGLES` places of the bump [rad]; below pi/2 the body cannot cross itself.
    smallest_piece : float
        Lower bound on the length of a piece, which keeps speeds away from delta.
    """
    mesh = bump_mesh(guess.shape[1] - 1, nodes)
    ratios = piece_lengths(guess) / np.mean(piece_lengths(guess))
    layout = _layout(body, mesh)
    n = layout.n
    point = bump_point(body, friction, float(mesh.h[0]))
    interval = np.repeat(np.arange(mesh.n), nodes)
    gather = np.concatenate([layout.q[:, interval], layout.q[:, interval + 1], layout.theta[:, mesh.sites.ravel()]])
    piece_gather = np.concatenate([layout.q[:, :-1], layout.q[:, 1:], np.repeat(layout.piece, mesh.n, axis=1)])
    n_out, n_source = point.n_out, point.n_out * mesh.n_point

    def pick(columns: np.ndarray, width: int) -> sparse.csr_matrix:
        return sparse.csr_matrix((np.ones(columns.size), (np.arange(columns.size), columns)), shape=(columns.size, width))

    def outputs(which: range) -> sparse.csr_matrix:
        return pick((np.arange(mesh.n_point)[:, None] * n_out + np.array(which)).ravel(), n_source)

    shape = body.modes_at(np.linspace(-1.0, 1.0, ANGLES + 2)[1:-1])[0]
    angles = sparse.kron(sparse.identity(mesh.n + 1), shape) @ pick(layout.q[1:].ravel(order="F"), n)
    orient_state, orient_rate = mesh.integration()
    state, rate = mesh.quadrature()
    none = {"point": None, "piece": None}
    rows: list[tuple[str, sparse.spmatrix, dict, float]] = [
        (
            "orientation",
            orient_state @ pick(layout.theta[0], n),
            none | {"point": -body.width * orient_rate @ outputs(range(1))},
            0.0,
        ),
        ("rotation", pick(layout.theta[0, :1], n) + pick(layout.theta[0, -1:], n), none, 0.0),
        ("distance", state @ pick(layout.distance[0], n), none | {"point": -rate @ outputs(range(1, 2))}, 0.0),
        ("work", state @ pick(layout.work[0], n), none | {"point": -rate @ outputs(range(2, 3))}, 0.0),
        ("pieces", sparse.csr_matrix((mesh.n, n)), none | {"piece": sparse.identity(mesh.n, format="csr")}, 0.0),
        ("angles", angles, none, largest_angle),
    ]
    ends = np.cumsum([0] + [linear.shape[0] for _, linear, _, _ in rows])
    upper_g = np.concatenate([np.full(linear.shape[0], bound) for _, linear, _, bound in rows])

    def scatter(block: str, width: int) -> sparse.csr_matrix:
        parts = [p[block] if p[block] is not None else sparse.csr_matrix((a.shape[0], width)) for _, a, p, _ in rows]
        return sparse.vstack(parts).tocsr()

    tau = np.tile(mesh.scheme.c, mesh.n)[None]
    velocity = BalancedVelocity(partial(solve_bump, body, friction), body.n, mesh.n_point)

    def balanced(local: ca.MX, delta: ca.MX) -> ca.MX:
        q0, q1 = local[: body.n, :], local[body.n : 2 * body.n, :]
        along = ca.repmat(ca.DM(tau), body.n, 1)
        return velocity((1 - along) * q0 + along * q1, (q1 - q0) / float(mesh.h[0]), delta)

    blocks = (
        Block(point, gather, scatter("point", n_source), tau, balanced),
        Block(_piece_length(body.n), piece_gather, scatter("piece", mesh.n), ratios[None]),
    )
    objective = Block(
        _loss(body, friction),
        np.array([[layout.distance[0, -1]], [layout.work[0, -1]]]),
        sparse.identity(1, format="csr"),
        np.empty((0, 1)),
    )
    lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
    lower[layout.q[0]], upper[layout.q[0]] = -body.reach, body.reach
    fixed = np.concatenate([layout.q[1:, 0], layout.q[1:, -1], layout.distance[:, 0], layout.work[:, 0]])
    lower[fixed] = upper[fixed] = 0.0
    lower[layout.piece], upper[layout.piece] = smallest_piece, 2.0
    return BumpTranscription(
        body,
        friction,
        mesh,
        layout,
        Assembly(n, objective, blocks, sparse.vstack([linear for _, linear, _, _ in rows]).tocsr()),
        lower,
        upper,
        -upper_g,
        upper_g,
        {name: slice(int(a), int(b)) for (name, *_), a, b in zip(rows, ends, ends[1:], strict=False)},
        velocity,
    )
