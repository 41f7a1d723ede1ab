"""CasADi expressions of gaits given by their path: where a point of a piece lies, and what
collocation evaluates there.

The path runs at unit shape speed, so that rates are the unit tangent and delta is measured at unit
shape speed; outputs are multiplied by the length of path per unit of phase. The tail velocity is
eliminated: it is the one that balances the body, from the NumPy solver, with derivatives by the
implicit function theorem (see `colloc.numerics.blocks.implicit_function`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from colloc.collocation.point_equations import N_RATE, forward, point_function
from colloc.collocation.shape_checks import ShapeCheck
from colloc.gaits.regime import Regime
from colloc.mechanics.bodies import FULL, Body
from colloc.mechanics.law import Law
from colloc.numerics import arcs
from colloc.numerics.blocks import LocalFunction, implicit_function, local_function
from colloc.numerics.columns import ColumnFunction


@dataclass(frozen=True, eq=False)
class Piece:
    """A point of a piece of the path as an expression: `shape` and `given` are its variables and
    instance parameters."""

    shape: ca.SX
    given: ca.SX
    angles: ca.SX
    direction: ca.SX
    speed: ca.SX


@lru_cache(maxsize=32)
def arc(n_joint: int) -> Piece:
    """A point of an arc.

    Shape: angles at its start, tangents at both ends, mean shape speed (length of the whole path
    over 2 pi). Given: the fraction tau of the arc, and the part of a period h that the arc takes.
    """
    rows = 1 if n_joint == 2 else n_joint
    start, t0, t1 = ca.SX.sym("q", n_joint), ca.SX.sym("t0", rows), ca.SX.sym("t1", rows)
    speed, tau, h = (ca.SX.sym(name) for name in ("speed", "tau", "h"))
    length = 2 * np.pi * speed
    return Piece(
        ca.vertcat(start, t0, t1, speed),
        ca.vertcat(tau, h),
        start + length * h * arcs.advance(t0, t1, tau),
        arcs.direction(t0, t1, tau),
        length,
    )


@lru_cache(maxsize=32)
def side(n_joint: int) -> Piece:
    """A point of a straight piece.

    Shape: angles at both ends. Given: the fraction sigma of the piece, and the part of the piece
    per unit of phase.
    """
    a, b = ca.SX.sym("a", n_joint), ca.SX.sym("b", n_joint)
    sigma, gain = ca.SX.sym("sigma"), ca.SX.sym("gain")
    step = b - a
    length = ca.sqrt(ca.sumsqr(step))
    return Piece(
        ca.vertcat(a, b), ca.vertcat(sigma, gain), a + sigma * step, step / length, gain * length
    )


Pulled = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Of a piece's shape ``(n_shape, n_point)`` and what is given at every point ``(2, n_point)``,
derivatives of k numbers along angles and direction ``(k, n_point, 2 n_joint)`` and along the speed
``(k, n_point)``: those along the shape, ``(k, n_shape, n_point)``."""


def along_shape(piece: Piece) -> Pulled:
    """By the Jacobian of the piece's expression."""
    out = ca.vertcat(piece.angles, piece.direction, piece.speed)
    slope = ca.densify(ca.vec(ca.jacobian(out, piece.shape)))
    jacobian, n_out = (
        ColumnFunction(ca.Function("slope", [piece.shape, piece.given], [slope])),
        out.numel(),
    )

    def pulled(
        shape: np.ndarray, given: np.ndarray, on_place: np.ndarray, on_speed: np.ndarray
    ) -> np.ndarray:
        slopes = jacobian(shape, given).T.reshape(-1, len(shape), n_out)
        on_out = np.concatenate([on_place, on_speed[:, :, None]], axis=2)
        return np.asarray((slopes @ on_out.transpose(1, 2, 0)).transpose(2, 1, 0))

    return pulled


def along_arcs(n_joint: int) -> Pulled:
    """Of arcs between unit tangents, by hand: all but a few weights is linear, which for four
    joints takes a third of the time.

    ``angles = start + 2 pi speed h (c T0 + e T1)`` and ``direction = a T0 + b T1``, with weights
    that depend on tau and on m = |T1 - T0|^2 / 4 (`colloc.numerics.arcs`).
    """
    m, tau = ca.SX.sym("m"), ca.SX.sym("tau")
    weights = ca.vertcat(*arcs.advance_weights(m, tau), *arcs.tangent_weights(m, tau))
    of_chord = ColumnFunction(
        ca.Function("weights", [m, tau], [ca.vertcat(weights, ca.jacobian(weights, m))])
    )

    def pulled(
        shape: np.ndarray, given: np.ndarray, on_place: np.ndarray, on_speed: np.ndarray
    ) -> np.ndarray:
        (tau, h), on = given, on_place.transpose(0, 2, 1)
        _, t0, t1 = shape[:-1].reshape(3, n_joint, -1)
        c, e, a, b, *slopes = of_chord(arcs.squared_half_chord(t0, t1), tau[None])
        on_angles, on_direction = on[:, :n_joint], on[:, n_joint:]
        on_advance = 2 * np.pi * shape[-1] * h * on_angles
        ends = [
            np.einsum("kjt,jt->kt", part, t)
            for part in (on_advance, on_direction)
            for t in (t0, t1)
        ]
        on_m = sum(slope * end for slope, end in zip(slopes, ends, strict=True))
        turned = 0.5 * on_m[:, None] * (t1 - t0)
        pace = (c * ends[0] + e * ends[1]) / shape[-1] + 2 * np.pi * on_speed
        on_t0, on_t1 = (
            c * on_advance + a * on_direction - turned,
            e * on_advance + b * on_direction + turned,
        )
        return np.concatenate([on_angles, on_t0, on_t1, pace[:, None]], axis=1)

    return pulled


