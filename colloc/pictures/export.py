"""A gait's shape coordinates over time as a file for a robot: comma-separated values or JSON, with
what a reader has to know; and the robot itself as a model for simulators.

Where the pace of a gait matters (viscous drag, power limits), its own pace is kept, and limits on
the speeds make the period longer. With inertia the numbers of the result hold for a robot of one
length at that period, which is said.

A robot is straight before it begins: samples before time 0 take it into the gait
(`colloc.verification.trajectory.approach`).
"""

from __future__ import annotations

import io
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
from colloc.mechanics.inertia import GRAVITY
from colloc.mechanics.law import rate_independent
from colloc.results.motion import RigidMotion
from colloc.results.robot import Robot, joint_torques, pressing, slow_torques
from colloc.results.robot_model import FORMATS, floor_of, note_of
from colloc.results.solution import Solution
from colloc.system.arguments import check_count
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.replaced_file import replaced_file
from colloc.verification.inertial_motion import gait_with_inertia, inertial_motion
from colloc.verification.trajectory import (
    MOST_SAMPLES,
    Approach,
    Trajectory,
    approach,
    one_each,
    timed,
)

KINDS = ".csv", ".json", *FORMATS
_CROSSES = 1e-8
"""Depth of links in each other that is more than rounding [body lengths]."""
_FINE, _ACCURACY, _SETTLED = 2000, 1e-5, 10
"""Samples a period, and the error, with which it is computed where the body ends; periods after
which all are alike."""


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
        Ends in ``.csv`` or ``.json``; or in ``.xml`` or ``.urdf`` for the robot as a model of
        MuJoCo (MJCF) or a URDF (`colloc.results.robot_model`), which takes `period`, `length` and
        `mass`.
    period : float, optional
        Seconds a period takes, rounded up to a whole number of samples; by default the shortest
        that `max_speed` allows.
    max_speed : float or (n_joint,), optional
        Largest speeds [rad/s]. Under dry friction the path is run through as evenly as they allow;
        where the pace matters, at the gait's own pace.
    rate : float
        Samples a second.
    periods : int
        How often the period is repeated.
    ramp : bool
        Whether samples at times below 0 lead from the straight body, at rest, into the gait, no
        joint faster than `max_speed`, the problem's `speed_limit` or the fastest one of the gait.
        Then the file says where the body ends.
    length, mass : float, optional
        Of the robot [m], [kg]: then torques [N m] and powers [W] of the joints are written too.
    gravity : float
        [m/s^2]

    Returns
    -------
    dict
        What stands in the file about the samples, as plain numbers and strings.

    Raises
    ------
    ProblemError
        If neither `period` nor `max_speed` is given, the period is too short for the limits, a
        number or the ending of the path is unusable, the solution holds a prescribed motion, only
        one of `length` and `mass` is given, or the way from the straight body crosses itself.
    """
    check_count(periods=periods)
    if path.suffix not in KINDS:
        raise ProblemError(f"{path} should end in {' or '.join(KINDS)}.")
    if not solution.problem.gait.free:
        raise ProblemError(
            f"{solution.problem.name} is a prescribed motion of a smooth body: it has no joints to "
            f"export."
        )
    if path.suffix in FORMATS:
        if period is None or length is None or mass is None:
            raise ProblemError(
                "a model for simulators needs the period [s], the length [m] and the mass [kg] of "
                "the robot."
            )
        if max_speed is not None:
            raise ProblemError(
                "a model for simulators holds no motion: leave max_speed out, and write the angles "
                "as CSV."
            )
        return _written_model(Robot(solution, length, mass, period, gravity), path)
    limits = None if max_speed is None else np.array(max_speed, dtype=float)
    trajectory = timed(
        solution.gait.driven, rate, period, limits, keep_pace=bool(solution.problem.paced_by)
    )
    facts = _about(solution, trajectory, rate, limits) | _pace(solution, trajectory.period, gravity)
    series = {"rad": trajectory.angles, "rad_per_s": trajectory.speeds}
    way = _approach(solution, trajectory, rate, limits) if ramp else None
    before = {} if way is None else {"rad": way.angles, "rad_per_s": way.speeds}
    robot = None
    if length is not None or mass is not None:
        if length is None or mass is None:
            raise ProblemError("torques need both the length and the mass of the robot.")
        # the period as it is asked for: that of whole samples may be another pace
        robot = Robot(solution, length, mass, period or trajectory.period, gravity)
        own_pace = limits is None or bool(solution.problem.paced_by)
        if own_pace:
            torques = robot.torques(trajectory.phase)
        else:  # what inertia does at another pace is not known
            torques = robot.torque_unit * joint_torques(
                solution, trajectory.phase, froude=solution.froude
            )
        series |= {"N_m": torques, "W": torques * trajectory.speeds}
        facts |= {"length_m": length, "mass_kg": mass, "gravity_m_per_s2": gravity}
        if own_pace:
            facts["torques"] = "those of this pace; of slow motion before time 0"
            facts["distance_at_this_pace_m"] = robot.facts["speed_m_per_s"] * robot.period
        else:
            facts["torques"] = "those of slow motion, as the pace is not the gait's own"
        if way is not None:
            pull = _pull(solution, way.time.size)
            joints = solution.problem.joint_path(way.angles, trajectory.period * way.speeds)
            torques = robot.torque_unit * slow_torques(solution, *joints, pull)
            before |= {"N_m": torques, "W": torques * way.speeds}
            robot = robot if own_pace else None
    if periods * trajectory.time.size > MOST_SAMPLES:
        raise ProblemError(
            f"{periods} periods have too many samples: a file holds at most {MOST_SAMPLES}."
        )
    time = (np.arange(periods)[:, None] * trajectory.period + trajectory.time).ravel()
    series = {unit: np.tile(rows, periods) for unit, rows in series.items()}
    if way is not None:
        facts["ramp_s"] = -float(way.time[0])
        facts |= _end(solution, trajectory, limits, periods, robot)
        time = np.append(way.time, time)
        series = {unit: np.append(before[unit], rows, axis=1) for unit, rows in series.items()}
    text = (_csv if path.suffix == ".csv" else _json)(
        facts, time, series, solution.gait.driven.coordinate
    )
    with replaced_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")
    return facts


def _approach(
    solution: Solution, trajectory: Trajectory, rate: float, limits: np.ndarray | None
) -> Approach:
    """From the straight body, which every range of joints allows."""
    problem, n, fastest = solution.problem, len(trajectory.speeds), np.abs(trajectory.speeds).max()
    if limits is None:
        stated = np.array(problem.largest_speeds) / trajectory.period
        limits = (
            np.maximum(stated, np.abs(trajectory.speeds).max(axis=1)) if stated.size else fastest
        )
    way = approach(trajectory, rate, one_each(limits, n, "joint speed limit"))
    angles, _ = problem.joint_path(way.angles, way.speeds)
    depth = max(
        float(problem.body.crossing_depth(angles).max()), problem.body.passing_depth(angles)
    )
    if depth > _CROSSES:
        raise ProblemError(
            "the body crosses itself on the way from straight into the gait: leave it out "
            "(ramp=False, --no-ramp), and bring "
            "the robot to the first sample by hand."
        )
    return way


def _pull(solution: Solution, count: int) -> np.ndarray | None:
    """Of the weight while the tail link points as it does at first."""
    return solution.problem.regime.pull(
        np.full((1, count), getattr(solution.gait, "theta", None) or 0.0)
    )


def _end(
    solution: Solution,
    trajectory: Trajectory,
    limits: np.ndarray | None,
    periods: int,
    robot: Robot | None,
) -> dict[str, Any]:
    """Where the centre of mass is after the periods, from where it is in the straight body that
    points along +x, and by how much the tail link has turned; with inertia where the pace is known.
    Nothing on slopes."""
    problem, delta, period = solution.problem, solution.delta_per_period, trajectory.period
    if problem.regime.slides:
        return {}
    way = _approach(solution, trajectory, _FINE / period, limits)
    time = np.append(way.time, 0.0) / period
    angles = np.append(way.angles, trajectory.angles[:, :1], axis=1)
    rates = period * np.append(way.speeds, trajectory.speeds[:, :1], axis=1)
    angles, rates = problem.joint_path(angles, rates)
    froude, moved = solution.froude or (robot.froude if robot else 0.0), None
    with suppress(ProblemError, NotConvergedError):
        if froude:
            moved = _from_rest(solution, froude, (time, angles, rates), periods)
    if moved is None:
        z = problem.body.solve(problem.law, angles, rates, delta).z
        theta = cumulative_trapezoid(z[2], time, initial=0.0)
        tail = trapezoid(np.exp(1j * theta) * (z[0] + 1j * z[1]), time)
        start, end = (complex(*place) for place in problem.body.centre(angles[:, [0, -1]]).T)
        then = solution.sample(np.array([0.0, float(periods)]))
        turn = float(theta[-1] - then.theta[0])
        along = complex(*(then.centre[:, 1] - then.centre[:, 0])) * np.exp(1j * turn)
        moved = tail + np.exp(1j * theta[-1]) * end - start + along, turn + float(then.theta[1])
        froude = 0.0
    place, turn = moved
    end_of = {
        "end_body_lengths": [float(place.real), float(place.imag)],
        "end_turned_deg": math.degrees(turn),
    }
    return end_of | {"end_includes_inertia": bool(froude)}


def _from_rest(
    solution: Solution, froude: float, way: tuple[np.ndarray, np.ndarray, np.ndarray], periods: int
) -> tuple[complex, float]:
    """How far the centre of mass comes, and the angle by which the tail link turns, with inertia,
    on a way to phase 0, given by times in periods, angles and rates, and through periods after it;
    after some these are alike."""
    problem, delta, long = solution.problem, solution.delta_per_period, -float(way[0][0])
    spline = CubicHermiteSpline(1.0 + way[0] / long, way[1], long * way[2], axis=1)

    def path(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return spline(t), spline(t, 1)

    how: dict[str, Any] = {"froude": froude / long**2, "breaks": ()}
    state = (
        gait_with_inertia(problem.body, problem.law, path, delta * long, **how)
        .run(np.zeros(3), _ACCURACY)
        .states[:, -1]
    )
    state[:3] /= long
    cycle = gait_with_inertia(
        problem.body,
        problem.law,
        solution.gait,
        delta,
        froude=froude,
        breaks=solution.gait.corner_phases,
    )
    before = state
    for _ in range(min(periods, _SETTLED)):
        before, state = state, cycle.run(state, _ACCURACY).states[:, -1]
    (theta, x, y), turn = state[3:6], state[3] - before[3]
    last = complex(x, y) - complex(*before[4:6]) * np.exp(1j * turn)
    more = RigidMotion(turn, last).repeated(periods - min(periods, _SETTLED))
    return complex(np.exp(1j * more.rotation) * complex(x, y) + more.shift), float(
        theta + more.rotation
    )


def _written_model(robot: Robot, path: Path) -> dict[str, Any]:
    """Write the robot as a model for simulators."""
    text, size = (
        FORMATS[path.suffix](robot),
        {"length_m": robot.length, "mass_kg": robot.mass, "period_s": robot.period},
    )
    with replaced_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")
    facts = {
        name: robot.facts[name]
        for name in ("name", "status", "peak_torque_N_m", "peak_speed_rad_per_s")
    } | size
    if path.suffix == ".urdf":
        return facts | {
            "note": "a URDF says nothing of friction, nor of how the weight is spread over what "
            "touches the floor"
        }
    if rate_independent(robot.solution.problem.law):
        with suppress(ProblemError, NotConvergedError):
            facts["moves_body_lengths_per_period"] = _moves(robot)
    return facts | ({"note": note} if (note := note_of(robot)) else {})


def _moves(robot: Robot) -> float:
    """What colloc says of the robot on the floor of its MJCF [body lengths]."""
    body, law = floor_of(robot)
    problem, gait = robot.solution.problem, robot.solution.gait
    how: dict[str, Any] = {
        "turn": robot.solution.rotation,
        "breaks": gait.corner_phases,
        "regime": problem.regime,
    }
    return inertial_motion(
        body, law, gait, robot.solution.delta_per_period, robot.froude, tolerance=1e-3, **how
    ).distance


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
    """Why the gait keeps its own pace, and of which robot distance and work are, where these depend
    on it."""
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


def _csv(
    facts: dict[str, Any], time: np.ndarray, series: dict[str, np.ndarray], coordinate: str
) -> str:
    """Comma-separated values, with the facts in '#' lines; of every unit a column for each
    joint."""
    names = [
        f"{coordinate}_{j}_{unit}" for unit, rows in series.items() for j in range(1, len(rows) + 1)
    ]
    text = io.StringIO()
    for key, value in facts.items():
        text.write(f"# {key}: {json.dumps(value)}\n")
    text.write(",".join(["time_s", *names]) + "\n")
    np.savetxt(text, np.concatenate([time[None], *series.values()]).T, fmt="%.9g", delimiter=",")
    return text.getvalue()


_WHAT = {"rad": "angles", "rad_per_s": "speeds", "N_m": "torques", "W": "powers"}


def _json(
    facts: dict[str, Any], time: np.ndarray, series: dict[str, np.ndarray], coordinate: str
) -> str:
    """One JSON object."""
    arrays = {f"{_WHAT[unit]}_{unit}": rows.tolist() for unit, rows in series.items()}
    return json.dumps({**facts, "coordinate": coordinate, "time_s": time.tolist(), **arrays}) + "\n"
