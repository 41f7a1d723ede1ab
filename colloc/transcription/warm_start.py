"""Feasible variables of a full program from a gait, through the balance solver."""

from __future__ import annotations

import numpy as np

from colloc.dynamics.collocated import CollocatedPose, point_weights, stage_weights, sums
from colloc.dynamics.control_problem import ControlProblem
from colloc.dynamics.kinds import (
    OMEGA,
    PeriodTotals,
    Shapes,
    initial_heading,
    kind_of_motion,
    static_parameters_of,
)
from colloc.gaits.gait_fields import AnyGait
from colloc.mechanics.chain import Chain
from colloc.numerics.mesh import Mesh
from colloc.transcription.layout import RADIANS, Layout


def balanced_variables(
    control: ControlProblem,
    layout: Layout,
    mesh: Mesh,
    parameters: np.ndarray,
    delta: float,
    gait: AnyGait = None,
) -> np.ndarray:
    """Variables ``(n,)`` that satisfy every equation but the closure of the rotation."""
    gaits, n_joint = control.admissible.gait, control.admissible.n_joint
    kind = kind_of_motion(control.dynamics.in_speeds_of(RADIANS))
    if gait is None:
        gait = gaits.trajectory(parameters, n_joint)
        begin = parameters[parameters.size - len(kind.static_parameters) :]
    else:
        begin = static_parameters_of(kind, gait)
    x = np.zeros(layout.n)
    x[layout.parameters[:, 0]] = parameters
    angles, rates = gait.angles(mesh.times), gait.rates(mesh.times) / RADIANS
    relative, speed = gaits.relative_delta, np.ones(mesh.n_point)
    if relative:
        rates = (gaits.rates_on(mesh, n_joint) @ parameters).T / RADIANS
        speed = np.linalg.norm(rates, axis=0)
    slow = delta if relative else delta / RADIANS
    shapes = Shapes(angles, rates / speed, slow, RADIANS, speed)
    along = kind.along(mesh, shapes, begin)
    now, z = along.now, speed * along.z

    weight, points = RADIANS * stage_weights(mesh), mesh.points
    turn = kind.turn * speed / (point_weights(mesh) @ speed) if relative else kind.turn
    pose = CollocatedPose.on_mesh(
        mesh,
        RADIANS * z[OMEGA] - turn,
        RADIANS * speed * np.array(now.centre),
        initial_heading(kind, begin),
    )
    power = (weight * (speed * now.power)[points]).sum(axis=1)
    shares = kind.total_gradients(
        PeriodTotals(
            complex(pose.place[-1]), float(pose.rotations.sum()), float(power.sum()), begin
        )
    )
    heading = float(np.angle(shares["distance"].side))
    ahead = (pose.place * np.exp(-1j * heading)).real
    climbed = (pose.place * np.conj(shares["work"].side)).real
    # where the orientation is no state the plane is turned so that the gait goes along +x
    theta_0 = 0.0 if "theta" in kind.static_parameters else -heading
    x[layout.distance[0, 1:]] = ahead[1:]
    x[layout.work[0, 1:]] = sums(power)[1:] + climbed[1:]
    x[layout.theta[0, mesh.sites]] = theta_0 + pose.stage_theta
    x[layout.theta[0, mesh.edge_sites]] = theta_0 + pose.theta
    at = kind.instants(shapes, pose.theta_on(mesh), along.z)
    for quantity, total in zip(layout.integrals, layout.totals, strict=True):
        x[total] = (weight * (speed * quantity.at(at))[0, points]).sum()
    if layout.momenta.size:
        x[layout.momenta[:, mesh.sites]] = along.states[: len(layout.momenta), points]
        x[layout.momenta[:, mesh.edge_sites]] = along.edges
    if layout.accelerations.size:
        matrix = gaits.angle_matrix(mesh.times, n_joint, 2) / RADIANS**2
        x[layout.accelerations] = (matrix @ parameters).T
    if layout.z.size:
        x[layout.angles], x[layout.rates], x[layout.z] = angles, rates, z
    else:
        if relative:
            x[layout.speed] = speed
        slows = slow * speed if relative else np.full(mesh.n_point, slow)
        _lift(control, layout, x, (angles, rates, z), slows, theta_0 + pose.theta_on(mesh))
    return x


def _lift(
    control: ControlProblem,
    layout: Layout,
    x: np.ndarray,
    motion: tuple[np.ndarray, np.ndarray, np.ndarray],
    delta: np.ndarray,
    theta: np.ndarray,
) -> None:
    """Set the variables of the links."""
    angles, rates, z = motion
    dynamics = control.dynamics.in_speeds_of(RADIANS)
    body, law, pull = dynamics.body, dynamics.law, dynamics.regime.pull(theta[None])
    assert isinstance(body, Chain)
    posture = body.posture(angles)
    link = body.velocity(posture, rates, z)
    axes = np.exp(1j * theta)
    along = axes * (posture.cos + 1j * posture.sin)  # directions of the links, complex
    velocity, place = (link.vs + 1j * link.vn) * along, axes * (posture.x + 1j * posture.y)
    friction = body.forces(law, angles, rates, z, delta[None])
    on_link = body.contact.on_links(friction)
    mass = body.mass_column()
    force = (on_link.tangential + 1j * on_link.normal) * along
    if pull is not None:
        force += mass * (pull[0] + 1j * pull[1]) * axes
    x[layout.directions] = theta + body.tangent_angles(angles)
    x[layout.spins] = link.w
    x[layout.vx], x[layout.vy] = velocity.real, velocity.imag
    x[layout.friction] = friction
    if layout.moments.size:
        # N_(i+1) = N_i + f_i,   M_(i+1) = M_i + c_i - l_i/2 e_i x (N_i + N_(i+1))
        at_joints = np.cumsum(force, axis=0)
        both = at_joints + np.concatenate([0 * at_joints[:1], at_joints[:-1]])
        lever = 0.5 * body.length_column() * (np.conj(along) * both).imag
        moments = np.cumsum(on_link.couple - lever, axis=0)
        x[layout.joint_fx], x[layout.joint_fy] = at_joints.real[:-1], at_joints.imag[:-1]
        x[layout.moments] = moments[:-1]
    else:
        arm = place - (mass * place).sum(axis=0)
        total, moving = force.sum(axis=0), (mass * velocity).sum(axis=0)
        moment = (on_link.couple + (np.conj(arm) * force).imag).sum(axis=0)
        x[layout.x], x[layout.y] = arm.real, arm.imag
        x[layout.centre] = [moving.real, moving.imag, total.real, total.imag, moment]
