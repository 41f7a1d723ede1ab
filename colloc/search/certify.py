"""The certificate: an independent replay of a gait, and its first- and second-order conditions."""

from __future__ import annotations

import numpy as np

from colloc.dynamics.control_problem import control_problem
from colloc.gaits.limits import under_one_limit
from colloc.gaits.problem import Problem
from colloc.mechanics.chain import BALANCED, Chain
from colloc.mechanics.contact import crossing_depth, passing_depth
from colloc.results.answer import EVALUATED, Answer
from colloc.results.checks import Certificate, Check
from colloc.results.measured import astray, measured
from colloc.search.options import TOLERANCES
from colloc.verification.adaptive_motion import Path, Replay
from colloc.verification.mesh_error import mesh_error
from colloc.verification.replay import replayer

_FINE_PHASES = 20000


def is_trivial(answer: Answer) -> bool:
    """True for a gait that goes nowhere and does not turn, as a retraced one."""
    problem = answer.problem
    if problem.regime.slides:
        return control_problem(problem).in_units(answer.value) < TOLERANCES.zero_value
    return goes_nowhere(answer) and not abs(answer.motion.rotation) > TOLERANCES.angle


def goes_nowhere(answer: Answer) -> bool:
    """True if the distance on level ground is negligible for the work; the gait may turn."""
    return abs(answer.efficiency) * answer.problem.law.smallest < TOLERANCES.zero_value


def certify(answer: Answer, *, tolerance: float = 1e-6, instants: int | None = None) -> Certificate:
    """Replay an answer's gait on a much finer grid and measure everything a claim of success rests
    on.

    Parameters
    ----------
    answer : Answer
        `Solution.answer`.
    tolerance : float
        Relative error of the replayed objective; a replay that does not reach it fails its check.
    instants : int, optional
        Instants of the first replay grid; by default many times the collocation points of a period.

    Returns
    -------
    Certificate

    Raises
    ------
    NotConvergedError
        If the balance cannot be solved at some instant of the replay.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> colloc.certify(colloc.solve(problem, starts=1).answer, tolerance=1e-7).passed
    True
    """
    problem, gait = answer.problem, answer.gait
    if instants is None:
        usual = problem.body.defaults
        each = 0.5 * usual.instants_a_point / problem.fraction
        instants = max(usual.instants, 2 * int(np.ceil(each * answer.mesh.n_point)))
    is_optimum = answer.program != EVALUATED
    return gait_certificate(
        problem,
        gait,
        answer.delta_per_period,
        gait.corner_phases,
        instants,
        tolerance,
        claimed=answer.value,
        before=(*_first_order(answer), _second_order(answer)) if is_optimum else (),
        after=_mesh_error(answer),
    )


def gait_certificate(
    problem: Problem,
    path: Path,
    delta: float,
    breaks: np.ndarray,
    instants: int = 1600,
    tolerance: float = 1e-6,
    *,
    claimed: float | None = None,
    before: tuple[Check, ...] = (),
    after: tuple[Check, ...] = (),
) -> Certificate:
    """The certificate of any gait, by its replay at three deltas.

    Parameters
    ----------
    problem : Problem
        Body, friction and limits.
    path : callable
        Angles and rates of the gait (`colloc.verification.replay`).
    delta : float
        Per period.
    breaks : (n,)
        Phases where the rates jump.
    instants, tolerance
        Of the replay, see `certify`.
    claimed : float, optional
        A value of the problem's objective that the replay has to confirm.
    before, after : tuple of Check
        Further checks.
    """
    result = measured(
        problem.body,
        problem.law,
        path,
        delta,
        tolerance=tolerance,
        instants=instants,
        breaks=breaks,
        rotation=problem.rotation,
        quantities=problem.integrals,
        limits=problem.path_limits,
        run=replayer(problem.regime),
        objective=problem.objective,
    )
    fine, efficiency, value = result.fine, result.efficiency, result.value
    influence = Check(
        "delta influence",
        value.limit.value / fine.value - 1,
        problem.body.defaults.delta_influence,
        "same gait at delta -> 0, relative change",
    )
    return Certificate(
        values=fine.values,
        errors=result.errors,
        others={},
        checks=(
            *before,
            *_motion(problem, path, fine, breaks, tolerance, claimed),
            *_requirements(problem, fine),
            _one_motion(problem, fine),
            *after,
            influence,
        ),
        instants=fine.instants,
        efficiency_error=efficiency.error,
        efficiency_at_zero_delta=efficiency.limit.value,
        error_at_zero_delta=efficiency.limit.error,
        value=fine.value,
        value_error=value.error,
        value_at_zero_delta=value.limit.value,
        value_error_at_zero_delta=value.limit.error,
    )


