"""A gait over time as CSV or JSON, for ROS 2 or in C, and its robot as a model for simulators, MJCF
(MuJoCo) and URDF.

Models are in SI units: links have the problem's lengths, masses and inertias; joints are hinges
about the vertical.

MJCF: each foot is a small body on a vertical slide with a spring that presses with its weight; pads
and links stand on Gauss points. A contact `<pair>` has two coefficients, the first along the axis
of a capsule, so a foot with directed friction is a very short capsule. A foot under `colloc.Axle`
is a wheel on a hinge, whose dry friction resists rolling. MuJoCo's other friction is that of
`colloc.Elliptic` (`_in_mujoco`). Its sliding contacts are lifted the more the
slower they respond: hence short steps, constraints of two steps, and an impedance that begins at 0.

URDF has no friction, springs or motors.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid
from scipy.interpolate import CubicHermiteSpline

from colloc.gaits.gait_fields import fields
from colloc.gaits.problem import Problem
from colloc.gaits.robot import joint_ranges
from colloc.laws.resistance import Elliptic
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth, passing_depth
from colloc.mechanics.floor_contact import whole_links
from colloc.mechanics.friction import Axle, Friction
from colloc.mechanics.inertia import GRAVITY
from colloc.mechanics.law import Law, rate_independent
from colloc.pictures import render
from colloc.results.motion import RigidMotion
from colloc.results.robot import (
    UNKNOWN,
    RobotSheet,
    joint_torques,
    pressing,
    quasi_static_torques,
    stated_robot,
)
from colloc.results.solution import Solution
from colloc.system.arguments import (
    check_count,
    checked_arguments,
    is_number,
    named_arguments,
    shown,
)
from colloc.system.errors import ProblemError
from colloc.system.files import write_text
from colloc.verification.differential_motion import GaitWithInertia
from colloc.verification.replay import replay
from colloc.verification.trajectory import (
    MOST_SAMPLES,
    Approach,
    Trajectory,
    approach,
    one_each,
    plan_trajectory,
)

_CROSSES = 1e-8  # depth of links in each other above rounding [body lengths]
_FINE, _ACCURACY = 2000, 1e-5  # samples per period, and error, of where the body ends
_SETTLED = 10  # periods after which all are alike
_UNITS = {"rad": "angles", "rad_per_s": "speeds", "N_m": "torques", "W": "powers"}
_UNITS |= {"deg": "angles", "deg_per_s": "speeds"}
_THIN = 0.02  # width and height of links that have none [body lengths]
_POINTS = 16  # on which a pad or a link stands
_STEPS, _LONGEST = 8000, 1e-3  # time steps of a cycle, and the longest one [s]
_AXIS, _MASS = 1e-4, 1e-6  # half length of a capsule, and mass of a foot, in those of the body
_STIFF = 5000.0  # gain of the position servos per rad, over the largest torque of the gait
_SPIN = 1e-3  # moment of inertia of a wheel, in load times radius squared
_LEAST = 1e-5  # smallest coefficient of friction in MuJoCo
_RESERVE = 1.5  # effort and speed in a URDF where none are stated, over the gait's largest


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
    degrees: bool = False,
    servo: Servo | None = None,
    length: float | None = None,
    mass: float | None = None,
    gravity: float | None = None,
) -> dict[str, Any]:
    """Write joint angles (or amplitudes of modes) and their speeds at equal steps of time.

    Parameters
    ----------
    solution : Solution
    path : Path
        Ends in ``.csv`` or ``.json``; ``.yaml``, a ``JointTrajectory`` of ROS 2, or ``.h``, a table
        in C; or in ``.xml`` (MJCF) or ``.urdf`` for a model of the robot, which takes `period`,
        `length` and `mass`.
    period : float, optional
        [s], rounded up to a whole number of samples; by default the shortest within `max_speed`.
    max_speed : float or (n_joint,), optional
        Limits [rad/s]. Under dry friction the path is retimed as evenly as they allow; where the
        pace matters the gait's own timing is kept.
    rate : float
        Samples per second.
    periods : int
    ramp : bool
        Lead from the straight body, at rest, into the gait at times below 0. A message of ROS 2
        also ends there, as its controllers refuse one that ends in motion.
    degrees : bool
        Write degrees, in CSV and JSON.
    servo : Servo, optional
        Write pulses instead of angles, in CSV and C.
    length, mass : float, optional
        Of the robot [m], [kg], to write torques [N m] and powers [W], too. These, and the period
        without `max_speed`, are by default those of the problem's robot.
    gravity : float, optional
        [m/s^2], by default that of the problem's robot, or 9.81.

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
    problem = solution.problem
    _check_format(problem, path, degrees, servo)
    if path.suffix in MODELS:
        if max_speed is not None:
            raise ProblemError("a model for simulators holds no motion: leave max_speed out.")
        return _write_model(solution.robot(length, mass, period, gravity=gravity), path)
    if problem.robot is not None:
        sheet = stated_robot(solution, length=length, mass=mass, period=period, gravity=gravity)
        length, mass, gravity = (sheet[name] for name in ("length", "mass", "gravity"))
        period = period if max_speed is not None else sheet["period"]
    gravity = GRAVITY if gravity is None else gravity
    limits = None if max_speed is None else np.array(max_speed, dtype=float)
    keep_pace = bool(problem.paced_by)
    cycle = plan_trajectory(solution.gait.motor_gait, rate, period, limits, keep_pace=keep_pace)
    if periods * cycle.time.size > MOST_SAMPLES:
        raise ProblemError(
            f"{periods} cycles have too many samples: a file holds at most {MOST_SAMPLES}."
        )
    facts = _facts(solution, cycle, rate, limits)
    if keep_pace:
        facts |= _facts_of_pace(solution, cycle, length, gravity)
    parts: list[Approach | Trajectory] = [cycle]
    if ramp:
        parts = [way_in := _way_in(problem, cycle, rate, limits), cycle]
    rows = [[part.angles, part.speeds] for part in parts]
    at_pace = None  # the robot, if the timing is the gait's own
    if length is not None or mass is not None:
        if length is None or mass is None:
            raise ProblemError("torques need both the length and the mass of the robot.")
        # the period that was requested: that of whole samples may be another pace
        robot = RobotSheet(solution, length, mass, period or cycle.period, gravity)
        facts |= {"length_m": length, "mass_kg": mass, "gravity_m_per_s2": gravity}
        if limits is None or keep_pace:
            at_pace, torques = robot, robot.torques(cycle.phase)
            facts["torques"] = "those of this pace; of slow motion before time 0"
            facts["distance_at_this_pace_m"] = robot.facts["speed_m_per_s"] * robot.period
        else:  # inertia with another timing is not known
            torques = joint_torques(solution, cycle.phase, froude=solution.froude)
            torques = robot.torque_unit * torques
            facts["torques"] = "those of slow motion, as the pace is not the gait's own"
        if ramp:
            joints = problem.joint_path(way_in.angles, cycle.period * way_in.speeds)
            pull = problem.regime.pull(np.full((1, way_in.time.size), solution.gait.theta or 0.0))
            rows[0].append(robot.torque_unit * quasi_static_torques(solution, *joints, pull))
        rows[-1].append(torques)
        for row in rows:
            row.append(row[2] * row[1])
    time = (np.arange(periods)[:, None] * cycle.period + cycle.time).ravel()
    table = np.tile(rows[-1], periods)  # (unit, joint, time)
    if ramp:
        facts["ramp_s"] = -float(way_in.time[0])
        if not problem.regime.slides:
            fine = _way_in(problem, cycle, _FINE / cycle.period, limits)
            facts |= _end(solution, cycle, fine, periods, at_pace)
        time = np.append(way_in.time, time)
        table = np.append(np.array(rows[0]), table, axis=2)
    if ramp and path.suffix == ".yaml":  # and out of it, as into the gait played backwards
        back = [np.roll(x[:, ::-1], 1, axis=1) for x in (cycle.angles, cycle.speeds)]
        way = _way_in(problem, replace(cycle, angles=back[0], speeds=-back[1]), rate, limits)
        ends = zip((cycle.angles, cycle.speeds), (way.angles, -way.speeds), strict=True)
        out = np.array([np.hstack([first[:, :1], rest[:, ::-1]]) for first, rest in ends])
        table = np.append(table[:2], out, axis=2)
        time = time[0] + np.arange(table.shape[2]) / rate
        facts["ramp_out_s"] = -float(way.time[0])
    _write_samples(path, facts, solution.gait.motor_gait.coordinate, time, table, degrees, servo)
    return facts


