"""How wrong a collocated gait is, interval by interval: states, objective and constraints between
the nodes.

On an interval the scheme takes the rate of a state to be the polynomial through its values at the
nodes. The *defect* of a state between the nodes is that polynomial less the true rate, which the
balance gives for the gait at any phase. Its integral over the interval is the error that the
interval adds to the state. It is evaluated against adaptive panels
(`colloc.verification.adaptive_motion`), which resolve the kinks of stick and slip between the
nodes.
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
from colloc.motion.collocated import CollocatedPose
from colloc.motion.heading import heading
from colloc.motion.kinds import kind_of_motion
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import Scheme
from colloc.verification.adaptive_motion import FineMotion, Rates, fine_motion, rates_at
from colloc.verification.collocated_course import course, course_defects

FINER = 0.05
"""The panels are refined until what they may still miss is this fraction of the error they measure
or of the tolerance."""
_SAMPLES = 32


@dataclass(frozen=True, eq=False)
class MeshError:
    """Errors of collocating one gait on one mesh, ``(n_interval,)`` each."""

    rotation: np.ndarray
    """Error of the rotation over the interval [rad], ``(n,)``."""
    displacement: np.ndarray
    """Magnitude of the error of the displacement over the interval [body lengths], ``(n,)``."""
    work: np.ndarray
    """Error of the work over the interval, ``(n,)``."""
    velocity: np.ndarray
    """Largest error between the nodes of the interpolated velocity of the tail or, times a body
    length, of its rotation rate [body lengths per period], ``(n,)``."""
    value: np.ndarray
    """Contribution to the error of the objective, relative to its magnitude, signed, to first
    order, ``(n,)``."""
    violation: np.ndarray
    """Largest excess over a joint limit [rad] or penetration of links [rad or body lengths] inside
    the interval, ``(n,)``."""
    total: float
    """Relative error of the collocated objective as a whole: all contributions, not linearised."""
    unresolved: float
    """What the panels that measured all this may have missed, relative to the objective."""
    turning: float
    """Rotation that collocation misses over a whole period, times the body's reach (half a length)
    over the distance; 0 where a symmetry closes the rotation. It is what makes the distance of a
    closed gait ambiguous."""

    @property
    def estimate(self) -> float:
        """Estimated relative error of the objective: the magnitudes of all intervals, so that
        errors of opposite sign do not cancel, and what is unresolved. An optimiser exploits
        cancellation; so this also covers its search."""
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
    """The gait's motion on adaptive panels, a `FineMotion`; where it has states, a
    `CourseOfGait`."""
    if kind_of_motion(control.dynamics).followed:
        return course(control, gait, delta, mesh, tolerance)
    shares, (body, friction, *_) = partial(_shares, control), control.dynamics
    asked: Any = {"quantities": control.aims.integrals, "turn": control.dynamics.turn}
    return fine_motion(body, friction, gait, delta, mesh.edges, tolerance, shares, **asked)


def _period(control: ControlProblem, part: Mapping[str, float]) -> dict[str, float]:
    """What a whole period comes to, from what the part that is solved does; of the way, which
    counts as distance, the chord."""
    return {name: _whole(control, name) * value for name, value in part.items()}


def _whole(control: ControlProblem, name: str) -> float:
    """What a quantity of the solved part counts in the whole period."""
    chord = chord_per_way(control.dynamics.turn) if name == "distance" else 1.0
    return 1.0 if name == "rotation" else chord / control.admissible.gait.fraction


def _shares(control: ControlProblem, part: Mapping[str, float]) -> dict[str, float]:
    """What a small change of each quantity of the solved part changes in the objective, relative to
    it."""
    shares = control.aims.objective.shares(_period(control, part))
    return {name: share * _whole(control, name) for name, share in shares.items()}


def mesh_error(
    control: ControlProblem,
    mesh: Mesh,
    gait: AnyGait,
    delta: float,
    tolerance: float = 1e-6,
    fine: Any = None,
) -> MeshError:
    """Errors of collocating a gait on a mesh, with delta per period; relative ones below the
    tolerance need not be exact. `fine` is the gait's motion, if it is known. `NotConvergedError` if
    the balance cannot be solved at some instant."""
    if fine is None:
        fine = gait_motion(control, gait, delta, mesh, FINER * tolerance)
    if kind_of_motion(control.dynamics).followed:
        violation = constraint_violation(control.admissible, mesh, gait)
        return MeshError(**course_defects(control, mesh, gait, delta, fine), violation=violation)
    known = Known(control, gait, delta, fine)
    own = _collocated_intervals(known, mesh.scheme, mesh.edges[:-1], mesh.edges[1:])
    seen = _part(control, own.pose.place[-1], own.pose.theta[-1], own.totals)
    collocated, exact = (
        control.aims.objective(_period(control, part)) for part in (seen, _fine_part(known))
    )
    return MeshError(
        own.rotation,
        np.abs(own.displacement),
        own.gained[0],
        _velocity_error(mesh, own.rates, fine),
        own.value,
        constraint_violation(control.admissible, mesh, gait),
        collocated / exact - 1,
        float(fine.unresolved.sum()),
        abs(float(_turning(known, own).sum())),
    )


def interval_shares(known: Known, rule: Scheme, left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """What collocating on each of the intervals from left to right adds to the relative error of
    the objective and to the rotation that is missed (as `MeshError.turning`), magnitudes,
    ``(n,)``."""
    own = _collocated_intervals(known, rule, left, right)
    return np.abs(own.value) + np.abs(_turning(known, own))


class _Own(NamedTuple):
    """What a scheme makes of intervals: errors as in `MeshError`, those of work and integrals ``(1
    + k, n)``, rates at its nodes, its own pose, and work and integrals ``(1 + k,)``."""

    rotation: np.ndarray
    displacement: np.ndarray
    gained: np.ndarray
    value: np.ndarray
    rates: Rates
    pose: CollocatedPose
    totals: np.ndarray


def _collocated_intervals(known: Known, rule: Scheme, left: np.ndarray, right: np.ndarray) -> _Own:
    control, gait, delta, fine = known
    nodes = left[:, None] + (right - left)[:, None] * rule.c
    at = *control.dynamics[:2], gait, delta, nodes
    rates = rates_at(
        *at,
        near=fine.velocity(nodes),
        quantities=control.aims.integrals,
        turn=control.dynamics.turn,
    )
    pose, weights = (
        CollocatedPose(rule, right - left, rates.z[2], rates.centre),
        (right - left)[:, None] * rule.b,
    )
    totals = (weights * rates.gained).sum(axis=2)
    (theta, path, *begun), (theta_right, path_right, *ended) = fine.at(left), fine.at(right)
    rotation, gained = (
        pose.rotations - (theta_right - theta),
        totals - (np.array(ended) - np.array(begun)),
    )
    displacement = pose.displacements * np.exp(1j * theta) - (path_right - path)
    # an error of rotation turns everything after it, and by half of it the direction that counts
    pull = displacement + 1j * rotation * (0.5 * fine.path[-1] - path_right)
    direction, shares = (
        _direction(control, fine.path[-1], fine.theta[-1]),
        _shares(control, _fine_part(known)),
    )
    value = shares["distance"] * (pull * np.conj(direction)).real + shares["rotation"] * rotation
    value += sum(shares[name] * part for name, part in zip(_summed(control), gained, strict=True))
    return _Own(rotation, displacement, gained, value, rates, pose, totals.sum(axis=1))


def _summed(control: ControlProblem) -> tuple[str, ...]:
    """What is summed up besides the way."""
    return "work", *(quantity.name for quantity in control.aims.integrals)


def _turning(known: Known, own: _Own) -> np.ndarray:
    """Rotation missed by intervals, times the body's reach over the distance, ``(n,)``."""
    return own.rotation * (
        0.5 / abs(known.fine.path[-1]) if known.control.admissible.gait.symmetry == NONE else 0.0
    )


