"""Errors of a collocated gait, interval by interval: states, objective and constraints between the
nodes.

On an interval the scheme takes the rate of a state to be the polynomial through its values at the
nodes; the integral of the *defect*, that polynomial less the true rate, is what the interval adds
to the error of the state. The truth is the motion on adaptive panels
(`colloc.verification.adaptive_motion`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from colloc.gaits.control_problem import Admissible, ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.limits import under_one_limit
from colloc.gaits.period import chord_per_way
from colloc.gaits.symmetry import NONE
from colloc.mechanics.contact import crossing_depth, far_pairs
from colloc.motion.collocated import CollocatedPose
from colloc.motion.heading import heading
from colloc.motion.kinds import kind_of_motion
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import Scheme
from colloc.verification.adaptive_motion import FineMotion, Rates, fine_motion, rates_at
from colloc.verification.reference_motion import reference_motion, state_errors

FINER = 0.05
"""The panels are refined until what they may still miss is this fraction of the error they measure
or of the tolerance."""
_SAMPLES = 32


@dataclass(frozen=True, eq=False)
class MeshError:
    """Errors of collocating one gait on one mesh; arrays over intervals, ``(n,)``."""

    rotation: np.ndarray  # [rad]
    displacement: np.ndarray  # magnitude [body lengths]
    work: np.ndarray
    velocity: np.ndarray
    """Largest error between the nodes of the interpolated velocity of the tail or, times a body
    length, of its rotation rate [body lengths per period]."""
    value: np.ndarray
    """Contribution to the relative error of the objective, signed, to first order."""
    violation: np.ndarray
    """Largest excess over a joint limit [rad] or penetration of links [rad or body lengths]."""
    total: float  # relative error of the collocated objective, not linearised
    unresolved: float  # what the panels may have missed of it
    turning: float
    """Rotation that collocation misses over a period, times half a length over the distance; 0
    where a symmetry closes the rotation. It makes the distance of a closed gait ambiguous."""

    @property
    def estimate(self) -> float:
        """Estimated relative error of the objective: the magnitudes of all intervals, as an
        optimiser exploits cancellation, and what is unresolved."""
        return float(np.abs(self.value).sum() + self.unresolved)


class Known(NamedTuple):
    """A gait, delta per period, and its motion (`gait_motion`)."""

    control: ControlProblem
    gait: AnyGait
    delta: float
    fine: Any


def gait_motion(
    control: ControlProblem, gait: AnyGait, delta: float, mesh: Mesh, tolerance: float
) -> Any:
    """The gait's motion: a `FineMotion`; where it has states, a `ReferenceMotion`."""
    if kind_of_motion(control.dynamics).followed:
        return reference_motion(control, gait, delta, mesh, tolerance)
    shares, (body, friction, *_) = partial(_shares, control), control.dynamics
    asked: Any = {"quantities": control.aims.integrals, "turn": control.dynamics.turn}
    return fine_motion(body, friction, gait, delta, mesh.edges, tolerance, shares, **asked)


def _per_part(control: ControlProblem, name: str) -> float:
    """What a quantity of the solved part counts in the whole period; of the way, the chord."""
    chord = chord_per_way(control.dynamics.turn) if name == "distance" else 1.0
    return 1.0 if name == "rotation" else chord / control.admissible.gait.fraction


def _period(control: ControlProblem, part: Mapping[str, float]) -> dict[str, float]:
    return {name: _per_part(control, name) * value for name, value in part.items()}


def _shares(control: ControlProblem, part: Mapping[str, float]) -> dict[str, float]:
    """Relative change of the objective per unit of each quantity of the solved part."""
    shares = control.aims.objective.shares(_period(control, part))
    return {name: share * _per_part(control, name) for name, share in shares.items()}


def mesh_error(
    control: ControlProblem,
    mesh: Mesh,
    gait: AnyGait,
    delta: float,
    tolerance: float = 1e-6,
    fine: Any = None,
) -> MeshError:
    """Errors of collocating a gait on a mesh, delta per period; relative ones below the tolerance
    need not be exact. `fine` is the gait's motion, if known. `NotConvergedError` if the balance
    cannot be solved at some instant."""
    if fine is None:
        fine = gait_motion(control, gait, delta, mesh, FINER * tolerance)
    violation = constraint_violation(control.admissible, mesh, gait)
    if kind_of_motion(control.dynamics).followed:
        return MeshError(**state_errors(control, mesh, gait, delta, fine), violation=violation)
    known = Known(control, gait, delta, fine)
    cells = _collocated_cells(known, mesh.scheme, mesh.edges[:-1], mesh.edges[1:])
    seen = _part(control, cells.pose.place[-1], cells.pose.theta[-1], cells.totals)
    collocated, exact = (
        control.aims.objective(_period(control, part)) for part in (seen, _fine_part(known))
    )
    return MeshError(
        rotation=cells.rotation,
        displacement=np.abs(cells.displacement),
        work=cells.gained[0],
        velocity=_velocity_error(mesh, cells.rates, fine),
        value=cells.value,
        violation=violation,
        total=collocated / exact - 1,
        unresolved=float(fine.unresolved.sum()),
        turning=abs(float(_turning(known, cells).sum())),
    )


