"""What every tool is given: the isotropic three-link body, its gait, and friction in closed form,
for any array library.

`m` is a module with sin, cos, sqrt and log: numpy, casadi, or the tool's own. The closed form is
the one of `mechanics.friction` without its case distinctions: 1 - q is lowered by one part in
1e6, which changes forces by less than 1e-6 and keeps every expression smooth. Phase runs over
0..pi, half a period; delta is per radian of phase.
"""

import numpy as np

LENGTH = 1 / 3
GUESSES = 20
DELTAS = [10 ** (-1 - 0.5 * k) for k in range(7)]
"""Per period, as in colloc; 0.1 to 1e-4."""
_RAISED = 1e-6


def gait(m, t, A0, A1, B1):
    """Joint angles and rates of the one-harmonic bilateral gait at phase t."""
    c, s = m.cos(t), m.sin(t)
    angles = (A0 + A1 * c + B1 * s, -A0 - A1 * c + B1 * s)
    rates = (-A1 * s + B1 * c, A1 * s + B1 * c)
    return angles, rates


def drag(m, vs, vn, w, delta):
    """Drag over velocity: of a link along it, across it, and in rotation about its midpoint."""
    half = 0.5 * LENGTH * w
    a2 = vs**2 + delta**2
    y0, y1 = vn - half, vn + half
    r0, r1 = m.sqrt(a2 + y0**2), m.sqrt(a2 + y1**2)
    S = r0 + r1
    Q = a2 / (a2 + y0 * y1 + r0 * r1)
    one_less_q = 2 * a2 / (Q * S**2) * (1 - _RAISED)
    q = (2 * half / S) ** 2 * (1 - _RAISED) + _RAISED
    root = m.sqrt(q)
    g = 0.5 * m.log((1 + root) ** 2 / one_less_q) / root
    h = (g - 1) / q
    return 2 * LENGTH * g / S, 2 * LENGTH / S, LENGTH**3 / S * (0.5 * Q - a2 * h / S**2)


def balance_and_rates(m, t, theta, z, parameters, delta, forces=None):
    """Force and torque balance (three values), and the rates of orientation, distance and work.

    With lifted `forces` (along, across and couple of each link) the balance holds for those, and
    has their law as nine rows more: force over drag, plus velocity, is zero."""
    u, v, omega = z
    (q1, q2), (p1, p2) = gait(m, t, *parameters)
    phi, w = (0.0 * q1, q1, q1 + q2), (omega, omega + p1, omega + p1 + p2)
    x = y = 0.0
    vx, vy = u, v
    fx = fy = torque = power = cx = cy = 0.0
    law = []
    for k in range(3):
        c, s = m.cos(phi[k]), m.sin(phi[k])
        x, y = x + 0.5 * LENGTH * c, y + 0.5 * LENGTH * s
        vx, vy = vx - 0.5 * LENGTH * w[k] * s, vy + 0.5 * LENGTH * w[k] * c
        vs, vn = vx * c + vy * s, vy * c - vx * s
        velocity, ratios = (vs, vn, w[k]), drag(m, vs, vn, w[k], delta)
        if forces is None:
            along, across, couple = (-ratio * v for ratio, v in zip(ratios, velocity, strict=True))
        else:
            along, across, couple = own = forces[3 * k : 3 * k + 3]
            law += [f / ratio + v for f, ratio, v in zip(own, ratios, velocity, strict=True)]
        px, py = along * c - across * s, along * s + across * c
        fx, fy, torque = fx + px, fy + py, torque + x * py - y * px + couple
        power = power - (along * vs + across * vn + couple * w[k])
        cx, cy = cx + LENGTH * vx, cy + LENGTH * vy
        x, y = x + 0.5 * LENGTH * c, y + 0.5 * LENGTH * s
        vx, vy = vx - 0.5 * LENGTH * w[k] * s, vy + 0.5 * LENGTH * w[k] * c
    advance = m.cos(theta) * cx - m.sin(theta) * cy
    return (fx, fy, torque, *law), (omega, advance, power)


def link_forces(t, z, parameters, delta):
    """The forces that a motion has by their law, in which they are linear; NumPy."""
    without, with_units = (
        np.array(balance_and_rates(np, t, 0.0, z, parameters, delta, 9 * [size])[0][3:])
        for size in (0.0, 1.0)
    )
    return -without / (with_units - without)