def _first_order(answer: Answer) -> tuple[Check, ...]:
    residual = np.abs(answer.motion.at_points.force).max() / answer.problem.law.largest
    return (
        Check(
            "KKT error",
            max(answer.kkt_error, answer.complementarity),
            TOLERANCES.kkt,
            "gradient of the Lagrangian, complementarity",
        ),
        Check(
            "constraint violation",
            answer.violation,
            TOLERANCES.violation,
            "largest violated equation or bound",
        ),
        Check(
            "balance at nodes",
            float(residual),
            TOLERANCES.kkt,
            "net force and torque by the closed-form law",
        ),
    )


def _second_order(answer: Answer) -> Check:
    second = answer.second_order
    if second.why_not:
        return Check("second order", 0.0, TOLERANCES.saddle, second.why_not)
    value = max(-second.smallest - second.error, 0.0)
    curvature = f"smallest curvature {second.smallest:.1e}"
    directions = f"in {second.n_free} free directions"
    if second.n_free == 0:
        verdict = "a vertex: what binds leaves no direction free"
    elif second.smallest > second.error:
        verdict = f"an optimum: {curvature} {directions}"
    elif value > TOLERANCES.saddle:
        verdict = f"a saddle: {curvature} {directions}"
    else:
        verdict = f"flat: {curvature} +- {second.error:.0e} {directions}"
    return Check("second order", value, TOLERANCES.saddle, f"{verdict} [1/rad^2]")


def _motion(
    problem: Problem,
    path: Path,
    fine: Replay,
    breaks: np.ndarray,
    tolerance: float,
    claimed: float | None,
) -> list[Check]:
    body, ends = problem.body, path(np.array([0.0, 1.0]))[0]
    angles, rates = path(np.union1d(np.linspace(0.0, 1.0, _FINE_PHASES + 1), breaks))
    stretched, limit = under_one_limit(angles, problem.joint_limit)
    excess = max(float(body.bounded_angles.largest(stretched).max()) - limit, 0.0)
    depth = max(float(crossing_depth(body, angles).max()), passing_depth(body, angles))
    balanced = "net force and torque at all replayed instants"
    if problem.froude:
        balanced = "what a period changes of the momenta"
    checks = [
        Check("balance in replay", fine.residual, TOLERANCES.kkt, balanced),
        Check(
            "closure",
            float(np.abs(ends[:, 1] - ends[:, 0]).max()),
            TOLERANCES.closure,
            f"{body.defaults.quantity}s after one period [rad]",
        ),
        *_rotation(problem, fine),
        Check(body.defaults.limit_name, excess, body.defaults.excess, "excess between nodes [rad]"),
        Check(
            "self-contact",
            depth,
            TOLERANCES.kkt,
            "penetration of links between nodes [body lengths]",
        ),
        *_speeds(problem, rates),
    ]
    lean = float(body.imbalance(angles).max()) if isinstance(body, Chain) else 0.0
    if lean > BALANCED:
        meaning = (
            "way from the centre of mass to where its weights press [body lengths]; "
            "reported, not judged"
        )
        checks.append(Check("statics", lean, 1.0, meaning))  # the body is no longer than that
    if fine.multipliers:
        meaning = (
            "largest Floquet multiplier: what a period leaves of a small change of the momenta"
        )
        checks.append(Check("stability", float(np.abs(fine.multipliers).max()), 1.0, meaning))
    if claimed is not None:
        gap = claimed / fine.value - 1
        # the part that the motions that differ do not explain
        unexplained = float(np.copysign(max(abs(gap) - fine.ambiguity, 0.0), gap))
        meaning = "collocated over replayed efficiency, less 1"
        checks.append(Check("replay gap", unexplained, TOLERANCES.replay_gap, meaning))
    return [
        *checks,
        Check(
            "replay error",
            fine.error,
            tolerance,
            "relative: its quadrature and balance; allowed as asked for",
        ),
        Check(
            "work = dissipation",
            fine.actuator_work / fine.work - 1,
            TOLERANCES.work_balance,
            f"work of the joints over {problem.regime.spent}, less 1",
        ),
    ]


