"""Evaluation of a given gait: replayed, certified except for optimality, and a solution like any
other."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from colloc.dynamics.control_problem import ControlProblem, control_problem
from colloc.gaits.coupled import Coupled
from colloc.gaits.fitted_gait import FittedGait, Given, Uncertainty, fitted_gait
from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.mechanics.contact import crossing_depth
from colloc.mechanics.densities import JointMap
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.reduced.motion import ReducedMotion
from colloc.reduced.program import SearchSpace
from colloc.results.answer import EVALUATED, Answer
from colloc.results.checks import UNCERTIFIED
from colloc.results.solution import Solution
from colloc.search.certify import certify, goes_nowhere
from colloc.search.confirm import answer_of_iterate
from colloc.search.iterate import evaluate_at
from colloc.search.options import OPTIONS, TOLERANCES
from colloc.smooth.prescribed_body import schedule
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.verification.refinement import plan_mesh

_PHASES = 256
_ROUGHLY = 1.25
"""Allowance for the mesh, which is made for the smoothed gait."""
_DRAWN = 4
"""Random changes of a series that are tried, each both ways."""


def evaluate(
    problem: Problem,
    gait: Given,
    *,
    period: float | None = None,
    harmonics: int | None = None,
    degrees: bool = False,
) -> Solution:
    """Evaluate joint angles, measured or invented, on the body and the ground of a problem.

    The angles are closed and smoothed (`colloc.gaits.fitted_gait.fitted_gait`), replayed and
    certified; optimality is not asked for. The gait may turn the body.

    Parameters
    ----------
    problem : Problem
        Body, friction, limits and objective; its class of gaits is left out.
    gait : any gait, array, path of a CSV file, or callable
        Joint angles: a series, ``(n_joint, n_time)`` at equal steps of a period, an xarray
        DataArray with a dimension "joint" and one of times, a file with a column of times, or a
        function of phases ``(n_time,)``.
    period, harmonics, degrees
        See `colloc.gaits.fitted_gait.fitted_gait`.

    Returns
    -------
    Solution
        Of a class of as many harmonics as the gait has. Its message says what was read and how far
        the angles were smoothed; its errors include two standard deviations of the samples
        (`Certificate.of_samples`).

    Raises
    ------
    ProblemError
        If the gait cannot be read, has other joints than the body, or the problem is one on a slope
        or of a prescribed motion.

    Examples
    --------
    >>> import colloc
    >>> mine = colloc.evaluate(colloc.Problem("mine"), colloc.ellipse(A0=0, A1=1.5, B1=1.0))
    >>> mine.success, round(mine.efficiency, 3)
    (True, 0.123)
    """
    begin = time.monotonic()
    if problem.regime.slides:
        raise ProblemError(
            "on a slope a gait goes where its body points: follow it with colloc.slope_motion."
        )
    if schedule(problem.body):
        raise ProblemError(f"{problem.name} is a prescribed motion: it has no other gaits.")
    fitted = fitted_gait(
        getattr(gait, "motor_gait", gait),
        problem.n_motor,
        period=period,
        harmonics=harmonics,
        degrees=degrees,
    )
    if fitted.centre:
        _check_centre(problem, fitted, gait)
    # refuses one that does not say a pace which the problem leaves open
    problem.regime.at(fitted.gait)
    solution = _evaluate_fit(problem, fitted)
    solution.seconds = time.monotonic() - begin
    return solution


def _check_centre(problem: Problem, fitted: FittedGait, given: Given) -> None:
    """Refuse servo angles about a right angle: all joints bent alike, and links that cross."""
    phases = np.arange(_PHASES) / _PHASES
    angles, _ = problem.joint_path(*fitted.gait(phases))
    if float(crossing_depth(problem.body, angles).max()) > TOLERANCES.kkt:
        raise ProblemError(
            f"{given}: all joints move about {fitted.centre}°, where links cross: if servos stand "
            f"so when the body is "
            "straight, subtract it from every column of angles."
        )


def _evaluate_fit(problem: Problem, fitted: FittedGait) -> Solution:
    gait_class: AnyClass = Harmonic(fitted.gait.n_harmonic)
    gait: AnyGait = fitted.gait
    if isinstance(problem.gait, Coupled):
        gait_class = replace(problem.gait, gait=gait_class)
        gait = gait_class.driven_by(gait, problem.body.n_joint)
    length = 2 * math.pi * gait.shape_speed
    if gait.shape_speed < problem.smallest_shape_speed:
        raise ProblemError(
            f"the gait hardly moves: its shape speed {gait.shape_speed:.3g} is below "
            f"smallest_shape_speed "
            f"{problem.smallest_shape_speed:g}, where friction is viscous."
        )
    delta = problem.delta * (length if problem.gait.relative_delta else 1.0)
    usual = {"guess": None, "delta_start": None, "intervals": None}
    stated = problem.with_(gait=gait_class, rotation=None, delta=delta, **usual)
    answer = _answer(stated, gait)
    turned = answer.motion.rotation
    if abs(turned) < TOLERANCES.replay_gap * answer.distance:
        if not problem.uses("rotation"):  # which then may be anything
            stated = stated.with_(rotation=0.0)
            answer = replace(answer, problem=stated)
    else:  # how far it goes is then the chord of its arc
        stated = stated.with_(rotation=turned)
        answer = _answer(stated, gait)
    if goes_nowhere(answer):
        said = (
            "It goes nowhere for its work, so there is no value to certify: is it one that "
            "retraces its path?"
        )
        return Solution(stated, answer, message=f"{fitted.describe()}. {said}")
    certificate, said = UNCERTIFIED, ""
    try:
        certificate = certify(answer)
        failures = ", ".join(
            f"{check.name} {check.value:.1e} (allowed {check.threshold:.0e})"
            for check in certificate.failures
        )
        said = f" It fails: {failures}." if failures else ""
    except NotConvergedError as error:
        said = f" The replay failed: {error}"
    if fitted.uncertainty is not None and certificate.replayed:
        errors, missed = _errors_of_samples(answer, fitted.gait, fitted.uncertainty)
        if errors[0] > certificate.value_error:
            what = (
                f"{problem.objective.short} uncertain by {errors[0]:.1e} (two standard "
                f"deviations{missed})"
            )
            said = f" Samples that far off leave {what}.{said}"
        certificate = certificate.with_samples(errors)
    return Solution(stated, answer, certificate, message=f"{fitted.describe()}.{said}")


def _answer(problem: Problem, gait: AnyGait) -> Answer:
    """The gait on a mesh that meets the problem's tolerance; on a first mesh if it goes nowhere."""
    begin = time.perf_counter()
    control = control_problem(problem)
    parameters = control.admissible.parameters(gait)
    member, mesh, message = control.admissible.member(parameters), control.mesh(), ""
    first, answer = mesh, _answer_on_mesh(control, mesh, parameters)
    meshes = OPTIONS.meshes if problem.mesh_tolerance > 0 and not goes_nowhere(answer) else 0
    for _ in range(meshes):
        plan = plan_mesh(control, mesh, member, problem.delta, problem.mesh_tolerance)
        if plan is None:
            break
        mesh = Mesh(scheme(plan.scheme), plan.edges)
        message = "" if plan.reached else f"the mesh is accurate to {plan.estimate:.0e} only."
    if mesh is not first:
        answer = _answer_on_mesh(control, mesh, parameters)
    answer = replace(answer, message=message, seconds=time.perf_counter() - begin)
    return replace(answer, history=(answer.step,))


