"""The certificate: every solve is judged by an independent replay and by its own first-order conditions."""

from __future__ import annotations

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.paths import ArcPath, Corners
from colloc.gaits.problem import Problem
from colloc.results.checks import Certificate, Check
from colloc.results.delta_limit import extrapolated_limit
from colloc.results.solution import Solution
from colloc.verification.mesh_error import mesh_error
from colloc.verification.replay import MixedPath, Path, Replay, replay

KKT, VIOLATION, RESIDUAL, CLOSURE, ROTATION, ADMISSIBLE, GAP, WORK = 1e-6, 1e-8, 1e-6, 1e-9, 1e-4, 1e-6, 1e-4, 1e-7
CURVATURE = 1e-6
"""Largest values that pass. ROTATION: the distance of a body that turns depends on the point of it that is followed, to first
order; so the rotation is limited by what it changes there, to as much as collocation may be wrong by (GAP). What delta may
change is the body's own (`colloc.mechanics.bodies.Usual`)."""
MOTIONS = 1e-2
"""Where the law leaves the motion open, no mesh decides it: as much as the other limit of the law, delta, may change."""

_FINE_PHASES = 20000


def gait_path(solution: Solution) -> Path:
    """Joint angles and rates of the solution's gait as a function of phase."""
    gait = solution.gait
    return lambda t: (gait.angles(t), gait.rates(t))


def corner_phases(gait: AnyGait) -> np.ndarray:
    """Phases in (0, 1) where the rates of a gait jump."""
    if not isinstance(gait, Corners):
        return np.empty(0)
    phases = gait.phases
    images = {"none": phases, "bilateral": 1 - phases, "antipodal": 0.5 + phases}[gait.symmetry]
    both = np.concatenate([phases, images])
    return np.unique(both[(both > 0) & (both < 1)])


def certify(solution: Solution, *, tolerance: float = 1e-6, instants: int | None = None) -> Certificate:
    """Replay the last level's gait on a much finer grid and measure everything a claim of success rests on.

    Parameters
    ----------
    solution : Solution
    tolerance : float
        Relative error of the replayed efficiency; a replay that does not reach it fails its check.
    instants : int, optional
        Instants of the first replay grid; by default at least ten times the collocation points of a period.

    Raises
    ------
    NotConvergedError
        If the balance cannot be solved at some instant of the replay.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> colloc.certify(colloc.solve(problem, starts=1), tolerance=1e-7).passed
    True
    """
    problem = solution.problem
    path = gait_path(solution)
    if instants is None:
        instants = max(1600, 2 * int(np.ceil(5 * solution.mesh.n_point / problem.gait.fraction)))
    gait, delta = solution.gait, solution.delta_per_period
    return gait_certificate(
        problem, path, delta, corner_phases(gait), instants, tolerance,
        claimed=solution.efficiency, before=tuple(_optimality(solution)), after=(*_class(solution), *_mesh(solution)),
    )  # fmt: skip


def gait_certificate(
    problem: Problem,
    path: Path | MixedPath,
    delta: float,
    breaks: np.ndarray,
    instants: int = 1600,
    tolerance: float = 1e-6,
    *,
    claimed: float | None = None,
    before: tuple[Check, ...] = (),
    after: tuple[Check, ...] = (),
) -> Certificate:
    """The certificate of any gait, found in whatever way, by its replay at three deltas.

    Parameters
    ----------
    problem : Problem
        Whose body, friction and joint limit are meant.
    path : callable
        The gait's angles and rates, and of a relaxed gait shares (`colloc.verification.replay`).
    delta : float
        Per period.
    breaks : (n,)
        Phases where the rates jump.
    instants, tolerance
        Of the replay, see `certify`.
    claimed : float, optional
        An efficiency that the replay has to confirm.
    before, after : tuple of Check
        What else has to hold.
    """

    def replayed_at(part: float, near: Replay | None) -> Replay:
        return replay(
            problem.body, problem.friction, path, part * delta, instants=instants, tolerance=tolerance, breaks=breaks, near=near
        )

    fine = replayed_at(1.0, None)
    at_tenth = replayed_at(0.1, fine)
    replays = fine, at_tenth, replayed_at(0.01, at_tenth)
    errors = [each.efficiency * (each.error + each.turning + each.ambiguity) for each in replays]
    limit = extrapolated_limit([replayed.efficiency for replayed in replays], errors)
    checks = (
        *before,
        *_motion(problem, path, fine, breaks, tolerance, claimed),
        _one_motion(problem, fine),
        *after,
        *_delta(problem, fine, limit.value),
    )
    return Certificate(
        checks,
        fine.efficiency,
        fine.distance,
        fine.work,
        errors[0],
        limit.value,
        fine.instants,
        limit.error,
        distance_error=fine.distance_error + fine.turning * fine.distance + fine.other_distance,
        work_error=fine.work_error + fine.other_work,
    )


