r"""A chain under its weight on a slope, and with inertia: balance, rates of the momenta
(`colloc.mechanics.inertia`) and joint torques, with derivatives.

A joint bears the moment about it of friction on all links ahead, less that of mass times
acceleration. A uniform pull, as that of a slope, accelerates all links alike and takes no torque.
Replays take accelerations by differences in time, and moments by virtual power; programs add up
forces from link to link (Newton and Euler); the two share no formula.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from colloc.gaits.regime import Regime
from colloc.mechanics.balance import TAIL, Moving, joint_moments
from colloc.mechanics.bodies import BalancedMotion, BalanceSolution
from colloc.mechanics.chain import Chain
from colloc.mechanics.densities import Instants, PathLimits, Quantity
from colloc.mechanics.fixed_point import motion_and_derivatives, solve_balance
from colloc.mechanics.friction import LinkVelocity
from colloc.mechanics.inertia import (
    STATES,
    Path,
    inertial_moments,
    momentum_rates,
    tail_velocity,
)
from colloc.mechanics.law import Law
from colloc.mechanics.native_kernel import call_for_all, native_kernel

N_OUT = 9
"""Tail velocity, velocity of the centre of mass, power, rates of the momenta."""
_STEP = 1e-5  # of differences in time, in phase
_LOAD = slice(-2, None)


class Leaning(NamedTuple):
    """A chain at instants on a slope."""

    solved: BalanceSolution
    now: BalancedMotion
    on_shape: np.ndarray
    """Derivatives of (tail velocity, velocity of the centre, power) with respect to (angles,
    rates), ``(6, 2 n_joint, n)``."""
    on_theta: np.ndarray
    """The same with respect to the orientation, ``(6, n)``."""


def balance_on_slope(
    body: Chain,
    friction: Law,
    slope: Regime,
    shapes: tuple[np.ndarray, np.ndarray, float],
    theta: np.ndarray,
    **settings: Any,
) -> Leaning:
    """The balance of angles and rates ``(n_joint, n)`` at a delta, the tail link at angles theta
    ``(n,)`` from straight uphill [rad]; settings are the start and tolerance of `solve_balance`."""
    load = slope.pull(theta[None])
    load = np.zeros((2, theta.size)) if load is None else load
    solved = solve_balance(body, friction, *shapes, load=load, **settings)
    now, slopes = motion_and_derivatives(body, friction, *shapes, solved, load)
    on_load = slopes[:, _LOAD]
    # the pull turns against theta
    on_theta = on_load[:, 0] * load[1] - on_load[:, 1] * load[0]
    return Leaning(solved, now, slopes[:, : _LOAD.start], on_theta)


@lru_cache(maxsize=32)
def _momenta_function(body: Chain, friction: Law, *, differentiated: bool) -> Any:
    """(angles, rates, momenta, delta, Froude number) to outputs and derivatives along the first
    three."""
    import casadi as ca  # which nothing slow needs, nor a search

    sizes = {"angles": body.n_joint, "rates": body.n_joint, "momenta": len(STATES)}
    given = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
    delta, froude = ca.SX.sym("delta"), ca.SX.sym("froude")
    now = momentum_rates(body, friction, *given.values(), delta=delta, froude=froude)
    out, slopes = ca.vertcat(now.z, given["momenta"][:2], now.power, now.rates), ca.SX(0, 1)
    if differentiated:
        slopes = ca.vec(ca.densify(ca.jacobian(out, ca.vertcat(*given.values())).T))
    return ca.Function("momenta", [*given.values(), delta, froude], [out, slopes], {"cse": True})


def momenta_at(
    body: Chain,
    friction: Law,
    shapes: tuple[np.ndarray, np.ndarray, float],
    states: np.ndarray,
    froude: float,
    *,
    along_states: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Outputs ``(9, n_time)`` and derivatives ``(9, 2 n_joint + 3, n_time)`` along angles, rates,
    momenta, or along the momenta alone; `shapes` are angles, rates ``(n_joint, n_time)`` and
    delta."""
    columns = len(STATES) if along_states else 2 * body.n_joint + len(STATES)
    library, (angles, rates, delta) = native_kernel(body, friction), shapes
    if library is not None:
        moving = Moving(body, friction, angles, rates, delta, None)
        n_time, spin = states.shape[1], body.inertia_column()
        outputs = np.empty((N_OUT, n_time)), np.empty((N_OUT, columns, n_time))
        call_for_all(library.colloc_momenta, moving, spin, froude, states, columns, *outputs)
        return outputs
    evaluate = _momenta_function(body, friction, differentiated=True)
    out, slopes = evaluate(angles, rates, states, delta, froude)
    by_output = slopes.full().reshape(N_OUT, -1, states.shape[1])
    return np.asarray(out.full()), np.asarray(by_output[:, -columns:])


