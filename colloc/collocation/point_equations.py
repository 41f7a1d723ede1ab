"""CasADi expressions of one mesh point: what collocation evaluates, each stated for a single instant.

The physics is that of `mechanics.balance` and `mechanics.link_friction`; here it is only arranged into outputs. The balance
itself is a step function of the tail velocity as delta goes to 0 and does not converge as a constraint. Two cures, the
*formulations* of a point:

``full``
    Link forces are variables, each tied to its velocities by an equation scaled like a velocity, F / I0 + mu v = 0;
    the balance is linear in the forces.
``implicit velocity``
    The tail velocity is tied to the one that balances the body, z - Z(angles, rates) = 0, with Z from the NumPy solver
    and its derivatives from the implicit function theorem. The velocity map is mild where the balance is not.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca

from colloc.collocation.shape_checks import ShapeCheck
from colloc.gaits.problem import FULL
from colloc.mechanics.balance import instant, net_force, total_power
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.mechanics.link_friction import LinkForce, link_moments
from colloc.numerics.blocks import LocalFunction, local_function, total_function

N_RATE = 2
"""The last outputs of a point: velocity of the centre of mass along the lab's x, and power."""


@lru_cache(maxsize=32)
def point_function(formulation: str, body: Chain, friction: Friction) -> LocalFunction:
    """Outputs at a mesh point: equations that must vanish, then rate of distance and power.

    Locals: theta, joint angles, joint rates, z, and for "full" tangential forces, normal forces, couples of the links.
    """
    return _full_point(body, friction) if formulation == FULL else _map_point(body, friction)


def _symbols(body: Chain) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
    names = (("theta", 1), ("q", body.n_joint), ("r", body.n_joint), ("z", 3), ("delta", 1))
    theta, angles, rates, z, delta = (ca.SX.sym(name, size) for name, size in names)
    return theta, angles, rates, z, delta


def advance(body: Chain, theta: ca.SX, angles: ca.SX, rates: ca.SX, z: ca.SX) -> ca.SX:
    """Velocity of the centre of mass along the lab's x."""
    posture = body.posture(angles)
    cx, cy = body.centre_velocity(posture, body.velocity(posture, rates, z))
    return ca.cos(theta) * cx - ca.sin(theta) * cy


