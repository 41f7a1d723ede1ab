"""A gait's efficiency by another program: nothing of colloc is imported, no formula and no rule of
integration is shared.

Friction on a link by the antiderivatives of an integral table (asinh), or by Gauss nodes along the
link where it hardly turns; velocities of the tail by Newton with difference quotients, from a large
regularisation down; time by Gauss nodes on panels that are halved until both halves agree with the
whole. Slow, and made to be believed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

Path = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_TIME, _TIME_WEIGHTS = (
    (np.polynomial.legendre.leggauss(7)[0] + 1) / 2,
    np.polynomial.legendre.leggauss(7)[1] / 2,
)
_TO_NODES = np.array(
    [
        [np.polyval(np.polyint(np.poly1d(row)), t) for row in np.linalg.inv(np.vander(_TIME)).T]
        for t in _TIME
    ]
)
"""Integrals from 0 to each node of the polynomials that are 1 at one node and 0 at the others."""
_SLENDER = 0.1
_NARROWEST = 1e-9
_MOST_PANELS = 8000


class Played(NamedTuple):
    """What a gait does in a period."""

    efficiency: float
    distance: float
    work: float
    rotation: float
    instants: int
    error: float
    """Relative, of the efficiency: what halving changed last."""


def _moments(
    vs: np.ndarray, vn: np.ndarray, w: np.ndarray, length: float, delta: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Integrals over a link of 1/r, y/r and s y/r, with y = vn + w s and r the regularised
    speed."""
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
    """A chain of links on a plane with Coulomb friction (mu_t, mu_f, mu_b); or one for each of many
    instants.

    Lengths and weights are then ``(link, n)`` and coefficients ``(3, n)``. Weights are shares, by
    default the lengths.
    """

    lengths: Sequence[float] | np.ndarray
    coefficients: Sequence[float] | np.ndarray
    weights: Sequence[float] | np.ndarray = ()

    @property
    def heavy(self) -> np.ndarray:
        """Weights of the links, stated or not."""
        return np.asarray(self.weights if len(self.weights) else self.lengths)

    def of(self, chosen: np.ndarray) -> Crawler:
        """Those of some instants."""
        if np.ndim(self.lengths) == 1:
            return self
        return Crawler(
            np.asarray(self.lengths)[:, chosen],
            np.asarray(self.coefficients)[:, chosen],
            self.heavy[:, chosen],
        )

    def forces(
        self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Force and torque about the tail ``(3, n)``, power ``(n,)`` and velocity of the centre of
        mass ``(2, n)``."""
        x = y = phi = np.zeros(angles.shape[1])
        ux, uy, w = z
        total, power, centre = np.zeros_like(z), np.zeros_like(x), np.zeros((2, x.size))
        for k, (length, weight) in enumerate(zip(self.lengths, self.heavy, strict=True)):
            mu_t, mu_f, mu_b = (weight / length * mu for mu in self.coefficients)
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
            centre += weight * np.stack([ux, uy])
            x, y, ux, uy = x + half * c, y + half * s, ux - w * half * s, uy + w * half * c
        return total, power, centre

    def _newton(
        self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: np.ndarray, steps: int
    ) -> np.ndarray:
        """Steps of Newton that are halved until the force falls, at every instant by itself; delta
        is ``(n,)``."""
        z, scale = z.copy(), np.maximum(np.abs(rates).max(axis=0), 1e-300)
        force = self.forces(angles, rates, z, delta)[0]
        live = np.arange(z.shape[1])
        for _ in range(steps):
            if not live.size:
                break
            at = self.of(live), angles[:, live], rates[:, live], delta[live]
            step = _newton_step(*at, z[:, live], force[:, live])
            factor, todo = np.ones(live.size), np.arange(live.size)
            norm = np.linalg.norm(force[:, live], axis=0)
            for _ in range(12):
                here = live[todo]
                trial = z[:, here] + factor[todo] * step[:, todo]
                new = at[0].of(todo).forces(at[1][:, todo], at[2][:, todo], trial, at[3][todo])[0]
                falls = np.linalg.norm(new, axis=0) <= (1 - 1e-4 * factor[todo]) * norm[todo]
                z[:, here[falls]], force[:, here[falls]] = trial[:, falls], new[:, falls]
                todo = todo[~falls]
                if not todo.size:
                    break
                factor[todo] *= 0.4
            moves = np.abs(factor * step).max(axis=0) >= 1e-13 * scale[live]
            moves[todo] = False
            live = live[moves]
        return z

    def velocity(
        self,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: np.ndarray,
        near: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """A tail velocity that balances the body at every instant, ``(3, n)``, from one nearby or
        from large delta down.

        And the instants where none was found. Delta is ``(n,)``.
        """
        n, speed = angles.shape[1], np.maximum(np.abs(rates).max(axis=0), 1e-300)
        z = np.zeros((3, n)) if near is None else self._newton(angles, rates, near, delta, 12)
        bad = (
            np.arange(n)
            if near is None
            else np.flatnonzero(~self._balanced(angles, rates, z, delta))
        )
        for factor in (0.3, 0.7, 0.9):
            if not bad.size:
                break
            body, at = self.of(bad), (angles[:, bad], rates[:, bad])
            found, level = np.zeros((3, bad.size)), 3.0 * speed[bad]
            while (level > delta[bad]).any():
                level = np.maximum(factor * level, delta[bad])
                found = body._newton(*at, found, level, 15)
            z[:, bad] = found = body._newton(*at, found, level, 40)
            bad = bad[~body._balanced(*at, found, level)]
        return z, bad

    def _balanced(
        self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: np.ndarray
    ) -> np.ndarray:
        """Whether the force vanishes, as far as the rounding of z lets it."""
        force = self.forces(angles, rates, z, delta)[0]
        rounding = 1e-14 * np.abs(rates).max(axis=0) / delta
        return np.abs(force).max(axis=0) < np.max(self.coefficients, axis=0) * (1e-9 + rounding)


def _newton_step(
    body: Crawler,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: np.ndarray,
    z: np.ndarray,
    force: np.ndarray,
) -> np.ndarray:
    """By difference quotients, ``(3, n)``."""
    size = 1e-7 * np.maximum(delta, 1e-4 * np.abs(z).max(axis=0))
    columns = [
        (body.forces(angles, rates, z + size * e[:, None], delta)[0] - force) / size
        for e in np.eye(3)
    ]
    jacobian = np.stack(columns, axis=1).transpose(2, 0, 1)
    jacobian = jacobian + 1e-14 * np.abs(jacobian).max(axis=(1, 2))[:, None, None] * np.eye(3)
    return np.linalg.solve(jacobian, -force.T[:, :, None])[:, :, 0].T


class Gait(NamedTuple):
    """What is played: a body, its path, the regularisation speed, and phases where the rates
    jump."""

    body: Crawler
    path: Path
    delta: float
    breaks: np.ndarray | Sequence[float] = ()


class _Panels(NamedTuple):
    """Pieces of the periods of many gaits: whose, where, and what happens in them; the last axis is
    that of panels."""

    owner: np.ndarray
    left: np.ndarray
    width: np.ndarray
    turn: np.ndarray
    move: np.ndarray
    """Displacement in the axes of the panel's begin."""
    work: np.ndarray
    z: np.ndarray
    """``(3, node, n)``."""
    gap: np.ndarray
    """What halving changed, relative."""
    balanced: np.ndarray

    def of(self, chosen: np.ndarray) -> _Panels:
        return _Panels(*(part[..., chosen] for part in self))

    def and_(self, more: _Panels) -> _Panels:
        return _Panels(*(np.concatenate(pair, axis=-1) for pair in zip(self, more, strict=True)))


def _panels(
    gaits: Sequence[Gait],
    owner: np.ndarray,
    left: np.ndarray,
    width: np.ndarray,
    near: np.ndarray | None,
) -> _Panels:
    """Panels, from velocities nearby ``(3, node, n)`` if there are any."""
    t = left + width * _TIME[:, None]
    angles = np.empty((len(gaits[0].body.lengths) - 1, *t.shape))
    rates = np.empty_like(angles)
    for k in np.unique(owner):
        own = owner == k
        there = gaits[k].path(t[:, own].ravel())
        angles[..., own], rates[..., own] = (
            each.reshape(angles.shape[0], _TIME.size, -1) for each in there
        )
    angles, rates = angles.reshape(angles.shape[0], -1), rates.reshape(angles.shape[0], -1)
    whose = np.tile(owner, _TIME.size)
    parts = zip(
        *((gait.body.lengths, gait.body.coefficients, gait.body.heavy) for gait in gaits),
        strict=True,
    )
    body = Crawler(*(np.array(part)[whose].T for part in parts))
    delta = np.array([gait.delta for gait in gaits])[whose]
    z, bad = body.velocity(angles, rates, delta, None if near is None else near.reshape(3, -1))
    _, power, centre = body.forces(angles, rates, z, delta)
    omega, along = z[2].reshape(t.shape), (centre[0] + 1j * centre[1]).reshape(t.shape)
    turned = np.exp(1j * width * (_TO_NODES @ omega)) * along
    turn, move, work = (
        _TIME_WEIGHTS @ values * width for values in (omega, turned, power.reshape(t.shape))
    )
    balanced = np.ones(t.size, dtype=bool)
    balanced[bad] = False
    gap = np.full(left.size, np.inf)
    return _Panels(
        owner,
        left,
        width,
        turn,
        move,
        work,
        z.reshape(3, *t.shape),
        gap,
        np.asarray(balanced.reshape(t.shape).all(axis=0)),
    )


def _halved(gaits: Sequence[Gait], whole: _Panels, size: np.ndarray) -> _Panels:
    """Both halves of panels; `size` is ``(3, n)``: what their displacement, work and turn are
    measured by."""
    half = np.repeat(0.5 * whole.width, 2)
    begin = np.repeat(whole.left, 2) + np.tile([0.0, 1.0], whole.left.size) * half
    # from the nearest node of the panel before
    nodes = (
        np.abs(0.5 * (np.concatenate([_TIME, _TIME + 1]))[:, None] - _TIME)
        .argmin(axis=1)
        .reshape(2, -1)
    )
    near = np.stack([whole.z[:, nodes[0]], whole.z[:, nodes[1]]], axis=-1).reshape(
        3, _TIME.size, -1
    )
    new = _panels(gaits, np.repeat(whole.owner, 2), begin, half, near)
    first, second = new.of(np.arange(0, half.size, 2)), new.of(np.arange(1, half.size, 2))
    moved = first.move + np.exp(1j * first.turn) * second.move
    change = (
        np.abs(moved - whole.move) / size[0]
        + np.abs(first.work + second.work - whole.work) / size[1]
    )
    change = change + np.abs(first.turn + second.turn - whole.turn) / size[2]
    return new._replace(gap=np.repeat(0.5 * change, 2))


def _summed(panels: _Panels) -> tuple[Played, np.ndarray]:
    """One gait, and what displacement, work and turn of its panels are measured by."""
    order = np.argsort(panels.left)
    heading = np.concatenate([[0.0], np.cumsum(panels.turn[order])])
    place = np.concatenate([[0.0], np.cumsum(np.exp(1j * heading[:-1]) * panels.move[order])])
    distance, work = float(abs(place[-1])), float(panels.work.sum())
    size = np.array(
        [max(distance, 1e-300), work, max(distance, 1e-300) / np.abs(place - place[-1]).max()]
    )
    return Played(
        distance / work,
        distance,
        work,
        float(heading[-1]),
        7 * panels.left.size,
        float(panels.gap.sum()),
    ), size


def played_together(
    gaits: Sequence[Gait], tolerance: float = 1e-8, panels: int = 40
) -> list[Played | None]:
    """Efficiency, distance of the centre of mass, work and rotation of every gait over its period."""
    edges = [
        np.union1d(np.linspace(0, 1, panels + 1), np.asarray(gait.breaks, dtype=float))
        for gait in gaits
    ]
    owner = np.repeat(np.arange(len(gaits)), [each.size - 1 for each in edges])
    left, width = (
        np.concatenate([each[:-1] for each in edges]),
        np.concatenate([np.diff(each) for each in edges]),
    )
    now, found = _panels(gaits, owner, left, width, None), list[Played | None]([None] * len(gaits))
    while True:
        sizes, open_ = np.empty((3, len(gaits))), np.zeros(now.owner.size, dtype=bool)
        for k in range(len(gaits)):
            own = np.flatnonzero(now.owner == k)
            if not now.balanced[own].all():
                found[k] = None
                continue
            found[k], sizes[:, k] = _summed(now.of(own))
            open_[own] = (
                (own.size <= _MOST_PANELS)
                & (now.gap[own] > tolerance / 300)
                & (now.width[own] > _NARROWEST)
            )
        if not open_.any():
            return found
        whole = now.of(open_)
        now = now.of(~open_).and_(_halved(gaits, whole, sizes[:, whole.owner]))


def played(
    body: Crawler,
    path: Path,
    delta: float,
    tolerance: float = 1e-8,
    breaks: np.ndarray | Sequence[float] = (),
    panels: int = 40,
) -> Played:
    """One gait; see `played_together`."""
    found = played_together([Gait(body, path, delta, breaks)], tolerance, panels)[0]
    if found is None:
        raise ArithmeticError("there are instants that are not balanced")
    return found
