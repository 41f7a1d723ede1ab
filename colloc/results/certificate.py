"""The certificate: every solve is judged by an independent replay and by its own first-order conditions."""

from __future__ import annotations

import numpy as np

from colloc.gaits.limits import under_one_limit
from colloc.gaits.problem import Problem
from colloc.results.checks import Certificate, Check
from colloc.results.measured import astray, measured
from colloc.results.solution import Solution
from colloc.results.steps import REALISED
from colloc.verification.mesh_error import mesh_error
from colloc.verification.replay import MixedPath, Path, Replay

KKT, VIOLATION, RESIDUAL, CLOSURE, ROTATION, ADMISSIBLE, GAP, WORK = 1e-6, 1e-8, 1e-6, 1e-9, 1e-4, 1e-6, 1e-4, 1e-7
"""Largest values that pass. ROTATION: the distance of a body that turns depends on the point of it that is followed, to first
order; so the rotation is limited by what it changes there, to as much as collocation may be wrong by (GAP). What delta may
change is the body's own (`colloc.mechanics.bodies.Usual`)."""
MOTIONS = 1e-2
"""Where the law leaves the motion open, no mesh decides it: as much as the other limit of the law, delta, may change."""

ASTRAY, SEVERAL = 1e-3, 1e-3
"""On a slope: angle off the direction that was asked for; part of the period at which the motion is left open."""

SADDLE, FLAT, NEAR = 1e-2, 1e-4, 1e-2
"""Curvatures of the objective over its value [1/rad^2]: a saddle rises by so much, as a tenth of a radian along it gains
5e-5, what the mesh may be wrong by; less than FLAT is called flat. NEAR: largest gradient at which they mean anything."""
_MOST_PARAMETERS = 150

_FINE_PHASES = 20000