def _part(
    control: ControlProblem, end: complex, rotation: float, totals: np.ndarray
) -> dict[str, float]:
    distance = float((end * np.conj(_direction(control, end, rotation))).real)
    return {"distance": distance, "rotation": float(rotation)} | dict(
        zip(_summed(control), totals.tolist(), strict=True)
    )


def _fine_part(known: Known) -> dict[str, float]:
    """What the solved part comes to."""
    fine = known.fine
    return _part(known.control, fine.path[-1], fine.theta[-1], fine.totals[:, -1])


def _direction(control: ControlProblem, end: complex, rotation: float) -> complex:
    """Unit vector along which the solved part's displacement counts."""
    return np.exp(1j * heading(control.dynamics.symmetry, end, rotation))


def _velocity_error(mesh: Mesh, rates: Rates, fine: FineMotion) -> np.ndarray:
    t = fine.nodes.ravel()
    k = np.clip(np.searchsorted(mesh.edges, t, side="right") - 1, 0, mesh.n - 1)
    interpolated = np.einsum(
        "ts,cts->ct", mesh.scheme.lagrange((t - mesh.edges[k]) / mesh.h[k]), rates.z[:, k]
    )
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
        np.abs(body.limited @ stretched).max(axis=0, initial=0.0) - limit,
        body.crossing_depth(angles, body.far_pairs),
    ]
    rows += [near.excess(angles)[0] for near in body.contacts()]
    return np.maximum(np.max(rows, axis=0), 0.0).reshape(mesh.n, -1).max(axis=1)
