"""Given gaits: replayed, certified except for optimality, and solutions like any other; and the
coefficients of friction under which a body whose joint angles were measured goes the measured way.

For those the motion is solved for; origin and direction of the measured axes follow in closed form.
What is left is least squares on logarithms x of the coefficients over the stated ones. Errors are
those of the residuals, as many as are independent, and of the samples of the joint angles.
"""

from __future__ import annotations

import math
import os
import re
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy  # loads `optimize` and `special` where they are used

from colloc.dynamics.control_problem import control_problem
from colloc.gaits.coupled import Coupled
from colloc.gaits.fitted_gait import (
    COVERED,
    FittedGait,
    Given,
    Uncertainty,
    correlation_time,
    fitted_gait,
)
from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.parameters import COEFFICIENTS, parameters
from colloc.gaits.problem import Problem
from colloc.gaits.record import FEWEST, HEADINGS, Column, Record
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth
from colloc.mechanics.densities import JointMap
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.reduced.motion import ReducedMotion
from colloc.reduced.program import SearchSpace
from colloc.results.answer import EVALUATED, Answer
from colloc.results.checks import UNCERTIFIED
from colloc.results.motion import lab_outline
from colloc.results.solution import Solution, direction_of_travel
from colloc.search.certify import certify, goes_nowhere
from colloc.search.confirm import answer_of_iterate
from colloc.search.iterate import evaluate_at
from colloc.search.options import OPTIONS, TOLERANCES, settings
from colloc.smooth.smooth_body import schedule
from colloc.system.arguments import check_finite
from colloc.system.environment import higher
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.verification.mesh_error import plan_mesh


def _fit_gait(
    problem: Problem, gait: Given, period: float | None, harmonics: int | None, degrees: bool
) -> FittedGait:
    body = problem.body if isinstance(problem.body, Chain) and not problem.joint_map else None
    return fitted_gait(
        gait, problem.n_motor, period=period, harmonics=harmonics, degrees=degrees, body=body
    )


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
    fitted = _fit_gait(problem, getattr(gait, "motor_gait", gait), period, harmonics, degrees)
    series = fitted.gait
    # servo angles about a right angle: all joints bent alike, and links that cross
    if fitted.centre:
        angles, _ = problem.joint_path(*series(np.arange(256) / 256))
        if float(crossing_depth(problem.body, angles).max()) > TOLERANCES.kkt:
            raise ProblemError(
                f"{gait}: all joints move about {fitted.centre}°, where links cross: if servos "
                f"stand so when the body is straight, subtract it from every column of angles."
            )
    problem, at_pace = _at_pace_of(problem, fitted)
    if problem.regime.free is not None:
        raise ProblemError(
            "a gait is evaluated at one pace, by an objective without the period: state "
            "froude=0.05 (a robot: one period, or a record's times in s), and such an objective."
        )
    problem, driven = with_motors(problem, series)
    if driven.shape_speed < (least := problem.smallest_shape_speed):
        raise ProblemError(
            f"the gait hardly moves: its shape speed {driven.shape_speed:.3g} is below "
            f"smallest_shape_speed {least:g}, where friction is viscous."
        )
    answer = on_fine_mesh(problem, driven)
    rotation = answer.rotation
    if abs(rotation) < TOLERANCES.replay_gap * answer.distance:
        if not problem.uses("rotation"):  # which then may be anything
            problem = problem.with_(rotation=0.0)
            answer = replace(answer, problem=problem)
    else:  # how far it goes is then the chord of its arc
        problem = problem.with_(rotation=rotation)
        answer = on_fine_mesh(problem, driven)
    certificate, remark = UNCERTIFIED, ""
    if goes_nowhere(answer):
        what = "there is nothing to certify: does it retrace its path?"
        remark = f" It has no net displacement, so {what}"
    else:
        try:
            certificate = certify(answer)
            remark = f" It fails: {certificate.missed}." if certificate.missed else ""
        except NotConvergedError as error:
            remark = f" The replay failed: {error}"
    if fitted.uncertainty is not None and certificate.replayed:
        errors, missed = _errors_of_samples(answer, series, fitted.uncertainty)
        if errors[0] > certificate.value_error:
            name = problem.objective.short
            what = f"{name} uncertain by {errors[0]:.1e} (two standard deviations{missed})"
            remark = f" This residual leaves {what}.{remark}"
        certificate = certificate.with_samples(errors)
    message = f"{fitted.describe()}{at_pace}.{remark}"
    solution = Solution(problem, answer, certificate, message=message, settings=settings())
    if fitted.path is not None and fitted.went and certificate.replayed:
        solution.message += (
            f" The points went {fitted.went:.3g} body lengths per cycle, "
            f"{direction_of_travel(*fitted.path)}; predicted {certificate.distance:.3g} +- "
            f"{certificate.errors['distance']:.0e}, {solution.travels}."
        )
    solution.seconds = time.monotonic() - begin
    return solution


