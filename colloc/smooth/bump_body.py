"""A straight body with one travelling bump whose profile varies: the shapes of optimised concertina crawlers.

On an arc of length `width`, centred at ``1/2 + width * C(t)``, the tangent angle is ``Theta = sum_m b_m(t) mode_m(x)`` with x
in [-1, 1] across the bump, and zero elsewhere. The straight parts are links, whose friction is integrated in closed form
(exact at stick); the bump carries Gauss panels. The coordinates of a shape are ``q = (C, b_0, b_1, ...)``. A gait runs
straight and at a uniform pace from vertex to vertex in q; the vertices are the values at the mesh's nodes.

Velocities, distance and work are in units of the bump's width here; rotation rates in widths per body length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from colloc.mechanics.friction import Friction
from colloc.mechanics.links import LinkVelocity
from colloc.numerics.arrays import Array, namespace
from colloc.smooth.curve import Curve, Panels, curve, node_velocity, resultant
from colloc.smooth.motion import Motion
from colloc.system.errors import ProblemError

_ODD_SCALE = 7**3.5 / 6**3


@dataclass(frozen=True)
class BumpBody:
    """A straight body with one bump.

    Parameters
    ----------
    epsilon : float
        Half-width of the region that the bump stays in.
    share : float
        The bump's width over that of the region, 2 epsilon.
    modes : int
    panels, order : int
        Gauss panels of the bump and nodes on each.
    """

    epsilon: float
    share: float = 0.5
    modes: int = 5
    panels: int = 3
    order: int = 8

    def __post_init__(self) -> None:
        if not 0 < self.epsilon < 0.5:
            raise ProblemError(f"epsilon must lie between 0 and 0.5, not {self.epsilon!r}.")
        if not 0 < self.share < 1:
            raise ProblemError(f"share must lie between 0 and 1, not {self.share!r}.")
        if not 2 <= self.modes <= 12:
            raise ProblemError(f"modes must lie between 2 and 12, not {self.modes!r}.")

    @property
    def width(self) -> float:
        """Arc length of the bump."""
        return 2 * self.epsilon * self.share

    @property
    def reach(self) -> float:
        """Largest |C|: the bump stays in its region."""
        return 0.5 * (1 / self.share - 1)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return 1 + self.modes

    @property
    def grid(self) -> Panels:
        return Panels(np.linspace(0.0, 1.0, self.panels + 1)[:, None], self.order)

    def modes_at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Modes ``(1 - x^2)^3 T_m(x)`` (m = 1 scaled to be `colloc.smooth.concertina.odd_profile`) at x, and their slopes.

        Zero outside [-1, 1]; shapes ``(*x.shape, modes)``. Value, slope and curvature vanish at the ends.
        """
        y = np.clip(1 - x * x, 0.0, None)
        values, slopes = [], []
        for m in range(self.modes):
            polynomial = np.polynomial.Chebyshev.basis(m)
            scale = -_ODD_SCALE if m == 1 else 1.0
            p, dp = polynomial(np.clip(x, -1, 1)), polynomial.deriv()(np.clip(x, -1, 1))
            values.append(scale * y**3 * p)
            slopes.append(scale * (y**3 * dp - 6 * x * y**2 * p))
        return np.stack(values, axis=-1), np.stack(slopes, axis=-1)

    def _fields(self, q: Array, rates: Array) -> tuple[Array, Array]:
        """Tangent angle and its rate at fixed arc length, at the grid's nodes."""
        xp = namespace(q, rates)
        value, slope = _node_modes(self)
        return xp.matmul(value, q[1:, :]), xp.matmul(value, rates[1:, :]) - 2 * rates[0:1, :] * xp.matmul(slope, q[1:, :])

    def angles(self, b: Array) -> Array:
        """Tangent angle at the grid's nodes."""
        return _node_modes(self)[0] @ b

    def link_lengths(self, q: Array) -> Array:
        """Lengths of the rear and front straight part, ``(2, n)``."""
        shift = self.width * q[0:1, :]
        return namespace(q).stack([0.5 - 0.5 * self.width + shift, 0.5 - 0.5 * self.width - shift])

    def bump(self, q: Array, rates: Array, z: Array) -> tuple[Curve, Array, Array]:
        """The bump's curve seen from its rear end, and its nodes' velocity; z ``(3, n)`` is the velocity of that end."""
        xp, zero = namespace(q, rates, z), np.zeros((1, 1))
        body = curve(self.grid, *self._fields(q, rates), 0, zero)
        return body, *node_velocity(body, xp.stack([z[0:2, :], self.width * z[2:3, :]]))

    def chord(self, q: Array) -> tuple[Array, Array]:
        """Position of the bump's front end seen from its rear end, in widths."""
        xp, angle = namespace(q), self._fields(q, q)[0]
        return xp.matmul(self.grid.weights.T, xp.cos(angle)), xp.matmul(self.grid.weights.T, xp.sin(angle))

    def links(self, q: Array, rates: Array, z: Array) -> LinkVelocity:
        """Velocities of the midpoints of the straight parts, rear then front, ``(2, n)``."""
        xp = namespace(q, rates, z)
        angle, turning = self._fields(q, rates)
        u, v, omega = z[0:1, :], z[1:2, :], z[2:3, :]
        turning = turning + self.width * omega
        u_front = u - xp.matmul(self.grid.weights.T, turning * xp.sin(angle))
        v_front = v + xp.matmul(self.grid.weights.T, turning * xp.cos(angle))
        half = 0.5 * self.link_lengths(q)
        return LinkVelocity(
            xp.stack([u, u_front]),
            xp.stack([v - half[0:1, :] * omega, v_front + half[1:2, :] * omega]),
            xp.stack([omega, omega]),
        )

    def bump_load(self, body: Curve, vs: Array, vn: Array, delta: Array, friction: Friction) -> tuple[Array, Array]:
        """Net force and torque about the rear end ``(3, n)`` on the bump [weight, weight x length], and its power."""
        xp = namespace(vs, delta)
        fs, fn = friction.density(vs, vn, delta)
        net = self.width * resultant(body, fs, fn)
        power = -self.width * xp.sum_rows(body.weight * (fs * vs + fn * vn))
        return xp.stack([net[0:2, :], self.width * net[2:3, :]]), power

    def motion(self, vertices: np.ndarray) -> Motion:
        """The antipodal motion whose first half period has the given vertices ``(n, k + 1)``."""
        pieces = vertices.shape[1] - 1
        times = np.linspace(0.0, 0.5, pieces + 1)
        w = self.width

        def state(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            second = t >= 0.5
            t = np.where(second, t - 0.5, t)
            k = np.clip((2 * pieces * t).astype(int), 0, pieces - 1)
            tau, sign = 2 * pieces * t - k, np.where(second, -1.0, 1.0)
            q = (1 - tau) * vertices[:, k] + tau * vertices[:, k + 1]
            return q, 2 * pieces * (vertices[:, k + 1] - vertices[:, k]), sign

        def angle(s: np.ndarray, t: np.ndarray) -> np.ndarray:
            q, _, sign = state(t)
            value, _ = self.modes_at(2 * ((s - 0.5) / w - q[0]))
            return sign * np.einsum("itm,mt->it", value, q[1:])

        def rate(s: np.ndarray, t: np.ndarray) -> np.ndarray:
            q, r, sign = state(t)
            value, slope = self.modes_at(2 * ((s - 0.5) / w - q[0]))
            return sign * (np.einsum("itm,mt->it", value, r[1:]) - 2 * r[0] * np.einsum("itm,mt->it", slope, q[1:]))

        def breaks(t: np.ndarray) -> np.ndarray:
            ends = 0.5 + w * (state(t)[0][0] + np.linspace(-0.5, 0.5, 5)[:, None])
            low, high = (np.full((1, t.size), 0.5 + sign * self.epsilon) for sign in (-1, 1))
            return np.concatenate([low, ends, high])

        return Motion(angle, rate, breaks, stages=tuple(times.tolist()), antipodal=True)


@cache
def _node_modes(body: BumpBody) -> tuple[np.ndarray, np.ndarray]:
    return body.modes_at(2 * body.grid.nodes[:, 0] - 1)
