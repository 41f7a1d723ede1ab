"""Decision variables of a full program: their places in the vector x, and feasible values of them
from a gait, through the balance solver."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from colloc.dynamics.chain import torque_function
from colloc.dynamics.collocated import CollocatedPose, point_weights, stage_weights, sums
from colloc.dynamics.control_problem import ControlProblem
from colloc.dynamics.dynamics import OMEGA, PeriodTotals, Shapes
from colloc.gaits.objective import chord_per_way
from colloc.mechanics.bodies import FULL
from colloc.mechanics.chain import Chain
from colloc.mechanics.inertia import STATES
from colloc.numerics.mesh import Mesh

RADIANS = 2 * np.pi
"""Radians of phase per period."""


class Layout(SimpleNamespace):
    """Index arrays ``(n_component, n_position)`` into the vector x of n variables; those that a
    problem has no use for are empty.

    Of the period: parameters, static, totals (of the integrals). At the mesh's sites: theta,
    momenta. At its edges: distance, work. At its points, of the links of a lifted chain:
    directions, spins, vx, vy; of contacts: friction; speed, of the shape, where delta is relative
    to it; of joints: joint_fx, joint_fy, moments. With inertia: x, y, midpoints from the centre of
    mass; centre, its velocity, force and moment about it; accelerations. Of other bodies: angles,
    rates, z.
    """

    @property
    def decisions(self) -> np.ndarray:
        """Parameters of the gait, and the static ones."""
        return np.concatenate([self.parameters, self.static])[:, 0]

    def total(self, name: str) -> np.ndarray:
        """A total of the solved part, ``(1,)``; of the rotation its end and begin; the log
        period."""
        places = {each.name: total for each, total in zip(self.integrals, self.totals, strict=True)}
        places |= {"distance": self.distance[0, -1:], "work": self.work[0, -1:]}
        places |= {"rotation": self.theta[0, [-1, 0]], "period": self.static[:1, 0]}
        return places[name]

    def shape_speed(self, x: np.ndarray) -> np.ndarray:
        if self.speed.size:
            return x[self.speed[0]]
        return np.linalg.norm(x[self.rates], axis=0)

    def tail_velocity(self, body: Any, x: np.ndarray) -> np.ndarray:
        if self.z.size:
            return x[self.z]
        phi, w, vx, vy = (x[part[0]] for part in (self.directions, self.spins, self.vx, self.vy))
        velocity, half = (vx + 1j * vy) * np.exp(-1j * phi), 0.5 * body.lengths[0]
        return np.stack([velocity.real, velocity.imag - half * w, w])


def layout_of(control: ControlProblem, mesh: Mesh) -> Layout:
    body, gait, dynamics = control.dynamics.body, control.admissible.gait, control.dynamics
    n_joint, inertial = body.n_joint, bool(dynamics.regime.froude)
    lifted = mesh.n_point * (control.formulation == FULL)
    contacts = len(body.contact.force_names) if isinstance(body, Chain) else 0
    balanced, moved = (0, lifted) if inertial else (lifted, 0)
    mapped = mesh.n_point - lifted
    forced = [control.actuators.needs_forces, *(x.needs_forces for x in control.aims.integrals)]
    sizes = {
        "parameters": (gait.size(n_joint), 1),
        "static": (len(dynamics.static_parameters), 1),
        "theta": (1, mesh.n_site),
        "distance": (1, mesh.n + 1),
        "work": (1, mesh.n + 1),
        "totals": (len(control.aims.integrals), 1),
        "momenta": (len(STATES) * inertial, mesh.n_site),
        "accelerations": (n_joint, moved * any(forced)),
        **dict.fromkeys(("directions", "spins", "vx", "vy"), (n_joint + 1, lifted)),
        "friction": (contacts, lifted),
        "speed": (1, lifted * gait.relative_delta),
        **dict.fromkeys(("joint_fx", "joint_fy", "moments"), (n_joint, balanced)),
        **dict.fromkeys(("x", "y"), (n_joint + 1, moved)),
        "centre": (5, moved),
        **dict.fromkeys(("angles", "rates"), (n_joint, mapped)),
        "z": (3, mapped),
    }
    indices, start = {}, 0
    for name, (rows, columns) in sizes.items():
        indices[name] = start + np.arange(rows * columns).reshape(columns, rows).T
        start += rows * columns
    return Layout(n=start, **indices, integrals=control.aims.integrals)


def distance_and_work(
    control: ControlProblem, layout: Layout, x: np.ndarray
) -> tuple[float, float]:
    """Distance and work of a period in the problem's units."""
    way, work = (
        float(x[row[0, -1]]) / control.admissible.fraction for row in (layout.distance, layout.work)
    )
    return chord_per_way(control.dynamics.turn) * way, work * control.unit