def full_equations(
    body: Chain, friction: Friction, angles: ca.SX, rates: ca.SX, z: ca.SX, force: LinkForce, delta: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """What vanishes where link forces obey the law of friction and balance: scaled laws, then the balance; and the power."""
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
    return ca.vertcat(*laws, net_force(posture, force)), total_power(velocity, force)


def link_forces(body: Chain) -> LinkForce:
    """Symbols of the forces on the links."""
    return LinkForce(*(ca.SX.sym(s, body.n_link) for s in ("f_s", "f_n", "couple")))


def _full_point(body: Chain, friction: Friction) -> LocalFunction:
    theta, angles, rates, z, delta = _symbols(body)
    force = link_forces(body)
    equations, power = full_equations(body, friction, angles, rates, z, force, delta)
    out = ca.vertcat(equations, advance(body, theta, angles, rates, z), power)
    return local_function("point", ca.vertcat(theta, angles, rates, z, *force), ca.SX(0, 1), delta, out)


def _map_point(body: Chain, friction: Friction) -> LocalFunction:
    """Outputs z - Z, rate of distance at z, power at Z, where Z(angles, rates) solves the balance (an instance parameter).

    Derivatives of Z follow from balance(Z, y) = 0: dZ/dy = -R_z^-1 R_y. The Hessian of w.Z + w_P P(Z, y) is that of
    w_P P + nu.R on (y, Z), pulled back along (I, dZ/dy), with nu such that the z-derivative of the whole vanishes.
    """
    theta, angles, rates, z, delta = _symbols(body)
    solved = ca.SX.sym("Z", 3)
    y = ca.vertcat(angles, rates)
    now = instant(body, friction, angles, rates, solved, delta)
    balance, power = net_force(now.posture, now.force), total_power(now.velocity, now.force)
    local = ca.vertcat(theta, y, z)
    forward = advance(body, theta, angles, rates, z)
    out = ca.vertcat(z - solved, forward, power)

    R_z, R_y = ca.jacobian(balance, solved), ca.jacobian(balance, y)
    P_z, P_y = ca.jacobian(power, solved), ca.jacobian(power, y)
    slope = -ca.solve(R_z, R_y)
    n_y = y.shape[0]
    zeros = ca.SX(3, 1)
    jacobian = ca.vertcat(
        ca.horzcat(zeros, -slope, ca.SX.eye(3)),
        ca.jacobian(forward, local),
        ca.horzcat(ca.SX(1, 1), P_y + P_z @ slope, ca.SX(1, 3)),
    )
    weight = ca.SX.sym("weight", 5)
    nu = ca.SX.sym("nu", 3)
    both = ca.vertcat(y, solved)
    inner = ca.hessian(weight[4] * power + ca.dot(nu, balance), both)[0]
    nu_value = ca.solve(R_z.T, weight[0:3] - weight[4] * P_z.T)
    inner = ca.substitute(inner, nu, nu_value)
    frame = ca.vertcat(ca.SX.eye(n_y), slope)
    hessian = ca.hessian(weight[3] * forward, local)[0]
    hessian[1 : 1 + n_y, 1 : 1 + n_y] += frame.T @ inner @ frame
    return total_function("point", local, solved, delta, out, jacobian, hessian, weight)


@lru_cache(maxsize=32)
def balance_steps(body: Chain, friction: Friction) -> ca.Function:
    """Steps on the balance, (angles, rates, z, delta) to (z by Newton, z by the paper's fixed point, residual before the step).

    Undamped, and in the tail's velocity: to finish what starts close by. `mechanics.fixed_point` converges from anywhere.
    """
    _, angles, rates, z, delta = _symbols(body)
    now = instant(body, friction, angles, rates, z, delta)
    balance = net_force(now.posture, now.force) / friction.largest
    newton = z - ca.solve(ca.jacobian(balance, z), balance)

    # link speeds frozen (paper, eqs. ftbtilde to deltatilde): forces linear in the velocities, with these moments
    frozen = [ca.SX.sym(name, body.n_link) for name in ("I0", "I1", "I2")]
    I0, I1, I2 = frozen
    vs, vn, w = now.velocity
    mu_s, mu_t = friction.tangential(vs), friction.mu_t
    linear = LinkForce(-mu_s * vs * I0, -mu_t * (vn * I0 + w * I1), -mu_t * (vn * I1 + w * I2))
    slope = ca.jacobian(net_force(now.posture, linear), z) / friction.largest
    moments = link_moments(vs, vn, w, ca.DM(body.length_column()), delta)
    secant = ca.substitute([slope], frozen, list(moments))[0]
    fixed_point = z - ca.solve(secant, balance)
    outputs = [newton, fixed_point, ca.norm_inf(balance)]
    return ca.Function("balance_steps", [angles, rates, z, delta], outputs, {"cse": True})


def gait_check(check: ShapeCheck, n_joint: int, n_parameter: int) -> LocalFunction:
    """A shape check as a function of gait parameters; given: the gait's angle matrix, by columns, and the share of the cut."""
    p = ca.SX.sym("p", n_parameter)
    matrix, share = ca.SX.sym("Phi", n_joint * n_parameter), ca.SX.sym("share")
    angles = ca.reshape(matrix, n_joint, n_parameter) @ p
    return local_function("check", p, ca.vertcat(matrix, share), ca.SX.sym("delta"), check.cut(angles, share))


def mean_square(weights: ca.DM) -> LocalFunction:
    """The quadratic form ``p' weights p`` of gait parameters."""
    p = ca.SX.sym("p", weights.shape[0])
    return local_function("mean_square", p, ca.SX(0, 1), ca.SX.sym("delta"), ca.bilin(weights, p, p))


def minus_efficiency() -> LocalFunction:
    """-x/W of the final distance and work."""
    state = ca.SX.sym("xW", 2)
    return local_function("objective", state, ca.SX(0, 1), ca.SX.sym("delta"), -state[0] / state[1])