def _check_format(problem: Problem, path: Path, degrees: bool, servo: Servo | None) -> None:
    kinds = (".csv", ".json", ".yaml", ".h", *MODELS)
    if path.suffix not in kinds:
        raise ProblemError(f"{path} should end in {' or '.join(kinds)}.")
    if not problem.gait.free:
        raise ProblemError(
            f"{problem.name} is a prescribed motion of a smooth body: it has no joints to export."
        )
    if degrees and (servo or path.suffix not in (".csv", ".json")):
        raise ProblemError("degrees are for angles in CSV and JSON: leave them out.")
    if servo and path.suffix not in (".csv", ".h"):
        raise ProblemError(f"pulses of servos are written as .csv or .h, not {path.suffix}.")


def _facts(
    solution: Solution, cycle: Trajectory, rate: float, limits: np.ndarray | None
) -> dict[str, Any]:
    problem, measured = solution.problem, solution.measured
    return {
        "name": problem.name,
        "status": solution.status,
        "period_s": cycle.period,
        "rate_hz": float(rate),
        "samples_per_period": cycle.time.size,
        "max_speed_rad_per_s": None if limits is None else np.ravel(limits).tolist(),
        "largest_speed_rad_per_s": np.abs(cycle.speeds).max(axis=1).tolist(),
        "body": problem.body.describe(),
        "friction": fields(problem.law),
        "efficiency": measured.efficiency,
        "objective": problem.objective.name,
        "value": measured.value,
        "distance_per_period_body_lengths": measured.distance,
        "travels": solution.travels,
        "rotation_per_period_rad": solution.rotation,
        "turning_radius_body_lengths": solution.turning_radius if solution.turning else None,
        "work_per_period_weight_times_length": measured.work,
        "problem_hash": problem.hash,
    }


