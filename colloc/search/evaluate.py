"""Evaluation of a given gait: replayed, certified except for optimality, and a solution like any
other."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from colloc.dynamics.control_problem import control_problem
from colloc.gaits.coupled import Coupled
from colloc.gaits.fitted_gait import Given, Uncertainty, fitted_gait
from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth
from colloc.mechanics.densities import JointMap
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.reduced.motion import ReducedMotion
from colloc.reduced.program import SearchSpace
from colloc.results.answer import EVALUATED, Answer
from colloc.results.checks import UNCERTIFIED
from colloc.results.solution import Solution, direction_of_travel
from colloc.search.certify import certify, goes_nowhere
from colloc.search.confirm import answer_of_iterate
from colloc.search.iterate import evaluate_at
from colloc.search.options import OPTIONS, TOLERANCES, settings
from colloc.smooth.prescribed_body import schedule
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.verification.mesh_error import plan_mesh


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
        Joint angles: a series, ``(n_joint, n_time)`` at equal steps of a cycle, an xarray
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
        body=problem.body if isinstance(problem.body, Chain) and not problem.joint_map else None,
    )
    series = fitted.gait
    # servo angles about a right angle: all joints bent alike, and links that cross
    if fitted.centre:
        angles, _ = problem.joint_path(*series(np.arange(256) / 256))
        if float(crossing_depth(problem.body, angles).max()) > TOLERANCES.kkt:
            raise ProblemError(
                f"{gait}: all joints move about {fitted.centre}°, where links cross: if servos "
                f"stand so when the body is straight, subtract it from every column of angles."
            )
    if problem.regime.free is not None:
        raise ProblemError(
            "a gait is evaluated at one pace, by an objective without the period: "
            "state froude=0.05 (a robot: one cycle), and such an objective."
        )
    stated, driven = with_motors(problem, series)
    if driven.shape_speed < (least := problem.smallest_shape_speed):
        raise ProblemError(
            f"the gait hardly moves: its shape speed {driven.shape_speed:.3g} is below "
            f"smallest_shape_speed {least:g}, where friction is viscous."
        )
    answer = on_fine_mesh(stated, driven)
    turned = answer.motion.rotation
    if abs(turned) < TOLERANCES.replay_gap * answer.distance:
        if not problem.uses("rotation"):  # which then may be anything
            stated = stated.with_(rotation=0.0)
            answer = replace(answer, problem=stated)
    else:  # how far it goes is then the chord of its arc
        stated = stated.with_(rotation=turned)
        answer = on_fine_mesh(stated, driven)
    certificate, said = UNCERTIFIED, ""
    if goes_nowhere(answer):
        said = " It has no net displacement, so there is nothing to certify: does it "
        said += "retrace its path?"
    else:
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
        errors, missed = _errors_of_samples(answer, series, fitted.uncertainty)
        if errors[0] > certificate.value_error:
            name = problem.objective.short
            what = f"{name} uncertain by {errors[0]:.1e} (two standard deviations{missed})"
            said = f" This residual leaves {what}.{said}"
        certificate = certificate.with_samples(errors)
    message = f"{fitted.describe()}.{said}"
    solution = Solution(stated, answer, certificate, message=message, settings=settings())
    if fitted.path is not None and fitted.went and certificate.replayed:
        solution.message += (
            f" The points went {fitted.went:.3g} body lengths per cycle, "
            f"{direction_of_travel(*fitted.path)}; predicted {certificate.distance:.3g} +- "
            f"{certificate.errors['distance']:.0e}, {solution.travels}."
        )
    solution.seconds = time.monotonic() - begin
    return solution


def with_motors(problem: Problem, motors: Fourier) -> tuple[Problem, AnyGait]:
    """The problem of series of as many harmonics, and the gait there of such motors."""
    gait_class: AnyClass = Harmonic(motors.n_harmonic)
    gait: AnyGait = motors
    if isinstance(problem.gait, Coupled):
        gait_class = replace(problem.gait, gait=gait_class)
        gait = gait_class.driven_by(motors, problem.body.n_joint)
    delta = problem.delta * (2 * math.pi * gait.shape_speed if problem.gait.relative_delta else 1.0)
    usual = {"guess": None, "delta_start": None, "intervals": None}
    return problem.with_(gait=gait_class, rotation=None, delta=delta, **usual), gait


def on_mesh(problem: Problem, gait: AnyGait, mesh: Mesh) -> Answer:
    """The motion of a gait on a mesh."""
    control = control_problem(problem)
    parameters = control.admissible.parameters(gait)
    space = SearchSpace(control, mesh.edges, mesh.scheme.name, full=parameters)
    answer = answer_of_iterate(evaluate_at(space, np.empty(0), problem.delta))
    return replace(answer, status=EVALUATED, program=EVALUATED)


def on_fine_mesh(problem: Problem, gait: AnyGait) -> Answer:
    """The gait on a mesh that meets the problem's tolerance; on a first mesh if it goes nowhere."""
    begin, control = time.perf_counter(), control_problem(problem)
    member = control.admissible.member(control.admissible.parameters(gait))
    mesh, message = control.mesh(), ""
    first, answer = mesh, on_mesh(problem, gait, mesh)
    meshes = OPTIONS.meshes if problem.mesh_tolerance > 0 and not goes_nowhere(answer) else 0
    for _ in range(meshes):
        plan = plan_mesh(control, mesh, member, problem.delta, problem.mesh_tolerance)
        if plan is None:
            break
        mesh = Mesh(scheme(plan.scheme), plan.edges)
        message = "" if plan.reached else f"the mesh is accurate to {plan.estimate:.0e} only."
    if mesh is not first:
        answer = on_mesh(problem, gait, mesh)
    answer = replace(answer, message=message, seconds=time.perf_counter() - begin)
    return replace(answer, history=(answer.step,))


