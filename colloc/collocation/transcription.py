"""Direct collocation of a problem: decision variables, constraints and objective on a mesh.

Decision variables: gait parameters p; at every point joint angles, joint rates and tail velocity z;
the tail's orientation theta at every site, seen from axes that turn evenly (`colloc.gaits.period`);
distance x and work W at every edge. Rates, velocities and delta are per radian of phase, so that
all variables are O(1).

What stands for the balance, by the formulation, is said in `colloc.collocation.point_equations`. x
is the displacement of the centre of mass along a fixed direction. The first orientation is free, so
maximising x turns the motion into that direction; nothing is imposed on the sideways displacement,
which is not even a variable. On a slope the balance contains the weight's pull, which depends on
theta, the first theta is the last parameter of the gait, and x is the way in the direction that
counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.collocation.implicit_velocity import ImplicitVelocity
from colloc.collocation.layout import RADIANS, Layout, layout_of
from colloc.collocation.motion_rows import (
    BlockParts,
    asked_rows,
    at_points,
    bound_motion,
    motion_groups,
    objective_block,
)
from colloc.collocation.point_equations import (
    N_RATE,
    gait_check,
    mean_square,
    member_equations,
    point_function,
    shares_of_length,
    square_of_mean_speed,
)
from colloc.collocation.program import CollocatedClass, GaitProgram, Implicit, stacked_rows
from colloc.collocation.shape_checks import ShapeCheck, shape_checks
from colloc.gaits.control_problem import Admissible, ControlProblem
from colloc.gaits.limits import widest
from colloc.mechanics.bodies import FULL, Pairs
from colloc.mechanics.inertia import STATES
from colloc.motion.heading import momenta_image
from colloc.numerics.blocks import Assembly, LocalFunction
from colloc.numerics.constraint_rows import (
    Group,
    block_group,
    equalities,
    gait_group,
    output_group,
    selector,
)
from colloc.numerics.mesh import Mesh


class _Series(NamedTuple):
    """A class in whose parameters the angles are linear, as
    `colloc.collocation.program.CollocatedClass`."""

    admissible: Admissible
    mesh: Mesh
    checks: list[ShapeCheck]

    def placed(self, check: ShapeCheck, times: np.ndarray) -> np.ndarray:
        """The matrices from parameters to what is checked at the instants, a column each."""
        matrix = check.matrix(self.admissible.gait, times, self.admissible.n_joint)
        return matrix.transpose(0, 2, 1).reshape(times.size, -1).T


def transcribe(
    control: ControlProblem, edges: np.ndarray | None = None, scheme: str = "", far: Pairs = ()
) -> GaitProgram:
    """The nonlinear program on the first mesh, or on the one with the given edges.

    Self-contact is constrained between links two apart, and between the pairs `far` of links
    farther apart: see `colloc.search.converge.crossing_pairs`.
    """
    mesh, dynamics, admissible = control.mesh(edges, scheme), control.dynamics, control.admissible
    layout = layout_of(control, mesh)
    moved = dynamics.in_speeds_of(RADIANS)
    body, friction = moved.body, moved.law
    gait, n_joint = admissible.gait, body.n_joint
    series = _Series(admissible, mesh, shape_checks(body, far, admissible.largest_speeds))
    relative = gait.relative_delta
    point = point_function(
        control.formulation, body, friction, dynamics.regime, RADIANS, relative=relative
    )
    n_parameter = layout.parameters.shape[0]

    paces = np.repeat(layout.parameters[[layout.pace]], mesh.n_point, axis=1)[
        : dynamics.regime.free_pace
    ]
    own, none = (
        at_points(layout, mesh, ("theta", "angles", "rates", "z", "forces", "momenta")),
        np.empty((0, mesh.n_point)),
    )
    blocks = {"point": (point, np.concatenate([own, paces]), none)}
    for check in series.checks:
        function = gait_check(check, n_joint, n_parameter)
        middles = np.vstack(
            [
                series.placed(check, 0.5 * (mesh.edges[1:] + mesh.edges[:-1])),
                np.full(mesh.n, -1.0),
            ]
        )
        blocks[check.name] = (function, np.repeat(layout.parameters, mesh.n, axis=1), middles)
    if relative:
        shares, on_sides = gait.side_rates(n_joint)
        square = square_of_mean_speed(shares, on_sides / RADIANS)
    else:
        square = mean_square(ca.DM(gait.mean_square_rate(n_joint) / RADIANS**2))
    blocks["shape speed"] = square, layout.parameters, np.empty((0, 1))
    evenly = None
    if relative and dynamics.turn:  # axes that turn evenly along the path
        blocks["shares"] = shares_of_length(shares, on_sides), layout.parameters, np.empty((0, 1))
        side = np.searchsorted(gait.corners_in_time, mesh.edges[:-1], side="right") - 1
        at, every = np.repeat(side, mesh.scheme.s), np.arange(mesh.n_point)
        evenly = sparse.csr_matrix(
            (dynamics.turn / shares[at], (every, at)), shape=(mesh.n_point, shares.size)
        )

    def block(function: LocalFunction, names: Sequence[str]) -> BlockParts:
        return function, at_points(layout, mesh, names), none

    rates = gait.rates_on(mesh, n_joint) / RADIANS
    groups = [
        gait_group(
            "angles",
            layout.angles,
            layout.parameters,
            gait.angle_matrix(mesh.times, n_joint),
            layout.n,
        ),
        gait_group("rates", layout.rates, layout.parameters, rates, layout.n),
        *_point_groups(control, point.n_out, mesh, layout),
        *motion_groups(control, layout, mesh, point.n_out, RADIANS, evenly),
        *(check.group(admissible.joint_limit, mesh.n, layout.n) for check in series.checks),
        block_group("shape speed", admissible.smallest_shape_speed**2, np.inf, 1, layout.n),
    ]
    if not gait.linear:
        members = member_equations(gait, n_joint)
        blocks["members"] = members, layout.parameters, np.empty((0, 1))
        groups.append(block_group("members", 0.0, 0.0, members.n_out, layout.n))
    velocity = ImplicitVelocity(body, friction, mesh.n_point)

    def velocity_map(local: ca.MX, delta: ca.MX) -> ca.MX:
        _, angles, rates, z = ca.vertsplit(
            local, [0, 1, 1 + n_joint, 1 + 2 * n_joint, 4 + 2 * n_joint]
        )
        if not relative:
            return velocity(angles, rates, z, delta)
        speed = ca.sqrt(ca.sum1(rates * rates))
        unit, start = (each / ca.repmat(speed, each.size1(), 1) for each in (rates, z))
        return ca.repmat(speed, 3, 1) * velocity(angles, unit, start, delta)

    asked = asked_rows(control, layout, mesh, block, RADIANS)
    rows = _Rows(
        blocks, groups, asked, {} if control.formulation == FULL else {"point": velocity_map}
    )
    bounds = gait.bounds(body, widest(admissible.joint_limit))
    unit = 1.0 if relative else RADIANS
    return _program(control, series, layout, rows, bounds=bounds, unit=unit, velocity=velocity)


class _Rows(NamedTuple):
    """Of a program: blocks by name and groups of rows, and those of what is asked of a period."""

    blocks: dict[str, BlockParts]
    groups: list[Group]
    asked: dict[str, tuple[BlockParts, Group]]
    implicit: Implicit


def _program(
    control: ControlProblem,
    gaits: CollocatedClass,
    layout: Layout,
    rows: _Rows,
    *,
    bounds: tuple[np.ndarray, np.ndarray],
    unit: float,
    velocity: ImplicitVelocity,
) -> GaitProgram:
    """The program of rows, with `bounds` of the gait's parameters."""
    blocks = rows.blocks | {name: parts for name, (parts, _) in rows.asked.items()}
    linear, scattered, row_lower, row_upper, places = stacked_rows(
        layout.n,
        blocks,
        [*rows.groups, *(group for _, group in rows.asked.values())],
        rows.implicit,
    )
    lower, upper, parameters = (
        np.full(layout.n, -np.inf),
        np.full(layout.n, np.inf),
        layout.parameters[:, 0],
    )
    lower[parameters], upper[parameters] = bounds
    bound_motion(control, layout, lower, upper)
    assembly = Assembly(layout.n, objective_block(control, layout), scattered, linear)
    return GaitProgram(
        control, gaits, layout, assembly, tuple(blocks), lower=lower, upper=upper,
        constraint_lower=row_lower, constraint_upper=row_upper, groups=places, speed_unit=unit,
        velocity=velocity,
    )  # fmt: skip