def _facts_of_pace(
    solution: Solution, cycle: Trajectory, length: float | None, gravity: float
) -> dict[str, Any]:
    froude = solution.froude
    pace = f"the gait's own, as {solution.problem.paced_by}; distance and work hold "
    if not froude:
        return {"pace": pace + "in a period of 1"}
    unit = froude * pressing(solution, gravity)
    needed = math.sqrt(length / unit) if length else cycle.period
    pace += f"at Froude number {froude:.4g}: a robot of {unit * needed**2:.3g} m in {needed:.4g} s"
    if abs(cycle.period - needed) > 1e-6 * needed:
        pace += f"; this cycle takes {cycle.period:.4g} s"
    return {"pace": pace, "froude_number": froude}


def _way_in(
    problem: Problem, cycle: Trajectory, rate: float, limits: np.ndarray | None
) -> Approach:
    """From the straight body at rest into a cycle; `ProblemError` where links would cross."""
    speeds = np.abs(cycle.speeds)
    most: Any = limits
    if limits is None:
        robot = np.array(problem.largest_speeds) / cycle.period
        most = np.maximum(robot, speeds.max(axis=1)) if robot.size else speeds.max()
    way = approach(cycle, rate, one_each(most, problem.n_motor, "joint speed limit"))
    angles, _ = problem.joint_path(way.angles, way.speeds)
    crossing = float(crossing_depth(problem.body, angles).max())
    if max(crossing, passing_depth(problem.body, angles)) > _CROSSES:
        raise ProblemError(
            "the body crosses itself on the way from straight into the gait: leave it out "
            "(ramp=False, --no-ramp), and bring the robot to the first sample by hand."
        )
    return way


