r"""How a balanced body changes with its shape and rates, whatever its parts: links of a chain or
nodes of a smooth curve.

A balanced velocity z solves R(z, y) = 0 with y = (shape, rates) and R the net force and torque, so

    dz/dy = -R_z^-1 R_y

and whatever depends on (z, y) changes by the chain rule (implicit function theorem). R and z are
those of the anchor, the slowest part, whose speed keeps its relative precision at any delta. The
switch of a directional law is differentiated on its current side.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from colloc.mechanics.damped_newton import solve3

Parts = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Tangential, normal, and of rotation, ``(n_part, n_time)`` each."""


class Changes(NamedTuple):
    """Derivatives along (shape, rates), or a load: of the anchor's velocity ``(3, n, n_time)``; of
    the parts' velocities in the body's axes, along and across the part, and of their rotation
    rates, ``(n_part, n, n_time)``; of the power ``(n, n_time)``."""

    anchor: np.ndarray
    vx: np.ndarray
    vy: np.ndarray
    vs: np.ndarray
    vn: np.ndarray
    w: np.ndarray
    power: np.ndarray


class Load(NamedTuple):
    """Outside forces on the parts, in the body's axes, and their derivatives; broadcast to
    ``(n_part, n, n_time)``."""

    x: np.ndarray
    y: np.ndarray
    dx: np.ndarray
    dy: np.ndarray


def implicit_changes(
    posture: tuple[np.ndarray, ...],
    velocity: Parts,
    force: Parts,
    stiffness: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...],
    left: np.ndarray,
    along_path: Callable[[np.ndarray], np.ndarray],
    dphi: np.ndarray,
    dw: np.ndarray,
    load: Load | None = None,
) -> Changes:
    """Changes of a body in balance; axes of all arrays: (part, shape coordinate or rate, time).

    Parameters
    ----------
    posture : (cos, sin, x, y) of the parts, seen from the anchor, ``(n_part, n_time)`` each
    velocity, force : Parts
        Forces and couples on whole parts.
    stiffness : 3 x 3 of (n_part, n_time)
        Minus the derivatives of a part's force with respect to its velocity.
    left : (n_time, 3, 3)
        Minus the derivative of the net force with respect to the anchor's velocity.
    along_path : callable
        Sums ``(n_part, ...)`` along the body from the anchor to the parts, times length.
    dphi, dw : (n_part, n, n_time)
        Derivatives of the parts' angles, and of their rotation rates relative to the anchor.
    load : Load, optional
        Outside forces on the parts.
    """
    c, s, x, y = (a[:, None] for a in posture)
    vs, vn, w = (a[:, None] for a in velocity)
    fs, fn, couple = (a[:, None] for a in force)
    dx, dy = -along_path(s * dphi), along_path(c * dphi)
    dvx, dvy = -along_path(dw * s + w * c * dphi), along_path(dw * c - w * s * dphi)
    dvs, dvn = dvx * c + dvy * s + vn * dphi, dvy * c - dvx * s - vs * dphi
    K = [[a[:, None] for a in row] for row in stiffness]

    def force_change(*d: np.ndarray) -> list[np.ndarray]:
        return [-(row[0] * d[0] + row[1] * d[1] + row[2] * d[2]) for row in K]

    fx, fy = fs * c - fn * s, fs * s + fn * c
    dfs, dfn, dcouple = force_change(dvs, dvn, dw)
    dfx, dfy = dfs * c - dfn * s - fy * dphi, dfs * s + dfn * c + fx * dphi
    if load is not None:
        dfx, dfy, fx, fy = dfx + load.dx, dfy + load.dy, fx + load.x, fy + load.y
    torque = dx * fy - dy * fx + x * dfy - y * dfx + dcouple
    net = np.stack([dfx.sum(axis=0), dfy.sum(axis=0), torque.sum(axis=0)])
    dz = np.stack([solve3(left, net[:, j]) for j in range(net.shape[1])], axis=1)

    dvx, dvy = dvx + dz[0] - y * dz[2], dvy + dz[1] + x * dz[2]
    dvs, dvn = (
        dvs + c * dz[0] + s * dz[1] + (x * s - y * c) * dz[2],
        dvn + c * dz[1] - s * dz[0] + (x * c + y * s) * dz[2],
    )
    dw = dw + dz[2]
    dfs, dfn, dcouple = force_change(dvs, dvn, dw)
    power = -(dfs * vs + dfn * vn + dcouple * w + fs * dvs + fn * dvn + couple * dw).sum(axis=0)
    return Changes(dz, dvx, dvy, dvs, dvn, dw, power)