def _at_pace_of(problem: Problem, fitted: FittedGait) -> tuple[Problem, str]:
    robot, seconds = problem.robot, fitted.seconds
    if not robot or not seconds or np.isclose(robot.period, seconds, rtol=1e-3).all():
        return problem, ""
    return problem.with_(robot=replace(robot, period=seconds)), f"; at its {seconds:.4g} s a cycle"


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
        if plan.reached:  # as the gait stays where it is
            message = ""
            break
        message = f"the mesh is accurate to {plan.estimate:.0e} only."
    if mesh is not first:
        answer = on_mesh(problem, gait, mesh)
    answer = replace(answer, message=message, seconds=time.perf_counter() - begin)
    return replace(answer, history=(answer.step,))


def _start_phase(motors: Fourier) -> float:
    """Phase of a series at which its answer begins (`Harmonic.parameters`)."""
    return math.atan2(motors.sin[0, 0], motors.cos[0, 0]) / (2 * math.pi)


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
    phases, wide = answer.mesh.times + _start_phase(gait), Harmonic(highest)
    functions = np.stack([wide.functions(phases, derivative) for derivative in range(3)])
    aims, delta = control.aims, answer.problem.delta
    shapes = _Series(functions, answer.problem.joint_map)
    motion = ReducedMotion(control.dynamics, answer.mesh, shapes, aims.integrals)
    scale = np.array([control.unscale(1.0), 1 / control.unit, 1.0, control.unit])

    def values(v):
        period = motion.values(v, delta)
        both = aims.objective(period), EFFICIENCY(period)
        return scale * [*both, period["distance"], period["work"]]

    v = gait.resize(highest).table.ravel()
    totals, period, slopes = values(v), motion.values(v, delta), motion.gradients(v, delta)
    by_aim = [
        aim.gradient(period, slopes) + np.zeros_like(v) for aim in (aims.objective, EFFICIENCY)
    ]
    gradients = scale[:, None] * [*by_aim, slopes["distance"], slopes["work"]]
    changes = np.zeros((len(samples.directions), gait.n_joint, 2 * highest + 1))
    changes[:, :, :n_rows] = samples.directions
    changes = changes.reshape(len(changes), -1)
    noise = np.linalg.norm(gradients @ changes.T, axis=1)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (4, len(changes)))
    bent = [0.5 * (values(v + change) + values(v - change)) - totals for change in signs @ changes]
    noise = samples.factor * (noise + np.abs(bent).max(axis=0))
    lack, missed = np.zeros(4), ""
    if richer is not None:
        lack = np.abs(values(richer.resize(highest).table.ravel()) - totals)
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


_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "rad": 1.0, "deg": np.pi / 180, "°": np.pi / 180}
_POINTS = {"tail": 0, "centre": 1, "center": 1, "head": 2}
_ACCURACY = 1e-5  # of the motion [body lengths]
_STEP = 2e-2  # of x in differences: with smaller ones slipping wheels are kinks, not slopes
_VAGUE, _HELD = 3.0, 1e-2
"""Standard deviations of x before anything is measured, and of what the motion does not tell."""
_FARTHEST = math.log(100.0)  # largest x
_UNTOLD = 0.5  # standard deviation of x from which the motion does not tell it
_MISSED, _ALIKE = 0.1, 3.0
"""Residual over the extent of the path, and like samples in a row, from which no coefficients
explain it."""
_PART = 0.3  # of the largest change, that is named


