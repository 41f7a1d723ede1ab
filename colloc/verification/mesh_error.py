"""Errors of a collocated gait, interval by interval, and the motion that meshes are held against.

On an interval the scheme takes the rate of a state to be the polynomial through its values at the
nodes; the integral of the *defect*, that polynomial less the true rate, is the error it adds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from colloc.dynamics.chain import joint_torques
from colloc.dynamics.collocated import CollocatedPose, stage_weights
from colloc.dynamics.control_problem import Admissible, ControlProblem
from colloc.dynamics.dynamics import OMEGA, Inertial, PeriodTotals, QuasiStatic, Shapes, Trajectory
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.limits import under_one_limit
from colloc.gaits.symmetry import NONE
from colloc.mechanics.contact import crossing_depth, far_pairs
from colloc.mechanics.inertia import STATES
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import Scheme
from colloc.verification.adaptive_motion import LEAST, fine_motion, rates_at, totals_along
from colloc.verification.differential_motion import GaitOnSlope, GaitWithInertia, amplification

FINER = 0.05
"""What the panels may miss, over the error they measure or the tolerance."""
_SAMPLES = 32


@dataclass(frozen=True, eq=False)
class MeshError:
    """Errors of collocating one gait on one mesh; arrays over intervals, ``(n,)``."""

    value: np.ndarray
    """Contribution to the relative error of the objective, signed, to first order."""
    violation: np.ndarray
    """Largest excess over a joint limit [rad] or penetration of links [rad or body lengths]."""
    total: float  # relative error of the collocated objective, not linearised
    unresolved: float  # what the panels may have missed of it
    turning: float
    """Rotation that collocation misses over a period, times half a length over the distance; 0
    where a symmetry closes it. It makes the distance of a closed gait ambiguous."""

    @property
    def estimate(self) -> float:
        """Relative error of the objective: magnitudes, as an optimiser exploits cancellation."""
        return float(np.abs(self.value).sum() + self.unresolved)


class ReferenceMotion(NamedTuple):
    """The motion of a gait with states by its differential equation."""

    at: Callable[[np.ndarray], np.ndarray]
    """Momenta if they are states, theta, place, work against friction, ``(4 or 7, n)``, at
    ascending phases, seen from axes that turn evenly."""
    error: float  # about that of these states
    sums: Callable[[np.ndarray], np.ndarray] | None = None
    """Quantities that forces are needed for up to ascending phases, ``(k, n)``."""
    solve_intervals: Callable[..., Any] | None = None
    """`colloc.dynamics.dynamics.Inertial.solve_intervals`; None: errors of intervals are seen in
    the whole motion."""


class Known(NamedTuple):
    """A gait, delta per period, and its motion (`gait_motion`)."""

    control: ControlProblem
    gait: AnyGait
    delta: float
    fine: Any


def gait_motion(
    control: ControlProblem, gait: AnyGait, delta: float, mesh: Mesh, tolerance: float
) -> Any:
    """The gait's motion, delta per period, to a relative error of the objective: a `FineMotion`;
    where it has states, a `ReferenceMotion`, by an error of the states. A regime of one's own has
    it as ``reference``."""
    kind = control.dynamics
    body, law, regime = kind.body, kind.law, kind.regime
    if not kind.followed:
        return fine_motion(
            body, law, gait, delta, mesh.edges, tolerance, control.aims.objective,
            quantities=control.aims.integrals, turn=kind.turn, periods=kind.periods,
        )  # fmt: skip
    on_mesh = _collocate(control, mesh, gait, delta)
    counts = sum(map(abs, control.aims.objective.shares(on_mesh.period).values()))
    error = tolerance / counts if np.isfinite(counts) else tolerance
    if hasattr(regime, "reference"):
        return regime.reference(control, gait, delta, mesh, error)
    asked = control.aims.integrals
    if regime.froude:
        paced = regime.at(gait)
        how: Any = {"froude": paced.froude, "turn": kind.turn, "regime": paced}
        moving = GaitWithInertia(body, law, gait, delta, quantities=asked, **how)
        begin, _, slopes = moving.rough_period(on_mesh.along.edges[:, 0])
        times = 1.0 + np.abs(amplification(slopes)).sum(axis=1).max()
        run = moving.periodic_run(begin, max(error / times, LEAST), slopes)
        by_interval = kind.solve_intervals  # type: ignore[attr-defined]
        sums = partial(moving.sums, run.course, run.aim)
        return ReferenceMotion(run.course.at, times * run.aim, sums, by_interval)
    if regime.slides:
        on = GaitOnSlope(body, law, gait, delta, regime.grade, gait.corner_phases)
        ran = on.integrate(gait.theta, error)
        sums = partial(on.totals, ran, error, asked)
        return ReferenceMotion(lambda t: ran.at(t)[:4], error, sums)
    raise NotImplementedError(
        f"no differential equation is known for {type(regime).__name__}: give it a reference."
    )


def mesh_error(
    control: ControlProblem,
    mesh: Mesh,
    gait: AnyGait,
    delta: float,
    tolerance: float = 1e-6,
    fine: Any = None,
) -> MeshError:
    """Errors of collocating a gait on a mesh, delta per period; relative ones below the tolerance
    need not be exact. `NotConvergedError` without a balance."""
    if fine is None:
        fine = gait_motion(control, gait, delta, mesh, FINER * tolerance)
    known, kind = Known(control, gait, delta, fine), control.dynamics
    violation = constraint_violation(control.admissible, mesh, gait)
    if kind.followed:
        return MeshError(**_errors_with_states(known, mesh), violation=violation)
    cells, objective = _collocated_cells(known, mesh.scheme, *_ends(mesh)), control.aims.objective
    seen = _period(known, cells.pose.place[-1], cells.pose.theta[-1], cells.totals)[1]
    return MeshError(
        value=cells.value,
        violation=violation,
        total=objective(seen) / objective(_exact(known)[1]) - 1,
        unresolved=float(fine.unresolved.sum()),
        turning=abs(float(cells.turning.sum())),
    )


def _ends(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    return mesh.edges[:-1], mesh.edges[1:]


def _first_order(
    control: ControlProblem,
    passed: PeriodTotals,
    period: Mapping[str, float],
    rotation: np.ndarray,
    displacement: np.ndarray,
    work: np.ndarray,
    integrals: Iterable[np.ndarray],
) -> np.ndarray:
    """Relative changes of the objective by errors of intervals; `displacement` at the end."""
    kind, weights = control.dynamics, control.aims.objective.shares(period)
    value = np.zeros(rotation.size)
    for name, share in kind.total_gradients(passed).items():
        way = (np.conj(share.side) * displacement).real
        value += weights.get(name, 0.0) * (way + share.rotation * rotation + share.work * work)
    for each, error in zip(control.aims.integrals, integrals, strict=True):
        value += weights[each.name] * kind.periods * error
    return value


class _Cells(NamedTuple):
    """Intervals by a scheme, with their errors."""

    value: np.ndarray
    turning: np.ndarray
    pose: CollocatedPose
    totals: np.ndarray  # work and integrals, (1 + k,)


def _collocated_cells(known: Known, rule: Scheme, left: np.ndarray, right: np.ndarray) -> _Cells:
    (control, gait, delta, fine), h = known, right - left
    nodes = left[:, None] + h[:, None] * rule.c
    kind = control.dynamics
    rates = rates_at(
        kind.body, kind.law, gait, delta, nodes, near=fine.velocity(nodes),
        quantities=control.aims.integrals, turn=kind.turn,
    )  # fmt: skip
    pose = CollocatedPose(rule, h, rates.z[2], rates.centre)
    totals = (h[:, None] * rule.b * rates.gained).sum(axis=2)
    (theta, path, *before), (theta_right, path_right, *after) = fine.at(left), fine.at(right)
    rotation = pose.rotations - (theta_right - theta)
    gained = totals - (np.array(after) - np.array(before))
    displacement = pose.displacements * np.exp(1j * theta) - (path_right - path)
    # an error of rotation turns everything after it
    added = displacement + 1j * rotation * (fine.path[-1] - path_right)
    value = _first_order(control, *_exact(known), rotation, added, gained[0], gained[1:])
    closed = control.admissible.gait.symmetry != NONE
    turning = rotation * (0.0 if closed else 0.5 / abs(fine.path[-1]))
    return _Cells(value, turning, pose, totals.sum(axis=1))


def interval_shares(known: Known, rule: Scheme, left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Magnitudes of what intervals add to the relative error of the objective and to the
    turning."""
    cells = _collocated_cells(known, rule, left, right)
    return np.abs(cells.value) + np.abs(cells.turning)


