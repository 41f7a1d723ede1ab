"""Derivatives of what is collocated on a path along the shapes of its pieces, swept back: a few numbers, many points."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from colloc.collocation.path_equations import Piece
from colloc.numerics import arcs
from colloc.numerics.columns import ColumnFunction

Pulled = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Of a piece's shape ``(n_shape, n_point)`` and what is given at every point ``(2, n_point)``, derivatives of k numbers along
angles and direction ``(k, n_point, 2 n_joint)`` and along the speed ``(k, n_point)``: those along the shape,
``(k, n_shape, n_point)``."""


def along_shape(piece: Piece) -> Pulled:
    """By the Jacobian of the piece's expression."""
    out = ca.vertcat(piece.angles, piece.direction, piece.speed)
    slope = ca.densify(ca.vec(ca.jacobian(out, piece.shape)))
    jacobian, n_out = ColumnFunction(ca.Function("slope", [piece.shape, piece.given], [slope])), out.numel()

    def pulled(shape: np.ndarray, given: np.ndarray, on_place: np.ndarray, on_speed: np.ndarray) -> np.ndarray:
        slopes = jacobian(shape, given).T.reshape(-1, len(shape), n_out)
        on_out = np.concatenate([on_place, on_speed[:, :, None]], axis=2)
        return np.asarray((slopes @ on_out.transpose(1, 2, 0)).transpose(2, 1, 0))

    return pulled


def along_arcs(n_joint: int) -> Pulled:
    """Of arcs between unit tangents, by hand: all but a few weights is linear, which for four joints takes a third of the time.

    ``angles = start + 2 pi speed h (c T0 + e T1)`` and ``direction = a T0 + b T1``, with weights that depend on tau and on
    m = |T1 - T0|^2 / 4 (`colloc.numerics.arcs`).
    """
    m, tau = ca.SX.sym("m"), ca.SX.sym("tau")
    weights = ca.vertcat(*arcs.advance_weights(m, tau), *arcs.tangent_weights(m, tau))
    of_chord = ColumnFunction(ca.Function("weights", [m, tau], [ca.vertcat(weights, ca.jacobian(weights, m))]))

    def pulled(shape: np.ndarray, given: np.ndarray, on_place: np.ndarray, on_speed: np.ndarray) -> np.ndarray:
        (tau, h), on = given, on_place.transpose(0, 2, 1)
        _, t0, t1 = shape[:-1].reshape(3, n_joint, -1)
        c, e, a, b, *slopes = of_chord(arcs.squared_half_chord(t0, t1), tau[None])
        on_angles, on_direction = on[:, :n_joint], on[:, n_joint:]
        on_advance = 2 * np.pi * shape[-1] * h * on_angles
        ends = [np.einsum("kjt,jt->kt", part, t) for part in (on_advance, on_direction) for t in (t0, t1)]
        on_m = sum(slope * end for slope, end in zip(slopes, ends, strict=True))
        turned = 0.5 * on_m[:, None] * (t1 - t0)
        pace = (c * ends[0] + e * ends[1]) / shape[-1] + 2 * np.pi * on_speed
        on_t0, on_t1 = c * on_advance + a * on_direction - turned, e * on_advance + b * on_direction + turned
        return np.concatenate([on_angles, on_t0, on_t1, pace[:, None]], axis=1)

    return pulled
