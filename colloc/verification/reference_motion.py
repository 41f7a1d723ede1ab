"""The motion of a gait with states by its differential equation, which meshes are held against."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from colloc.dynamics.collocated import CollocatedPose, stage_weights
from colloc.dynamics.control_problem import ControlProblem
from colloc.dynamics.dynamics import (
    OMEGA,
    PeriodTotals,
    QuasiStatic,
    Shapes,
    Trajectory,
)
from colloc.numerics.mesh import Mesh
from colloc.verification.inertial_motion import GaitWithInertia, amplification
from colloc.verification.replay_record import LEAST
from colloc.verification.slope import GaitOnSlope


class ReferenceMotion(NamedTuple):
    at: Callable[[np.ndarray], np.ndarray]
    """Momenta if they are states, theta, place, work against friction, ``(4 or 7, n)``, at
    ascending phases, seen from axes that turn evenly."""
    error: float  # about that of these states
    sums: Callable[[np.ndarray], np.ndarray] | None = None
    """Quantities that forces are needed for up to ascending phases, ``(k, n)``."""
    alone: Callable[..., Any] | None = None
    """Intervals by themselves (`colloc.dynamics.dynamics.Inertial.alone`); None: their errors are
    seen in the whole motion."""


def reference_motion(
    control: ControlProblem, gait: Any, delta: float, mesh: Mesh, tolerance: float
) -> ReferenceMotion:
    """The motion of a gait, delta per period, to a relative error of the objective; a regime of
    one's own has it as ``reference``, by an error of the states."""
    dynamics = control.dynamics
    on_mesh, regime = collocate(control, mesh, gait, delta), dynamics.regime
    counts = sum(map(abs, control.aims.objective.shares(on_mesh.period).values()))
    error = tolerance / counts if np.isfinite(counts) else tolerance
    if hasattr(regime, "reference"):
        return regime.reference(control, gait, delta, mesh, error)
    if regime.froude:
        at = regime.at(gait)
        how: Any = {"froude": at.froude, "turn": dynamics.turn, "regime": at}
        moving = GaitWithInertia(dynamics.body, dynamics.law, gait, delta, **how)
        begin, _, slopes = moving.rough_period(on_mesh.along.edges[:, 0])
        times = 1.0 + np.abs(amplification(slopes)).sum(axis=1).max()
        run = moving.periodic_run(begin, max(error / times, LEAST), slopes)
        alone = dynamics.alone  # type: ignore[attr-defined]
        return ReferenceMotion(run.course.at, times * run.aim, alone=alone)
    if regime.slides:
        asked = [each for each in control.aims.integrals if each.needs_forces]
        breaks = gait.corner_phases
        on = GaitOnSlope(dynamics.body, dynamics.law, gait, delta, regime.grade, breaks)
        ran = on.integrate(np.array([gait.theta]), error)
        return ReferenceMotion(lambda t: ran.at(t)[:4], error, lambda t: on.totals(ran, asked, t))
    raise NotImplementedError(
        f"no differential equation is known for {type(regime).__name__}: give it a reference."
    )


class Collocated(NamedTuple):
    """A gait on a mesh."""

    shapes: Shapes
    along: Trajectory
    pose: CollocatedPose
    work: np.ndarray  # against friction, (n,)
    integrals: dict[str, np.ndarray]  # of intervals
    period: dict[str, float]


def collocate(control: ControlProblem, mesh: Mesh, gait: Any, delta: float) -> Collocated:
    kind, weights, (angles, rates) = (
        control.dynamics,
        stage_weights(mesh),
        gait(mesh.times),
    )
    shapes = Shapes(angles, rates, delta)
    along = kind.simulate(mesh, shapes, kind.static_of(gait))
    theta = kind.initial_heading(along.static)
    pose = CollocatedPose.on_mesh(mesh, along.now.z[OMEGA] - kind.turn, along.now.centre, theta)
    now = kind.instants(shapes, pose.theta_on(mesh), along.now.z)
    work = (weights * along.now.power[mesh.points]).sum(axis=1)
    sums = {
        each.name: (weights * each.at(now)[0, mesh.points]).sum(axis=1)
        for each in control.aims.integrals
    }
    way, turn = complex(pose.place[-1]), float(pose.rotations.sum())
    passed = PeriodTotals(way, turn, float(work.sum()), along.static)
    return Collocated(shapes, along, pose, work, sums, period_of(kind, passed, sums))


def period_of(kind: QuasiStatic, passed: PeriodTotals, sums: Mapping[str, Any]) -> dict[str, float]:
    """Quantities of a period from those of the solved part."""
    totals = {name: kind.periods * float(np.sum(part)) for name, part in sums.items()}
    return kind.totals(passed) | totals
