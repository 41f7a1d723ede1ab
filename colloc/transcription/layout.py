"""Indices of the decision variables of a full program in the vector x."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from colloc.dynamics.control_problem import ControlProblem
from colloc.dynamics.kinds import kind_of_motion
from colloc.gaits.period import chord_per_way
from colloc.mechanics.bodies import FULL, Body
from colloc.mechanics.densities import Quantity
from colloc.mechanics.inertia import STATES
from colloc.mechanics.links import Links
from colloc.numerics.mesh import Mesh

RADIANS = 2 * np.pi
"""Radians of phase per period."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Index arrays ``(n_component, n_position)`` into x.

    At the mesh's sites theta and, with inertia, the momenta; at its edges distance and work. At its
    points of a lifted chain the directions of the links, their rotation rates, the velocities of
    their midpoints, the friction on what touches the floor, the shape speed where delta is relative
    to it, and the force and the moment at each joint or, with inertia, positions of the midpoints
    from the centre of mass and the velocity of that, force and moment about it, and where torques
    are limited the accelerations of the joints; of other bodies
    shape coordinates, their rates and the tail velocity z.
    """

    parameters: np.ndarray
    theta: np.ndarray
    distance: np.ndarray
    work: np.ndarray
    totals: np.ndarray
    momenta: np.ndarray
    accelerations: np.ndarray
    directions: np.ndarray
    spins: np.ndarray
    vx: np.ndarray
    vy: np.ndarray
    friction: np.ndarray
    speed: np.ndarray
    joint_fx: np.ndarray
    joint_fy: np.ndarray
    moments: np.ndarray
    x: np.ndarray
    y: np.ndarray
    centre: np.ndarray
    angles: np.ndarray
    rates: np.ndarray
    z: np.ndarray
    n: int
    integrals: tuple[Quantity, ...] = ()
    pace: int = -1
    """Index of the log period among the parameters."""

    def of_period(self, names: Iterable[str]) -> np.ndarray:
        """Totals of the solved part, ``(n, 1)``; of the rotation its end and begin."""
        places = {each.name: total for each, total in zip(self.integrals, self.totals, strict=True)}
        places |= {
            "distance": self.distance[0, -1:],
            "work": self.work[0, -1:],
            "rotation": self.theta[0, [-1, 0]],
            "period": self.parameters[self.pace],  # its logarithm
        }
        return np.concatenate([places[name] for name in names])[:, None]

    def shape_speed(self, x: np.ndarray) -> np.ndarray:
        speed: np.ndarray = x[self.speed[0]] if self.speed.size else x[self.rates]
        return speed if speed.ndim == 1 else np.linalg.norm(speed, axis=0)

    def tail_velocity(self, body: Body, x: np.ndarray) -> np.ndarray:
        if self.z.size:
            return x[self.z]
        phi, w, vx, vy = (x[part[0]] for part in (self.directions, self.spins, self.vx, self.vy))
        velocity, half = (vx + 1j * vy) * np.exp(-1j * phi), 0.5 * body.lengths[0]  # type: ignore[attr-defined]
        return np.stack([velocity.real, velocity.imag - half * w, w])


def layout_of(control: ControlProblem, mesh: Mesh) -> Layout:
    body, gait, dynamics = control.dynamics.body, control.admissible.gait, control.dynamics
    n_joint, inertial = body.n_joint, bool(dynamics.regime.froude)
    lifted = mesh.n_point * (control.formulation == FULL)
    contacts = len(body.contact.force_names) if isinstance(body, Links) else 0
    balanced, moved = (0, lifted) if inertial else (lifted, 0)
    mapped = mesh.n_point - lifted
    sizes = {
        "parameters": (gait.size(n_joint), 1),
        "theta": (1, mesh.n_site),
        "distance": (1, mesh.n + 1),
        "work": (1, mesh.n + 1),
        "totals": (len(control.aims.integrals), 1),
        "momenta": (len(STATES) * inertial, mesh.n_site),
        "accelerations": (n_joint, moved * control.actuators.needs_forces),
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
    pace = -len(
        kind_of_motion(dynamics).static_parameters
    )  # which comes first of what a gait tells
    return Layout(n=start, **indices, integrals=control.aims.integrals, pace=pace)


def distance_and_work(
    control: ControlProblem, layout: Layout, x: np.ndarray
) -> tuple[float, float]:
    """Distance and work of a period in the problem's units; a gait that turns has its chord."""
    way, work = (
        float(x[row[0, -1]]) / control.admissible.gait.fraction
        for row in (layout.distance, layout.work)
    )
    return chord_per_way(control.dynamics.turn) * way, work * control.unit