def _write_samples(
    path: Path, facts: dict[str, Any], coordinate: str, time: np.ndarray, table: np.ndarray,
    degrees: bool, servo: Servo | None,
) -> None:  # fmt: skip
    columns = dict(zip(_UNITS, table, strict=False))
    if degrees:
        columns = {
            unit.replace("rad", "deg"): np.degrees(values) if "rad" in unit else values
            for unit, values in columns.items()
        }
    if servo:
        pulses, clamped = servo.pulses(table[0])
        columns = {"pulse": pulses}
        facts |= servo.facts() | {"clamped_samples": clamped}
    motors = [f"{coordinate}_{j + 1}" for j in range(table.shape[1])]
    if path.suffix == ".csv":
        names = [f"{joint}_{unit}" for unit in columns for joint in motors]
        lines = [*comment_lines(facts), ",".join(["time_s", *names])]
        samples = np.vstack([time, *columns.values()]).T
        lines += [",".join(f"{x:.9g}" for x in row) for row in samples]
        text = "\n".join(lines) + "\n"
    elif path.suffix == ".h":
        text = c_table(facts, path, motors, time, next(iter(columns.values())))
    elif path.suffix == ".yaml":
        text = joint_trajectory(facts, motors, time, *table[:2])
    else:
        arrays = {f"{_UNITS[unit]}_{unit}": values.tolist() for unit, values in columns.items()}
        content = {**facts, "coordinate": coordinate, "time_s": time.tolist(), **arrays}
        text = json.dumps(content) + "\n"
    write_text(path, text)


def _end(
    solution: Solution,
    trajectory: Trajectory,
    way: Approach,
    periods: int,
    robot: RobotSheet | None,
) -> dict[str, Any]:
    """Displacement of the centre of mass and turn of the tail link from the straight body along +x
    over a way into the gait to the end, with inertia if the pace is known."""
    body, law, delta = solution.problem.body, solution.problem.law, solution.delta_per_period
    period, froude = trajectory.period, solution.froude or (robot.froude if robot else 0.0)
    time = np.append(way.time, 0.0) / period
    angles, rates = solution.problem.joint_path(
        np.append(way.angles, trajectory.angles[:, :1], axis=1),
        period * np.append(way.speeds, trajectory.speeds[:, :1], axis=1),
    )
    inertial = False
    with suppress(*UNKNOWN):
        if froude:
            long = -float(time[0])
            spline = CubicHermiteSpline(1.0 + time / long, angles, long * rates, axis=1)
            entry: Any = body, law, lambda t: (spline(t), spline(t, 1)), delta * long
            begin = GaitWithInertia(*entry, froude=froude / long**2)
            cycle = solution.played_by(GaitWithInertia, froude=froude)
            state = begin.run(np.zeros(3), _ACCURACY).states[:, -1]
            state[:3] /= long
            before = state
            for _ in range(min(periods, _SETTLED)):
                before, state = state, cycle.run(state, _ACCURACY).states[:, -1]
            place, turn = complex(*state[4:6]), state[3] - before[3]
            last = place - complex(*before[4:6]) * np.exp(1j * turn)
            more = RigidMotion(turn, last).repeat(periods - min(periods, _SETTLED))
            place = complex(np.exp(1j * more.rotation) * place + more.shift)
            turn, inertial = float(state[3] + more.rotation), True
    if not inertial:
        z = body.solve(law, angles, rates, delta).z
        theta = cumulative_trapezoid(z[2], time, initial=0.0)
        tail = trapezoid(np.exp(1j * theta) * (z[0] + 1j * z[1]), time)
        first, entry = (complex(*place) for place in body.centre(angles[:, [0, -1]]).T)
        then = solution.sample(np.array([0.0, float(periods)]))
        turn = float(theta[-1] - then.theta[0])
        along = complex(*(then.centre[:, 1] - then.centre[:, 0])) * np.exp(1j * turn)
        place = tail + np.exp(1j * theta[-1]) * entry - first + along
        turn += float(then.theta[1])
    return {
        "end_body_lengths": [float(place.real), float(place.imag)],
        "end_turned_deg": math.degrees(turn),
        "end_includes_inertia": inertial,
    }


