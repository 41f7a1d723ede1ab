r"""Friction on a straight link, integrated along it from the law at a point.

Along a link vs is constant and ``y = vn + w sigma``; a dry law changes within ``a = sqrt(vs^2 +
delta^2)`` of y = 0. So Gauss nodes are equally spaced in tau, ``y = a sinh(tau)``. With tau = m +
h x, x in [-1, 1], on a link of length l

    d sigma = l/2 h/sinh(h) cosh(tau)/cosh(m) dx,
    sigma   = l/2 [sinh(h x) - 2 tanh(m) sinh(h (1+x)/2) sinh(h (1-x)/2)]/sinh(h).

Two panels meet at y = 0, or at the end nearest to it: a law may have a kink there.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np

from colloc.mechanics.law import Matrix
from colloc.mechanics.link_friction import LinkForce
from colloc.numerics.arrays import Array, namespace

NODES = 20
"""Gauss nodes of a panel: 1e-9 of the largest force, unless a law changes faster than within a."""
_X, _WEIGHT = np.polynomial.legendre.leggauss(NODES)
_SMALL = 1e-8
"""h^2 below which three terms of the series are exact."""


class Node(NamedTuple):
    """Distance from the midpoint, normal velocity, and weight; weights add up to the length."""

    sigma: Array
    y: Array
    weight: Array


def link_nodes(vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Iterator[Node]:
    """Gauss nodes of links: with CasADi one after the other, with NumPy those of a panel at once,
    along a first axis."""
    xp = namespace(vs, vn, w, delta)
    if isinstance(vs, np.ndarray):
        places = [(_X[:, None, None], _WEIGHT[:, None, None])]
    else:
        places = list(zip(_X, _WEIGHT, strict=True))
    a = xp.sqrt(vs * vs + delta * delta)
    half = 0.5 * length * w
    y0, y1 = vn - half, vn + half
    r0, r1 = xp.sqrt(a * a + y0 * y0), xp.sqrt(a * a + y1 * y1)
    # sinh(2 h) = (y1 r0 - y0 r1)/a^2; where both ends have one sign that cancels
    same = y0 * y1 > 0
    both = xp.where(same, y1 * r0 + y0 * r1, 1.0)
    h = 0.5 * xp.arcsinh(
        xp.where(same, (y1 - y0) * (y1 + y0) / both, (y1 * r0 - y0 * r1) / (a * a))
    )
    m = xp.arcsinh(y0 / a) + h
    tilt, square = xp.tanh(m), h * h
    small = square < _SMALL
    safe = xp.where(small, 1.0, h)
    per_sinh = 1.0 / xp.sinh(safe)
    width = 0.5 * length * xp.where(small, 1.0 - square / 6, safe * per_sinh) / xp.cosh(m)
    slowest = -m * xp.where(small, 0.0, 1.0) / safe
    slowest = xp.where(slowest > 1.0, 1.0, xp.where(slowest < -1.0, -1.0, slowest))
    for reach, centre in (
        (0.5 * (slowest + 1.0), 0.5 * (slowest - 1.0)),
        (0.5 * (1.0 - slowest), 0.5 * (slowest + 1.0)),
    ):
        for place, weight in places:
            x = centre + reach * place
            tau, rest = m + h * x, 1.0 - x * x
            bend = 1.0 - square * rest / 12
            series = x * (1.0 - square * rest / 6) - 0.5 * tilt * h * rest * bend
            product = xp.sinh(0.5 * safe * (1.0 + x)) * xp.sinh(0.5 * safe * (1.0 - x))
            share = xp.where(small, series, (xp.sinh(safe * x) - 2.0 * tilt * product) * per_sinh)
            mass = weight * reach * width * xp.cosh(tau)
            yield Node(0.5 * length * share, a * xp.sinh(tau), mass)


def _sum(values: Array) -> Array:
    """The sum over nodes along a first axis, if there is one."""
    return values.sum(axis=0) if getattr(values, "ndim", 2) > 2 else values


class LineIntegrals:
    """A law on links: velocities along and across them at their midpoints and rotation rates,
    ``(n_link, n_time)``, lengths ``(n_link, 1)``; NumPy and CasADi. By quadrature; laws in closed
    form register a subclass."""

    def __init__(self, law: Any) -> None:
        self.law = law

    def force(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> LinkForce:
        """Force and couple on links."""
        tangential = normal = couple = 0.0 * (vs + vn + w)
        for sigma, y, weight in link_nodes(vs, vn, w, length, delta):
            fs, fn = self.law.density(vs, y, delta)
            tangential, normal = tangential + _sum(weight * fs), normal + _sum(weight * fn)
            couple = couple + _sum(weight * sigma * fn)
        return LinkForce(tangential, normal, couple)

    def jacobian(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        """Minus its derivative with respect to (vs, vn, w), 3 x 3."""
        return self._integrate(self.law.density_jacobian, vs, vn, w, length, delta)

    def secant(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        """`colloc.mechanics.law.Law.density_secant`, integrated, 3 x 3."""
        return self._integrate(self.law.density_secant, vs, vn, w, length, delta)

    def _integrate(
        self, density: Any, vs: Array, vn: Array, w: Array, length: Array, delta: Array
    ) -> Matrix:
        total = [[0.0] * 3 for _ in range(3)]
        for sigma, y, weight in link_nodes(vs, vn, w, length, delta):
            (ss, sn), (ns, nn) = density(vs, y, delta)
            rows = (
                (ss, sn, sigma * sn),
                (ns, nn, sigma * nn),
                (sigma * ns, sigma * nn, sigma * sigma * nn),
            )
            total = [
                [t + _sum(weight * entry) for t, entry in zip(*pair, strict=True)]
                for pair in zip(total, rows, strict=True)
            ]
        return tuple(tuple(row) for row in total)

    def potential(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Array:
        """`colloc.mechanics.law.Law.density_potential`, integrated."""
        return sum(
            _sum(weight * self.law.density_potential(vs, y, delta))
            for _, y, weight in link_nodes(vs, vn, w, length, delta)
        )

    def scaled_laws(
        self, vs: Array, vn: Array, w: Array, length: Array, delta: Array, force: LinkForce
    ) -> list[Array]:
        """Residuals of the law for link forces that are variables, scaled like velocities: mild
        constraints where the force is nearly a step."""
        integral = self.force(vs, vn, w, length, delta)
        secant = self.secant(vs, vn, w, length, delta)
        return [
            (force.tangential - integral.tangential) / secant[0][0],
            (force.normal - integral.normal) / secant[1][1],
            (force.couple - integral.couple) / secant[1][1] * (6 / length),
        ]

    def largest_forces(self, length: np.ndarray) -> np.ndarray:
        """Bounds on force, normal force and couple at any speed, ``(3, n_link, 1)``."""
        return np.full((3, *length.shape), np.inf)


line_integrals = singledispatch(LineIntegrals)
"""The `LineIntegrals` of a law."""
