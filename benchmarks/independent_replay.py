"""A gait's efficiency by another program: nothing of colloc is imported, no formula and no rule of integration is shared.

Friction on a link by the antiderivatives of an integral table (asinh), or by Gauss nodes along the link where it hardly turns;
velocities of the tail by Newton with difference quotients, from a large regularisation down; time by Gauss nodes on panels
that are halved until both halves agree with the whole. Slow, and made to be believed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

Path = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_TIME, _TIME_WEIGHTS = (np.polynomial.legendre.leggauss(7)[0] + 1) / 2, np.polynomial.legendre.leggauss(7)[1] / 2
_TO_NODES = np.array([[np.polyval(np.polyint(np.poly1d(row)), t) for row in np.linalg.inv(np.vander(_TIME)).T] for t in _TIME])
"""Integrals from 0 to each node of the polynomials that are 1 at one node and 0 at the others."""
_SLENDER = 0.1
_NARROWEST = 1e-9


class Played(NamedTuple):
    """What a gait does in a period."""

    efficiency: float
    distance: float
    work: float
    rotation: float
    instants: int
    error: float
    """Relative, of the efficiency: what halving changed last."""


def _moments(vs: np.ndarray, vn: np.ndarray, w: np.ndarray, length: float, delta: np.ndarray) -> tuple[np.ndarray, ...]:
    """Integrals over a link of 1/r, y/r and s y/r, with y = vn + w s and r the regularised speed."""
    a2, half = vs**2 + delta**2, 0.5 * length
    slender = np.abs(w) * half < _SLENDER * np.sqrt(a2 + vn**2)
    s = half * _NODES[:, None]
    y = vn + w * s
    inverse = half * _WEIGHTS[:, None] / np.sqrt(a2 + y**2)
    summed = inverse.sum(axis=0), (inverse * y).sum(axis=0), (inverse * s * y).sum(axis=0)
    spin = np.where(slender, 1.0, w)
    y0, y1, a = vn - spin * half, vn + spin * half, np.sqrt(a2)
    r0, r1 = np.hypot(a, y0), np.hypot(a, y1)
    k0 = np.arcsinh(y1 / a) - np.arcsinh(y0 / a)
    k2 = 0.5 * (y1 * r1 - y0 * r0 - a2 * k0)
    closed = k0 / spin, (r1 - r0) / spin, (k2 - vn * (r1 - r0)) / spin**2
    return tuple(np.where(slender, one, other) for one, other in zip(summed, closed, strict=True))


class Crawler(NamedTuple):
    """A chain of links on a plane with Coulomb friction (mu_t, mu_f, mu_b)."""

    lengths: Sequence[float]
    coefficients: Sequence[float]

    def forces(
        self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Force and torque about the tail ``(3, n)``, power ``(n,)`` and velocity of the centre of mass ``(2, n)``."""
        mu_t, mu_f, mu_b = self.coefficients
        x = y = phi = np.zeros(angles.shape[1])
        ux, uy, w = z
        total, power, centre = np.zeros_like(z), np.zeros_like(x), np.zeros((2, x.size))
        for k, length in enumerate(self.lengths):
            if k:
                phi, w = phi + angles[k - 1], w + rates[k - 1]
            c, s, half = np.cos(phi), np.sin(phi), 0.5 * length
            x, y, ux, uy = x + half * c, y + half * s, ux - w * half * s, uy + w * half * c
            vs, vn = ux * c + uy * s, uy * c - ux * s
            k0, k1, k2 = _moments(vs, vn, w, length, delta)
            along, across, couple = -np.where(vs > 0, mu_f, mu_b) * vs * k0, -mu_t * k1, -mu_t * k2
            fx, fy = along * c - across * s, along * s + across * c
            total += np.stack([fx, fy, x * fy - y * fx + couple])
            power -= along * vs + across * vn + couple * w
            centre += length * np.stack([ux, uy])
            x, y, ux, uy = x + half * c, y + half * s, ux - w * half * s, uy + w * half * c
        return total, power, centre

    def _newton(self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: np.ndarray, steps: int) -> np.ndarray:
        """Steps of Newton that are halved until the force falls; delta is ``(n,)``."""
        z, scale = z.copy(), np.maximum(np.abs(rates).max(axis=0), 1e-300)
        force = self.forces(angles, rates, z, delta)[0]
        for _ in range(steps):
            size = 1e-7 * np.maximum(delta, 1e-4 * np.abs(z).max(axis=0))
            columns = [(self.forces(angles, rates, z + size * e[:, None], delta)[0] - force) / size for e in np.eye(3)]
            jacobian = np.stack(columns, axis=1).transpose(2, 0, 1)
            jacobian = jacobian + 1e-14 * np.abs(jacobian).max(axis=(1, 2))[:, None, None] * np.eye(3)
            step = np.linalg.solve(jacobian, -force.T[:, :, None])[:, :, 0].T
            norm, left = np.linalg.norm(force, axis=0), np.ones(z.shape[1], dtype=bool)
            factor = np.ones(z.shape[1])
            for _ in range(12):
                trial = z + factor * step
                new = self.forces(angles, rates, trial, delta)[0]
                left = np.linalg.norm(new, axis=0) > (1 - 1e-4 * factor) * norm
                if not left.any():
                    break
                factor[left] *= 0.4
            z, force = np.where(left, z, trial), np.where(left, force, new)
            if (left | (np.abs(factor * step).max(axis=0) < 1e-13 * scale)).all():
                break
        return z

    def velocity(self, angles: np.ndarray, rates: np.ndarray, delta: float, near: np.ndarray | None = None) -> np.ndarray:
        """A tail velocity that balances the body at every instant, ``(3, n)``, from one nearby or from large delta down.

        Raises
        ------
        ArithmeticError
            If there is an instant where none was found.
        """
        n, speed = angles.shape[1], np.maximum(np.abs(rates).max(axis=0), 1e-300)
        z = np.zeros((3, n)) if near is None else self._newton(angles, rates, near, np.full(n, delta), 12)
        bad = np.arange(n) if near is None else np.flatnonzero(~self._balanced(angles, rates, z, delta))
        for factor in (0.3, 0.7, 0.9):
            if not bad.size:
                break
            z[:, bad], level = 0.0, 3.0 * speed[bad]
            while (level > delta).any():
                level = np.maximum(factor * level, delta)
                z[:, bad] = self._newton(angles[:, bad], rates[:, bad], z[:, bad], level, 15)
            z[:, bad] = self._newton(angles[:, bad], rates[:, bad], z[:, bad], level, 40)
            bad = bad[~self._balanced(angles[:, bad], rates[:, bad], z[:, bad], delta)]
        if bad.size:
            raise ArithmeticError(f"{bad.size} of {n} instants are not balanced")
        return z

    def _balanced(self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: float) -> np.ndarray:
        """Whether the force vanishes, as far as the rounding of z lets it."""
        force = self.forces(angles, rates, z, np.full(z.shape[1], delta))[0]
        rounding = 1e-14 * np.abs(rates).max(axis=0) / delta
        return np.abs(force).max(axis=0) < max(self.coefficients) * (1e-9 + rounding)