@dataclass(frozen=True, eq=False)
class Identification:
    problem: Problem = field(repr=False)  # with this friction
    coefficients: dict[str, tuple[float, float]]
    """Values and errors, two standard deviations; these are infinite where the motion does not tell
    a coefficient, and 0 where it is as stated."""
    before: float
    """Root mean square distance of the predicted path from the measured one with the stated
    coefficients [body lengths; rad if there are headings alone]."""
    after: float  # with the identified ones
    remarks: tuple[str, ...]  # what the motion does not tell
    message: str  # what was read

    @property
    def line(self) -> str:
        """For the problem file."""
        body: Any = self.problem.body
        feet, text = getattr(body, "feet", ()), f"friction={self.problem.friction!r}"
        if any(foot.friction is not None for foot in feet):
            plain = tuple(replace(foot, weight=None) for foot in feet)  # said if they differ
            text = f"feet={plain if replace(body, feet=plain).feet == feet else feet!r}"
            text = re.sub(r", (weight=None|(offset|angle|extent)=0\.0)\b", "", text)
        return re.sub(r"\d+\.\d{7,}", lambda x: f"{float(x[0]):.6g}", text)

    def facts(self) -> dict[str, Any]:
        """Plain numbers (JSON); None for an error that is infinite."""
        finite = {x: [v, e if e < math.inf else None] for x, (v, e) in self.coefficients.items()}
        plain = {name: getattr(self, name) for name in ("before", "after", "remarks", "message")}
        return {"coefficients": finite, **plain, "line": self.line}

    def __str__(self) -> str:
        text: str = higher("pictures:render")("identified.txt", result=self, isfinite=math.isfinite)
        return text.rstrip("\n")