def certify(
    solution: Solution, *, tolerance: float = 1e-6, instants: int | None = None, second_order: Check | None = None
) -> Certificate:
    """Replay the last level's gait on a much finer grid and measure everything a claim of success rests on.

    Parameters
    ----------
    solution : Solution
    tolerance : float
        Relative error of the replayed objective; a replay that does not reach it fails its check.
    instants : int, optional
        Instants of the first replay grid; by default many times the collocation points of a period.
    second_order : Check, optional
        The check of second order, where it was made before: it is the only one that needs CasADi.

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
    problem = solution.resolved
    if instants is None:
        usual = problem.body.usual
        each = 0.5 * usual.instants_a_point / problem.gait.fraction
        instants = max(usual.instants, 2 * int(np.ceil(each * solution.mesh.n_point)))
    gait = solution.gait
    at = problem, gait, solution.delta_per_period, gait.corner_phases, instants, tolerance
    if solution.last.program == REALISED:  # it need not be an optimum, nor is it collocated to be measured by that
        return gait_certificate(*at)
    return gait_certificate(
        *at,
        claimed=solution.value,
        before=(*_optimality(solution), second_order or _second_order(solution)),
        after=(*_class(solution), *_mesh(solution)),
    )


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
        A value of the problem's objective that the replay has to confirm.
    before, after : tuple of Check
        What else has to hold.
    """

    settings = {"tolerance": tolerance, "instants": instants, "breaks": breaks, "rotation": problem.rotation}
    settings |= {"driven": problem.uses("driven_work"), "limits": problem.actuator_limits, "slope": problem.slope}
    known = measured(problem.body, problem.friction, path, delta, **settings, objective=problem.objective)  # type: ignore[arg-type]
    fine = known.fine
    checks = (
        *before,
        *_motion(problem, path, fine, breaks, tolerance, claimed),
        *_reached(problem, fine),
        *_actuators(problem, fine),
        *_direction(problem, fine),
        _one_motion(problem, fine),
        *after,
        *_delta(problem, fine, known.limit.value),
    )
    return Certificate(
        checks,
        fine.efficiency,
        fine.distance,
        fine.work,
        known.efficiency_error,
        known.efficiency_limit.value,
        fine.instants,
        known.efficiency_limit.error,
        known.distance_error,
        known.work_error,
        fine.value,
        known.value_error,
        known.limit.value,
        known.limit.error,
        fine.rotation,
        fine.length,
        fine.driven_work,
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


def _second_order(solution: Solution) -> Check:
    """Whether the gait is a local optimum and no other critical point, in the space of its class."""
    problem, level = solution.resolved, solution.last
    if not problem.gait.free:
        return Check("second order", 0.0, SADDLE, "nothing is free in a prescribed motion")
    from colloc.reduced.program import ReducedProgram  # these load CasADi
    from colloc.reduced.second_order import curvature
    from colloc.reduced.spaces import space_near

    space, v = space_near(problem, solution.gait, level.edges, level.scheme)
    space = space.with_far(problem.body.far_pairs)
    program = ReducedProgram(space, level.delta)
    program.place_rows(v)
    if v.size > _MOST_PARAMETERS:
        return Check("second order", 0.0, SADDLE, f"not measured, for {v.size} parameters")
    found = curvature(program, v)
    size = abs(level.value)
    least, error = found.smallest / size, found.error / size
    value = max(-least - error, 0.0)
    if not found.kkt_error < NEAR * size:
        return Check("second order", 0.0, SADDLE, "not measured, where the gradient of the reduced program does not vanish")
    if found.n_free == 0:
        verdict = "a vertex: what binds leaves no direction free"
    elif least > max(error, FLAT):
        verdict = f"an optimum: smallest curvature {least:.1e} in {found.n_free} free directions"
    elif value > SADDLE:
        verdict = f"a saddle: smallest curvature {least:.1e} in {found.n_free} free directions"
    else:
        verdict = f"flat: smallest curvature {least:.1e} +- {error:.0e} in {found.n_free} free directions"
    return Check("second order", value, SADDLE, f"{verdict} [1/rad^2]")


def _motion(
    problem: Problem, path: Path | MixedPath, fine: Replay, breaks: np.ndarray, tolerance: float, claimed: float | None
) -> list[Check]:
    body, ends = problem.body, path(np.array([0.0, 1.0]))[0]
    angles = path(np.union1d(np.linspace(0.0, 1.0, _FINE_PHASES + 1), breaks))[0]
    stretched, limit = under_one_limit(angles, problem.joint_limit)
    beyond = max(float(body.largest_angles(stretched).max()) - limit, 0.0)
    depth = max(float(body.crossing_depth(angles).max()), body.passing_depth(angles))
    checks = [
        Check("balance in replay", fine.residual, RESIDUAL, "net force and torque at all replayed instants"),
        Check("closure", float(np.abs(ends[:, 1] - ends[:, 0]).max()), CLOSURE, f"{body.quantity}s after one period [rad]"),
        *_rotation(problem, fine),
        Check(body.usual.limit_name, beyond, body.usual.excess, "excess between nodes [rad]"),
        Check("self-contact", depth, ADMISSIBLE, "penetration of links between nodes [body lengths]"),
    ]
    if claimed is not None:
        gap = _beyond(claimed / fine.value - 1, fine.ambiguity)
        checks.append(Check("replay gap", gap, GAP, "collocated over replayed efficiency, less 1"))
    spent = "friction" if problem.slope is None else "friction and climb"
    return [
        *checks,
        Check("replay error", fine.error, tolerance, "relative: its quadrature and balance; allowed as asked for"),
        Check("work = dissipation", fine.actuator_work / fine.work - 1, WORK, f"work of the joints over {spent}, less 1"),
    ]


def _rotation(problem: Problem, fine: Replay) -> list[Check]:
    """The net rotation, where it is prescribed."""
    if problem.rotation is None:
        return []
    which = f"beyond {problem.rotation:g} rad" if problem.rotation else "over a period"
    value = astray(fine, problem.rotation) / max(fine.distance, 1e-300)
    return [Check("net rotation", value, ROTATION, f"{which}, times the body's reach over the distance")]


def _reached(problem: Problem, fine: Replay) -> list[Check]:
    """Values that have to be reached."""
    checks = []
    for aim, least in problem.at_least:
        lacks = max(least - aim(fine.period), 0.0) / max(abs(least), 1e-300)
        checks.append(Check(f"least {aim.name}", lacks, GAP, f"relative, below {least:g}, in replay"))
    return checks


def _actuators(problem: Problem, fine: Replay) -> list[Check]:
    """What the joints have to do, against what they can."""
    names = problem.actuator_limits.names
    if not names:
        return []
    most, excess = names[np.argmax(fine.shares)], max(float(fine.shares.max()) - 1.0, 0.0)
    return [Check("actuators", excess, GAP, f"excess over a limit, relative, in replay; nearest to its own: {most}")]


def _direction(problem: Problem, fine: Replay) -> list[Check]:
    """Where the way leads, if that is asked for."""
    if problem.towards is None:
        return []
    return [Check("direction", fine.across / fine.distance, ASTRAY, "of the way, off the one that was asked for [rad]")]


def _beyond(value: float, unknown: float) -> float:
    """The part of a difference that something of unknown sign does not explain."""
    return float(np.copysign(max(abs(value) - unknown, 0.0), value))


def _one_motion(problem: Problem, fine: Replay) -> Check:
    """How far the objective depends on which of several balanced motions the body takes."""
    if problem.slope is not None:
        meaning = "part of the period at which several motions are balanced; what they would change is not measured"
        return Check("one motion", fine.several, SEVERAL, meaning)
    if problem.friction.associated:
        meaning = "relative; the law leaves one balanced motion"
    elif not problem.body.looks_for_all_velocities:
        meaning = "relative; other balanced motions of a smooth body are not looked for"
    elif fine.several == 0:
        meaning = f"relative; no other balanced motion was found at {fine.instants} instants"
    else:
        meaning = f"relative; several motions are balanced at {fine.several:.2g} of the period"
    return Check("one motion", fine.ambiguity, MOTIONS, meaning)


def _class(solution: Solution) -> list[Check]:
    """What members of its class have to keep besides."""
    return [Check(*line) for line in solution.problem.gait.own_checks(solution.gait)]


def _mesh(solution: Solution) -> list[Check]:
    """The error estimate from the scheme's own defect; it has to pass only if the problem requests an accuracy."""
    problem = solution.resolved
    tolerance = problem.mesh_tolerance
    if tolerance == 0:
        return []
    error = mesh_error(problem, solution.mesh, solution.gait, solution.delta_per_period, tolerance)
    return [
        Check("mesh error", error.estimate, tolerance, f"of the {problem.objective.name}, relative, from defects between nodes")
    ]


def _delta(problem: Problem, fine: Replay, at_zero: float) -> list[Check]:
    allowed = problem.body.usual.delta_influence
    return [Check("delta influence", at_zero / fine.value - 1, allowed, "same gait at delta -> 0, relative change")]