def _answer_on_mesh(control: ControlProblem, mesh: Mesh, parameters: np.ndarray) -> Answer:
    space = SearchSpace(control, mesh.edges, mesh.scheme.name, full=parameters)
    iterate = evaluate_at(space, np.empty(0), control.problem.delta)
    return replace(answer_of_iterate(iterate), status=EVALUATED, program=EVALUATED)


def _errors_of_samples(
    answer: Answer, gait: Fourier, samples: Uncertainty
) -> tuple[tuple[float, ...], str]:
    """Errors (two standard deviations) of value, efficiency, distance and work from samples, and
    the part due to lack of fit, in words.

    The covariance of the fit goes through the gradients of the collocated motion. Near an optimum
    these vanish and second order counts: typical changes of the series are tried, both ways. Lack
    of fit is what a series of more harmonics changes.
    """
    control, richer = control_problem(answer.problem), samples.richer
    highest = max(
        gait.n_harmonic, samples.directions.shape[2] // 2, richer.n_harmonic if richer else 0
    )
    # where the gait of the answer begins
    later = math.atan2(gait.sin[0, 0], gait.cos[0, 0]) / (2 * math.pi)
    phases, wide = answer.mesh.times + later, Harmonic(highest)
    series = _Series(
        np.stack([wide.functions(phases), wide.functions(phases, 1)]), answer.problem.joint_map
    )
    aims, delta = control.aims, answer.problem.delta
    motion = ReducedMotion(control.dynamics, answer.mesh, series, aims.integrals)
    scale = np.array([control.stated(1.0), 1 / control.unit, 1.0, control.unit])

    def values(v: np.ndarray) -> np.ndarray:
        period = motion.values(v, delta)
        return scale * [
            aims.objective(period),
            EFFICIENCY(period),
            period["distance"],
            period["work"],
        ]

    v = gait.resize(highest).table.ravel()
    known, period, slopes = values(v), motion.values(v, delta), motion.gradients(v, delta)
    by_aim = [
        aim.gradient(period, slopes) + np.zeros_like(v) for aim in (aims.objective, EFFICIENCY)
    ]
    gradients = scale[:, None] * [*by_aim, slopes["distance"], slopes["work"]]
    changes = np.zeros((len(samples.directions), gait.n_joint, 2 * highest + 1))
    changes[:, :, : samples.directions.shape[2]] = samples.directions
    changes = changes.reshape(len(changes), -1)
    noise = np.linalg.norm(gradients @ changes.T, axis=1)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (_DRAWN, len(changes)))
    bent = [0.5 * (values(v + change) + values(v - change)) - known for change in signs @ changes]
    noise = samples.factor * (noise + np.abs(bent).max(axis=0))
    lack, missed = np.zeros(4), ""
    if richer is not None:
        lack = np.abs(values(richer.resize(highest).table.ravel()) - known)
        missed = (
            f", and lack of fit: {richer.n_harmonic} harmonics would change it by {lack[0]:.1e}"
        )
    # the mesh was made for a smoother gait
    return tuple(np.nan_to_num(noise + _ROUGHLY * lack, nan=np.inf).tolist()), missed


class _Series(NamedTuple):
    """Fourier series by their coefficients, on the points of a mesh; `functions` ``(2, 2 K + 1,
    n_point)`` are the basis and its derivatives."""

    functions: np.ndarray
    joint_map: JointMap | None = None

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        angles, rates = v.reshape(-1, self.functions.shape[1]) @ self.functions
        if self.joint_map is not None:
            angles, rates = self.joint_map.joint_angles(angles), self.joint_map.joint_rates(rates)
        return angles, rates, np.ones(self.functions.shape[2])

    def vjp(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        both = on_shape.reshape(*on_shape.shape[:2], 2, -1)
        if self.joint_map is not None:
            both = both @ self.joint_map.matrix
        return np.einsum("ktdj,dwt->kjw", both, self.functions).reshape(len(both), -1)