def _errors_of_samples(
    answer: Answer, gait: Fourier, samples: Uncertainty
) -> tuple[tuple[float, ...], str]:
    """Errors (two standard deviations) of value, efficiency, distance and work from samples, and
    the part due to lack of fit, in words.

    The covariance of the fit goes through the gradients of the collocated motion. Near an optimum
    these vanish and second order counts: four typical changes of the series are tried, both ways.
    Lack of fit is what a series of more harmonics changes; a quarter more of it, as the mesh was
    made for a smoother gait.
    """
    control, richer = control_problem(answer.problem), samples.richer
    n_rows = samples.directions.shape[2]
    highest = max(gait.n_harmonic, n_rows // 2, richer.n_harmonic if richer else 0)
    # where the gait of the answer begins
    later = math.atan2(gait.sin[0, 0], gait.cos[0, 0]) / (2 * math.pi)
    phases, wide = answer.mesh.times + later, Harmonic(highest)
    functions = np.stack([wide.functions(phases, derivative) for derivative in range(3)])
    aims, delta = control.aims, answer.problem.delta
    shapes = _Series(functions, answer.problem.joint_map)
    motion = ReducedMotion(control.dynamics, answer.mesh, shapes, aims.integrals)
    scale = np.array([control.unscale(1.0), 1 / control.unit, 1.0, control.unit])

    def values(v: np.ndarray) -> np.ndarray:
        period = motion.values(v, delta)
        both = aims.objective(period), EFFICIENCY(period)
        return scale * [*both, period["distance"], period["work"]]

    v = gait.resize(highest).table.ravel()
    known, period, slopes = values(v), motion.values(v, delta), motion.gradients(v, delta)
    by_aim = [
        aim.gradient(period, slopes) + np.zeros_like(v) for aim in (aims.objective, EFFICIENCY)
    ]
    gradients = scale[:, None] * [*by_aim, slopes["distance"], slopes["work"]]
    changes = np.zeros((len(samples.directions), gait.n_joint, 2 * highest + 1))
    changes[:, :, :n_rows] = samples.directions
    changes = changes.reshape(len(changes), -1)
    noise = np.linalg.norm(gradients @ changes.T, axis=1)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (4, len(changes)))
    bent = [0.5 * (values(v + change) + values(v - change)) - known for change in signs @ changes]
    noise = samples.factor * (noise + np.abs(bent).max(axis=0))
    lack, missed = np.zeros(4), ""
    if richer is not None:
        lack = np.abs(values(richer.resize(highest).table.ravel()) - known)
        more = f"{richer.n_harmonic} harmonics would change it by {lack[0]:.1e}"
        missed = f", and lack of fit: {more}"
    return tuple(np.nan_to_num(noise + 1.25 * lack, nan=np.inf).tolist()), missed


class _Series(NamedTuple):
    """Fourier series by their coefficients, on the points of a mesh; `functions` ``(3, 2 K + 1,
    n_point)`` are the basis and its derivatives."""

    functions: np.ndarray
    joint_map: JointMap | None = None

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        angles, rates = v.reshape(-1, self.functions.shape[1]) @ self.functions[:2]
        if self.joint_map is not None:
            angles, rates = self.joint_map.joint_angles(angles), self.joint_map.joint_rates(rates)
        return angles, rates, np.ones(self.functions.shape[2])

    def vjp(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        both = on_shape.reshape(*on_shape.shape[:2], 2, -1)
        if self.joint_map is not None:
            both = both @ self.joint_map.matrix
        return np.einsum("ktdj,dwt->kjw", both, self.functions[:2]).reshape(len(both), -1)

    def accelerations(self, v: np.ndarray, t: np.ndarray) -> np.ndarray:
        return v.reshape(-1, self.functions.shape[1]) @ self.functions[2]

    def accelerations_vjp(self, v: np.ndarray, on_points: np.ndarray) -> np.ndarray:
        return np.einsum("kjt,wt->kjw", on_points, self.functions[2]).reshape(len(on_points), -1)