class MomentaAt:
    """Outputs ``(n, 9)`` for n momenta at one time, in a few microseconds."""

    def __init__(self, body: Chain, friction: Law, delta: float, froude: float, n: int = 1) -> None:
        shapes = np.zeros((2, body.n_joint))
        momenta = np.zeros((n, len(STATES)))
        numbers = np.array([[delta], [froude]])
        self._given, self._out = (*shapes, momenta, *numbers), np.zeros((n, N_OUT))
        one = _momenta_function(body, friction, differentiated=False)
        self._function = one.map("momenta", "serial", n, [0, 1, 3, 4], list[int]())
        self._buffer, self._evaluate = self._function.buffer()
        for k, given in enumerate(self._given):
            self._buffer.set_arg(k, memoryview(given.reshape(-1).data))
        self._buffer.set_res(0, memoryview(self._out.reshape(-1).data))

    def __call__(self, angles: np.ndarray, rates: np.ndarray, states: np.ndarray) -> np.ndarray:
        self._given[0][:], self._given[1][:], self._given[2][:] = angles, rates, states
        self._evaluate()
        return self._out.copy()


def joint_torques(
    body: Chain,
    friction: Law,
    path: Path,
    t: np.ndarray,
    momenta: np.ndarray,
    *,
    delta: float,
    froude: float,
) -> np.ndarray:
    """Joint torques ``(n_joint, n_time)`` of a gait with momenta ``(3, n_time)`` at phases t."""
    angles, rates = path(t)
    z = tail_velocity(body, angles, rates, momenta)
    how: Any = {"delta": delta, "froude": froude}
    changes = momentum_rates(body, friction, angles, rates, momenta, **how).rates

    def link_velocity(by: float) -> LinkVelocity:
        angles, rates = path(t + by)
        tail = tail_velocity(body, angles, rates, momenta + by * changes)
        return body.velocity(body.posture(angles), rates, tail)

    pairs = zip(link_velocity(-_STEP), link_velocity(_STEP), strict=True)
    growth = LinkVelocity(*((after - before) / (2 * _STEP) for before, after in pairs))
    link = body.velocity(body.posture(angles), rates, z)
    forces = body.forces(friction, angles, rates, z, delta)
    inertial = froude * inertial_moments(body, angles, link, growth)
    return joint_moments(body, angles, forces) + inertial


@lru_cache(maxsize=32)
def torque_function(body: Chain, friction: Law) -> Any:
    """CasADi function (q, r, q'', momenta, delta, Froude number) to the joint torques ``(n_joint,
    1)`` at one time, in any unit of time."""
    import casadi as ca

    n = body.n_joint
    sizes = (("q", n), ("r", n), ("a", n), ("momenta", len(STATES)), ("delta", 1), ("froude", 1))
    q, r, accelerations, momenta, delta, froude = symbols = [ca.SX.sym(*each) for each in sizes]
    posture, z = body.posture(q), tail_velocity(body, q, r, momenta)
    sliding = body.contact.on_links(body.forces(friction, q, r, z, delta))
    (cos, sin, x, y), mass, spin = posture, body.mass_column(), body.inertia_column()
    fx = sliding.tangential * cos - sliding.normal * sin
    fy = sliding.tangential * sin + sliding.normal * cos
    # accelerations of midpoints, the tail's end resting and its rate even
    rate, turn = z[2] + body.tangent_angles(r), body.tangent_angles(accelerations)
    path = ca.sparsify(ca.DM(body.weighted_path(TAIL)))
    ax, ay = path @ (-sin * turn - cos * rate**2), path @ (cos * turn - sin * rate**2)
    # seen from the centre of mass
    x, y, ax, ay = (each - ca.dot(mass, each) for each in (x, y, ax, ay))
    moment = ca.sum1(x * fy - y * fx + sliding.couple)
    gained = froude * ca.sum1(mass * (x * ay - y * ax) + spin * turn)
    alpha = (moment - gained) / ca.sum1(mass * (x**2 + y**2) + spin)  # times the Froude number
    about_midpoint = sliding.couple - spin * (alpha + froude * turn)
    fx, fy = (
        fx - mass * (ca.sum1(fx) + froude * ax - alpha * y),
        fy - mass * (ca.sum1(fy) + froude * ay + alpha * x),
    )
    torques: list[Any] = []
    ahead = ca.SX(3, 1)  # force, and moment about the joint, of all links ahead
    for i in range(n, 0, -1):
        half = 0.5 * body.lengths[i] * ca.vertcat(cos[i], sin[i])
        about_joint = half[0] * (fy[i] + 2 * ahead[1]) - half[1] * (fx[i] + 2 * ahead[0])
        ahead += ca.vertcat(fx[i], fy[i], about_joint + about_midpoint[i])
        torques.insert(0, -ahead[2])
    torques = ca.vertcat(*torques)
    return ca.Function("torques", symbols, [torques], {"cse": True})