def _period(
    known: Known, end: complex, rotation: float, totals: np.ndarray
) -> tuple[PeriodTotals, dict[str, float]]:
    """The solved part, and quantities of the period."""
    kind = known.control.dynamics
    passed = PeriodTotals(complex(end), float(rotation) - kind.turn, float(totals[0]))
    names = (each.name for each in known.control.aims.integrals)
    return passed, _period_of(kind, passed, dict(zip(names, totals[1:], strict=True)))


def _exact(known: Known) -> tuple[PeriodTotals, dict[str, float]]:
    fine = known.fine
    return _period(known, fine.path[-1], fine.theta[-1], fine.totals[:, -1])


def _period_of(
    kind: QuasiStatic, passed: PeriodTotals, sums: Mapping[str, Any]
) -> dict[str, float]:
    """Quantities of a period from those of the solved part."""
    totals = {name: kind.periods * float(np.sum(part)) for name, part in sums.items()}
    return kind.totals(passed) | totals


class _Collocated(NamedTuple):
    """A gait on a mesh."""

    shapes: Shapes
    along: Trajectory
    pose: CollocatedPose
    work: np.ndarray  # against friction, (n,)
    integrals: dict[str, np.ndarray]  # of intervals
    period: dict[str, float]


def _collocate(
    control: ControlProblem,
    mesh: Mesh,
    gait: Any,
    delta: float,
    near_states: np.ndarray | None = None,
) -> _Collocated:
    kind, weights = control.dynamics, stage_weights(mesh)
    angles, rates = gait(mesh.times)
    shapes = Shapes(angles, rates, delta)
    along = kind.simulate(mesh, shapes, kind.static_of(gait), near_states)
    theta = kind.initial_heading(along.static)
    pose = CollocatedPose.on_mesh(mesh, along.now.z[OMEGA] - kind.turn, along.now.centre, theta)
    now = kind.instants(shapes, pose.theta_on(mesh), along.now.z)
    if isinstance(kind, Inertial):
        how: Any = {"delta": delta, "froude": kind.froude_at(shapes, along.static)}
        at = kind.chain, kind.law, gait, mesh.times, along.states[: len(STATES)]
        now = replace(now, moments=joint_torques(*at, **how), froude=how["froude"])
    work = (weights * along.now.power[mesh.points]).sum(axis=1)
    sums = {
        each.name: (weights * each.at(now)[0, mesh.points]).sum(axis=1)
        for each in control.aims.integrals
    }
    way, turn = complex(pose.place[-1]), float(pose.rotations.sum())
    passed = PeriodTotals(way, turn, float(work.sum()), along.static)
    return _Collocated(shapes, along, pose, work, sums, _period_of(kind, passed, sums))