def _point_groups(control: ControlProblem, n_out: int, mesh: Mesh, layout: Layout) -> list[Group]:
    """The equations of every point: lifted force laws, then the balance (or the velocity map in
    its place), or with inertia what the momenta are; and how these grow, and close a period."""
    n, n_point, momenta = layout.n, mesh.n_point, layout.momenta
    end = n_out - N_RATE - len(momenta)
    names, starts = ("force law", "balance"), [0, end - 3]
    groups = [
        output_group(name, range(a, b), n_out, n_point, n)
        for name, a, b in zip(names, starts, [*starts[1:], end], strict=True)
        if b > a
    ]
    state, rate = mesh.integration()
    for row, sites in enumerate(momenta):
        pick = selector(np.arange(n_point) * n_out + end + row, n_out * n_point)
        grown = state @ selector(sites, n)
        groups.append(
            equalities(
                f"momentum {STATES[row]}", grown, {"point": (-RADIANS * rate @ pick).tocsr()}
            )
        )
    if len(momenta):
        image = momenta_image(control.dynamics.symmetry)
        begin, last = selector(momenta[:, 0], n), selector(momenta[:, -1], n)
        groups.append(
            equalities(
                "momenta", last - (begin if image is None else sparse.csr_matrix(image) @ begin)
            )
        )
    return groups