def _write_model(robot: RobotSheet, path: Path) -> dict[str, Any]:
    write_text(path, MODELS[path.suffix](robot))
    solution, problem = robot.solution, robot.solution.problem
    names = ("name", "status", "peak_torque_N_m", "peak_speed_rad_per_s")
    facts: dict[str, Any] = {name: robot.facts[name] for name in names}
    facts |= {"length_m": robot.length, "mass_kg": robot.mass, "period_s": robot.period}
    law, chain = problem.friction, _links(robot)["chain"]
    if path.suffix == ".urdf":
        note = (
            "a URDF says nothing of friction, nor of how the weight is spread over what touches "
            "the floor"
        )
        if robot.max_torque is None or robot.max_speed is None:
            note += f"; limits not stated are {_RESERVE:g} times the gait's"
    elif not rate_independent(problem.law):
        note = (
            f"contacts of MuJoCo have dry friction alone, not {law.label}: the model touches no "
            f"floor"
        )
    else:
        laws = dict.fromkeys([foot.friction or law for foot in chain.standing_on] or [law])
        note = ", ".join(
            f"{x.label} is {_in_mujoco(x).label}" for x in laws if _in_mujoco(x) is not x
        )
        note = note and f"friction in MuJoCo is elliptic, and alike forwards and backwards: {note}"
        feet = tuple(
            replace(foot, friction=foot.friction and _in_mujoco(foot.friction))
            for foot in chain.standing_on
        )
        with suppress(*UNKNOWN):
            facts["moves_body_lengths_per_period"] = replay(
                replace(chain, feet=feet) if chain.feet else chain, _in_mujoco(law), solution.gait,
                solution.delta_per_period, tolerance=1e-3, turn=solution.rotation,
                breaks=solution.gait.corner_phases,
                regime=replace(problem.regime, froude=robot.froude, free=None),
            ).distance  # fmt: skip
    return facts | ({"note": note} if note else {})


def _links(robot: RobotSheet) -> dict[str, Any]:
    """Links and joints in SI units; the inertia about a link's length is that of its box."""
    problem = robot.solution.problem
    chain, limit = problem.body, problem.joint_limit
    if problem.joint_map is not None or type(chain) is not Chain:
        raise ProblemError(
            "models for simulators are of a Chain with a motor in every joint, without gears and "
            f"stuck joints: not of {problem.name}."
        )
    width, height = robot.length * (chain.width or _THIN), _THIN * robot.length
    masses = robot.mass * chain.mass_column()[:, 0]
    upright = robot.mass * robot.length**2 * chain.inertia_column()[:, 0]
    return {
        "chain": chain,
        "lengths": robot.length * np.array(chain.lengths),
        "masses": masses,
        "inertias": np.stack([masses * (width**2 + height**2) / 12, upright, upright], axis=1),
        "width": width,
        "height": height,
        "ranges": joint_ranges(limit, chain.n_joint).tolist(),
    }