def _errors_with_states(known: Known, mesh: Mesh) -> dict[str, Any]:
    """`MeshError` but for the violation."""
    (control, gait, delta, exact), kind = known, known.control.dynamics
    # momenta, perhaps theta
    at_edges, near = exact.at(mesh.edges), exact.at(mesh.times)[: len(kind.states)]
    aims, seen = control.aims, _collocate(control, mesh, gait, delta, near)
    shapes, along, pose = seen[:3]
    angle, *place = at_edges[-4:-1]
    theta, x, y, work = np.diff(at_edges[-4:], axis=1)
    passed = PeriodTotals(
        complex(x.sum(), y.sum()), float(theta.sum()), float(work.sum()), along.static
    )
    with_forces = iter([] if exact.sums is None else np.diff(exact.sums(mesh.edges), axis=1))
    integrals = {
        each.name: next(with_forces)
        if each.needs_forces
        else totals_along(each, gait, *_ends(mesh), 4)
        for each in aims.integrals
    }
    period = _period_of(kind, passed, integrals)
    weights = aims.objective.shares(period)
    rotation, energy = pose.rotations - theta, seen.work - work
    displacement = np.diff(pose.place) - (x + 1j * y)
    turned = abs(float(rotation.sum())) * 0.5 / max(abs(period["distance"]), 1e-300)
    by_states: Any = 0.0
    if exact.solve_intervals is not None:
        states = at_edges[: len(kind.states)]
        out, ends, solved = exact.solve_intervals(mesh, shapes, along, states[:, :-1], near)
        local = CollocatedPose.on_mesh(mesh, out[OMEGA] - kind.turn, out[3:5])
        rotation = local.rotations - theta
        energy = (stage_weights(mesh) * out[5][mesh.points]).sum(axis=1) - work
        displacement = np.exp(1j * angle[:-1]) * local.displacements - (x + 1j * y)
        if not kind.states[3:]:  # an error of rotation turns everything after it
            path = place[0] + 1j * place[1]
            displacement += 1j * rotation * (path[-1] - path[1:])
        shares, (_, on_states) = kind.total_gradients(passed), along.slopes()
        *_, on_ends = kind.vjp(mesh, pose, shares.values(), on_states)
        counts = np.array([weights.get(name, 0.0) for name in shares])
        by_states = np.einsum("m,mkn,kn->n", counts, on_ends, ends - states[:, 1:])
        by_states[~solved] = 1.0
    off = [seen.integrals[name] - part for name, part in integrals.items()]
    value = by_states + _first_order(control, passed, period, rotation, displacement, energy, off)
    return {
        "value": value if along.held.all() else np.nan * value,
        "total": float(aims.objective(seen.period) / aims.objective(period) - 1),
        "unresolved": float(exact.error * sum(map(abs, weights.values()))),
        "turning": turned if control.admissible.gait.symmetry == NONE else 0.0,
    }


def constraint_violation(admissible: Admissible, mesh: Mesh, gait: AnyGait) -> np.ndarray:
    """Largest excess over a joint limit or penetration of links in each interval; 0 if none."""
    t = (mesh.edges[:-1, None] + mesh.h[:, None] * np.linspace(0.0, 1.0, _SAMPLES + 1)).ravel()
    angles, body = gait.angles(t), admissible.body
    stretched, limit = under_one_limit(angles, admissible.joint_limit)
    rows = [
        np.abs(body.bounded_angles.rows @ stretched).max(axis=0, initial=0.0) - limit,
        crossing_depth(body, angles, far_pairs(body)),
        *(near.excess(angles)[0] for near in body.contacts()),
    ]
    return np.maximum(np.max(rows, axis=0), 0.0).reshape(mesh.n, -1).max(axis=1)
