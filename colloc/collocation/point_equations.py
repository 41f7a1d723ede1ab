"""CasADi expressions of one mesh point: what collocation evaluates, each stated for a single
instant.

The physics is the body's (`colloc.mechanics.bodies`); here it is only arranged into outputs. The
balance itself is a step function of the tail velocity as delta goes to 0 and does not converge as a
constraint. Two cures, the *formulations* of a point:

``full``
    Link forces are variables, each tied to its velocities by an equation scaled like a velocity, F
    / I0 + mu v = 0; the balance is linear in the forces.
``implicit velocity``
    The tail velocity is tied to the one that balances the body, z - Z(angles, rates) = 0, with Z
    from the NumPy solver and its derivatives from the implicit function theorem. The velocity map
    is mild where the balance is not.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from colloc.collocation.shape_checks import ShapeCheck
from colloc.gaits.control_problem import Dynamics
from colloc.gaits.gait_fields import AnyClass
from colloc.gaits.regime import LEVEL, Regime
from colloc.mechanics.balance import load_wrench
from colloc.mechanics.bodies import FULL, Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.densities import Instants, PathLimits, Quantity
from colloc.mechanics.inertia import STATES, about_centre, checked_mass, momenta, turning
from colloc.mechanics.law import Law
from colloc.numerics.blocks import LocalFunction, implicit_function, local_function

N_RATE = 3
"""The last outputs of a point: rotation rate, velocity of the centre of mass along the lab's x, and
power."""


@lru_cache(maxsize=32)
def point_function(
    formulation: str,
    body: Body,
    friction: Law,
    regime: Regime = LEVEL,
    unit: float = 1.0,
    *,
    relative: bool = False,
) -> LocalFunction:
    """Outputs at a mesh point: equations that must vanish, then rates of rotation and distance and
    power of the joints, all per period divided by `unit`, as the law of friction takes rates.

    Locals: theta, joint angles, joint rates, z, and for "full" tangential forces, normal forces,
    couples of the links. With inertia the momenta, too: they, not the balance, have to be those
    that the body has, and before the last outputs are their rates; at a free pace the logarithm of
    the period comes last. Delta may be relative to the shape speed.
    """
    if regime.froude:
        log_period = ca.SX.sym("log_period", int(regime.free_pace))
        froude = ca.exp(-2.0 * log_period) if regime.free_pace else regime.froude
        return _point_with_inertia(
            checked_mass(body), friction, regime, froude * unit**2, log_period
        )
    return (
        _full_point(body, friction, regime, relative=relative)
        if formulation == FULL
        else _map_point(body, friction, relative=relative)
    )


def _symbols(body: Body) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
    names = (("theta", 1), ("q", body.n_joint), ("r", body.n_joint), ("z", 3), ("delta", 1))
    theta, angles, rates, z, delta = (ca.SX.sym(name, size) for name, size in names)
    return theta, angles, rates, z, delta


def forward(theta: ca.SX, centre: ca.SX) -> ca.SX:
    """Velocity of the centre of mass along the lab's x, from that in the body's axes."""
    return ca.cos(theta) * centre[0] - ca.sin(theta) * centre[1]


def _slow(delta: ca.SX, rates: ca.SX, *, relative: bool) -> ca.SX:
    """Delta at a point."""
    return delta * ca.norm_2(rates) if relative else delta


def _full_point(body: Body, friction: Law, regime: Regime, *, relative: bool) -> LocalFunction:
    theta, angles, rates, z, delta = _symbols(body)
    forces = ca.SX.sym("forces", len(body.force_names))
    slow = _slow(delta, rates, relative=relative)
    laws, balance, centre, power = body.with_forces(friction, angles, rates, z, forces, slow)
    load = regime.pull(theta)
    if load is not None:
        balance += load_wrench(body, body.posture(angles), load)  # type: ignore[attr-defined, arg-type]
        power -= ca.sum1(load * centre)
    out = ca.vertcat(laws, balance, z[2], forward(theta - regime.ahead, centre), power)
    return local_function(
        "point", ca.vertcat(theta, angles, rates, z, forces), ca.SX(0, 1), delta, out
    )


def _point_with_inertia(
    body: Chain, friction: Law, regime: Regime, froude: float | ca.SX, log_period: ca.SX
) -> LocalFunction:
    theta, angles, rates, z, delta = _symbols(body)
    forces, states, posture = (
        ca.SX.sym("forces", len(body.force_names)),
        ca.SX.sym("momenta", len(STATES)),
        body.posture(angles),
    )
    laws, force, centre, power = body.with_forces(friction, angles, rates, z, forces, delta)
    own = momenta(body, posture, body.velocity(posture, rates, z))
    pull = regime.pull(theta)
    pushed = about_centre(body, angles, force)
    if pull is not None:
        pushed += ca.vertcat(pull, 0)
        power -= ca.sum1(pull * centre)
    changes = pushed / froude + turning(z, states)
    out = ca.vertcat(
        laws, own - states, changes, z[2], forward(theta - regime.ahead, centre), power
    )
    return local_function(
        "point",
        ca.vertcat(theta, angles, rates, z, forces, states, log_period),
        ca.SX(0, 1),
        delta,
        out,
    )


def across_point(dynamics: Dynamics) -> LocalFunction:
    """Velocity of the centre of mass to the left of the direction whose way counts."""
    body, friction, regime, *_ = dynamics
    theta, angles, rates, z, delta = _symbols(body)
    out = forward(
        theta - regime.ahead - 0.5 * np.pi, body.sliding(friction, angles, rates, z, delta).centre
    )
    return local_function("across", ca.vertcat(theta, angles, rates, z), ca.SX(0, 1), delta, out)


def _map_point(body: Body, friction: Law, *, relative: bool) -> LocalFunction:
    """Outputs z - Z, rates at z, power at Z, where Z(angles, rates) solves the balance (an instance
    parameter)."""
    theta, angles, rates, z, delta = _symbols(body)
    solved, local = ca.SX.sym("Z", 3), ca.vertcat(theta, angles, rates, z)
    slow = _slow(delta, rates, relative=relative)
    balanced = body.sliding(friction, angles, rates, solved, slow)
    ahead = forward(theta, body.sliding(friction, angles, rates, z, slow).centre)
    out = ca.vertcat(z - solved, z[2], ahead, balanced.power)
    return implicit_function("point", local, ca.SX(0, 1), solved, delta, balanced.force, out)


def gait_check(check: ShapeCheck, n_joint: int, n_parameter: int) -> LocalFunction:
    """A shape check as a function of gait parameters; given: the gait's angle matrix, by columns,
    and the share of the cut."""
    p = ca.SX.sym("p", n_parameter)
    matrix, share = ca.SX.sym("Phi", n_joint * n_parameter), ca.SX.sym("share")
    angles = ca.reshape(matrix, n_joint, n_parameter) @ p
    return local_function(
        "check", p, ca.vertcat(matrix, share), ca.SX.sym("delta"), check.cut(angles, share)
    )


def mean_square(weights: ca.DM) -> LocalFunction:
    """The quadratic form ``p' weights p`` of gait parameters."""
    p = ca.SX.sym("p", weights.shape[0])
    return local_function(
        "mean_square", p, ca.SX(0, 1), ca.SX.sym("delta"), ca.bilin(weights, p, p)
    )