def _xml(template: str, robot: RobotSheet, /, **values: Any) -> str:
    facts = robot.facts
    peaks = np.array(facts["peak_torque_N_m"]), np.array(facts["peak_speed_rad_per_s"])
    text = render(template, name=robot.solution.problem.name, robot=robot, peaks=peaks, **values)
    root = ElementTree.fromstring(text)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def mjcf(robot: RobotSheet, *, contacts: bool = True) -> str:
    """The robot as MJCF with position servos and the keyframe "start"; without `contacts`, and
    under laws that are not dry, it touches no floor. `ProblemError` for other bodies than such
    chains."""
    parts, problem, gait = _links(robot), robot.solution.problem, robot.solution.gait
    chain, feet = parts["chain"], list[dict[str, Any]]()
    floor = contacts and rate_independent(problem.law)
    # points on which it stands, each pressed on the floor with its share of the weight
    standing = chain.standing_on or whole_links(chain.weight_column()[:, 0])
    for foot in standing if floor else ():
        law: Any = _in_mujoco(foot.friction or problem.friction)
        turns = isinstance(law, Axle)
        both = (law.largest,) * 2 if turns else (law.mu_f, law.mu_t)
        rule = np.polynomial.legendre.leggauss(_POINTS) if foot.extent else ([0.0], [2.0])
        for node, share in zip(*rule, strict=True):
            along = (foot.place + 0.5 * node * foot.extent) * parts["lengths"][foot.link]
            feet.append(
                {
                    "number": len(feet) + 1,
                    "link": foot.link,
                    "place": (along, foot.offset * robot.length, 0),
                    "angle": foot.angle,
                    "borne": robot.mass * (0.5 * share * float(foot.weight or 0.0)),
                    "friction": (*both, 0, 0, 0),  # a contact has no other resistance
                    "directed": len({f"{x:.9g}" for x in both}) > 1,
                    "rolling": law.rolling if turns else 0.0,
                }
            )
    pull = problem.regime.pull(np.array([[gait.theta or 0.0]]))
    leaning = (0.0, 0.0) if pull is None else pull[:, 0]  # gravity leans, not the floor
    start = gait.angles(np.zeros(1))[:, 0]
    posture = [0.0, 0.0, 0.0]  # the tail, joints, and feet on slides and hinges, link by link
    for k in range(chain.n_link):
        dofs = sum(1 + bool(foot["rolling"]) for foot in feet if foot["link"] == k)
        posture += [*start[max(k - 1, 0) : k], *[0.0] * dofs]
    return _xml(
        "robot.xml",
        robot,
        parts=parts,
        step=robot.period / max(_STEPS, np.ceil(robot.period / _LONGEST)),
        gravity=robot.pressing * np.append(leaning, -1.0) + 0.0,  # no -0
        floor=floor,
        feet=feet,
        foot_mass=_MASS * robot.mass,
        axis=_AXIS * robot.length,
        stiff=_STIFF,
        spin=_SPIN,
        posture=posture,
        start=start,
    )


def urdf(robot: RobotSheet) -> str:
    """The robot as a URDF; link_1 is its tail. Limits not stated are 1.5 times the gait's."""
    return _xml("robot.urdf", robot, parts=_links(robot), reserve=_RESERVE)


MODELS = {".xml": mjcf, ".urdf": urdf}


def _in_mujoco(law: Law) -> Law:
    dry = isinstance(law, Friction) and law.associated and law.reversible
    if dry or isinstance(law, Axle):
        return law
    one, none = np.ones((1, 1)), np.zeros((1, 1))
    ahead, back, aside = (
        max(float(np.hypot(*(force[0, 0] for force in law.density(*way, 1e-12 * one)))), _LEAST)
        for way in ((one, none), (-one, none), (none, one))
    )
    along = math.sqrt(ahead * back)
    return Elliptic(mu_t=aside, mu_f=along, mu_b=along)


_PER_DEGREE, _RANGE = 2000 / 180, (500.0, 2500.0)  # of common servos [microseconds]