def interval_shares(known: Known, rule: Scheme, left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """What collocating on each of the intervals adds to the relative error of the objective and to
    `MeshError.turning`, magnitudes, ``(n,)``."""
    cells = _collocated_cells(known, rule, left, right)
    return np.abs(cells.value) + np.abs(_turning(known, cells))


class _Cells(NamedTuple):
    """Intervals by a scheme: errors as in `MeshError`, those of work and integrals ``(1 + k, n)``,
    rates at its nodes, its pose, and its work and integrals ``(1 + k,)``."""

    rotation: np.ndarray
    displacement: np.ndarray
    gained: np.ndarray
    value: np.ndarray
    rates: Rates
    pose: CollocatedPose
    totals: np.ndarray


def _collocated_cells(known: Known, rule: Scheme, left: np.ndarray, right: np.ndarray) -> _Cells:
    (control, gait, delta, fine), h = known, right - left
    nodes = left[:, None] + h[:, None] * rule.c
    asked: Any = {"quantities": control.aims.integrals, "turn": control.dynamics.turn}
    at = *control.dynamics[:2], gait, delta, nodes
    rates = rates_at(*at, near=fine.velocity(nodes), **asked)
    pose = CollocatedPose(rule, h, rates.z[2], rates.centre)
    totals = (h[:, None] * rule.b * rates.gained).sum(axis=2)
    (theta, path, *before), (theta_right, path_right, *after) = fine.at(left), fine.at(right)
    rotation = pose.rotations - (theta_right - theta)
    gained = totals - (np.array(after) - np.array(before))
    displacement = pose.displacements * np.exp(1j * theta) - (path_right - path)
    # an error of rotation turns everything after it, and by half of it the direction that counts
    pull = displacement + 1j * rotation * (0.5 * fine.path[-1] - path_right)
    direction = _direction(control, fine.path[-1], fine.theta[-1])
    shares = _shares(control, _fine_part(known))
    value = shares["distance"] * (pull * np.conj(direction)).real + shares["rotation"] * rotation
    value += sum(shares[name] * part for name, part in zip(_summed(control), gained, strict=True))
    return _Cells(rotation, displacement, gained, value, rates, pose, totals.sum(axis=1))


def _summed(control: ControlProblem) -> tuple[str, ...]:
    return "work", *(quantity.name for quantity in control.aims.integrals)


def _turning(known: Known, cells: _Cells) -> np.ndarray:
    closed = known.control.admissible.gait.symmetry != NONE
    return cells.rotation * (0.0 if closed else 0.5 / abs(known.fine.path[-1]))


def _part(
    control: ControlProblem, end: complex, rotation: float, totals: np.ndarray
) -> dict[str, float]:
    """Quantities of the solved part."""
    distance = float((end * np.conj(_direction(control, end, rotation))).real)
    sums = dict(zip(_summed(control), totals.tolist(), strict=True))
    return {"distance": distance, "rotation": float(rotation)} | sums


def _fine_part(known: Known) -> dict[str, float]:
    fine = known.fine
    return _part(known.control, fine.path[-1], fine.theta[-1], fine.totals[:, -1])


def _direction(control: ControlProblem, end: complex, rotation: float) -> complex:
    """Unit vector along which the solved part's displacement counts."""
    return np.exp(1j * heading(control.dynamics.symmetry, end, rotation))


def _velocity_error(mesh: Mesh, rates: Rates, fine: FineMotion) -> np.ndarray:
    t = fine.nodes.ravel()
    k = np.clip(np.searchsorted(mesh.edges, t, side="right") - 1, 0, mesh.n - 1)
    weights = mesh.scheme.lagrange((t - mesh.edges[k]) / mesh.h[k])
    interpolated = np.einsum("ts,cts->ct", weights, rates.z[:, k])
    largest = np.zeros(mesh.n)
    np.maximum.at(largest, k, np.abs(interpolated - fine.rates.z.reshape(3, -1)).max(axis=0))
    return largest


def constraint_violation(admissible: Admissible, mesh: Mesh, gait: AnyGait) -> np.ndarray:
    """Largest excess over a joint limit or penetration of any two links inside each interval,
    ``(n_interval,)``; 0 if none."""
    t = (mesh.edges[:-1, None] + mesh.h[:, None] * np.linspace(0.0, 1.0, _SAMPLES + 1)).ravel()
    angles, body = gait.angles(t), admissible.body
    stretched, limit = under_one_limit(angles, admissible.joint_limit)
    rows = [
        np.abs(body.bounded_angles.rows @ stretched).max(axis=0, initial=0.0) - limit,
        crossing_depth(body, angles, far_pairs(body)),
        *(near.excess(angles)[0] for near in body.contacts()),
    ]
    return np.maximum(np.max(rows, axis=0), 0.0).reshape(mesh.n, -1).max(axis=1)
