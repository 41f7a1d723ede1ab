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
    SHAPE,
    BlockParts,
    asked_rows,
    at_points,
    bound_motion,
    motion_groups,
    objective_block,
)
from colloc.collocation.path_equations import full_path_point, path_point, per_phase
from colloc.collocation.path_geometry import path_geometry
from colloc.collocation.point_equations import (
    N_RATE,
    gait_check,
    mean_square,
    member_equations,
    point_function,
)
from colloc.collocation.program import CollocatedClass, GaitProgram, Implicit, stacked_rows
from colloc.collocation.shape_checks import ShapeCheck, shape_checks
from colloc.gaits.control_problem import Admissible, ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.limits import widest
from colloc.gaits.path_samples import Gait
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
    knots: np.ndarray | None = None

    def phase_mesh(self, gait: AnyGait) -> Mesh:
        return self.mesh

    def placed(self, check: ShapeCheck, times: np.ndarray, mesh: Mesh) -> np.ndarray:
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
    checks = shape_checks(body, far, admissible.largest_speeds, dynamics.joint_map)
    series = _Series(admissible, mesh, checks)
    point = point_function(control.formulation, body, friction, dynamics.regime, RADIANS)
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
        function = gait_check(check, check.offset(gait, n_joint), n_parameter)
        middles = np.vstack(
            [
                series.placed(check, 0.5 * (mesh.edges[1:] + mesh.edges[:-1]), mesh),
                np.full(mesh.n, -1.0),
            ]
        )
        blocks[check.name] = (function, np.repeat(layout.parameters, mesh.n, axis=1), middles)
    square = mean_square(ca.DM(gait.mean_square_rate(n_joint) / RADIANS**2))
    blocks["shape speed"] = square, layout.parameters, np.empty((0, 1))

    def block(function: LocalFunction, names: Sequence[str]) -> BlockParts:
        return function, at_points(layout, mesh, names), none

    rates = gait.rate_matrix(mesh.times, n_joint) / RADIANS
    groups = [
        gait_group(
            "angles",
            layout.angles,
            layout.parameters,
            gait.angle_matrix(mesh.times, n_joint),
            layout.n,
            np.tile(gait.offset(n_joint)[:, 0], mesh.n_point),
        ),
        gait_group("rates", layout.rates, layout.parameters, rates, layout.n),
        *_point_groups(control, point.n_out, mesh, layout),
        *motion_groups(control, layout, mesh, point.n_out, RADIANS),
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
        return velocity(angles, rates, z, delta)

    asked = asked_rows(control, layout, mesh, block, RADIANS)
    rows = _Rows(
        blocks, groups, asked, {} if control.formulation == FULL else {"point": velocity_map}
    )
    bounds = gait.bounds(body, widest(admissible.joint_limit))
    return _program(control, series, layout, rows, bounds=bounds, unit=RADIANS, velocity=velocity)


def transcribe_path(
    control: ControlProblem,
    gait: Gait,
    edges: np.ndarray | None = None,
    scheme: str = "",
    far: Pairs = (),
) -> GaitProgram:
    """The nonlinear program for a class that bounds the path, near a gait: arguments as of
    `colloc.collocation.path_geometry.path_geometry`.

    Rates are unit tangents and delta is measured at unit shape speed; joint angles, rates, tail
    velocity and link forces are variables in the formulation "full" only.
    """
    paths = path_geometry(control, gait, edges, scheme, far)
    mesh, piece, blocks = paths.mesh, paths.piece, paths.blocks
    layout, (body, law, regime, *_) = layout_of(control, mesh, paths.knots), control.dynamics
    full = layout.forces.size > 0
    point = full_path_point(body, law, piece, regime) if full else path_point(body, law, piece)
    here, given = (
        np.repeat(paths.shape, mesh.scheme.s, axis=1),
        paths.given(np.tile(mesh.scheme.c, mesh.n)),
    )
    own = at_points(
        layout, mesh, ("theta", "angles", "rates", "z", "forces") if full else ("theta",)
    )
    blocks["point"] = (point, np.concatenate([own, here]), given)
    groups = [
        *paths.groups,
        *(_point_groups(control, point.n_out, mesh, layout, placed=True) if full else []),
        *motion_groups(
            control, layout, mesh, point.n_out, 1.0, paths.evenly(control.dynamics.turn)
        ),
    ]
    velocity = ImplicitVelocity(body, law, mesh.n_point)
    place = ca.Function("place", [piece.shape, piece.given], [piece.angles, piece.direction]).map(
        mesh.n_point
    )
    unknown = ca.DM(np.full((3, mesh.n_point), np.nan))

    def balanced(local: ca.MX, delta: ca.MX) -> ca.MX:
        angles, direction = place(local[1:, :], ca.DM(given))
        return velocity(angles, direction, unknown, delta)

    def block(function: LocalFunction, names: Sequence[str]) -> BlockParts:
        placed = names == SHAPE
        own = [] if placed else [at_points(layout, mesh, names)]
        return per_phase(function, piece, placed=placed), np.concatenate([*own, here]), given

    asked = asked_rows(control, layout, mesh, block, 1.0)
    rows = _Rows(blocks, groups, asked, {} if full else {"point": balanced})
    return _program(
        control, paths, layout, rows, bounds=(paths.lower, paths.upper), unit=1.0, velocity=velocity
    )


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


def _point_groups(
    control: ControlProblem, n_out: int, mesh: Mesh, layout: Layout, *, placed: bool = False
) -> list[Group]:
    """The equations of every point: where it is, if its block says that; lifted force laws, then
    the balance (or the velocity map in its place), or with inertia what the momenta are; and how
    these grow, and close a period."""
    n, n_point, momenta, n_joint = (
        layout.n,
        mesh.n_point,
        layout.momenta,
        control.admissible.n_joint,
    )
    end = n_out - N_RATE - len(momenta)
    names = (*(SHAPE if placed else ()), "force law", "balance")
    starts = [0, *((n_joint, 2 * n_joint) if placed else ()), end - 3]
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