def _rotation(problem: Problem, fine: Replay) -> list[Check]:
    if problem.rotation is None:
        return []
    which = f"beyond {problem.rotation:g} rad" if problem.rotation else "over a period"
    meaning = f"{which}, times the body's reach over the distance"
    value = astray(fine, problem.rotation) / max(fine.distance, 1e-300)
    return [Check("net rotation", value, TOLERANCES.replay_gap, meaning)]


def _speeds(problem: Problem, rates: np.ndarray) -> list[Check]:
    if not problem.largest_speeds:
        return []
    joints = problem.joint_map
    motors = rates if joints is None else joints.motor_rates(rates)
    share = np.abs(motors).max(axis=1) / np.array(problem.largest_speeds)
    name = f"{'motor' if joints else problem.body.defaults.coordinate} {int(share.argmax()) + 1}"
    return [
        Check(
            "joint speed",
            max(float(share.max()) - 1.0, 0.0),
            TOLERANCES.replay_gap,
            f"excess over a limit, relative; nearest to its own: {name}",
        )
    ]


def _requirements(problem: Problem, fine: Replay) -> list[Check]:
    """Values that have to be reached, limits of the actuators, the direction on a slope."""
    checks = [
        Check(
            f"least {aim.name}",
            max(least - aim(fine.values), 0.0) / (abs(least) or 1.0),
            TOLERANCES.replay_gap,
            f"relative, below {least:g}, in replay",
        )
        for aim, least in problem.at_least
    ]
    if names := problem.path_limits.names:
        nearest = names[np.argmax(fine.shares)]
        meaning = f"excess over a limit, relative, in replay; nearest to its own: {nearest}"
        excess = max(float(fine.shares.max()) - 1.0, 0.0)
        checks.append(Check("actuators", excess, TOLERANCES.replay_gap, meaning))
    if problem.regime.towards is not None:
        meaning = "of the way, off the one that was asked for [rad]"
        checks.append(Check("direction", fine.across / fine.distance, TOLERANCES.angle, meaning))
    return checks


def _one_motion(problem: Problem, fine: Replay) -> Check:
    """Change of the objective by other balanced motions: where the law leaves it open no mesh
    decides it, and as much is allowed as delta may change."""
    if problem.regime.slides and not problem.regime.froude:
        meaning = (
            "part of the period at which several motions are balanced; what they would "
            "change is not measured"
        )
        return Check("one motion", fine.several, TOLERANCES.nonunique_fraction, meaning)
    if problem.regime.froude:
        meaning = "between the motions that follow from slow motion and from rest"
    elif problem.law.associated:
        meaning = "the law leaves one balanced motion"
    elif not isinstance(problem.body, Chain):
        meaning = "other balanced motions of a smooth body are not looked for"
    elif fine.several == 0:
        meaning = f"no other balanced motion was found at {fine.instants} instants"
    else:
        meaning = f"several motions are balanced at {fine.several:.2g} of the period"
    allowed = problem.body.defaults.delta_influence
    return Check("one motion", fine.ambiguity, allowed, f"relative; {meaning}")


def _mesh_error(answer: Answer) -> tuple[Check, ...]:
    problem, tolerance = answer.problem, answer.problem.mesh_tolerance
    if tolerance == 0:
        return ()
    error = mesh_error(
        control_problem(problem), answer.mesh, answer.gait, answer.delta_per_period, tolerance
    )
    meaning = f"of the {problem.objective.name}, relative, from defects between nodes"
    return (Check("mesh error", error.estimate, tolerance, meaning),)
