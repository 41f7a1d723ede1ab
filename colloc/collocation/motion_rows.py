"""Rows of a full program that are of the motion and of what is asked of a period, whatever the
class of gaits."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.collocation.layout import Layout
from colloc.collocation.point_equations import N_RATE, across_point, actuator_point, density_point
from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.objective import Objective
from colloc.gaits.period import chord_per_way
from colloc.motion.heading import closing_sign
from colloc.motion.kinds import kind_of_motion
from colloc.numerics.blocks import Block, LocalFunction, local_function
from colloc.numerics.constraint_rows import (
    Group,
    block_group,
    equalities,
    quadrature_group,
    rotation_groups,
    selector,
    total_group,
    zero_total_group,
)
from colloc.numerics.mesh import Mesh

ACTUATORS = "actuators"
"""The rows of the limits on torques and powers, point by point."""
SHAPE, MOVING, WITH_FORCES = (
    ("angles", "rates"),
    ("theta", "angles", "rates", "z"),
    ("theta", "angles", "rates", "forces"),
)
"""Variables of a point that functions of an instant are of."""
_STATES = ("theta", "momenta")
BlockParts = tuple[LocalFunction, np.ndarray, np.ndarray]
"""What a `colloc.numerics.blocks.Block` is made of: function, gather, instance parameters."""


def at_points(layout: Layout, mesh: Mesh, names: Sequence[str]) -> np.ndarray:
    """Where variables of the points are, one below the other, ``(n_variable, n_point)``."""
    sites = np.empty(mesh.n_point, dtype=int)
    sites[mesh.points] = mesh.sites
    found = {name: getattr(layout, name) for name in names}
    return np.concatenate(
        [where[:, sites] if name in _STATES else where for name, where in found.items()]
    )


def motion_groups(
    control: ControlProblem,
    layout: Layout,
    mesh: Mesh,
    n_out: int,
    unit: float,
    shares: sparse.csr_matrix | None = None,
) -> list[Group]:
    """theta' = omega - turn, how theta closes where no symmetry does it, and where it begins if the
    gait says so; distance and work grow. Rates are the last outputs of the block "point", per
    `unit` of time; where phases of the points depend on the gait, `shares` is how fast axes turn
    there that turn evenly, from the block "shares"."""
    n, theta, dynamics = layout.n, layout.theta[0], control.dynamics
    state, rate = mesh.integration()
    omega, forward, power = range(n_out - N_RATE, n_out)
    pick = selector(np.arange(mesh.n_point) * n_out + omega, n_out * mesh.n_point)
    parts, turned = (
        {"point": (-unit * rate @ pick).tocsr()},
        -dynamics.turn * np.asarray(rate.sum(axis=1)).ravel(),
    )
    if shares is not None:
        parts, turned = parts | {"shares": (rate @ shares).tocsr()}, 0.0 * turned
    sign = closing_sign(control.admissible.gait.closing_symmetry)
    begin = selector(theta[:1], n) - selector(layout.parameters[-1], n)
    return [
        equalities("orientation", state @ selector(theta, n), parts, turned),
        *rotation_groups(sign, theta, n, control.aims.rotation is not None),
        *([equalities("heading", begin)] if "theta" in kind_of_motion(dynamics).told else []),
        quadrature_group("distance", layout.distance, forward, n_out, mesh, n, unit),
        quadrature_group("work", layout.work, power, n_out, mesh, n, unit),
    ]


def bound_motion(
    control: ControlProblem, layout: Layout, lower: np.ndarray, upper: np.ndarray
) -> None:
    """Set the bounds of link forces, and where distance and work begin."""
    if layout.forces.size:
        most = control.dynamics.body.largest_forces(control.dynamics.law)
        lower[layout.forces], upper[layout.forces] = -most, most
    for state in (layout.distance, layout.work):
        lower[state[0, 0]] = upper[state[0, 0]] = 0.0


def asked_rows(
    control: ControlProblem,
    layout: Layout,
    mesh: Mesh,
    block: Callable[[LocalFunction, Sequence[str]], BlockParts],
    unit: float,
) -> dict[str, tuple[BlockParts, Group]]:
    """Blocks and rows, by name, of what is asked of a period besides the objective, and of what
    actuators can do at its points.

    `block`: that of a function of an instant, of variables by their names, per `unit` of time at
    the points.
    """
    found: dict[str, tuple[BlockParts, Group]] = {}
    n, aims, limits, dynamics = (
        layout.n,
        control.aims,
        control.actuators,
        control.dynamics.in_speeds_of(unit),
    )
    relative = control.admissible.gait.relative_delta
    for quantity, total in zip(aims.integrals, layout.totals, strict=True):
        parts = block(
            density_point(quantity, dynamics, unit, relative=relative),
            WITH_FORCES if quantity.needs_forces else SHAPE,
        )
        found[quantity.name] = parts, total_group(quantity.name, total[:, None], mesh, n, unit)
    if aims.at_least:
        reached, least = zip(*aims.at_least, strict=True)
        parts = _period_block(control, reached, 1.0, layout)
        found["at least"] = parts, block_group("at least", np.array(least), np.inf, len(least), n)
    if limits.names:
        n_point = mesh.n_point
        function = (
            actuator_point(limits, dynamics, unit, relative=relative),
            at_points(layout, mesh, WITH_FORCES),
            np.empty((0, n_point)),
        )
        group = block_group(
            ACTUATORS, np.tile(limits.least, n_point), 1.0, n_point * len(limits.names), n
        )
        found[ACTUATORS] = function, group
    if aims.no_way_across:
        found["across"] = block(across_point(dynamics), MOVING), zero_total_group("across", mesh, n)
    return found


def objective_block(control: ControlProblem, layout: Layout) -> Block:
    """Minus the objective for a whole period, of which a part is solved."""
    function, gather, given = _period_block(control, [control.aims.objective], -1.0, layout)
    return Block(function, gather, sparse.eye(1, format="csr"), given)


def _period_block(
    control: ControlProblem, aims: Sequence[Objective], sign: float, layout: Layout
) -> BlockParts:
    """`sign` times the values of objectives for a whole period, of which a part is solved."""
    names = tuple(dict.fromkeys(name for aim in aims for name in aim.uses))
    parts = {name: ca.SX.sym(name, 2 if name == "rotation" else 1) for name in names}
    turn, fraction = control.dynamics.turn, control.admissible.gait.fraction
    whole = dict.fromkeys(names, 1 / fraction) | {"distance": chord_per_way(turn) / fraction}
    period = {
        name: part[0] - part[1] + turn if name == "rotation" else whole[name] * part
        for name, part in parts.items()
    }
    period |= {name: ca.exp(parts[name]) for name in names if name == "period"}
    out = ca.vertcat(*(sign * aim(period) for aim in aims))
    function = local_function(
        "period", ca.vertcat(*parts.values()), ca.SX(0, 1), ca.SX.sym("delta"), out
    )
    return function, layout.of_period(names), np.empty((0, 1))