def identify(
    problem: Problem,
    record: str | os.PathLike[str],
    *,
    length: float | None = None,
    mu_forward: float | None = None,
    period: float | None = None,
    harmonics: int | None = None,
    degrees: bool = False,
) -> Identification:
    """Identify coefficients of friction from measured joint angles and the way that a body went.

    Slow motion under dry friction tells ratios of coefficients alone: the forward one is taken as
    stated. With inertia all of them are found.

    Parameters
    ----------
    problem : Problem
        Body and law of friction; the search begins at its coefficients.
    record : path of a CSV file
        Times and joint angles as for `colloc.evaluate`, over one or more periods, and places: x, y
        of the centre of mass, head_x, head_y, tail_x, tail_y; perhaps the direction of the tail
        link, theta, yaw or heading, or head_theta. Or markers at all ends and joints, which tell
        the angles too. Axes may lie anywhere, y to the left of x.
    length : float, optional
        Of the body [m], if places are in m or, by their names, cm or mm; by default that of the
        problem's robot. Without any they are in body lengths.
    mu_forward : float, optional
        The forward coefficient as measured otherwise, where motion tells ratios alone; by default
        the stated one.
    period, harmonics, degrees
        See `colloc.evaluate`.

    Returns
    -------
    Identified
        Its `problem` has the friction that was found, `coefficients` has values and errors.

    Raises
    ------
    ProblemError
        If the record cannot be read or holds no path, or the problem is one on a slope, of a
        prescribed motion, or under a law without coefficients.
    NotConvergedError
        If the motion cannot be computed.

    Examples
    --------
    A record as of a robot on a floor that one does not know:

    >>> import tempfile, colloc
    >>> gait, floor = colloc.ellipse(A0=0.3, A1=1.6, B1=1.1), colloc.Problem("floor", delta=1e-3)
    >>> carpet = floor.with_(friction=colloc.Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3))
    >>> record = tempfile.mkdtemp() + "/record.csv"
    >>> colloc.evaluate(carpet, gait).to_dataframe()[::10].to_csv(record)
    >>> colloc.identify(floor, record).problem.friction
    Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
    """
    if problem.regime.slides or schedule(problem.body):
        raise ProblemError(
            f"{problem.name} is no gait on the level: state a problem of such gaits."
        )
    if length is None:
        length = getattr(problem.robot, "length", None)
    if length is not None:
        check_finite(positive=True, length=length)
    fitted = _fit_gait(problem, path := Path(record), period, harmonics, degrees)
    read: Any = fitted.record
    problem, at_pace = _at_pace_of(problem, fitted)
    if problem.regime.free is not None:
        raise ProblemError("coefficients are identified at one pace: state one period or froude.")
    measured, used = _measured(path, read, length)
    fit = _Fit(problem.without_robot, measured, fitted.gait, read.time / fitted.period)
    if mu_forward is not None:
        check_finite(positive=True, mu_forward=mu_forward)
        if not fit.only_ratios:
            raise ProblemError(
                "with inertia the motion determines all coefficients: leave mu_forward out."
            )
        fit.nominal *= mu_forward / fit.nominal[fit.forward]
    x, best, noise = np.zeros(len(fit.free)), math.inf, fit.noise
    before = fit.rms(fit.off(x))
    for begin in (0.0, 0.7, -0.7):  # of logarithms: squares may have several minima
        trial = np.full(x.size, begin)
        for _ in range(2):  # then with the noise of places and of headings
            trial = fit.best(trial)
        if (after := fit.rms(fit.off(trial))) < best:
            x, best, noise = trial, after, fit.noise
        if best <= _MISSED * fit.extent:
            break
    fit.noise = noise
    alike, covariance = fit.covariance(x, fitted.uncertainty)
    squares, directions = np.linalg.eigh(covariance) if x.size else (x, covariance)
    untold = directions.T[squares > _UNTOLD**2]
    if untold.size:
        fit.prior = np.vstack([fit.prior, untold / _HELD])
        x = fit.best(0 * x)
    deviations, errors = np.sqrt(np.diag(covariance)), np.zeros(len(fit.names))
    errors[fit.free] = np.where(deviations < _UNTOLD, deviations, np.inf)
    values, after = fit.values(x), fit.rms(fit.off(x))
    errors *= values * float(scipy.special.stdtrit(max(fit.freedom / alike, 1.0), COVERED))
    remarks = [fit.describe(direction) for direction in untold]
    if fit.only_ratios:
        remarks.append(
            f"Slow motion determines only ratios: a common factor, here fixed by "
            f"{fit.names[fit.forward]} as stated, changes only torques and work."
        )
    if untold.size and fit.only_ratios and "rolling" in fit.names:
        remarks.append(
            "Slow motion on axles may be the same for other coefficients: record a faster gait, in "
            "which inertia counts."
        )
    elif after > _MISSED * fit.extent and alike > _ALIKE:
        remarks.append(
            "No coefficients reproduce the path: are lengths, order and signs of joints, and y "
            "right?"
        )
    points = [name for name, k in _POINTS.items() if fit.mask[0, k].any() and name != "center"]
    unit = f"lengths of {length:g} m" if length else "lengths"
    path_of = ", ".join(points) or "headings"
    message = f"{fitted.describe(used)}{at_pace}; path of {path_of} in body {unit}"
    both = zip(values.tolist(), errors.tolist(), strict=True)
    coefficients = dict(zip(fit.names, both, strict=True))
    return Identification(fit.with_(x, 5), coefficients, before, after, tuple(remarks), message)