def _panel_values(
    body: Crawler, path: Path, delta: float, left: np.ndarray, width: np.ndarray, near: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Turn, displacement in the axes of the panel's begin and work of panels ``(n,)``, and velocities ``(3, n, node)``."""
    t = (left[:, None] + width[:, None] * _TIME).ravel()
    angles, rates = path(t)
    z = body.velocity(angles, rates, delta, None if near is None else near.reshape(3, -1))
    _, power, centre = body.forces(angles, rates, z, np.full(t.size, delta))
    shape = (left.size, _TIME.size)
    omega, along = z[2].reshape(shape), (centre[0] + 1j * centre[1]).reshape(shape)
    turned = np.exp(1j * width[:, None] * (omega @ _TO_NODES.T)) * along
    turn, move, work = (values @ _TIME_WEIGHTS * width for values in (omega, turned, power.reshape(shape)))
    return turn, move, work, z.reshape(3, *shape)


def played(
    body: Crawler,
    path: Path,
    delta: float,
    tolerance: float = 1e-8,
    breaks: np.ndarray | Sequence[float] = (),
    panels: int = 40,
) -> Played:
    """Efficiency, distance of the centre of mass, work and rotation of a path over one period.

    Parameters
    ----------
    body : Crawler
    path : callable
        Joint angles and rates ``(n_joint, n)`` at phases ``(n,)``.
    delta : float
        Regularisation speed.
    tolerance : float
        Relative, of the efficiency.
    breaks : (n,), optional
        Phases where the rates jump.
    panels : int
        To begin with.
    """
    edges = np.unique(np.concatenate([np.linspace(0, 1, panels + 1), np.asarray(breaks, dtype=float)]))
    left, width = edges[:-1], np.diff(edges)
    turn, move, work, z = _panel_values(body, path, delta, left, width, None)
    gap = np.full(left.size, np.inf)
    while True:
        order = np.argsort(left)
        heading = np.concatenate([[0.0], np.cumsum(turn[order])])
        place = np.concatenate([[0.0], np.cumsum(np.exp(1j * heading[:-1]) * move[order])])
        distance, spent = abs(place[-1]), work.sum()
        chosen = np.flatnonzero((gap > tolerance / 300) & (width > _NARROWEST))
        if not chosen.size or left.size > 8000:
            return Played(distance / spent, distance, spent, float(heading[-1]), 7 * left.size, float(gap.sum()))
        half = np.repeat(0.5 * width[chosen], 2)
        begin = np.repeat(left[chosen], 2) + np.tile([0.0, 1.0], chosen.size) * half
        # from the nearest node of the panel before
        nodes = np.abs(0.5 * (np.concatenate([_TIME, _TIME + 1]))[:, None] - _TIME).argmin(axis=1)
        near = z[:, chosen][:, :, nodes].reshape(3, begin.size, -1)
        new = _panel_values(body, path, delta, begin, half, near)
        first, second = ([part[k::2] for part in new[:3]] for k in (0, 1))
        moved = first[1] + np.exp(1j * first[0]) * second[1]
        change = np.abs(moved - move[chosen]) / max(distance, 1e-300) + np.abs(first[2] + second[2] - work[chosen]) / spent
        change = change + np.abs(first[0] + second[0] - turn[chosen]) * np.abs(place - place[-1]).max() / max(distance, 1e-300)
        kept = np.setdiff1d(np.arange(left.size), chosen)
        left, width = np.concatenate([left[kept], begin]), np.concatenate([width[kept], half])
        turn, move, work = (np.concatenate([a[kept], b]) for a, b in zip((turn, move, work), new[:3], strict=True))
        z, gap = np.concatenate([z[:, kept], new[3]], axis=1), np.concatenate([gap[kept], np.repeat(0.5 * change, 2)])
