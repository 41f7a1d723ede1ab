"""CasADi expressions of one mesh point: what collocation evaluates, each stated for a single instant.

The physics is that of `colloc.balance` and `colloc.friction`; here it is only arranged into outputs.
"""

from __future__ import annotations

import casadi as ca

from colloc.balance import net_force, total_power
from colloc.blocks import LocalFunction, local_function
from colloc.body import Chain
from colloc.contact import crossing_bounds
from colloc.friction import Friction, LinkForce, link_moments


def lifted_point(body: Chain, friction: Friction) -> LocalFunction:
    """Force laws, balance, rate of distance and power at a point, with the link forces as variables.

    Locals: theta, joint angles, joint rates, z, then tangential forces, normal forces and couples of the links.
    Outputs: ``3 n_link`` force laws, each scaled like a velocity (F / I0 + mu v = 0); force and torque balance (3);
    velocity of the centre of mass along the lab's x; power.
    """
    n_joint, n_link = body.n_joint, body.n_link
    theta, angles, rates, z = (ca.SX.sym(s, k) for s, k in (("theta", 1), ("q", n_joint), ("r", n_joint), ("z", 3)))
    force = LinkForce(*(ca.SX.sym(s, n_link) for s in ("f_s", "f_n", "couple")))
    delta = ca.SX.sym("delta")
    posture = body.posture(angles)
    velocity = body.velocity(posture, rates, z)
    vs, vn, w = velocity
    length = ca.DM(body.length_column())
    I0, I1, I2 = link_moments(vs, vn, w, length, delta)
    mu_s, mu_t = friction.tangential(vs), friction.mu_t
    laws = [
        force.tangential / I0 + mu_s * vs,
        force.normal / I0 + mu_t * (vn + w * I1 / I0),
        (force.couple / I0 + mu_t * (vn * I1 / I0 + w * I2 / I0)) * 6 / length,
    ]
    cx, cy = body.centre_velocity(posture, velocity)
    out = ca.vertcat(
        *laws,
        net_force(posture, force),
        ca.cos(theta) * cx - ca.sin(theta) * cy,
        total_power(velocity, force),
    )
    return local_function("point", ca.vertcat(theta, angles, rates, z, *force), ca.SX(0, 1), delta, out)


def shape_checks(body: Chain) -> list[tuple[str, ca.Function]]:
    """Named scalar functions of the joint angles that admissibility bounds: each joint angle, each pair of links."""
    angles = ca.SX.sym("q", body.n_joint)
    checks = [(f"joint {j + 1}", angles[j]) for j in range(body.n_joint)]
    bounds = crossing_bounds(body, angles)
    if bounds is not None:
        for i in range(body.n_link - 2):
            for side, name in ((0, "left"), (1, "right")):
                checks.append((f"links {i + 1} and {i + 3} ({name})", bounds[2 * i + side]))
    return [(name, ca.Function("check", [angles], [expression])) for name, expression in checks]


def gait_check(check: ca.Function, n_joint: int, n_parameter: int) -> LocalFunction:
    """A shape check as a function of gait parameters; the instance parameters are the gait's angle matrix, by columns."""
    p = ca.SX.sym("p", n_parameter)
    matrix = ca.SX.sym("Phi", n_joint * n_parameter)
    angles = ca.reshape(matrix, n_joint, n_parameter) @ p
    return local_function("check", p, matrix, ca.SX.sym("delta"), check(angles))


def mean_square(weights: ca.DM) -> LocalFunction:
    """The quadratic form ``p' weights p`` of gait parameters."""
    p = ca.SX.sym("p", weights.shape[0])
    return local_function("mean_square", p, ca.SX(0, 1), ca.SX.sym("delta"), ca.bilin(weights, p, p))


def minus_efficiency() -> LocalFunction:
    """-x/W of the final distance and work."""
    state = ca.SX.sym("xW", 2)
    return local_function("objective", state, ca.SX(0, 1), ca.SX.sym("delta"), -state[0] / state[1])
