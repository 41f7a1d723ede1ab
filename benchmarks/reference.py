"""References at any precision, in mpmath: textbook antiderivatives and plain Newton, nothing shared
with colloc.

The closed forms of `colloc.mechanics.friction` are arranged to lose no digits; these are not:
they are what an integral table says (asinh), and digits are bought with precision instead.
`benchmarks.independent_replay` has the same forces in a program of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mpmath as mp

DIGITS = 60


def link_moments(
    vs: float, vn: float, w: float, length: float, delta: float
) -> tuple[mp.mpf, mp.mpf, mp.mpf]:
    """Integrals of sigma^j / sqrt(vs^2 + (vn + w sigma)^2 + delta^2) over a link, j = 0, 1, 2, to
    about 30 digits."""
    with mp.workdps(_digits(vs, vn, w, delta)):
        vs, vn, w, length, delta = (mp.mpf(value) for value in (vs, vn, w, length, delta))
        a2 = vs * vs + delta * delta
        if w == 0:
            r = mp.sqrt(a2 + vn * vn)
            return length / r, mp.mpf(0), length**3 / (12 * r)
        root = mp.sqrt(a2)
        y0, y1 = vn - w * length / 2, vn + w * length / 2
        r0, r1 = mp.sqrt(a2 + y0 * y0), mp.sqrt(a2 + y1 * y1)
        k0 = mp.asinh(y1 / root) - mp.asinh(y0 / root)
        k1 = r1 - r0
        k2 = (y1 * r1 - y0 * r0 - a2 * k0) / 2
        return k0 / w, (k1 - vn * k0) / w**2, (k2 - 2 * vn * k1 + vn * vn * k0) / w**3


def _digits(*values: float) -> int:
    """Enough digits for cancellation between numbers of the given magnitudes, cubed."""
    magnitudes = [abs(mp.mpf(v)) for v in values if v != 0]
    spread = float(mp.log10(max(magnitudes) / min(magnitudes))) if magnitudes else 0.0
    return DIGITS + int(4 * spread)


def net_force(
    lengths: Sequence[float],
    coefficients: Sequence[float],
    angles: Sequence[float],
    rates: Sequence[float],
    z: Sequence[mp.mpf],
    delta: float,
    anchor: int,
) -> list[mp.mpf]:
    """Force and torque about the midpoint of link `anchor`, which moves with z = (vx, vy, w), in
    body-frame axes.

    Links one after the other, each by `link_moments`; coefficients are (mu_t, mu_f, mu_b).
    """
    mu_t, mu_f, mu_b = (mp.mpf(c) for c in coefficients)
    n = len(lengths)
    phi = [mp.mpf(0)]
    for angle in angles:
        phi.append(phi[-1] + mp.mpf(angle))
    turning = [mp.mpf(0)]
    for rate in rates:
        turning.append(turning[-1] + mp.mpf(rate))
    omega = [z[2] + t - turning[anchor] for t in turning]
    place, motion = {anchor: (mp.mpf(0), mp.mpf(0))}, {anchor: (z[0], z[1])}
    for i in (*range(anchor + 1, n), *range(anchor - 1, -1, -1)):
        j, sign = (i - 1, 1) if i > anchor else (i + 1, -1)
        x, y = place[j]
        vx, vy = motion[j]
        for k in (j, i):
            half = sign * mp.mpf(lengths[k]) / 2
            c, s = mp.cos(phi[k]), mp.sin(phi[k])
            x, y = x + half * c, y + half * s
            vx, vy = vx - omega[k] * half * s, vy + omega[k] * half * c
        place[i], motion[i] = (x, y), (vx, vy)
    fx = fy = torque = mp.mpf(0)
    for i in range(n):
        c, s = mp.cos(phi[i]), mp.sin(phi[i])
        vs, vn = motion[i][0] * c + motion[i][1] * s, motion[i][1] * c - motion[i][0] * s
        I0, I1, I2 = link_moments(vs, vn, omega[i], lengths[i], delta)
        along = -(mu_f if vs > 0 else mu_b) * vs * I0
        across = -mu_t * (vn * I0 + omega[i] * I1)
        px, py = along * c - across * s, along * s + across * c
        fx, fy = fx + px, fy + py
        torque += place[i][0] * py - place[i][1] * px - mu_t * (vn * I1 + omega[i] * I2)
    return [fx, fy, torque]


def balanced_velocity(
    lengths: Sequence[float],
    coefficients: Sequence[float],
    angles: Sequence[float],
    rates: Sequence[float],
    delta: float,
    anchor: int,
    start: Sequence[float],
    digits: int | None = None,
) -> list[mp.mpf]:
    """Velocity of the midpoint of link `anchor` that balances the body: damped Newton with
    difference quotients.

    With equal coefficients the balance has one solution, so any root found is the answer; otherwise
    it is the root that Newton reaches from `start`. Raises ArithmeticError if it does not converge.
    """
    # slow stretches lose the square of delta to cancellation
    digits = digits or 40 + 2 * max(0, round(-math.log10(delta)))
    with mp.workdps(digits):

        def residual(z: Sequence[mp.mpf]) -> mp.matrix:
            return mp.matrix(net_force(lengths, coefficients, angles, rates, z, delta, anchor))

        z = mp.matrix([mp.mpf(value) for value in start])
        step = mp.mpf(delta) * mp.mpf(10) ** (-digits // 2)
        force = residual(z)
        for _ in range(60):
            if mp.norm(force, mp.inf) < mp.mpf(10) ** (-digits // 2):
                return list(z)
            jacobian = mp.matrix(3, 3)
            for j in range(3):
                shifted = z.copy()
                shifted[j] += step
                jacobian[:, j] = (residual(shifted) - force) / step
            move = mp.lu_solve(jacobian, -force)
            factor = mp.mpf(1)
            while True:
                trial = z + factor * move
                new = residual(trial)
                if mp.norm(new) < mp.norm(force) or factor < mp.mpf(2) ** -40:
                    break
                factor /= 2
            z, force = trial, new
        raise ArithmeticError(
            f"no balance found at delta = {delta:g}, residual {mp.nstr(mp.norm(force), 3)}"
        )