def _optimality(solution: Solution) -> list[Check]:
    level = solution.last
    _, now = solution.at_points()
    residual = np.abs(now.force).max() / solution.problem.friction.largest
    return [
        Check("KKT error", max(level.kkt_error, level.complementarity), KKT, "gradient of the Lagrangian, complementarity"),
        Check("constraint violation", level.violation, VIOLATION, "largest violated equation or bound"),
        Check("balance at nodes", float(residual), RESIDUAL, "net force and torque by the closed-form law"),
    ]


def _motion(
    problem: Problem, path: Path | MixedPath, fine: Replay, breaks: np.ndarray, tolerance: float, claimed: float | None
) -> list[Check]:
    body, ends = problem.body, path(np.array([0.0, 1.0]))[0]
    angles = path(np.union1d(np.linspace(0.0, 1.0, _FINE_PHASES + 1), breaks))[0]
    beyond = max(float(body.largest_angles(angles).max()) - problem.joint_limit, 0.0)
    depth = max(float(body.crossing_depth(angles).max()), body.passing_depth(angles))
    checks = [
        Check("balance in replay", fine.residual, RESIDUAL, "net force and torque at all replayed instants"),
        Check("closure", float(np.abs(ends[:, 1] - ends[:, 0]).max()), CLOSURE, "joint angles after one period [rad]"),
        Check("net rotation", fine.turning, ROTATION, "over a period, times the body's reach over the distance"),
        Check(body.usual.limit_name, beyond, body.usual.excess, "excess between nodes [rad]"),
        Check("self-contact", depth, ADMISSIBLE, "penetration of links between nodes [body lengths]"),
    ]
    if claimed is not None:
        gap = _beyond(claimed / fine.efficiency - 1, fine.ambiguity)
        checks.append(Check("replay gap", gap, GAP, "collocated over replayed efficiency, less 1"))
    return [
        *checks,
        Check("replay error", fine.error, tolerance, "relative: its quadrature and balance; allowed as asked for"),
        Check("work = dissipation", fine.actuator_work / fine.work - 1, WORK, "work of the joints over friction, less 1"),
    ]


def _beyond(value: float, unknown: float) -> float:
    """The part of a difference that something of unknown sign does not explain."""
    return float(np.copysign(max(abs(value) - unknown, 0.0), value))


def _one_motion(problem: Problem, fine: Replay) -> Check:
    """How far the efficiency depends on which of several balanced motions the body takes."""
    if problem.friction.isotropic:
        meaning = "relative; equal coefficients leave one balanced motion"
    elif not problem.body.looks_for_all_velocities:
        meaning = "relative; other balanced motions of a smooth body are not looked for"
    elif fine.several == 0:
        meaning = f"relative; no other balanced motion was found at {fine.instants} instants"
    else:
        meaning = f"relative; several motions are balanced at {fine.several:.2g} of the period"
    return Check("one motion", fine.ambiguity, MOTIONS, meaning)


_BESIDE = 1e-10


def _largest_jump(gait: ArcPath) -> float:
    """Largest jump of the angles of a free path where its arcs meet and where a symmetry continues it."""
    seams = np.concatenate([gait.edges, 1 - gait.edges, 0.5 + gait.edges])
    seams = seams[(seams > _BESIDE) & (seams < 1 - _BESIDE)]
    jump = np.linalg.norm(gait.angles(seams + _BESIDE) - gait.angles(seams - _BESIDE), axis=0).max()
    return float(max(jump - 2 * _BESIDE * gait.length, 0.0))


def _class(solution: Solution) -> list[Check]:
    """How far a free path bends more than its class allows, from the directions of its rates alone."""
    gait = solution.gait
    if not isinstance(gait, ArcPath):
        return []
    t = np.linspace(0.0, 1.0, _FINE_PHASES + 1)
    tangent = gait.rates(t) / gait.length
    turn = 2 * np.arcsin(0.5 * np.linalg.norm(np.diff(tangent), axis=0))
    curvature = float(turn.max()) * _FINE_PHASES / gait.length
    excess = max(curvature / solution.problem.gait.curvature - 1, 0.0)
    return [
        Check("joins", _largest_jump(gait), VIOLATION, "jump of the joint angles where arcs or symmetric halves meet [rad]"),
        Check("curvature", excess, CURVATURE, "of the path between nodes, relative excess over its bound"),
    ]


def _mesh(solution: Solution) -> list[Check]:
    """The error estimate from the scheme's own defect; it has to pass only if the problem requests an accuracy."""
    problem = solution.problem
    tolerance = problem.mesh_tolerance
    if tolerance == 0:
        return []
    error = mesh_error(problem, solution.mesh, solution.gait, solution.delta_per_period, tolerance)
    return [Check("mesh error", error.estimate, tolerance, "of the efficiency, relative, from defects between nodes")]


def _delta(problem: Problem, fine: Replay, at_zero: float) -> list[Check]:
    allowed = problem.body.usual.delta_influence
    return [Check("delta influence", at_zero / fine.efficiency - 1, allowed, "same gait at delta -> 0, relative change")]
