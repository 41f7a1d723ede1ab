"""The certificate: every solve is judged by an independent replay and by its own first-order
conditions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.gaits.control_problem import control_problem
from colloc.gaits.limits import under_one_limit
from colloc.gaits.problem import Problem
from colloc.gaits.starts import is_visible
from colloc.mechanics.chain import BALANCED
from colloc.results.answer import EVALUATED, Answer
from colloc.results.checks import UNCERTIFIED, Certificate, Check
from colloc.results.measured import astray, measured
from colloc.verification.mesh_error import mesh_error
from colloc.verification.played import Path, Replay
from colloc.verification.replay import replayer

EXACT, VIOLATION, CLOSURE, WORK = 1e-6, 1e-8, 1e-9, 1e-7
"""Largest values that pass of what holds but for rounding and the ends of iterations. EXACT:
gradient of the Lagrangian, balance of forces, penetration of links [body lengths]."""
GAP = 1e-4
"""As much as collocation may be wrong by, relative. The distance of a body that turns depends on
the point of it that is followed, to first order; so its rotation is limited by what that changes
there."""
ANGLE, SEVERAL = 1e-3, 1e-3
"""An angle that counts [rad]: on a slope off the direction that was asked for, or turned in a
period by a gait that goes nowhere. Part of the period at which the motion on a slope may be left
open."""
SADDLE = 1e-2
"""Curvature of the objective over its value [1/rad^2]: a saddle rises by so much, as a tenth of a
radian along it gains 5e-5, what the mesh may be wrong by."""
NOWHERE = 1e-4
"""Efficiency times the smallest friction coefficient (at most 1), or on a slope the value of the
objective in units of the friction, up to which a gait goes nowhere."""
_FINE_PHASES = 20000
_BALANCED = "net force and torque at all replayed instants", "what a period changes of the momenta"


class Certified(NamedTuple):
    """An answer with its certificate, which is `UNCERTIFIED` where no replay was possible or of
    use."""

    answer: Answer
    certificate: Certificate = UNCERTIFIED
    failure: str = ""
    """Why there was no replay."""

    @property
    def holds(self) -> bool:
        """Whether the first-order conditions and every check hold."""
        return self.answer.optimal and self.certificate.passed

    @property
    def is_finite(self) -> bool:
        """Whether a person sees the gait move."""
        return is_visible(self.answer.gait)


def is_trivial(answer: Answer) -> bool:
    """Whether a search ended in a gait that goes nowhere and does not turn, such as a retraced one:
    no optimum."""
    problem = answer.problem
    if problem.regime.slides:
        return control_problem(problem).in_units(answer.value) < NOWHERE
    if not goes_nowhere(answer):
        return False
    return not abs(answer.motion.rotation) > ANGLE


def goes_nowhere(answer: Answer) -> bool:
    """Whether what a gait on the level travels is nothing for its work; it may turn."""
    return abs(answer.efficiency) * answer.problem.law.smallest < NOWHERE


def certify(answer: Answer, *, tolerance: float = 1e-6, instants: int | None = None) -> Certificate:
    """Replay an answer's gait on a much finer grid and measure everything a claim of success rests
    on.

    Parameters
    ----------
    answer : Answer
        As `Solution.answer` has it.
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
        usual = problem.body.usual
        each = 0.5 * usual.instants_a_point / problem.gait.fraction
        instants = max(usual.instants, 2 * int(np.ceil(each * answer.mesh.n_point)))
    at = problem, gait, answer.delta_per_period, gait.corner_phases, instants, tolerance
    if answer.program == EVALUATED:
        return gait_certificate(*at, claimed=answer.value, after=tuple(_mesh(answer)))
    before = (*_first_order(answer), _second_order(answer))
    return gait_certificate(*at, claimed=answer.value, before=before, after=tuple(_mesh(answer)))


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
    """The certificate of any gait, found in whatever way, by its replay at three deltas.

    Parameters
    ----------
    problem : Problem
        Whose body, friction and joint limit are meant.
    path : callable
        The gait's angles and rates (`colloc.verification.replay`).
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

    settings = {
        "tolerance": tolerance,
        "instants": instants,
        "breaks": breaks,
        "rotation": problem.rotation,
    }
    run = replayer(problem.regime)
    settings |= {"quantities": problem.integrals, "limits": problem.path_limits, "run": run}
    known = measured(
        problem.body,
        problem.law,
        path,
        delta,
        **settings,  # type: ignore[arg-type]
        objective=problem.objective,
    )
    fine, at_zero, allowed = known.fine, known.value.limit.value, problem.body.usual.delta_influence
    checks = (
        *before,
        *_motion(problem, path, fine, breaks, tolerance, claimed),
        *_reached(problem, fine),
        *_actuators(problem, fine),
        *_direction(problem, fine),
        _one_motion(problem, fine),
        *after,
        Check(
            "delta influence",
            at_zero / fine.value - 1,
            allowed,
            "same gait at delta -> 0, relative change",
        ),
    )
    return Certificate(
        values=fine.values,
        errors=known.errors,
        others={},
        checks=checks,
        instants=fine.instants,
        efficiency_error=known.efficiency.error,
        efficiency_at_zero_delta=known.efficiency.limit.value,
        error_at_zero_delta=known.efficiency.limit.error,
        value=fine.value,
        value_error=known.value.error,
        value_at_zero_delta=at_zero,
        value_error_at_zero_delta=known.value.limit.error,
    )


def _first_order(answer: Answer) -> list[Check]:
    residual = np.abs(answer.motion.at_points.force).max() / answer.problem.law.largest
    return [
        Check(
            "KKT error",
            max(answer.kkt_error, answer.complementarity),
            EXACT,
            "gradient of the Lagrangian, complementarity",
        ),
        Check(
            "constraint violation",
            answer.violation,
            VIOLATION,
            "largest violated equation or bound",
        ),
        Check(
            "balance at nodes",
            float(residual),
            EXACT,
            "net force and torque by the closed-form law",
        ),
    ]


def _second_order(answer: Answer) -> Check:
    """Whether the gait is a local optimum and no other critical point, in the space of its
    class."""
    found = answer.second_order
    if found.why_not:
        return Check("second order", 0.0, SADDLE, found.why_not)
    value = max(-found.smallest - found.error, 0.0)
    if found.n_free == 0:
        verdict = "a vertex: what binds leaves no direction free"
    elif found.smallest > found.error:
        verdict = (
            f"an optimum: smallest curvature {found.smallest:.1e} in {found.n_free} free directions"
        )
    elif value > SADDLE:
        verdict = (
            f"a saddle: smallest curvature {found.smallest:.1e} in {found.n_free} free directions"
        )
    else:
        verdict = (
            f"flat: smallest curvature {found.smallest:.1e} +- {found.error:.0e} in "
            f"{found.n_free} free directions"
        )
    return Check("second order", value, SADDLE, f"{verdict} [1/rad^2]")


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
    beyond = max(float(body.largest_angles(stretched).max()) - limit, 0.0)
    depth = max(float(body.crossing_depth(angles).max()), body.passing_depth(angles))
    checks = [
        Check("balance in replay", fine.residual, EXACT, _BALANCED[bool(problem.froude)]),
        Check(
            "closure",
            float(np.abs(ends[:, 1] - ends[:, 0]).max()),
            CLOSURE,
            f"{body.quantity}s after one period [rad]",
        ),
        *_rotation(problem, fine),
        Check(body.usual.limit_name, beyond, body.usual.excess, "excess between nodes [rad]"),
        Check("self-contact", depth, EXACT, "penetration of links between nodes [body lengths]"),
        *_speeds(problem, rates),
    ]
    if (lean := float(body.imbalance(angles).max())) > BALANCED:
        beside = (
            "way from the centre of mass to where its weights press [body lengths]; "
            "reported, "
            "not judged"
        )
        checks.append(Check("statics", lean, 1.0, beside))  # the body is no longer than that
    if fine.multipliers:
        meaning = (
            "largest Floquet multiplier: what a period leaves of a small change of the momenta"
        )
        checks.append(Check("stability", float(np.abs(fine.multipliers).max()), 1.0, meaning))
    if claimed is not None:
        gap = _beyond(claimed / fine.value - 1, fine.ambiguity)
        checks.append(Check("replay gap", gap, GAP, "collocated over replayed efficiency, less 1"))
    spent = problem.regime.spent
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
            WORK,
            f"work of the joints over {spent}, less 1",
        ),
    ]


def _speeds(problem: Problem, rates: np.ndarray) -> list[Check]:
    """The fastest joint, against what its motor can do."""
    if not problem.largest_speeds:
        return []
    joints = problem.joint_map
    motors = rates if joints is None else joints.motor_rates(rates)
    share = np.abs(motors).max(axis=1) / np.array(problem.largest_speeds)
    excess, fastest = (
        max(float(share.max()) - 1.0, 0.0),
        f"{'motor' if joints else problem.body.coordinate} {int(share.argmax()) + 1}",
    )
    return [
        Check(
            "joint speed",
            excess,
            GAP,
            f"excess over a limit, relative; nearest to its own: {fastest}",
        )
    ]


def _rotation(problem: Problem, fine: Replay) -> list[Check]:
    """The net rotation, where it is prescribed."""
    if problem.rotation is None:
        return []
    which = f"beyond {problem.rotation:g} rad" if problem.rotation else "over a period"
    value = astray(fine, problem.rotation) / max(fine.distance, 1e-300)
    return [Check("net rotation", value, GAP, f"{which}, times the body's reach over the distance")]


def _reached(problem: Problem, fine: Replay) -> list[Check]:
    """Values that have to be reached."""
    checks = []
    for aim, least in problem.at_least:
        lacks = max(least - aim(fine.values), 0.0) / (abs(least) or 1.0)
        checks.append(
            Check(f"least {aim.name}", lacks, GAP, f"relative, below {least:g}, in replay")
        )
    return checks


def _actuators(problem: Problem, fine: Replay) -> list[Check]:
    """What the joints have to do, against what they can."""
    names = problem.path_limits.names
    if not names:
        return []
    most, excess = names[np.argmax(fine.shares)], max(float(fine.shares.max()) - 1.0, 0.0)
    return [
        Check(
            "actuators",
            excess,
            GAP,
            f"excess over a limit, relative, in replay; nearest to its own: {most}",
        )
    ]


def _direction(problem: Problem, fine: Replay) -> list[Check]:
    """Where the way leads, if that is asked for."""
    if not problem.regime.keeps_ahead:
        return []
    return [
        Check(
            "direction",
            fine.across / fine.distance,
            ANGLE,
            "of the way, off the one that was asked for [rad]",
        )
    ]


def _beyond(value: float, unknown: float) -> float:
    """The part of a difference that something of unknown sign does not explain."""
    return float(np.copysign(max(abs(value) - unknown, 0.0), value))


def _one_motion(problem: Problem, fine: Replay) -> Check:
    """How far the objective depends on which of several balanced motions the body takes: where the
    law leaves it open, no mesh decides it, and as much is allowed as the law's other limit, delta,
    may change."""
    if not problem.regime.others_measured:
        meaning = (
            "part of the period at which several motions are balanced; what they would "
            "change is not measured"
        )
        return Check("one motion", fine.several, SEVERAL, meaning)
    if problem.regime.others:
        meaning = f"relative; between the motions {problem.regime.others}"
    elif problem.law.associated:
        meaning = "relative; the law leaves one balanced motion"
    elif not problem.body.looks_for_all_velocities:
        meaning = "relative; other balanced motions of a smooth body are not looked for"
    elif fine.several == 0:
        meaning = f"relative; no other balanced motion was found at {fine.instants} instants"
    else:
        meaning = f"relative; several motions are balanced at {fine.several:.2g} of the period"
    return Check("one motion", fine.ambiguity, problem.body.usual.delta_influence, meaning)


def _mesh(answer: Answer) -> list[Check]:
    """The error estimate from the scheme's own defect; it has to pass only if the problem requests
    an accuracy."""
    problem = answer.problem
    tolerance = problem.mesh_tolerance
    if tolerance == 0:
        return []
    error = mesh_error(
        control_problem(problem), answer.mesh, answer.gait, answer.delta_per_period, tolerance
    )
    return [
        Check(
            "mesh error",
            error.estimate,
            tolerance,
            f"of the {problem.objective.name}, relative, from defects between nodes",
        )
    ]