def balanced_variables(
    control: ControlProblem, layout: Layout, mesh: Mesh, parameters: np.ndarray, delta: float
) -> np.ndarray:
    """Variables ``(n,)`` that satisfy every equation but the closure of the rotation."""
    gaits, n_joint = control.admissible.gait, control.admissible.n_joint
    kind: Any = control.dynamics.in_speeds_of(RADIANS)
    x = np.zeros(layout.n)
    x[layout.decisions] = parameters
    parameters, begin = np.split(parameters, [len(layout.parameters)])
    gait = gaits.trajectory(parameters, n_joint)
    angles, rates = gait.angles(mesh.times), gait.rates(mesh.times) / RADIANS
    relative, speed = gaits.relative_delta, np.ones(mesh.n_point)
    if relative:
        rates = (gaits.rates_on(mesh, n_joint) @ parameters).T / RADIANS
        speed = np.linalg.norm(rates, axis=0)
    slow = delta if relative else delta / RADIANS
    shapes = Shapes(angles, rates / speed, slow, RADIANS, speed)
    along = kind.simulate(mesh, shapes, begin)
    now, z = along.now, speed * along.now.z

    weight, points = RADIANS * stage_weights(mesh), mesh.points
    turn = kind.turn * speed / (point_weights(mesh) @ speed) if relative else kind.turn
    rotation, velocity = RADIANS * z[OMEGA] - turn, RADIANS * speed * np.array(now.centre)
    pose = CollocatedPose.on_mesh(mesh, rotation, velocity, kind.initial_heading(begin))
    power = (weight * (speed * now.power)[points]).sum(axis=1)
    way, rotation = complex(pose.place[-1]), float(pose.rotations.sum())
    along_totals = kind.total_gradients(PeriodTotals(way, rotation, float(power.sum()), begin))
    heading = float(np.angle(along_totals["distance"].side))
    climbed = (pose.place * np.conj(along_totals["work"].side)).real
    # where the orientation is no state the plane is turned so that the gait goes along +x
    theta_0 = 0.0 if "theta" in kind.states else -heading
    theta = theta_0 + pose.theta_on(mesh)
    x[layout.distance[0, 1:]] = (pose.place * np.exp(-1j * heading)).real[1:]
    x[layout.work[0, 1:]] = sums(power)[1:] + climbed[1:]
    x[layout.theta[0, mesh.sites]] = theta_0 + pose.stage_theta
    x[layout.theta[0, mesh.edge_sites]] = theta_0 + pose.theta
    at = kind.instants(shapes, pose.theta_on(mesh), along.now.z)
    if layout.momenta.size:
        x[layout.momenta[:, mesh.sites]] = along.states[: len(layout.momenta), points]
        x[layout.momenta[:, mesh.edge_sites]] = along.edges
    if layout.accelerations.size:
        matrix = gaits.angle_matrix(mesh.times, n_joint, 2) / RADIANS**2
        x[layout.accelerations] = (matrix @ parameters).T
        torques, froude = torque_function(kind.body, kind.law), kind.froude_at(shapes, begin)
        y = angles, rates, x[layout.accelerations], along.states[: len(layout.momenta)]
        at = replace(at, moments=torques(*y, slow, froude).full(), froude=froude)
    for quantity, total in zip(layout.integrals, layout.totals, strict=True):
        x[total] = (weight * (speed * quantity.at(at))[0, points]).sum()
    if layout.z.size:
        x[layout.angles], x[layout.rates], x[layout.z] = angles, rates, z
        return x

    # the variables of links, contacts and joints
    if relative:
        x[layout.speed] = speed
    dynamics = control.dynamics.in_speeds_of(RADIANS)
    body, pull = dynamics.body, dynamics.regime.pull(theta[None])
    assert isinstance(body, Chain)
    posture = body.posture(angles)
    link, axes = body.velocity(posture, rates, z), np.exp(1j * theta)
    direction = axes * (posture.cos + 1j * posture.sin)
    velocity, place = (link.vs + 1j * link.vn) * direction, axes * (posture.x + 1j * posture.y)
    slows = slow * speed if relative else np.full(mesh.n_point, slow)
    friction = body.forces(dynamics.law, angles, rates, z, slows[None])
    on_link, mass = body.contact.on_links(friction), body.mass_column()
    force = (on_link.tangential + 1j * on_link.normal) * direction
    if pull is not None:
        force += mass * (pull[0] + 1j * pull[1]) * axes
    x[layout.directions] = theta + body.tangent_angles(angles)
    x[layout.spins], x[layout.vx], x[layout.vy] = link.w, velocity.real, velocity.imag
    x[layout.friction] = friction
    if layout.moments.size:
        # N_(i+1) = N_i + f_i,   M_(i+1) = M_i + c_i - l_i/2 e_i x (N_i + N_(i+1))
        at_joints = np.cumsum(force, axis=0)
        both = at_joints + np.concatenate([0 * at_joints[:1], at_joints[:-1]])
        lever = 0.5 * body.length_column() * (np.conj(direction) * both).imag
        x[layout.joint_fx], x[layout.joint_fy] = at_joints.real[:-1], at_joints.imag[:-1]
        x[layout.moments] = np.cumsum(on_link.couple - lever, axis=0)[:-1]
    else:
        arm = place - (mass * place).sum(axis=0)
        total, moving = force.sum(axis=0), (mass * velocity).sum(axis=0)
        moment = (on_link.couple + (np.conj(arm) * force).imag).sum(axis=0)
        x[layout.x], x[layout.y] = arm.real, arm.imag
        x[layout.centre] = [moving.real, moving.imag, total.real, total.imag, moment]
    return x
