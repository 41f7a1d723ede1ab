"""The certificate: an independent replay of a gait, and its first- and second-order conditions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from colloc.dynamics.control_problem import control_problem
from colloc.gaits.problem import Problem
from colloc.gaits.robot import under_one_limit
from colloc.mechanics.chain import BALANCED, Chain
from colloc.mechanics.contact import crossing_depth, passing_depth
from colloc.results.answer import EVALUATED, Answer
from colloc.results.checks import BACKLASH, Certificate, Check, astray, measure
from colloc.search.options import TOLERANCES
from colloc.verification.adaptive_motion import Path, Replay
from colloc.verification.mesh_error import mesh_error
from colloc.verification.replay import replayer

Row = tuple[str, float, float, str]  # of a `Check`


def is_trivial(answer: Answer) -> bool:
    """True for a gait that goes nowhere and does not turn, as a retraced one."""
    problem = answer.problem
    if problem.regime.slides:
        return answer.value / control_problem(problem).unscale(1.0) < TOLERANCES.zero_value
    return goes_nowhere(answer) and not abs(answer.rotation) > TOLERANCES.angle


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
        Instants of the first replay grid; by default many times the collocation points of a cycle.

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
    problem, gait, at = answer.problem, answer.gait, TOLERANCES
    if instants is None:
        usual = problem.body.defaults
        each = 0.5 * usual.instants_a_point / problem.fraction
        instants = max(usual.instants, 2 * int(np.ceil(each * answer.mesh.n_point)))
    before, after, speed = list[Row](), list[Row](), answer.delta_per_period
    if answer.program != EVALUATED:
        residual = float(np.abs(answer.at_points.force).max() / problem.law.largest)
        gradient, second = max(answer.kkt_error, answer.complementarity), answer.second_order
        value = max(-second.smallest - second.error, 0.0)
        curvature = f"smallest curvature {second.smallest:.1e}"
        directions = f"over {second.n_free} free direction{'s' * (second.n_free != 1)} [1/rad^2]"
        if second.why_not:
            value, verdict = 0.0, second.why_not
        elif second.n_free == 0:
            verdict = "a vertex: active constraints leave no free direction [1/rad^2]"
        elif second.smallest > second.error:
            verdict = f"an optimum: {curvature} {directions}"
        elif value > at.saddle:
            verdict = f"a saddle: {curvature} {directions}"
        else:
            verdict = f"flat: {curvature} +- {second.error:.0e} {directions}"
        violation = answer.violation, at.violation, "largest violated equation or bound"
        by_law = "net force and torque by the closed-form law"
        before = [
            ("KKT error", gradient, at.kkt, "gradient of the Lagrangian, complementarity"),
            ("constraint violation", *violation),
            ("balance at nodes", residual, at.kkt, by_law),
            ("second order", value, at.saddle, verdict),
        ]
    if problem.mesh_tolerance > 0:
        control, allowed = control_problem(problem), problem.mesh_tolerance
        error = mesh_error(control, answer.mesh, gait, speed, allowed).estimate
        meaning = f"of the {problem.objective.name}, relative, from defects between nodes"
        after = [("mesh error", error, allowed, meaning)]
    return gait_certificate(
        *(problem, gait, speed, gait.corner_phases, instants, tolerance),
        claimed=answer.value,
        before=before,
        after=after,
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
    before: Iterable[Row] = (),
    after: Iterable[Row] = (),
) -> Certificate:
    """The certificate of any gait, by its replay at three deltas, with further checks before and
    after: of a path of angles and rates, whose rates jump at phases `breaks`, and of a `claimed`
    value of the objective."""
    fine, measured = measure(
        *(problem.body, problem.law, path, delta),
        tolerance=tolerance,
        instants=instants,
        breaks=breaks,
        rotation=problem.rotation,
        quantities=problem.integrals,
        limits=problem.path_limits,
        run=replayer(problem.regime),
        objective=problem.objective,
    )
    rows = [*before, *_rows(problem, path, fine, breaks, tolerance, claimed), *after]
    influence = measured.value_at_zero_delta / fine.value - 1
    meaning = "same gait at delta -> 0, relative change"
    rows.append(("delta influence", influence, problem.body.defaults.delta_influence, meaning))
    return replace(measured, checks=tuple(Check(*row) for row in rows))


def _rows(
    problem: Problem,
    path: Path,
    fine: Replay,
    breaks: np.ndarray,
    tolerance: float,
    claimed: float | None,
) -> Iterator[Row]:
    body, at, usual = problem.body, TOLERANCES, problem.body.defaults
    ends = path(np.array([0.0, 1.0]))[0]
    angles, rates = path(np.union1d(np.linspace(0.0, 1.0, 20001), breaks))
    balanced = "net force and torque at all replayed time points"
    if problem.froude:
        balanced = "change of the momenta over a cycle"
    yield "balance in replay", fine.residual, at.kkt, balanced
    opened, meaning = float(np.abs(ends[:, 1] - ends[:, 0]).max()), "s after one cycle [rad]"
    yield "closure", opened, at.closure, f"{usual.quantity}{meaning}"
    if problem.rotation is not None:
        which = f"beyond {problem.rotation:g} rad" if problem.rotation else "over a cycle"
        meaning = f"{which}, times the body's reach over the distance"
        by_rotation = astray(fine, problem.rotation) / max(fine.distance, 1e-300)
        yield "net rotation", by_rotation, at.replay_gap, meaning
    stretched, limit = under_one_limit(angles, problem.joint_limit)
    excess = max(float(body.bounded_angles.largest(stretched).max()) - limit, 0.0)
    yield usual.limit_name, excess, usual.excess, "excess between nodes [rad]"
    depth = max(float(crossing_depth(body, angles).max()), passing_depth(body, angles))
    yield "self-contact", depth, at.kkt, "penetration of links between nodes [body lengths]"
    if problem.largest_speeds:
        joints = problem.joint_map
        motors = rates if joints is None else joints.motor_rates(rates)
        share = np.abs(motors).max(axis=1) / np.array(problem.largest_speeds)
        name = f"{'motor' if joints else usual.coordinate} {int(share.argmax()) + 1}"
        meaning = f"excess over a limit, relative; closest: {name}"
        yield "joint speed", max(float(share.max()) - 1.0, 0.0), at.replay_gap, meaning
    if problem.robot is not None and problem.robot.backlash:
        share = problem.robot.backlash / max(float(np.ptp(angles, axis=1).max()), 1e-300)
        meaning = "play of a joint over the angle by which the joint that moves most moves"
        yield BACKLASH, share, 1.0, meaning
    lean = 0.0
    if isinstance(body, Chain) and body.largest_imbalance > BALANCED:
        lean = float(body.imbalance(angles).max())
    if lean > BALANCED:
        meaning = "way from the centre of mass to where its weights press [body lengths]; "
        # the body is no longer than that
        yield "statics", lean, 1.0, f"{meaning}reported, not judged"
    if fine.multipliers:
        meaning = "largest Floquet multiplier: share of a small momentum change left after a cycle"
        yield "stability", float(np.abs(fine.multipliers).max()), 1.0, meaning
    if claimed is not None:
        gap = claimed / fine.value - 1
        # the part that the motions that differ do not explain
        unexplained = float(np.copysign(max(abs(gap) - fine.ambiguity, 0.0), gap))
        meaning = "collocated over replayed efficiency, less 1"
        yield "replay gap", unexplained, at.replay_gap, meaning
    meaning = "relative: quadrature and balance; tolerance as requested"
    yield "replay error", fine.error, tolerance, meaning
    meaning = f"work of the joints over {problem.regime.spent}, less 1"
    yield "work = dissipation", fine.actuator_work / fine.work - 1, at.work_balance, meaning
    for aim, least in problem.at_least:
        missed = max(least - aim(fine.values), 0.0) / (abs(least) or 1.0)
        meaning = f"relative, below {least:g}, in replay"
        yield f"least {aim.name}", missed, at.replay_gap, meaning
    if names := problem.path_limits.names:
        nearest = names[np.argmax(fine.shares)]
        meaning = f"excess over a limit, relative, in replay; closest: {nearest}"
        yield "actuators", max(float(fine.shares.max()) - 1.0, 0.0), at.replay_gap, meaning
    if problem.regime.towards is not None:
        meaning = "direction of travel, off the requested one [rad]"
        yield "direction", fine.across / fine.distance, at.angle, meaning
    # change of the objective by other balanced motions: where the law leaves it open no mesh
    # decides it, and as much is allowed as delta may change
    if problem.regime.slides and not problem.regime.froude:
        meaning = "part of the cycle at which several motions are balanced; what they would "
        meaning += "change is not measured"
        yield "one motion", fine.several, at.nonunique_fraction, meaning
        return
    if problem.regime.froude:
        meaning = "between the motions that follow from slow motion and from rest"
    elif problem.law.associated:
        meaning = "the law leaves one balanced motion"
    elif not isinstance(body, Chain):
        meaning = "other balanced motions of a smooth body are not looked for"
    elif fine.several == 0:
        meaning = f"no other balanced motion was found at {fine.instants} time points"
    else:
        meaning = f"several motions are balanced at {fine.several:.2g} of the cycle"
    yield "one motion", fine.ambiguity, usual.delta_influence, f"relative; {meaning}"