@named_arguments
@dataclass(frozen=True)
class Servo:
    """Pulses of servos: ``neutral + sign * scale * degrees``, whole ones. Each value is one for all
    joints, or one each.

    Parameters
    ----------
    neutral : float or (n_joint,)
        Of the straight joint: a width in microseconds, or ticks.
    scale : float or (n_joint,)
        Pulses per degree; by default 2000 microseconds for 180 degrees.
    sign : int or (n_joint,)
        -1 where larger pulses turn the joint clockwise.
    clamp : (low, high) or (n_joint, 2), optional
        Pulses beyond are set to these; by default (500, 2500), or none with a scale of one's own.

    Raises
    ------
    ProblemError
        If values are not such numbers.

    Examples
    --------
    >>> import numpy as np
    >>> from colloc import Servo
    >>> Servo(neutral=(1500, 1480), sign=(1, -1)).pulses(np.radians([[0, 30, 120], [0, 30, 0]]))
    (array([[1500, 1833, 2500], [1480, 1147, 1480]]), [1, 0])
    """

    neutral: float | Sequence[float] = 1500.0
    scale: float | Sequence[float] = _PER_DEGREE
    sign: int | Sequence[int] = 1
    clamp: Sequence[Any] | None = None

    def __post_init__(self) -> None:
        if self.clamp is None and is_number(self.scale) and self.scale == _PER_DEGREE:
            object.__setattr__(self, "clamp", _RANGE)
        needs: dict[str, tuple[str, Callable[[np.ndarray], Any]]] = {
            "neutral": ("numbers", np.isfinite),
            "scale": ("positive numbers", lambda x: np.isfinite(x) & (x > 0)),
            "sign": ("1 or -1", lambda x: abs(x) == 1),
            "clamp": ("pairs of a low and a high number", lambda x: np.less(*x.reshape(-1, 2).T)),
        }
        for name, (what, fits) in needs.items():
            if (given := getattr(self, name)) is None:
                continue
            try:
                values = np.array(given, dtype=float).ravel()
                good = values.size > 0 and bool(np.all(fits(values)))
            except (TypeError, ValueError, OverflowError):
                good = False
            if not good:
                raise ProblemError(f"{name} of servos must be {what}, not {shown(given)}.")
            object.__setattr__(self, name, tuple(values.tolist()))

    def pulses(self, angles: np.ndarray) -> tuple[np.ndarray, list[int]]:
        """Whole pulses of angles [rad], and how many of each joint are clamped."""
        columns: list[np.ndarray] = []
        for name, many in (("neutral", 1), ("scale", 1), ("sign", 1), ("clamp", 2)):
            values = np.reshape(getattr(self, name) or (-np.inf, np.inf), (-1, many, 1))
            if len(values) not in (1, len(angles)):
                raise ProblemError(
                    f"{name} of servos is given for {len(values)} joints of {len(angles)}: give it "
                    "once for all, or for each."
                )
            columns += [*values.transpose(1, 0, 2)]
        neutral, scale, sign, low, high = columns
        exact = neutral + sign * scale * np.degrees(angles)
        clipped = np.clip(exact, low, high)
        return np.rint(clipped).astype(int), np.sum(clipped != exact, axis=1).tolist()

    def facts(self) -> dict[str, Any]:
        return {
            "pulses": "neutral + sign * scale * degrees, within clamp, to whole ones; microseconds "
            "by default: 1500 straight, 2000 for 180 degrees",
            **vars(self),
        }


def comment_lines(facts: Mapping[str, Any], mark: str = "#") -> list[str]:
    """Lines of comment, each a JSON value."""
    return [f"{mark} {key}: {json.dumps(value)}" for key, value in facts.items()]


def joint_trajectory(
    facts: Mapping[str, Any],
    names: Sequence[str],
    time: np.ndarray,
    angles: np.ndarray,
    speeds: np.ndarray,
) -> str:
    """A ``trajectory_msgs/msg/JointTrajectory`` in YAML, from time 0 on."""
    # without exponents, which not all readers know
    rows = ([[f"{x:.6f}" for x in row] for row in np.round(x.T, 6) + 0.0] for x in (angles, speeds))
    clock = np.rint(1e9 * (time - time[0])).astype(int).tolist()
    points = zip((divmod(nanoseconds, 10**9) for nanoseconds in clock), *rows, strict=True)
    comment = "\n".join(comment_lines(facts))
    return render("trajectory.yaml", comment=comment, names=names, points=points)


def c_table(
    facts: Mapping[str, Any], path: Path, names: Sequence[str], time: np.ndarray, rows: np.ndarray
) -> str:
    """A C header with samples before time 0, to be sent once, and then those of the cycle: floats
    [rad], or whole pulses. Names begin with that of the file."""
    stem = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    kind, number = "float", lambda x: f"{round(x, 7) + 0.0:.7f}f"
    if rows.dtype == int:
        kind, number = "short" if np.abs(rows).max() < 2**15 else "long", str
    parts = [("ramp", "once, from straight, at rest", time < 0), ("cycle", "for ever", time >= 0)]
    tables = [(x, how, [[*map(number, row)] for row in rows.T[at]]) for x, how, at in parts]
    return render(
        "table.h", facts=facts, kind=kind, names=names, parts=[each for each in tables if each[2]],
        stem=f"gait_{stem}" if stem[:1].isdigit() else stem,
        comment="\n".join(comment_lines(facts, "//")),
    )  # fmt: skip
