"""The most efficient gait of three links on a dry floor: direct collocation in plain CasADi.

Lengths and weights are 1/3 and friction is 1. Phase t runs from 0 to 2 pi, speeds are per radian.
Equations have the numbers of docs/collocation.md:

    (1)  q1 = A0 + A1 cos t + B1 sin t,   q2 = -A0 - A1 cos t + B1 sin t      joint angles
    (2)  f = -k(v; delta) v: friction, smoothed below the speed delta         on each link
    (3)  sum f = 0, sum of torques = 0                                        at each point
    (4)  theta' = omega,  x' = velocity ahead,  W' = -sum f . v               collocated
    (5)  maximise x / W at the end, from x = W = 0, with all angles within pi
"""

from contextlib import suppress

import casadi as ca
import numpy as np

L, N, S = 1 / 3, 48, 3  # length of a link; intervals of the period; Radau points on each
n, h = N * S, 2 * np.pi / N
GUESS = 0.0, 2.0, 1.0  # A0, A1, B1
DELTAS = 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4  # body lengths per period
IPOPT = {"mu_strategy": "monotone", "mu_init": 1e-4, "bound_push": 1e-5, "bound_frac": 1e-5}
IPOPT |= {"max_iter": 300, "print_level": 0, "sb": "yes"}  # above: for a start close to the answer
tau = ca.collocation_points(S, "radau")
C, D, _ = ca.collocation_coeff(tau)
t = h * np.add.outer(np.arange(N), tau).reshape(1, n)


def gait(A0, A1, B1):
    """(1), and the rates, at all points: two arrays (2, n)."""
    c, s = ca.DM(np.cos(t)), ca.DM(np.sin(t))
    q = ca.vertcat(A0 + A1 * c + B1 * s, -A0 - A1 * c + B1 * s)
    return q, ca.vertcat(-A1 * s + B1 * c, A1 * s + B1 * c)


def drag(vs, vn, w, delta):
    """k of (2), for velocities along and across and rotation: integrals over the link, in closed
    form, of what 1 / sqrt(vs^2 + (vn + w a)^2 + delta^2) multiplies."""
    a2, y0, y1 = vs**2 + delta**2, vn - w * L / 2, vn + w * L / 2
    r0, r1 = ca.sqrt(a2 + y0**2), ca.sqrt(a2 + y1**2)
    R, T = r0 + r1, a2 + y0 * y1 + r0 * r1
    rest = (1 - 1e-6) * 2 * T / R**2  # 1 - (w L / R)^2, lowered so that its root is smooth
    root = ca.sqrt(1 - rest)
    g = ca.log((1 + root) ** 2 / rest) / (2 * root)  # artanh(root) / root
    m = a2 / (2 * T) - a2 * (g - 1) / (root * R) ** 2
    return ca.vertcat(2 * L * g / R, 2 * L / R, L**3 / R * m)


# one instant, seen from the tail, which moves with z = (u, v, omega): from link to link
q, r, z, f = (ca.SX.sym(name, size) for name, size in (("q", 2), ("r", 2), ("z", 3), ("f", 9)))
delta, x, y, phi, (vx, vy, w) = ca.SX.sym("delta"), 0, 0, 0, ca.vertsplit(z)
v, k, F, V = [], [], 0, 0
for i in range(3):
    a, b = L / 2 * ca.cos(phi), L / 2 * ca.sin(phi)  # half a link
    c, s, x, y, vx, vy = 2 / L * a, 2 / L * b, x + a, y + b, vx - w * b, vy + w * a  # midpoint
    v += [ca.vertcat(c * vx + s * vy, c * vy - s * vx, w)]
    k += [drag(*ca.vertsplit(v[i]), delta)]
    along, across, couple = f[3 * i], f[3 * i + 1], f[3 * i + 2]
    fx, fy = c * along - s * across, s * along + c * across
    F, V = F + ca.vertcat(fx, fy, x * fy - y * fx + couple), V + L * ca.vertcat(vx, vy)
    x, y, vx, vy = x + a, y + b, vx - w * b, vy + w * a  # joint
    phi, w = (phi + q[i], w + r[i]) if i < 2 else (phi, w)
v, k = ca.vertcat(*v), ca.vertcat(*k)
sliding = ca.Function("sliding", [q, r, z, delta], [v, k])
balance = ca.Function("balance", [q, r, z, f], [F, V, -ca.dot(f, v)])
held = ca.SX.sym("k", 9)  # with k held, F is linear in z: one step of the paper's fixed point
linear = ca.substitute(F, f, -held * v)
change = ca.substitute(ca.solve(ca.jacobian(linear, z), linear), held, k)
step = ca.Function("step", [q, r, z, delta], [z - change])


def literal(opti, v, k):
    """(2) as it stands: forces are expressions."""
    return -k * v


def program(friction):
    """The program; its parameters, tail velocities, states at points and at edges, and delta."""
    opti = ca.Opti()
    A, z, X, edges = (opti.variable(*size) for size in ((3,), (3, n), (3, n), (3, N + 1)))
    delta, (q, r) = opti.parameter(), gait(A[0], A[1], A[2])
    F, V, power = balance.map(n)(q, r, z, friction(opti, *sliding.map(n)(q, r, z, delta)))
    c, s = ca.cos(X[0, :]), ca.sin(X[0, :])
    rates = ca.vertcat(z[2, :], c * V[0, :] - s * V[1, :], power)
    opti.subject_to(ca.vec(F) == 0)  # (3)
    for i in range(N):  # (4): a polynomial through the edge and the points, and where it ends
        points = slice(i * S, (i + 1) * S)
        values = ca.horzcat(edges[:, i], X[:, points])
        opti.subject_to(ca.vec(values @ C - h * rates[:, points]) == 0)
        opti.subject_to(values @ D == edges[:, i + 1])
    opti.subject_to(edges[1:, 0] == 0)  # theta(0) is free: the way of the body becomes the x axis
    opti.subject_to(opti.bounded(-np.pi, ca.vec(q), np.pi))
    opti.minimize(-edges[1, N] / edges[2, N])  # (5)
    return opti, A, z, X, edges, delta


def follow(friction, guess=GUESS, deltas=DELTAS, ipopt=IPOPT):
    """Print and return delta, efficiency, gait, iterations and status as delta falls."""
    opti, A, z, _, edges, delta = program(friction)
    opti.solver("ipopt", {"expand": True, "print_time": False}, ipopt)
    (q, r), balanced = gait(*guess), ca.DM.zeros(3, n)
    for _ in range(200):
        balanced = step.map(n)(q, r, balanced, deltas[0] / (2 * np.pi))
    opti.set_initial(A, guess)
    opti.set_initial(z, balanced)
    opti.set_initial(edges[2, :], np.linspace(0, 1, N + 1))
    opti.set_value(delta, deltas[0] / (2 * np.pi))
    first = opti.copy()  # with the guess held: its motion, which the continuation starts from
    first.subject_to(ca.DM(guess) == A)
    opti.set_initial(first.solve().value_variables())
    rows = []
    for level in deltas:
        opti.set_value(delta, level / (2 * np.pi))
        with suppress(RuntimeError):  # of a failure; the status says which
            opti.solve()
        last, stats = opti.debug, opti.stats()
        x, W = last.value(edges[1:, N])
        rows += [(level, x / W, last.value(A), stats["iter_count"], stats["return_status"])]
        print("delta {:.4f}   d/W {:.4f}   A {}   iterations {}   {}".format(*rows[-1]), flush=True)
        if not stats["success"]:
            break
        opti.set_initial(last.value_variables())
    return rows


if __name__ == "__main__":
    follow(literal)