@lru_cache(maxsize=32)
def path_point(body: Body, friction: Law, piece: Piece) -> LocalFunction:
    """Rotation rate, velocity of the centre of mass along the lab's x, and power. Locals: theta,
    then the piece's shape.

    Differentiating takes most of the time in which a program is built, so it is done once.
    """
    theta, delta, z = ca.SX.sym("theta"), ca.SX.sym("delta"), ca.SX.sym("Z", 3)
    now = body.sliding(friction, piece.angles, piece.direction, z, delta)
    out = piece.speed * ca.vertcat(z[2], forward(theta, now.centre), now.power)
    return implicit_function(
        "point", ca.vertcat(theta, piece.shape), piece.given, z, delta, now.force, out
    )


@lru_cache(maxsize=32)
def full_path_point(body: Body, friction: Law, piece: Piece, regime: Regime) -> LocalFunction:
    """The same with everything as a variable: locals of
    `colloc.collocation.point_equations.point_function`, then the shape. Outputs: the place of the
    point and its direction, and the equations of that function, which all vanish; then those of
    `path_point`."""
    here, n = point_function(FULL, body, friction, regime), 2 * body.n_joint
    local, delta = ca.SX.sym("local", here.n_local), ca.SX.sym("delta")
    equations, gained = ca.vertsplit(
        here.value(local, ca.SX(0, 1), delta), [0, here.n_out - N_RATE, here.n_out]
    )
    place = local[1 : 1 + n] - ca.vertcat(piece.angles, piece.direction)
    out = ca.vertcat(place, equations, piece.speed * gained)
    return local_function("point", ca.vertcat(local, piece.shape), piece.given, delta, out)


@lru_cache(maxsize=256)
def chord(piece: Piece) -> LocalFunction:
    """Displacement along a whole arc."""
    n_joint = piece.angles.shape[0]
    whole = ca.substitute(piece.angles - piece.shape[:n_joint], piece.given[0], 1.0)
    return local_function("chord", piece.shape, piece.given[1], ca.SX.sym("delta"), whole)


def per_phase(function: LocalFunction, piece: Piece, *, placed: bool = False) -> LocalFunction:
    """A density at unit shape speed as one per unit of phase. Locals: its own, then the shape of
    the piece, by which angles and rates are `placed` if it is a function of these alone."""
    own, delta = ca.SX.sym("local", 0 if placed else function.n_local), ca.SX.sym("delta")
    out = function.value(
        ca.vertcat(piece.angles, piece.direction) if placed else own, ca.SX(0, 1), delta
    )
    return local_function(
        function.value.name(), ca.vertcat(own, piece.shape), piece.given, delta, piece.speed * out
    )


@lru_cache(maxsize=256)
def placed_check(check: ShapeCheck, piece: Piece) -> LocalFunction:
    """A shape check at a point of a piece; given are those of the piece and the share of the
    cut."""
    share = ca.SX.sym("share")
    given = ca.vertcat(piece.given, share)
    return local_function(
        "check", piece.shape, given, ca.SX.sym("delta"), check.cut(piece.angles, share)
    )


def side_lengths(n_joint: int, n_piece: int) -> LocalFunction:
    """Squared length of every piece of a chain of vertices, then the length of the chain."""
    vertices = ca.SX.sym("v", n_joint, n_piece + 1)
    step = vertices[:, 1:] - vertices[:, :-1]
    squared = ca.sum1(step * step).T
    out = ca.vertcat(squared, ca.sum1(ca.sqrt(squared)))
    return local_function("sides", ca.vec(vertices), ca.SX(0, 1), ca.SX.sym("delta"), out)


def side_shares(n_joint: int, n_piece: int) -> LocalFunction:
    """The length of every piece of a chain of vertices over that of the chain."""
    vertices = ca.SX.sym("v", n_joint, n_piece + 1)
    step = vertices[:, 1:] - vertices[:, :-1]
    length = ca.sqrt(ca.sum1(step * step)).T
    return local_function(
        "shares", ca.vec(vertices), ca.SX(0, 1), ca.SX.sym("delta"), length / ca.sum1(length)
    )


def unit_norm(n_joint: int) -> LocalFunction:
    """Squared norm of a tangent, less 1."""
    tangent = ca.SX.sym("t", n_joint)
    return local_function("norm", tangent, ca.SX(0, 1), ca.SX.sym("delta"), ca.sumsqr(tangent) - 1)


def excess_turn(n_joint: int, curvature: float) -> LocalFunction:
    """How far unit tangents at both ends of an arc are apart beyond what the curvature allows, as
    an angle.

    Locals: both tangents and the mean shape speed; given: the part of a period h that the arc
    takes. Half a turn an arc is the most that unit tangents can express.
    """
    t0, t1 = ca.SX.sym("t0", n_joint), ca.SX.sym("t1", n_joint)
    speed, h = ca.SX.sym("speed"), ca.SX.sym("h")
    half = ca.fmin(np.pi * curvature * speed * h, 1.4)
    out = 0.25 * ca.sumsqr(t1 - t0) / ca.sin(half) - ca.sin(half)
    return local_function("turn", ca.vertcat(t0, t1, speed), h, ca.SX.sym("delta"), out)