def _measured(path: Path, record: Record, length: float | None) -> tuple[np.ndarray, list[Column]]:
    """Measured places of tail, centre and head, and directions there, ``(2, 3, n_time)``, both
    complex; NaN where there is none. And the columns that tell them."""
    used = list[Column]()
    table = np.full((3, 3, record.time.size), np.nan)  # x, y, angle; of each
    if record.path is not None:  # of centre and tail
        table[:2, [1, 0]] = record.path.transpose(1, 0, 2)
    for column, row in record.others if record.path is None else ():
        words = {*column.words}
        what = next((word for word in column.words if word in {"x", "y", *HEADINGS}), "")
        if not what or words - {what, "pos", "position", *_UNITS, *_POINTS}:
            continue
        unit, is_place = next(iter(words & {*_UNITS}), ""), what in "xy"
        if is_place and unit and length is None:
            raise ProblemError(
                f"{path}: {column.name} is in {unit}: give the length of the body [m]."
            )
        point = next((_POINTS[word] for word in words if word in _POINTS), int(is_place))
        scale = _UNITS.get(unit, 1.0) / ((is_place and length) or 1.0)
        table["xy".find(what), point] = scale * row
        used.append(column)
    measured = np.array([table[0] + 1j * table[1], np.exp(1j * table[2])])
    counts = np.isfinite(measured).sum(axis=2)
    if min(counts[counts > 0], default=0) < FEWEST:
        raise ProblemError(
            f"{path} holds no path of the body: give columns x and y of the centre of mass, or "
            f"head_x, head_y, tail_x, tail_y, or theta."
        )
    return measured, used


