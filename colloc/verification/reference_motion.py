r"""Errors of collocating a motion with states: what the scheme says of every interval
(`colloc.motion.kinds`) against the differential equation, solved with steps of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.inertia import Paced
from colloc.gaits.sloped import Slope
from colloc.gaits.symmetry import NONE
from colloc.motion.collocated import CollocatedPose, stage_weights
from colloc.motion.kinds import (
    OMEGA,
    Along,
    Kind,
    Passed,
    Shapes,
    begin_of,
    first_theta,
    kind_of_motion,
    through_motion,
)
from colloc.numerics.mesh import Mesh
from colloc.verification.adaptive_motion import totals_along
from colloc.verification.inertial_motion import GaitWithInertia, amplification
from colloc.verification.played import LEAST
from colloc.verification.slope import GaitOnSlope


class ReferenceMotion(NamedTuple):
    """A gait's motion by the differential equation."""

    at: Callable[[np.ndarray], np.ndarray]
    """Momenta if they are states, theta, place, work against friction, ``(4 or 7, n)``, at phases
    in order, seen from axes that turn evenly."""
    error: float  # about that of these states
    sums: Callable[[np.ndarray], np.ndarray] | None = None
    """Quantities that forces are needed for up to phases in order, ``(k, n)``; None if there are
    none."""
    alone: Callable[..., Any] | None = None
    """Intervals by themselves (`colloc.motion.kinds.WithInertia.alone`); None: their errors are
    seen in the whole motion."""


def reference_motion(
    control: ControlProblem, gait: Any, delta: float, mesh: Mesh, tolerance: float
) -> ReferenceMotion:
    """The motion of a gait, delta per period, to a relative error of the objective; with inertia it
    is sought near the motion on the mesh. A regime of one's own has it as ``reference``, by an
    error of the states."""
    period = _collocated(control, mesh, gait, delta).period
    counts = sum(map(abs, control.aims.objective.shares(period).values()))
    error = tolerance / counts if np.isfinite(counts) else tolerance
    regime = control.dynamics.regime
    if hasattr(regime, "reference"):
        return regime.reference(control, gait, delta, mesh, error)
    if isinstance(regime, Paced):
        return _with_inertia(control, gait, delta, mesh, error)
    if isinstance(regime, Slope):
        asked = [each for each in control.aims.integrals if each.needs_forces]
        body, law, *_ = control.dynamics
        on = GaitOnSlope(body, law, gait, delta, regime.grade, gait.corner_phases)
        ran = on.integrate(np.array([gait.theta]), error)
        return ReferenceMotion(lambda t: ran.at(t)[:4], error, lambda t: on.totals(ran, asked, t))
    raise NotImplementedError(
        f"no differential equation is known for {type(regime).__name__}: give it a reference."
    )


def _with_inertia(
    control: ControlProblem, gait: Any, delta: float, mesh: Mesh, error: float
) -> ReferenceMotion:
    dynamics, kind = control.dynamics, _kind(control)
    regime = dynamics.regime.at(gait)
    how: Any = {"froude": regime.froude, "turn": dynamics.turn, "regime": regime}
    moving = GaitWithInertia(dynamics.body, dynamics.law, gait, delta, **how)
    along = kind.along(mesh, _shapes(gait, mesh, delta), begin_of(kind, gait))
    begin, _, slopes = moving.rough_period(along.edges[:, 0])
    times = 1.0 + np.abs(amplification(slopes)).sum(axis=1).max()
    ran = moving.periodic_run(begin, max(error / times, LEAST), slopes)
    return ReferenceMotion(ran.course.at, times * ran.aim, alone=kind.alone)


def _kind(control: ControlProblem) -> Any:
    return kind_of_motion(control.dynamics)


def _shapes(gait: Any, mesh: Mesh, delta: float) -> Shapes:
    angles, rates = gait(mesh.times)
    return Shapes(angles, rates, delta)


class _Collocated(NamedTuple):
    """A gait on a mesh."""

    along: Along
    pose: CollocatedPose
    work: np.ndarray  # against friction, (n,)
    integrals: dict[str, np.ndarray]  # of intervals
    period: dict[str, float]