@lru_cache(maxsize=32)
def _torques_and_slopes(body: Chain, friction: Law) -> Any:
    import casadi as ca

    function = torque_function(body, friction)
    symbols = function.sx_in()
    torques, along = function(*symbols), ca.vertcat(*symbols[:4], symbols[-1])
    slopes = ca.vec(ca.densify(ca.jacobian(torques, along).T))
    return ca.Function("torques", symbols, [torques, slopes], {"cse": True})


def torques_at(
    body: Chain, friction: Law, y: np.ndarray, delta: float, *, differentiated: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Joint torques ``(n_joint, n_time)`` at y = (angles, rates, accelerations, momenta, Froude
    number), of which the last is one for all; and their derivatives along y, ``(n_joint, n_y,
    n_time)``, or none."""
    n, n_time, library = body.n_joint, y.shape[1], native_kernel(body, friction)
    angles, rates, accelerations, states, froude = np.split(y, [n, 2 * n, 3 * n, len(y) - 1])
    if library is None:
        arguments = angles, rates, accelerations, states, delta, froude
        torques, slopes = _torques_and_slopes(body, friction)(*arguments)
        return torques.full(), slopes.full().reshape(n, -1, n_time)
    moving = Moving(body, friction, angles, rates, delta, None)
    slopes = np.empty((n, len(y), n_time)) if differentiated else None
    torques = np.empty((n, n_time))
    at = body.inertia_column(), float(froude[0, 0]), states, accelerations
    call_for_all(library.colloc_torques, moving, *at, torques, slopes)
    return torques, np.empty((n, 0, n_time)) if slopes is None else slopes


@lru_cache(maxsize=32)
def of_torques(body: Chain, friction: Law, formula: Quantity | PathLimits) -> Any:
    """Functions (y, delta) to a density, or to shares of limits, ``(n_row, n_time)``, and to the
    derivatives along y, as of `torques_at`, ``(n_row, n_y, n_time)``."""
    import casadi as ca

    from colloc.numerics.repeated import at_instances

    n = body.n_joint
    q, r, torques, froude = parts = [ca.SX.sym("x", size) for size in (n, n, n, 1)]
    delta, x = ca.SX.sym("delta"), ca.vertcat(*parts)
    out = formula.at(Instants(body, friction, q, r, delta, moments=torques, froude=froude))
    slope = ca.vec(ca.densify(ca.jacobian(out, x).T))
    along_x = ca.Function("slopes", [x, delta], [slope], {"cse": True})

    def values(y: np.ndarray, delta: float) -> np.ndarray:
        (q, r), froude = np.split(y[: 2 * n], 2), y[-1:]
        moments = torques_at(body, friction, y, delta)[0]
        return formula.at(Instants(body, friction, q, r, delta, moments=moments, froude=froude))

    def slopes(y: np.ndarray, delta: float) -> np.ndarray:
        moments, along_y = torques_at(body, friction, y, delta, differentiated=True)
        x = np.concatenate([y[: 2 * n], moments, y[-1:]])
        direct = at_instances(along_x, [x, np.full((1, x.shape[1]), delta)])
        direct = direct.reshape(x.shape[1], out.shape[0], len(x)).transpose(1, 2, 0)
        total = np.einsum("rjt,jyt->ryt", direct[:, 2 * n : -1], along_y)
        total[:, : 2 * n] += direct[:, : 2 * n]
        total[:, -1] += direct[:, -1]
        return total

    return values, slopes