class _Fit:
    def __init__(
        self, problem: Problem, measured: np.ndarray, gait: Fourier, phases: np.ndarray
    ) -> None:
        self.problem, self.gait, self.phases = problem, gait, phases
        symbols = {text: x for x, text in COEFFICIENTS.items() if x != "power"}
        groups: dict[str, tuple[float, list[int]]] = {}
        for k, number in enumerate(parameters(problem)):
            words, *feet = number.name.split(" of f")
            if words in symbols:
                name = " of f".join([symbols[words], *feet])
                forwards = name.replace("mu_b of", "mu_f of")  # a wheel rolls both ways alike
                if groups.get(forwards, (None,))[0] == number.value:
                    name = forwards
                groups.setdefault(name, (number.value, []))[1].append(k)
        if not groups:
            raise ProblemError(f"{problem.name} has a law without coefficients: state Friction().")
        values, self.groups = zip(*groups.values(), strict=True)
        self.nominal, short = np.array(values), [name.split(" of ")[0] for name in groups]
        self.names = short if len({*short}) == len(short) else [*groups]
        along = {"mu_f", "tangential", "rolling"}
        self.forward = next((k for k, x in enumerate(short) if x in along), 0)
        self.only_ratios = not problem.froude and problem.law.degree is not None
        every = range(len(short))
        self.free = [k for k in every if k != self.forward or not self.only_ratios]
        self.prior = np.eye(len(self.free)) / _VAGUE
        self.noise = np.full((2, 1), 1e-3)  # of places and of headings
        self.mask = np.isfinite(measured)
        self.measured = np.where(self.mask, measured, 0)
        # less the numbers that place the axes
        counts, axes = self.mask.sum(axis=(1, 2)), self.mask.any(axis=2).sum(axis=1)
        self.counts = counts * [2, 1] - [3 * (axes[0] > 0), axes[1]]
        self.freedom = max(float(self.counts.sum()) - len(self.free), 1.0)
        self.extent = self.rms(self.off_from(np.array([0 * phases, 0 * phases + 1])[:, None]))
        for_path = with_motors(problem.with_(objective=EFFICIENCY), gait)
        self.mesh = on_fine_mesh(*for_path).mesh

    def values(self, x: np.ndarray) -> np.ndarray:
        values = self.nominal.copy()
        values[self.free] *= np.exp(x)
        return values

    def with_(self, x: np.ndarray, digits: int = 12) -> Problem:
        changed = self.problem
        for group, value in zip(self.groups, self.values(x), strict=True):
            for which in group:
                number = parameters(changed)[which]
                changed = number.changed(float(f"{value:.{digits}g}") / number.value - 1)
        return changed

    def off(self, x: np.ndarray, motors: Fourier | None = None) -> np.ndarray:
        series = motors or self.gait
        problem, gait = with_motors(self.with_(x), series)
        motion = on_mesh(problem, gait, self.mesh).sample(self.phases - _start_phase(series))
        centre, outline = (
            x + 1j * y for x, y in (motion.centre, lab_outline(problem.body, motion))
        )
        tail, head = np.exp(1j * motion.theta), np.exp(1j * np.angle(outline[-1] - outline[-2]))
        return self.off_from(np.array([[outline[0], centre, outline[-1]], [tail, tail, head]]))

    def off_from(self, predicted: np.ndarray) -> np.ndarray:
        """Predicted places less measured ones, and the angles between directions, in the axes that
        fit best, ``(2, 3, n_time)``."""
        places, turns = np.where(self.mask, predicted, 0)
        at, measured = (
            each - self.mask[0] * each.sum() / max(self.mask[0].sum(), 1)
            for each in (places, self.measured[0])
        )
        turn, between = np.vdot(at, measured), turns * self.measured[1].conj()
        angles = np.angle(between * between.sum(axis=1, keepdims=True).conj())
        return np.where(self.mask, [at * turn / max(abs(turn), 1e-300) - measured, angles], 0)

    def rms(self, off: np.ndarray) -> float:
        which = int(not self.mask[0].any())
        return math.sqrt((np.abs(off[which]) ** 2).sum() / self.mask[which].sum())

    def rows(self, x: np.ndarray, motors: Fourier | None = None) -> np.ndarray:
        """What squares are least of: residuals over their noise, and x over its own."""
        places, angles = self.off(x, motors).reshape(2, -1) / self.noise
        return np.concatenate([places.real, places.imag, angles.real, self.prior @ x])

    def slopes(self, x: np.ndarray) -> np.ndarray:
        steps = _STEP * np.eye(x.size)
        return np.transpose([(self.rows(x + h) - self.rows(x - h)) / (2 * _STEP) for h in steps])

    def best(self, x: np.ndarray) -> np.ndarray:
        if x.size:
            how: Any = {"bounds": (-_FARTHEST, _FARTHEST), "xtol": 1e-6}
            x = scipy.optimize.least_squares(self.rows, x, self.slopes, **how).x
        left = (np.abs(self.off(x)) ** 2).sum(axis=(1, 2))
        share = self.freedom / self.counts.sum()
        self.noise = np.sqrt(left / np.maximum(self.counts * share, 1))[:, None] + _ACCURACY
        return x

    def covariance(self, x: np.ndarray, samples: Uncertainty | None) -> tuple[float, np.ndarray]:
        """Number of residuals in a row that are alike, and the covariance of x."""
        places, angles = self.off(x)
        alike = max(map(correlation_time, (places.real, places.imag, angles.real)))
        if not x.size:
            return alike, np.empty((0, 0))
        self.noise *= alike**0.5
        slopes, here = self.slopes(x), self.rows(x)
        covariance = np.linalg.inv(slopes.T @ slopes)
        if samples is not None:
            most = max(samples.directions.shape[2] // 2, self.gait.n_harmonic)
            table = self.gait.resize(most).table
            others = [Fourier.from_table(table + each) for each in samples.directions]
            others += [samples.richer] if samples.richer is not None else []
            change = np.array([self.rows(x, each) - here for each in others])
            effects = covariance @ slopes.T @ change.T
            covariance += effects @ effects.T
        return alike, covariance

    def describe(self, direction: np.ndarray) -> str:
        change = np.zeros(len(self.names))
        change[self.free] = direction / np.abs(direction).max()
        # any factor of all is left out, so as to name few
        shifts = [0.0, *change] if self.only_ratios else [0.0]
        change = min((change - c for c in shifts), key=lambda c: (np.abs(c) > _PART).sum())
        parts = np.flatnonzero(np.abs(change) > _PART)
        names = " and ".join(self.names[k] for k in parts)
        if parts.size == 1:
            others = " and ".join(name for name in self.names if name != names)
            why = "it does not change the motion"
            return f"This gait cannot distinguish {names} from {others}: {why}."
        by = ", ".join(f"{self.names[k]} {100 * np.expm1(0.1 * change[k]):+.0f} %" for k in parts)
        return f"This gait cannot distinguish {names}: the motion is the same with {by}."
