"""Where each decision variable of a collocated problem sits in the vector x, and its unit of time.
No CasADi."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.period import chord_per_way
from colloc.mechanics.bodies import FULL
from colloc.mechanics.densities import Quantity
from colloc.mechanics.inertia import STATES
from colloc.motion.kinds import kind_of_motion
from colloc.numerics.mesh import Mesh

RADIANS = 2 * np.pi
"""Radians of phase per period: rates, velocities and delta of the variables are those per period
divided by it."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Where each kind of variable sits in the vector x: index arrays, ``(n_component,
    n_position)``."""

    parameters: np.ndarray
    theta: np.ndarray
    distance: np.ndarray
    work: np.ndarray
    angles: np.ndarray
    rates: np.ndarray
    z: np.ndarray
    momenta: np.ndarray
    forces: np.ndarray
    totals: np.ndarray
    n: int
    integrals: tuple[Quantity, ...] = ()
    """What `totals` are of, over the solved part of the period."""
    pace: int = -1
    """Which of the parameters is the logarithm of the period, if one is."""

    def of_period(self, names: Iterable[str]) -> np.ndarray:
        """``(n, 1)``: where quantities of the solved part of the period are; of the rotation its
        end and its begin."""
        ends = {
            "distance": [self.distance[0, -1]],
            "work": [self.work[0, -1]],
            "rotation": self.theta[0, [-1, 0]],
        }
        own = {each.name: total for each, total in zip(self.integrals, self.totals, strict=True)}
        own["period"] = self.parameters[self.pace]  # its logarithm
        return np.concatenate([(ends | own)[name] for name in names])[:, None]


def layout_of(control: ControlProblem, mesh: Mesh) -> Layout:
    """Index arrays of all variables on a mesh."""
    body, gait, full = control.dynamics.body, control.admissible.gait, control.formulation == FULL
    n_joint, n_point = body.n_joint, mesh.n_point
    sizes = {
        "parameters": (gait.size(n_joint), 1),
        "theta": (1, mesh.n_site),
        "distance": (1, mesh.n + 1),
        "work": (1, mesh.n + 1),
        "angles": (n_joint, n_point),
        "rates": (n_joint, n_point),
        "z": (3, n_point),
        "momenta": (len(STATES) if control.dynamics.regime.froude else 0, mesh.n_site),
        "forces": (len(body.force_names) if full else 0, n_point),
        "totals": (len(control.aims.integrals), 1),
    }
    indices, start = {}, 0
    for name, (rows, columns) in sizes.items():
        indices[name] = start + np.arange(rows * columns).reshape(columns, rows).T
        start += rows * columns
    pace = -len(kind_of_motion(control.dynamics).told)  # which comes first of what a gait tells
    return Layout(n=start, **indices, integrals=control.aims.integrals, pace=pace)


def distance_and_work(
    control: ControlProblem, layout: Layout, x: np.ndarray
) -> tuple[float, float]:
    """Of a whole period, as the problem states them, from variables ``(n,)`` in units of friction.
    Of a gait that turns the variables have the way that is seen from axes that turn evenly
    (`colloc.gaits.period`)."""
    way, work = (
        float(x[row[0, -1]]) / control.admissible.gait.fraction
        for row in (layout.distance, layout.work)
    )
    return chord_per_way(control.dynamics.turn) * way, work * control.unit