def _collocated(control: ControlProblem, mesh: Mesh, gait: Any, delta: float) -> _Collocated:
    kind, shapes, weights = _kind(control), _shapes(gait, mesh, delta), stage_weights(mesh)
    along = kind.along(mesh, shapes, begin_of(kind, gait))
    theta = first_theta(kind, along.begin)
    pose = CollocatedPose.on_mesh(mesh, along.z[OMEGA] - kind.turn, along.now.centre, theta)
    now = kind.instants(shapes, pose.theta_on(mesh), along.z)
    work = (weights * along.now.power[mesh.points]).sum(axis=1)
    sums = {
        each.name: (weights * each.at(now)[0, mesh.points]).sum(axis=1)
        for each in control.aims.integrals
    }
    way, turn = complex(pose.place[-1]), float(pose.rotations.sum())
    period = _period(kind, Passed(way, turn, float(work.sum()), along.begin), sums)
    return _Collocated(along, pose, work, sums, period)


def _period(kind: Kind, passed: Passed, sums: dict[str, np.ndarray]) -> dict[str, float]:
    totals = {name: kind.periods * float(part.sum()) for name, part in sums.items()}
    return kind.counted(passed) | totals


def state_errors(
    control: ControlProblem, mesh: Mesh, gait: Any, delta: float, exact: ReferenceMotion
) -> dict[str, Any]:
    """Errors by the names of `colloc.verification.mesh_error.MeshError`; the work is that against
    friction, velocities have none."""
    kind, objective = _kind(control), control.aims.objective
    along, pose, collocated_work, sums, other = _collocated(control, mesh, gait, delta)
    at_edges = exact.at(mesh.edges)
    angle, *place = at_edges[-4:-1]
    theta, x, y, work = np.diff(at_edges[-4:], axis=1)
    true = Passed(complex(x.sum(), y.sum()), float(theta.sum()), float(work.sum()), along.begin)
    with_forces = iter([] if exact.sums is None else np.diff(exact.sums(mesh.edges), axis=1))
    known = {
        each.name: next(with_forces)
        if each.needs_forces
        else totals_along(each, gait, mesh.edges[:-1], mesh.edges[1:], 4)
        for each in control.aims.integrals
    }
    period = _period(kind, true, known)
    weights, value = objective.shares(period), np.zeros(mesh.n)
    rotation, energy = pose.rotations - theta, collocated_work - work
    displacement = np.diff(pose.place) - (x + 1j * y)
    turned = abs(float(rotation.sum())) * 0.5 / max(abs(period["distance"]), 1e-300)
    if exact.alone is not None:
        shapes = _shapes(gait, mesh, delta)
        # momenta, perhaps theta
        edge_states, near = (at[: len(kind.states)] for at in (at_edges, exact.at(mesh.times)))
        out, ends, alone = exact.alone(mesh, shapes, along, edge_states[:, :-1], near)
        local = CollocatedPose.on_mesh(mesh, out[OMEGA] - kind.turn, out[3:5])
        rotation = local.rotations - theta
        energy = (stage_weights(mesh) * out[5][mesh.points]).sum(axis=1) - work
        displacement = np.exp(1j * angle[:-1]) * local.displacements - (x + 1j * y)
        if not kind.states[3:]:
            # an error of rotation turns everything after it, and by half of it the direction that
            # counts
            rest = (place[0] - place[0][0]) + 1j * (place[1] - place[1][0])
            displacement += 1j * rotation * (0.5 * rest[-1] - rest[1:])
        shares, (_, on_states) = kind.shares(true), kind.slopes(shapes, along)
        *_, on_ends = through_motion(kind, mesh, pose, shares.values(), on_states)
        aims = np.array([weights.get(name, 0.0) for name in shares])
        value += np.einsum("m,mkn,kn->n", aims, on_ends, ends - edge_states[:, 1:])
        value[~alone] = 1.0
    for name, share in kind.shares(true).items():
        turns = rotation if name == "rotation" else 0.0
        way = (np.conj(share.side) * displacement).real
        value += weights.get(name, 0.0) * (way + turns + share.work * energy)
    value += sum(weights[name] * kind.periods * (sums[name] - known[name]) for name in known)
    if not along.held.all():
        value = np.nan * value
    return {
        "rotation": rotation,
        "displacement": np.abs(displacement),
        "work": energy,
        "velocity": np.full(mesh.n, np.nan),
        "value": value,
        "total": float(objective(other) / objective(period) - 1),
        "unresolved": float(exact.error * sum(map(abs, weights.values()))),
        "turning": turned if control.admissible.gait.symmetry == NONE else 0.0,
    }
