"""Direct collocation of a problem: decision variables, constraints and objective on a mesh.

Decision variables: gait parameters p; at every point joint angles, joint rates and tail velocity z; the tail's orientation
theta at every site, seen from axes that turn evenly (`colloc.gaits.period`); distance x and work W at every edge. Rates,
velocities and delta are per radian of phase, so that all variables are O(1).

What stands for the balance, by the formulation, is said in `colloc.collocation.point_equations`. x is the displacement of the
centre of mass along a fixed direction. The first orientation is free, so maximising x turns the motion into that direction;
nothing is imposed on the sideways displacement, which is not even a variable. On a slope the balance contains the weight's
pull, which depends on theta, the first theta is the last parameter of the gait, and x is the way in the direction that counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.collocation.implicit_velocity import ImplicitVelocity
from colloc.collocation.layout import RADIANS, Layout, layout_of
from colloc.collocation.motion_rows import BlockParts, asked_rows, at_points, bound_motion, motion_groups, objective_block
from colloc.collocation.point_equations import N_RATE, gait_check, mean_square, member_equations, point_function
from colloc.collocation.program import GaitProgram, Implicit, assembled
from colloc.collocation.shape_checks import ShapeCheck, shape_checks
from colloc.gaits.control_problem import Admissible, ControlProblem
from colloc.gaits.limits import widest
from colloc.mechanics.bodies import FULL, Pairs
from colloc.mechanics.inertia import STATES
from colloc.motion.heading import momenta_image
from colloc.numerics.blocks import LocalFunction
from colloc.numerics.constraint_rows import Group, block_group, equalities, gait_group, output_group, selector
from colloc.numerics.mesh import Mesh


class SeriesProgram(GaitProgram):
    """The program of a class in whose parameters the angles are linear."""

    def placed(self, check: ShapeCheck, times: np.ndarray, mesh: Mesh) -> np.ndarray:
        """The matrices from parameters to what is checked at the instants, a column each."""
        return _columns(check, self.control.admissible, times)


def _columns(check: ShapeCheck, admissible: Admissible, times: np.ndarray) -> np.ndarray:
    matrix = check.matrix(admissible.gait, times, admissible.n_joint)
    return matrix.transpose(0, 2, 1).reshape(times.size, -1).T


def transcribe(control: ControlProblem, edges: np.ndarray | None = None, scheme: str = "", far: Pairs = ()) -> SeriesProgram:
    """The nonlinear program on the first mesh, or on the one with the given edges.

    Self-contact is constrained between links two apart, and between the pairs `far` of links farther apart: see
    `colloc.search.converge.crossing_pairs`.
    """
    mesh, dynamics, admissible = control.mesh(edges, scheme), control.dynamics, control.admissible
    layout = layout_of(control, mesh)
    moved = dynamics.in_speeds_of(RADIANS)
    body, friction = moved.body, moved.law
    gait, n_joint = admissible.gait, body.n_joint
    checks = shape_checks(body, far, admissible.largest_speeds)
    point = point_function(control.formulation, body, friction, dynamics.regime, RADIANS)
    n_parameter = layout.parameters.shape[0]

    paces = np.repeat(layout.parameters[[layout.pace]], mesh.n_point, axis=1)[: dynamics.regime.free_pace]
    own, none = at_points(layout, mesh, ("theta", "angles", "rates", "z", "forces", "momenta")), np.empty((0, mesh.n_point))
    blocks = {"point": (point, np.concatenate([own, paces]), none)}
    for check in checks:
        function = gait_check(check, n_joint, n_parameter)
        middles = np.vstack([_columns(check, admissible, 0.5 * (mesh.edges[1:] + mesh.edges[:-1])), np.full(mesh.n, -1.0)])
        blocks[check.name] = (function, np.repeat(layout.parameters, mesh.n, axis=1), middles)
    blocks["shape speed"] = (
        mean_square(ca.DM(gait.mean_square_rate(n_joint) / RADIANS**2)),
        layout.parameters,
        np.empty((0, 1)),
    )

    def block(function: LocalFunction, names: Sequence[str]) -> BlockParts:
        return function, at_points(layout, mesh, names), none

    besides = asked_rows(control, layout, mesh, block, RADIANS)
    if not gait.linear:
        members = member_equations(gait, n_joint)
        besides["members"] = (
            (members, layout.parameters, np.empty((0, 1))),
            block_group("members", 0.0, 0.0, members.n_out, layout.n),
        )
    blocks |= {name: parts for name, (parts, _) in besides.items()}

    rates = gait.rate_matrix(mesh.times, n_joint) / RADIANS
    groups = [
        gait_group("angles", layout.angles, layout.parameters, gait.angle_matrix(mesh.times, n_joint), layout.n),
        gait_group("rates", layout.rates, layout.parameters, rates, layout.n),
        *_point_groups(control, point.n_out, mesh, layout),
        *motion_groups(control, layout, mesh, point.n_out, RADIANS),
        *(check.group(admissible.joint_limit, mesh.n, layout.n) for check in checks),
        block_group("shape speed", admissible.smallest_shape_speed**2, np.inf, 1, layout.n),
        *(group for _, group in besides.values()),
    ]
    velocity = ImplicitVelocity(body, friction, mesh.n_point)

    def velocity_map(local: ca.MX, delta: ca.MX) -> ca.MX:
        _, angles, rates, z = ca.vertsplit(local, [0, 1, 1 + n_joint, 1 + 2 * n_joint, 4 + 2 * n_joint])
        return velocity(angles, rates, z, delta)

    implicit: Implicit = {} if control.formulation == FULL else {"point": velocity_map}
    objective = objective_block(control, layout)
    assembly, names, row_lower, row_upper, rows = assembled(layout, objective, blocks, groups, implicit)
    lower, upper, parameters = np.full(layout.n, -np.inf), np.full(layout.n, np.inf), layout.parameters[:, 0]
    lower[parameters], upper[parameters] = gait.bounds(body, widest(admissible.joint_limit))
    bound_motion(control, layout, lower, upper)
    return SeriesProgram(
        control, mesh, None, layout, assembly, names, lower, upper, row_lower, row_upper, rows, checks, RADIANS, velocity
    )


def _point_groups(control: ControlProblem, n_out: int, mesh: Mesh, layout: Layout) -> list[Group]:
    """The equations of every point: lifted force laws, then the balance (or the velocity map in its place), or with inertia
    what the momenta are; and how these grow, and close a period."""
    n, n_point, momenta = layout.n, mesh.n_point, layout.momenta
    n_law = n_out - N_RATE - 3 - len(momenta)
    groups = [output_group("balance", range(n_law, n_law + 3), n_out, n_point, n)]
    if control.formulation == FULL:
        groups.insert(0, output_group("force law", range(n_law), n_out, n_point, n))
    state, rate = mesh.integration()
    for row, sites in enumerate(momenta):
        pick = selector(np.arange(n_point) * n_out + n_law + 3 + row, n_out * n_point)
        grown = state @ selector(sites, n)
        groups.append(equalities(f"momentum {STATES[row]}", grown, {"point": (-RADIANS * rate @ pick).tocsr()}))
    if len(momenta):
        image = momenta_image(control.dynamics.symmetry)
        begin, end = selector(momenta[:, 0], n), selector(momenta[:, -1], n)
        groups.append(equalities("momenta", end - (begin if image is None else sparse.csr_matrix(image) @ begin)))
    return groups
