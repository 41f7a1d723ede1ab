"""A smooth body by its tangent angle, integrated on composite Gauss panels.

Positions are integrals of cos and sin of ``Theta(s, t)`` with the panels' integration matrices
(paper, eqs. x0, y0), so the body is inextensible to rounding. The rigid velocity ``z = (u, v,
omega)`` is that of a *reference*, one of the panels' edges: velocity of the point and rotation rate
of the tangent there. Path integrals start at the reference and rates are relative to it, so a
stretch that keeps its shape moves with relative precision, however slow it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy import sparse

from colloc.numerics.arrays import Array, namespace
from colloc.numerics.schemes import Scheme, scheme


@lru_cache(maxsize=1024)
def _panel_matrices(
    n: int, order: int
) -> tuple[sparse.csc_matrix, sparse.csc_matrix, sparse.csc_matrix]:
    """Nodes to whole panels, panels to their nodes, and the integrals from a panel's left end to
    its nodes."""
    each, unit = sparse.identity(n, format="csc"), scheme(f"gauss-{order}")
    return (
        sparse.kron(each, unit.b, "csc"),
        sparse.kron(each, np.ones((order, 1)), "csc"),
        sparse.kron(each, unit.A, "csc"),
    )


@dataclass(frozen=True, eq=False)
class PanelGrid:
    """Gauss panels on the arc length, one column a time point (or a single column for all).

    edges: ascending from 0 to 1, ``(n_panel + 1, n_time)``; panels of width zero fill up columns
    that need fewer. order: Gauss nodes a panel.
    """

    edges: np.ndarray
    order: int = 8

    @property
    def n(self) -> int:
        return len(self.edges) - 1

    @property
    def fixed(self) -> bool:
        """Whether the panels are the same at all times."""
        return self.edges.shape[1] == 1

    @property
    def gauss(self) -> Scheme:
        return scheme(f"gauss-{self.order}")

    @property
    def widths(self) -> np.ndarray:
        """Width of the panel of each node, ``(n_panel * order, n_time)``."""
        return np.repeat(np.diff(self.edges, axis=0), self.order, axis=0)

    @property
    def nodes(self) -> np.ndarray:
        """Arc length of the nodes, ``(n_panel * order, n_time)``."""
        left = np.repeat(self.edges[:-1], self.order, axis=0)
        return left + np.tile(self.gauss.c, self.n)[:, None] * self.widths

    @property
    def weights(self) -> np.ndarray:
        """Quadrature weights, ``(n_panel * order, n_time)``."""
        return np.tile(self.gauss.b, self.n)[:, None] * self.widths

    def integrate(self, integrand: Array, reference: int) -> Array:
        """Integrals from edge `reference` to the nodes; the integrand ``(n_node, n_time)`` is times
        the panel widths."""
        matmul = namespace(integrand).matmul
        whole, spread, inside = _panel_matrices(self.n, self.order)
        ahead, ones = np.arange(self.n) >= reference, np.ones((self.n, self.n))
        panel_by_panel = np.tril(ones, -1) * ahead - np.triu(ones) * ~ahead
        start = matmul(panel_by_panel, matmul(whole, integrand))
        return matmul(spread, start) + matmul(inside, integrand)

    def edge_path(self, reference: int) -> np.ndarray:
        """The same integrals up to the edges, ``(n_panel + 1, n_node)``."""
        edge, panel = np.arange(self.n + 1)[:, None], np.arange(self.n)[None, :]
        ahead = (panel >= reference).astype(float) * (panel < edge)
        return np.kron(ahead - (panel < reference) * (panel >= edge), self.gauss.b)

    def panel_sums(self, density: np.ndarray) -> np.ndarray:
        """Integral of a density ``(n_node, n_time)`` over each panel, ``(n_panel, n_time)``."""
        return (self.weights * density).reshape(self.n, self.order, -1).sum(axis=1)


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
    x, y = panels.integrate(width * c, reference), panels.integrate(width * s, reference)
    turning = width * (rate - reference_rate)
    vx, vy = -panels.integrate(turning * s, reference), panels.integrate(turning * c, reference)
    return Curve(
        c, s, x * s - y * c, x * c + y * s, vx * c + vy * s, vy * c - vx * s, panels.weights
    )


def node_velocity(body: Curve, z: Array) -> tuple[Array, Array]:
    """Tangential and normal velocity of the nodes when the reference moves with z ``(3,
    n_time)``."""
    u, v, omega = z[0:1, :], z[1:2, :], z[2:3, :]
    return (
        body.cos * u + body.sin * v + body.arm_s * omega + body.shape_s,
        body.cos * v - body.sin * u + body.arm_n * omega + body.shape_n,
    )


def resultant(body: Curve, tangential: Array, normal: Array) -> Array:
    """Net force and torque about the reference of a force per length, ``(3, n_time)`` (paper, eq.
    ftb)."""
    xp = namespace(body.cos, tangential)
    fs, fn = body.weight * tangential, body.weight * normal
    return xp.stack(
        [
            xp.sum_rows(fs * body.cos - fn * body.sin),
            xp.sum_rows(fs * body.sin + fn * body.cos),
            xp.sum_rows(fs * body.arm_s + fn * body.arm_n),
        ]
    )


def mean_velocity(body: Curve, vs: Array, vn: Array) -> Array:
    """Velocity of the centre of mass, ``(2, n_time)``, from that of the nodes."""
    return resultant(body, vs, vn)[:2, :]


def bending_power(
    panels: PanelGrid, body: Curve, tangential: np.ndarray, normal: np.ndarray, rate: np.ndarray
) -> np.ndarray:
    """Power of what bends the body against a force per length, ``(n_time,)``; `rate` is that of
    Theta at the nodes.

    The moment of all force F ahead of s has the derivative ``-t x F(s)``; its work on the curvature
    is, by parts, ``-int (n . F) dTheta/dt ds``. In balance that is the power dissipated.
    """
    fx, fy = tangential * body.cos - normal * body.sin, tangential * body.sin + normal * body.cos
    ahead_x, ahead_y = (-panels.integrate(panels.widths * f, panels.n) for f in (fx, fy))
    return -(body.weight * rate * (body.cos * ahead_y - body.sin * ahead_x)).sum(axis=0)
