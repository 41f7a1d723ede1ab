"""Circular arcs: where one leads and which way, in closed form, from the tangents at its ends.

An arc of unit length (curvature = turn) runs from tangent T0 to tangent T1; at a fraction ``tau``
of it the tangent has turned by that fraction of the way. For two joints a tangent is its heading
psi, one row, and may turn by any angle; for more joints it is a unit vector, ``(n_joint, n_time)``,
and turns along the great circle, by less than pi:

    T(tau) = [ sin((1 - tau) phi) T0 + sin(tau phi) T1 ] / sin(phi),      phi the angle between T0 and T1.

The same functions run on NumPy arrays and on CasADi matrices.
"""  # noqa: E501

from __future__ import annotations

from colloc.numerics.arrays import Array, namespace

_SMALL = 1e-2
"""Below this square of an angle series are used; six terms leave less than 1e-17."""


def _series(y: Array, first: float, start: int) -> Array:
    """``sum over k of (-y)^k first / (start (start + 1)) / ...``: the tail of a sine's or cosine's
    series."""
    terms = [first]
    for k in range(5):
        terms.append(terms[-1] / ((start + 2 * k) * (start + 2 * k + 1)))
    result = terms[-1]
    for term in terms[-2::-1]:
        result = term - y * result
    return result


def _sinc(y: Array) -> Array:
    """sin(x)/x of x = sqrt(y)."""
    xp = namespace(y)
    root = xp.sqrt(xp.where(y < _SMALL, 1.0, y))
    return xp.where(y < _SMALL, _series(y, 1.0, 2), xp.sin(root) / root)


def _versine(y: Array) -> Array:
    """(1 - cos(x))/x^2 of x = sqrt(y)."""
    half = _sinc(0.25 * y)
    return 0.5 * half * half


def squared_half_chord(t0: Array, t1: Array) -> Array:
    """A quarter of the squared distance of unit vectors, a row: sin(phi/2)^2."""
    step = t1 - t0
    return 0.25 * namespace(t0, t1).sum_rows(step * step)


def _squared_angle(m: Array) -> Array:
    """phi^2 where sin(phi/2)^2 = m; smooth at 0."""
    xp = namespace(m)
    small = m < 1e-3
    safe = xp.where(small, 0.5, m)
    half = xp.arctan2(xp.sqrt(safe), xp.sqrt(xp.where(safe < 1.0, 1.0 - safe, 1e-12)))
    # asin(x)^2 = sum of (2 x)^(2k) / (2 k^2 binomial(2k, k))
    series = m * (1 + m * (1 / 3 + m * (8 / 45 + m * (4 / 35 + m * (128 / 1575)))))
    return 4.0 * xp.where(small, series, half * half)


def tangent_weights(m: Array, tau: Array) -> tuple[Array, Array]:
    """What of T0 and of T1 the tangent is at fractions tau of arcs of a squared half chord m."""
    y, rest = _squared_angle(m), 1.0 - tau
    whole = _sinc(y)
    return rest * _sinc(rest * rest * y) / whole, tau * _sinc(tau * tau * y) / whole


def advance_weights(m: Array, tau: Array) -> tuple[Array, Array]:
    """The integrals of `tangent_weights`."""
    y, rest = _squared_angle(m), 1.0 - tau
    whole = _sinc(y)
    # integral of sin((1 - tau) phi) is (cos((1 - tau) phi) - cos phi)/phi, of sin(tau phi) it is (1
    # - cos(tau phi))/phi
    return (_versine(y) - rest * rest * _versine(rest * rest * y)) / whole, tau * tau * _versine(
        tau * tau * y
    ) / whole


def direction(t0: Array, t1: Array, tau: Array) -> Array:
    """Unit tangents ``(n_joint, n_time)`` at fractions tau of arcs between given tangents."""
    if t0.shape[0] == 1:
        xp, psi = namespace(t0, t1, tau), t0 + tau * (t1 - t0)
        return xp.stack([xp.cos(psi), xp.sin(psi)])
    of_first, of_last = tangent_weights(squared_half_chord(t0, t1), tau)
    return of_first * t0 + of_last * t1


def advance(t0: Array, t1: Array, tau: Array) -> Array:
    """Displacement ``(n_joint, n_time)`` up to fractions tau of arcs of unit length: the integral
    of `direction`."""
    if t0.shape[0] == 1:
        xp, half = namespace(t0, t1, tau), 0.5 * tau * (t1 - t0)
        chord = tau * _sinc(half * half)
        return xp.stack([chord * xp.cos(t0 + half), chord * xp.sin(t0 + half)])
    of_first, of_last = advance_weights(squared_half_chord(t0, t1), tau)
    return of_first * t0 + of_last * t1
