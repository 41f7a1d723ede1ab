"""A gait's shape coordinates over time as a file for a robot: comma-separated values or JSON, with what a reader has to know;
and the robot itself as a model for simulators.

Where the pace of a gait matters (viscous drag, power limits), its own pace is kept, and limits on the speeds make the period
longer. With inertia the numbers of the result hold for a robot of one length at that period, which is said.
"""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from colloc.gaits.gait_fields import fields
from colloc.mechanics.inertia import GRAVITY
from colloc.mechanics.law import rate_independent
from colloc.results.robot import Robot, pressing
from colloc.results.robot_model import FORMATS, floor_of, note_of
from colloc.results.solution import Solution
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.replaced_file import replaced_file
from colloc.verification.inertial_motion import inertial_motion
from colloc.verification.trajectory import Trajectory, timed

KINDS = ".csv", ".json", *FORMATS


def write_export(
    solution: Solution,
    path: Path,
    *,
    period: float | None = None,
    max_speed: float | Sequence[float] | None = None,
    rate: float = 50.0,
    periods: int = 1,
    length: float | None = None,
    mass: float | None = None,
    gravity: float = GRAVITY,
) -> dict[str, Any]:
    """Write joint angles (or amplitudes of modes) and their speeds at equal steps of time.

    Parameters
    ----------
    solution : Solution
    path : Path
        Ends in ``.csv`` or ``.json``; or in ``.xml`` or ``.urdf`` for the robot as a model of MuJoCo (MJCF) or a URDF
        (`colloc.results.robot_model`), which takes `period`, `length` and `mass`.
    period : float, optional
        Seconds a period takes, rounded up to a whole number of samples; by default the shortest that `max_speed` allows.
    max_speed : float or (n_joint,), optional
        Largest speeds [rad/s]. Under dry friction the path is run through as evenly as they allow; where the pace matters,
        at the gait's own pace.
    rate : float
        Samples a second.
    periods : int
        How often the period is repeated.
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
        If neither `period` nor `max_speed` is given, the period is too short for the limits, a number or the ending of the
        path is unusable, the solution holds a prescribed motion, or only one of `length` and `mass` is given.
    """
    if periods < 1:
        raise ProblemError(f"periods must be at least 1, not {periods}.")
    if path.suffix not in KINDS:
        raise ProblemError(f"{path} should end in {' or '.join(KINDS)}.")
    if not solution.problem.gait.free:
        raise ProblemError(f"{solution.problem.name} is a prescribed motion of a smooth body: it has no joints to export.")
    if path.suffix in FORMATS:
        if period is None or length is None or mass is None:
            raise ProblemError("a model for simulators needs the period [s], the length [m] and the mass [kg] of the robot.")
        if max_speed is not None:
            raise ProblemError("a model for simulators holds no motion: leave max_speed out, and write the angles as CSV.")
        return _written_model(Robot(solution, length, mass, period, gravity), path)
    limits = None if max_speed is None else np.array(max_speed, dtype=float)
    trajectory = timed(solution.gait, rate, period, limits, keep_pace=bool(solution.problem.paced_by))
    facts = _about(solution, trajectory, rate, limits) | _pace(solution, trajectory.period, gravity)
    series = {"rad": trajectory.angles, "rad_per_s": trajectory.speeds}
    if length is not None or mass is not None:
        if length is None or mass is None:
            raise ProblemError("torques need both the length and the mass of the robot.")
        # the period as it is asked for: that of whole samples may be another pace
        torques = Robot(solution, length, mass, period or trajectory.period, gravity).torques(trajectory.phase)
        series |= {"N_m": torques, "W": torques * trajectory.speeds}
        facts |= {"length_m": length, "mass_kg": mass, "gravity_m_per_s2": gravity}
    time = (np.arange(periods)[:, None] * trajectory.period + trajectory.time).ravel()
    series = {unit: np.tile(rows, periods) for unit, rows in series.items()}
    text = (_csv if path.suffix == ".csv" else _json)(facts, time, series, solution.gait.coordinate)
    with replaced_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")
    return facts


def _written_model(robot: Robot, path: Path) -> dict[str, Any]:
    """Write the robot as a model for simulators."""
    text, size = FORMATS[path.suffix](robot), {"length_m": robot.length, "mass_kg": robot.mass, "period_s": robot.period}
    with replaced_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")
    facts = {name: robot.facts[name] for name in ("name", "status", "peak_torque_N_m", "peak_speed_rad_per_s")} | size
    if path.suffix == ".urdf":
        return facts | {"note": "a URDF says nothing of friction, nor of how the weight is spread over what touches the floor"}
    if rate_independent(robot.solution.problem.law):
        with suppress(ProblemError, NotConvergedError):
            facts["moves_body_lengths_per_period"] = _moves(robot)
    return facts | ({"note": note} if (note := note_of(robot)) else {})


def _moves(robot: Robot) -> float:
    """What colloc says of the robot on the floor of its MJCF [body lengths]."""
    body, law = floor_of(robot)
    problem, gait = robot.solution.problem, robot.solution.gait
    how: dict[str, Any] = {"turn": robot.solution.rotation, "breaks": gait.corner_phases, "regime": problem.regime}
    return inertial_motion(body, law, gait, robot.solution.delta_per_period, robot.froude, tolerance=1e-3, **how).distance


def _about(solution: Solution, trajectory: Trajectory, rate: float, limits: np.ndarray | None) -> dict[str, Any]:
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
    """Why the gait keeps its own pace, and of which robot distance and work are, where these depend on it."""
    reason, froude = solution.problem.paced_by, solution.froude
    if not reason:
        return {}
    if not froude:
        return {"pace": f"the gait's own, as {reason}; distance and work are those in a period of 1"}
    length = froude * pressing(solution, gravity) * period**2
    robot = f"those at the Froude number {froude:.4g}: of a robot of {length:.3g} m in this period"
    return {"pace": f"the gait's own, as {reason}; distance and work are {robot}", "froude_number": froude}


def _csv(facts: dict[str, Any], time: np.ndarray, series: dict[str, np.ndarray], coordinate: str) -> str:
    """Comma-separated values, with the facts in '#' lines; of every unit a column for each joint."""
    names = [f"{coordinate}_{j}_{unit}" for unit, rows in series.items() for j in range(1, len(rows) + 1)]
    text = io.StringIO()
    for key, value in facts.items():
        text.write(f"# {key}: {json.dumps(value)}\n")
    text.write(",".join(["time_s", *names]) + "\n")
    np.savetxt(text, np.concatenate([time[None], *series.values()]).T, fmt="%.9g", delimiter=",")
    return text.getvalue()


_WHAT = {"rad": "angles", "rad_per_s": "speeds", "N_m": "torques", "W": "powers"}


def _json(facts: dict[str, Any], time: np.ndarray, series: dict[str, np.ndarray], coordinate: str) -> str:
    """One JSON object."""
    arrays = {f"{_WHAT[unit]}_{unit}": rows.tolist() for unit, rows in series.items()}
    return json.dumps({**facts, "coordinate": coordinate, "time_s": time.tolist(), **arrays}) + "\n"