def square_of_mean_speed(shares: np.ndarray, rates: np.ndarray) -> LocalFunction:
    """The square of the mean shape speed from gait parameters, by the share of each side in the
    time and its rates per parameter ``(n_side, n_joint, n_parameter)``."""
    p = ca.SX.sym("p", rates.shape[2])
    speeds = (share * ca.norm_2(ca.DM(each) @ p) for share, each in zip(shares, rates, strict=True))
    return local_function("mean_speed", p, ca.SX(0, 1), ca.SX.sym("delta"), sum(speeds) ** 2)


def shares_of_length(shares: np.ndarray, rates: np.ndarray) -> LocalFunction:
    """The length of every side over that of all, from gait parameters; arguments as of
    `square_of_mean_speed`."""
    p = ca.SX.sym("p", rates.shape[2])
    sides = zip(shares, rates, strict=True)
    lengths = ca.vertcat(*(share * ca.norm_2(ca.DM(each) @ p) for share, each in sides))
    out = lengths / ca.sum1(lengths)
    return local_function("shares", p, ca.SX(0, 1), ca.SX.sym("delta"), out)


def member_equations(gait: AnyClass, n_joint: int) -> LocalFunction:
    """Fourier coefficients less those that the own parameters of a class give
    (`colloc.gaits.serpenoid`): 0 of members."""
    p = ca.SX.sym("p", gait.size(n_joint))
    given = ca.vertcat(*(value for row in gait.coefficients(p, n_joint) for value in row))
    return local_function(
        "members",
        p,
        ca.SX(0, 1),
        ca.SX.sym("delta"),
        p[gait.n_own : gait.n_own + given.numel()] - given,
    )


def density_point(
    quantity: Quantity, dynamics: Dynamics, unit: float, *, relative: bool = False
) -> LocalFunction:
    """Density of a quantity at a point, from joint angles and rates or, if it needs forces, from
    the locals of `with_forces`, per period divided by `unit`."""
    theta, angles, rates, _, delta = _symbols(dynamics.body)
    slow = _slow(delta, rates, relative=relative)
    if not quantity.needs_forces:
        out = quantity.at(Instants(dynamics.body, dynamics.law, angles, rates, slow, unit=unit))
        return local_function(quantity.name, ca.vertcat(angles, rates), ca.SX(0, 1), delta, out)
    local, now = with_forces(dynamics, theta, angles, rates, slow, unit)
    return local_function(quantity.name, local, ca.SX(0, 1), delta, quantity.at(now))


def with_forces(
    dynamics: Dynamics, theta: ca.SX, angles: ca.SX, rates: ca.SX, delta: ca.SX, unit: float
) -> tuple[ca.SX, Instants]:
    """The locals orientation, angles, rates and forces of a point of a full program, and its
    instant as formulas see it."""
    body, law = dynamics.body, dynamics.law
    forces, load = ca.SX.sym("forces", len(body.force_names)), dynamics.regime.pull(theta)
    now = Instants(body, law, angles, rates, delta, forces=forces, unit=unit, load=load)
    return ca.vertcat(theta, angles, rates, forces), now


def actuator_point(
    limits: PathLimits, dynamics: Dynamics, unit: float, *, relative: bool = False
) -> LocalFunction:
    """What limited actuators do at a point, as parts of what they can; locals and unit as of
    `with_forces`."""
    theta, angles, rates, _, delta = _symbols(dynamics.body)
    slow = _slow(delta, rates, relative=relative)
    local, now = with_forces(dynamics, theta, angles, rates, slow, unit)
    return local_function("actuators", local, ca.SX(0, 1), delta, limits.at(now))
