r"""Closed forms of Coulomb friction on a straight link (design notes, section 2).

Along a link vs is constant and ``y = vn + w sigma`` is linear; with ``r = sqrt(vs^2 + y^2 +
delta^2)`` the force per length is ``-(mu_s vs, mu_t y)/r`` (paper, eqs. frictiondelta and delta).
Everything is expressed through

    r0, r1   the end values of r,       S = r0 + r1,      a^2 = vs^2 + delta^2
    q        = (w l / S)^2 in [0, 1)
    P        = a^2 + y0 y1 + r0 r1 = (1 - q) S^2 / 2,     Q = a^2 / P
    g        = atanh(sqrt q)/sqrt q,    h = (g - 1)/q

without cancellation for any ``w``, ``vs``, ``vn`` and ``delta > 0``.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from colloc.mechanics.law import Matrix
from colloc.numerics.arrays import Array, namespace

_SERIES_LIMIT = 0.1
_H_SERIES = tuple(1.0 / (2 * j + 3) for j in range(16))
"""h = sum q^j / (2j + 3); 16 terms leave less than 1e-16 below the limit, above it the closed form
loses 10 eps."""


class Coefficients(Protocol):
    """As `colloc.mechanics.friction.Friction`."""

    @property
    def mu_t(self) -> float: ...

    def tangential(self, vs: Array) -> Array: ...

    def stretch(self, vs: Array) -> Array: ...


class _Roots(NamedTuple):
    a2: Array
    r0r1: Array
    S: Array
    Q: Array
    g: Array
    h: Array


class Moments(NamedTuple):
    """``I_j``, the integrals of sigma^j / r over a link, j = 0, 1, 2."""

    I0: Array
    I1: Array
    I2: Array


class LinkForce(NamedTuple):
    """Friction on a link: tangential force, normal force, couple about the midpoint."""

    tangential: Array
    normal: Array
    couple: Array


def _roots(vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> _Roots:
    xp = namespace(vs, vn, w, delta)
    a2 = vs * vs + delta * delta
    half = 0.5 * length * w
    y0, y1 = vn - half, vn + half
    r0, r1 = xp.sqrt(a2 + y0 * y0), xp.sqrt(a2 + y1 * y1)
    S = r0 + r1
    r0r1 = r0 * r1
    # P = T + r0 r1 cancels where T < 0; there P = a^2 (w l)^2 / (r0 r1 - T).
    T = a2 + y0 * y1
    opposite = T < 0
    Q = xp.where(opposite, r0r1 - T, a2) / xp.where(opposite, 4.0 * half * half, r0r1 + T)
    # squared before |w| appears: behind an absolute value automatic differentiation loses q'' at
    # w = 0
    signed_root_q = 2.0 * half / S
    q = signed_root_q * signed_root_q
    small = q < _SERIES_LIMIT
    h_small = 0.0
    for coefficient in reversed(_H_SERIES):
        h_small = h_small * q + coefficient
    safe = xp.where(small, 0.5, xp.abs(signed_root_q))
    # 1 - q = 2 P / S^2 = 2 a^2 / (Q S^2)
    g_large = 0.5 * xp.log((1.0 + safe) * (1.0 + safe) * Q * S * S / (2.0 * a2)) / safe
    h = xp.where(small, h_small, (g_large - 1.0) / (safe * safe))
    return _Roots(a2, r0r1, S, Q, 1.0 + q * h, h)


def link_moments(vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Moments:
    """Integrals of sigma^j / r over links, from velocities of the midpoints along and across,
    rotation rates ``(n_link, n_time)``, lengths ``(n_link, 1)`` and delta."""
    k = _roots(vs, vn, w, length, delta)
    l3 = length**3
    return Moments(
        2.0 * length * k.g / k.S,
        -2.0 * vn * w * l3 * k.h / k.S**3,
        l3 / k.S * (0.5 * k.Q + (2.0 * vn * vn - k.a2) * k.h / (k.S * k.S)),
    )


def link_force(
    vs: Array, vn: Array, w: Array, length: Array, delta: Array, friction: Coefficients
) -> LinkForce:
    mu_s, vs = friction.tangential(vs), friction.stretch(vs) * vs
    k = _roots(vs, vn, w, length, delta)
    return LinkForce(
        -mu_s * vs * 2.0 * length * k.g / k.S,
        -friction.mu_t * 2.0 * vn * length / k.S,
        -friction.mu_t * w * length**3 / k.S * (0.5 * k.Q - k.a2 * k.h / (k.S * k.S)),
    )


def link_dissipation(vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Array:
    """Dissipation potential of links at mu = 1, the integral of r."""
    k = _roots(vs, vn, w, length, delta)
    return length / k.S * (vn * vn + 0.25 * k.S * k.S + k.a2 * k.g)


def power(vs: Array, vn: Array, w: Array, force: LinkForce) -> Array:
    """Rate of work against friction of each link."""
    return -(force.tangential * vs + force.normal * vn + force.couple * w)


def link_force_jacobian(
    vs: Array, vn: Array, w: Array, length: Array, delta: Array, friction: Coefficients
) -> Matrix:
    """Minus the derivative of (tangential, normal, couple) with respect to (vs, vn, w); a switch
    of coefficients is differentiated on its current side."""
    mu_s, mu_t, stretch = friction.tangential(vs), friction.mu_t, friction.stretch(vs)
    vs = stretch * vs
    k = _roots(vs, vn, w, length, delta)
    l3 = length**3
    # integrals of 1/r^3 (times a^2), y/r^3, sigma y/r^3, and (delta^2 + y^2)/r^3
    a2J0 = length * k.S * k.Q / k.r0r1
    a2J1 = -vn * w * l3 * k.Q / (k.r0r1 * k.S)
    E = k.a2 + vn * vn
    a2J2 = 2.0 * l3 * k.a2 * k.h / k.S**3 + l3 * (E * k.Q - 0.5 * k.a2) / (k.S * k.r0r1)
    y_r3 = 2.0 * vn * length / (k.S * k.r0r1)
    sy_r3 = w * l3 / k.S * (2.0 * k.h / (k.S * k.S) + (k.Q - 0.5) / k.r0r1)
    along = a2J0 * (delta * delta / k.a2) + vn * y_r3 + w * sy_r3
    return (
        (stretch * mu_s * along, -mu_s * vs * y_r3, -mu_s * vs * sy_r3),
        (-stretch * mu_t * vs * y_r3, mu_t * a2J0, mu_t * a2J1),
        (-stretch * mu_t * vs * sy_r3, mu_t * a2J1, mu_t * a2J2),
    )


def link_secant(
    vs: Array, vn: Array, w: Array, length: Array, delta: Array, friction: Coefficients
) -> Matrix:
    """Minus force over velocity with r frozen: the paper's fixed point on links."""
    mu_s, mu_t, stretch = friction.tangential(vs), friction.mu_t, friction.stretch(vs)
    I0, I1, I2 = link_moments(stretch * vs, vn, w, length, delta)
    zero = 0.0 * I0
    return (
        (stretch * mu_s * I0, zero, zero),
        (zero, mu_t * I0, mu_t * I1),
        (zero, mu_t * I1, mu_t * I2),
    )
