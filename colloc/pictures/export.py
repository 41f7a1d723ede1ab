"""Shape coordinates of a gait over time as CSV or JSON, and the robot as a model for simulators."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid
from scipy.interpolate import CubicHermiteSpline

from colloc.gaits.gait_fields import fields
from colloc.mechanics.contact import crossing_depth, passing_depth
from colloc.mechanics.inertia import GRAVITY
from colloc.mechanics.law import rate_independent
from colloc.pictures.robot_model import FORMATS, floor_of, note_of
from colloc.results.motion import RigidMotion
from colloc.results.robot import Robot, joint_torques, pressing, quasi_static_torques
from colloc.results.solution import Solution
from colloc.system.arguments import check_count, checked_arguments
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.files import write_text
from colloc.verification.inertial_motion import GaitWithInertia, inertial_motion
from colloc.verification.trajectory import (
    MOST_SAMPLES,
    Approach,
    Trajectory,
    approach,
    one_each,
    plan_trajectory,
)

KINDS = ".csv", ".json", *FORMATS
_CROSSES = 1e-8  # depth of links in each other above rounding [body lengths]
_FINE, _ACCURACY = 2000, 1e-5  # samples per period, and error, of where the body ends
_SETTLED = 10  # periods after which all are alike
_UNITS = {"rad": "angles", "rad_per_s": "speeds", "N_m": "torques", "W": "powers"}
_Way = tuple[np.ndarray, np.ndarray, np.ndarray]  # times up to 0 [periods], angles, rates


@checked_arguments
def write_export(
    solution: Solution,
    path: Path,
    *,
    period: float | None = None,
    max_speed: float | Sequence[float] | None = None,
    rate: float = 50.0,
    periods: int = 1,
    ramp: bool = True,
    length: float | None = None,
    mass: float | None = None,
    gravity: float = GRAVITY,
) -> dict[str, Any]:
    """Write joint angles (or amplitudes of modes) and their speeds at equal steps of time.

    Parameters
    ----------
    solution : Solution
    path : Path
        Ends in ``.csv`` or ``.json``; or in ``.xml`` (MJCF) or ``.urdf`` for a model of the robot,
        which takes `period`, `length` and `mass`.
    period : float, optional
        [s], rounded up to a whole number of samples; by default the shortest within `max_speed`.
    max_speed : float or (n_joint,), optional
        Limits [rad/s]. Under dry friction the path is retimed as evenly as they allow; where the
        pace matters the gait's own timing is kept.
    rate : float
        Samples per second.
    periods : int
    ramp : bool
        Lead from the straight body, at rest, into the gait at times below 0.
    length, mass : float, optional
        Of the robot [m], [kg], to write torques [N m] and powers [W], too.
    gravity : float
        [m/s^2]

    Returns
    -------
    dict
        What the file says about the samples.

    Raises
    ------
    ProblemError
        If an argument is missing or unusable, the motion is prescribed, or the ramp crosses itself.
    """
    check_count(periods=periods)
    problem, is_model = solution.problem, path.suffix in FORMATS
    if path.suffix not in KINDS:
        raise ProblemError(f"{path} should end in {' or '.join(KINDS)}.")
    if not problem.gait.free:
        raise ProblemError(
            f"{problem.name} is a prescribed motion of a smooth body: it has no joints to export."
        )
    if is_model and (period is None or length is None or mass is None):
        raise ProblemError(
            "a model for simulators needs the period [s], the length [m] and the mass [kg] of "
            "the robot."
        )
    if is_model and max_speed is not None:
        raise ProblemError(
            "a model for simulators holds no motion: leave max_speed out, and write the angles as "
            "CSV."
        )
    if is_model:
        return _write_model(Robot(solution, length, mass, period, gravity), path)  # type: ignore[arg-type]
    limits = None if max_speed is None else np.array(max_speed, dtype=float)
    gait, own_timing = solution.gait.motor_gait, bool(problem.paced_by)
    trajectory = plan_trajectory(gait, rate, period, limits, keep_pace=own_timing)
    facts = _about(solution, trajectory, rate, limits) | _pace(solution, trajectory.period, gravity)
    way = _approach(solution, trajectory, rate, limits) if ramp else None
    parts: list[Approach | Trajectory] = [trajectory] if way is None else [way, trajectory]
    rows = [[part.angles, part.speeds] for part in parts]
    at_pace = None  # the robot, if the timing is the gait's own
    if length is not None or mass is not None:
        if length is None or mass is None:
            raise ProblemError("torques need both the length and the mass of the robot.")
        # the period that was requested: that of whole samples may be another pace
        robot = Robot(solution, length, mass, period or trajectory.period, gravity)
        facts |= {"length_m": length, "mass_kg": mass, "gravity_m_per_s2": gravity}
        if limits is None or own_timing:
            at_pace, torques = robot, [robot.torques(trajectory.phase)]
            facts["torques"] = "those of this pace; of slow motion before time 0"
        else:  # inertia with another timing is not known
            slow = joint_torques(solution, trajectory.phase, froude=solution.froude)
            torques = [robot.torque_unit * slow]
            facts["torques"] = "those of slow motion, as the pace is not the gait's own"
        if way is not None:
            joints = problem.joint_path(way.angles, trajectory.period * way.speeds)
            theta = getattr(solution.gait, "theta", None) or 0.0  # the initial heading on a slope
            pull = problem.regime.pull(np.full((1, way.time.size), theta))
            slow = quasi_static_torques(solution, *joints, pull)
            torques.insert(0, robot.torque_unit * slow)
        for part, row, torque in zip(parts, rows, torques, strict=True):
            row += [torque, torque * part.speeds]
        if at_pace is not None:
            facts["distance_at_this_pace_m"] = robot.facts["speed_m_per_s"] * robot.period
    if periods * trajectory.time.size > MOST_SAMPLES:
        raise ProblemError(
            f"{periods} periods have too many samples: a file holds at most {MOST_SAMPLES}."
        )
    time = (np.arange(periods)[:, None] * trajectory.period + trajectory.time).ravel()
    table = np.tile(rows[-1], periods)  # (unit, joint, time)
    if way is not None:
        facts["ramp_s"] = -float(way.time[0])
        facts |= _end(solution, trajectory, limits, periods, at_pace)
        time = np.append(way.time, time)
        table = np.append(np.array(rows[0]), table, axis=2)
    columns = {unit: table[k] for k, unit in enumerate(_UNITS) if k < len(table)}
    if path.suffix == ".csv":
        lines = [f"# {key}: {json.dumps(value)}" for key, value in facts.items()]
        count = table.shape[1]
        names = [f"{gait.coordinate}_{j + 1}_{unit}" for unit in columns for j in range(count)]
        lines.append(",".join(["time_s", *names]))
        lines += [",".join(f"{x:.9g}" for x in row) for row in np.vstack([time, *table]).T]
        write_text(path, "\n".join(lines) + "\n")
    else:
        arrays = {f"{_UNITS[unit]}_{unit}": values.tolist() for unit, values in columns.items()}
        content = {**facts, "coordinate": gait.coordinate, "time_s": time.tolist(), **arrays}
        write_text(path, json.dumps(content) + "\n")
    return facts


def _approach(
    solution: Solution, trajectory: Trajectory, rate: float, limits: np.ndarray | None
) -> Approach:
    """Way from the straight body into the gait."""
    problem, speeds = solution.problem, np.abs(trajectory.speeds)
    most: Any = limits
    if limits is None:
        stated = np.array(problem.largest_speeds) / trajectory.period
        most = np.maximum(stated, speeds.max(axis=1)) if stated.size else speeds.max()
    way = approach(trajectory, rate, one_each(most, problem.n_motor, "joint speed limit"))
    angles, _ = problem.joint_path(way.angles, way.speeds)
    crossing = float(crossing_depth(problem.body, angles).max())
    if max(crossing, passing_depth(problem.body, angles)) > _CROSSES:
        raise ProblemError(
            "the body crosses itself on the way from straight into the gait: leave it out "
            "(ramp=False, --no-ramp), and bring the robot to the first sample by hand."
        )
    return way


def _end(
    solution: Solution,
    trajectory: Trajectory,
    limits: np.ndarray | None,
    periods: int,
    robot: Robot | None,
) -> dict[str, Any]:
    """Displacement of the centre of mass and turn of the tail link from the straight body along +x
    to the end, with inertia if the pace is known; nothing on slopes."""
    if solution.problem.regime.slides:
        return {}
    period = trajectory.period
    way = _approach(solution, trajectory, _FINE / period, limits)
    time = np.append(way.time, 0.0) / period
    angles = np.append(way.angles, trajectory.angles[:, :1], axis=1)
    rates = period * np.append(way.speeds, trajectory.speeds[:, :1], axis=1)
    angles, rates = solution.problem.joint_path(angles, rates)
    froude, end = solution.froude or (robot.froude if robot else 0.0), None
    with suppress(ProblemError, NotConvergedError):
        if froude:
            end = _end_with_inertia(solution, froude, (time, angles, rates), periods)
    place, turn = end or _end_slowly(solution, (time, angles, rates), periods)
    return {
        "end_body_lengths": [float(place.real), float(place.imag)],
        "end_turned_deg": math.degrees(turn),
        "end_includes_inertia": end is not None,
    }


def _end_slowly(solution: Solution, way: _Way, periods: int) -> tuple[complex, float]:
    (time, angles, rates), body = way, solution.problem.body
    z = body.solve(solution.problem.law, angles, rates, solution.delta_per_period).z
    theta = cumulative_trapezoid(z[2], time, initial=0.0)
    tail = trapezoid(np.exp(1j * theta) * (z[0] + 1j * z[1]), time)
    start, end = (complex(*place) for place in body.centre(angles[:, [0, -1]]).T)
    then = solution.sample(np.array([0.0, float(periods)]))
    turn = float(theta[-1] - then.theta[0])
    along = complex(*(then.centre[:, 1] - then.centre[:, 0])) * np.exp(1j * turn)
    return tail + np.exp(1j * theta[-1]) * end - start + along, turn + float(then.theta[1])


def _end_with_inertia(
    solution: Solution, froude: float, way: _Way, periods: int
) -> tuple[complex, float]:
    """Displacement and turn over a way and the periods after it."""
    body, law, delta = solution.problem.body, solution.problem.law, solution.delta_per_period
    long, gait = -float(way[0][0]), solution.gait
    spline = CubicHermiteSpline(1.0 + way[0] / long, way[1], long * way[2], axis=1)

    def approaching(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return spline(t), spline(t, 1)

    pace = froude / long**2
    begin = GaitWithInertia(body, law, approaching, delta * long, froude=pace, breaks=())
    cycle = GaitWithInertia(body, law, gait, delta, froude=froude, breaks=gait.corner_phases)
    state = begin.run(np.zeros(3), _ACCURACY).states[:, -1]
    state[:3] /= long
    before = state
    for _ in range(min(periods, _SETTLED)):
        before, state = state, cycle.run(state, _ACCURACY).states[:, -1]
    place, turn = complex(*state[4:6]), state[3] - before[3]
    last = place - complex(*before[4:6]) * np.exp(1j * turn)
    more = RigidMotion(turn, last).repeat(periods - min(periods, _SETTLED))
    return complex(np.exp(1j * more.rotation) * place + more.shift), float(state[3] + more.rotation)


def _write_model(robot: Robot, path: Path) -> dict[str, Any]:
    write_text(path, FORMATS[path.suffix](robot))
    names = ("name", "status", "peak_torque_N_m", "peak_speed_rad_per_s")
    facts = {name: robot.facts[name] for name in names}
    facts |= {"length_m": robot.length, "mass_kg": robot.mass, "period_s": robot.period}
    note = (
        "a URDF says nothing of friction, nor of how the weight is spread over what touches the "
        "floor"
    )
    if path.suffix != ".urdf":
        note, solution = note_of(robot), robot.solution
        if rate_independent(solution.problem.law):
            with suppress(ProblemError, NotConvergedError):
                facts["moves_body_lengths_per_period"] = inertial_motion(
                    *floor_of(robot), solution.gait, solution.delta_per_period, robot.froude,
                    tolerance=1e-3, turn=solution.rotation, breaks=solution.gait.corner_phases,
                    regime=solution.problem.regime,
                ).distance  # fmt: skip
    return facts | ({"note": note} if note else {})


def _about(
    solution: Solution, trajectory: Trajectory, rate: float, limits: np.ndarray | None
) -> dict[str, Any]:
    measured = solution.measured
    return {
        "name": solution.problem.name,
        "status": solution.status,
        "period_s": trajectory.period,
        "rate_hz": float(rate),
        "samples_per_period": trajectory.time.size,
        "max_speed_rad_per_s": None if limits is None else np.ravel(limits).tolist(),
        "largest_speed_rad_per_s": np.abs(trajectory.speeds).max(axis=1).tolist(),
        "body": solution.problem.body.describe(),
        "friction": fields(solution.problem.law),
        "efficiency": measured.efficiency,
        "objective": solution.problem.objective.name,
        "value": measured.value,
        "distance_per_period_body_lengths": measured.distance,
        "travels": solution.travels,
        "rotation_per_period_rad": solution.rotation,
        "turning_radius_body_lengths": solution.turning_radius if solution.turning else None,
        "work_per_period_weight_times_length": measured.work,
        "problem_hash": solution.problem.hash,
    }


def _pace(solution: Solution, period: float, gravity: float) -> dict[str, Any]:
    """Why the gait's timing is kept, and the robot for which distance and work hold."""
    reason, froude = solution.problem.paced_by, solution.froude
    if not reason:
        return {}
    if not froude:
        return {
            "pace": f"the gait's own, as {reason}; distance and work are those in a period of 1"
        }
    length = froude * pressing(solution, gravity) * period**2
    robot = f"those at the Froude number {froude:.4g}: of a robot of {length:.3g} m in this period"
    return {
        "pace": f"the gait's own, as {reason}; distance and work are {robot}",
        "froude_number": froude,
    }
