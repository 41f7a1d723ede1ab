"""A gait on a robot of given length and mass, the only module in SI units; utilisation of the
limits of a problem by a gait, and limits that no gait could reach.

Elsewhere lengths are in body lengths L, forces in weights m g, times in periods T: torque and work
in m g L, power in m g L / T. Inertia depends on the Froude number Fr = L / (g T^2) alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from colloc.dynamics.chain import joint_torques as inertial_torques
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.problem import Problem
from colloc.gaits.robot import LARGEST, SPEED_OF_ROBOT, joint_ranges, of_each, under_one_limit
from colloc.mechanics.balance import joint_moments, largest_moments
from colloc.mechanics.chain import Chain
from colloc.mechanics.densities import Instants
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.inertia import GRAVITY, checked_mass, momenta
from colloc.mechanics.law import rate_independent
from colloc.results.motion import (
    Column,
    SampledMotion,
    motion_dataset,
    motion_with_inertia,
    rotate,
    way_on_circle,
)
from colloc.results.solution import Solution, direction_of_travel
from colloc.system.arguments import check_range
from colloc.system.environment import higher
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.verification.trajectory import one_each, shortest_period

if TYPE_CHECKING:
    import xarray

SLOW_ENOUGH = 0.01  # share of the efficiency that inertia may take from a quasi-static gait
_SAME_PACE = 0.01  # relative difference of Froude numbers that counts as none
_ACCURACY = 1e-6  # of the momenta with inertia
_INSTANTS, _A_SIDE = 2000, 8  # samples of a cycle, and of a side of a polygon, at least
UNKNOWN = ProblemError, NotConvergedError


def joint_torques(
    solution: Solution,
    t: np.ndarray,
    motion: SampledMotion | None = None,
    froude: float | None = None,
) -> np.ndarray:
    """Motor torques [weight x body length] at phases t, ``(n_joint, n_time)``: of the result, or of
    another `motion` at these phases with its Froude number."""
    problem = solution.problem
    if not isinstance(problem.body, Chain):
        raise ProblemError(
            f"{problem.name} is a smooth body: joint torques are not defined for it."
        )
    motion = motion or solution.sample(t)
    froude = solution.froude if froude is None else froude
    (angles, rates), z = solution.gait(t), motion.z
    load = problem.regime.pull(motion.theta[None])
    if not froude:
        return quasi_static_torques(solution, angles, rates, load, start=z)
    body, law = checked_mass(problem.body), problem.law
    posture = body.posture(angles)
    states = momenta(body, posture, body.velocity(posture, rates, z))
    how: Any = {"delta": solution.delta_per_period, "froude": froude}
    return problem.of_motors(inertial_torques(body, law, solution.gait, t, states, **how))


def quasi_static_torques(
    solution: Solution,
    angles: np.ndarray,
    rates: np.ndarray,
    load: np.ndarray | None,
    start: np.ndarray | None = None,
) -> np.ndarray:
    """Motor torques against friction and a load on the centre of mass ``(2, n_time)``, at tail
    velocities that balance, sought near `start`."""
    body: Any = solution.problem.body
    law, delta = solution.problem.law, solution.delta_per_period
    balance = body.solve if load is None else partial(solve_balance, body, load=load)
    z = balance(law, angles, rates, delta, start=start).z
    forces = body.forces(law, angles, rates, z, delta)
    return solution.problem.of_motors(joint_moments(body, angles, forces, load))


class _MotionWithInertia:
    """Periodic motion of a gait with inertia; the distance is the chord of `colloc.results.motion`.

    `ProblemError` if gait or body cannot have inertia, `NotConvergedError` if no motion is found.
    """

    def __init__(self, solution: Solution, froude: float) -> None:
        from colloc.verification.differential_motion import GaitWithInertia

        regime, self._gait = solution.problem.regime, solution.gait
        moving = solution.played_by(GaitWithInertia, froude=froude, regime=regime)
        self._chain, rough = moving.body, moving.find_period()
        self._course = moving.periodic_run(rough.momenta, _ACCURACY, rough.slopes).course
        totals = moving.totals(self._course.states)
        self.work, self.rotation = totals["work"], totals["rotation"]
        self.distance, self._heading = totals["distance"], 0.0
        if not regime.slides:
            path = self._course.at(np.linspace(0.0, 1.0, _INSTANTS + 1))[4:6]
            self.distance = abs(chord := way_on_circle(self.rotation, path))
            end = complex(*self._course.states[4:6, -1])
            if solution.problem.rotation:  # its circle sets out along +x
                end = chord * np.exp(-0.5j * self.rotation)
            self._heading = float(np.angle(end))

    def sample(self, t: np.ndarray) -> SampledMotion:
        states = self._course.at(t)[:6]
        states[3:] = [states[3] - self._heading, *rotate(states[4:], -self._heading)]
        return motion_with_inertia(self._chain, self._gait, t, states)


def pressing(solution: Solution, gravity: float) -> float:
    """Component of gravity normal to the ground."""
    return gravity * math.cos(math.atan(solution.problem.grade))


def stated_robot(solution: Solution, **changes: Any) -> dict[str, Any]:
    """Arguments of `RobotSheet` that are given, the others as the problem's robot has them; empty
    if there are none."""
    arguments, robot = {}, solution.problem.robot
    if robot is not None:
        names = ("length", "mass", "gravity", "max_speed", "max_torque")
        arguments = {name: getattr(robot, name) for name in names} | {"period": period_of(solution)}
    arguments |= {name: value for name, value in changes.items() if value is not None}
    missing = [name for name in ("length", "mass", "period") if name not in arguments]
    if arguments and missing:
        raise ProblemError(f"a robot needs its length, mass and period; {missing[0]} is missing.")
    return arguments


def period_of(solution: Solution) -> float:
    """Time that a cycle of the problem's robot takes [s]."""
    robot: Any = solution.problem.robot
    if isinstance(robot.period, tuple):
        pace = robot.pressing(solution.problem.grade) * solution.froude
        return math.sqrt(robot.length / pace)
    return float(robot.period)


class Units(NamedTuple):
    """Sizes of units that a solution is drawn in, and their names."""

    length: float = 1.0
    of_length: str = "body lengths"
    time: float = 1.0
    of_time: str = "phase t"
    angle: float = 1.0
    of_angle: str = "rad"
    of_speed: str = "1/period"
    power: float = 1.0
    of_power: str = "weight·length/period"

    @property
    def speed(self) -> float:
        return self.length / self.time


def drawn_units(solution: Solution) -> Units:
    """Centimetres, seconds, degrees and watts of a robot; else those without dimensions."""
    if (robot := solution.problem.robot) is None:
        return Units()
    period, work = period_of(solution), robot.torque_unit(solution.problem.grade)
    lengths, times = (100 * robot.length, "cm"), (period, "time  [s]")
    return Units(*lengths, *times, math.degrees(1.0), "deg", "cm/s", work / period, "W")


def in_si(solution: Solution) -> dict[str, float]:
    """Speed, way and energy of the problem's robot, by names that end in their units; empty without
    a robot."""
    robot, period = solution.problem.robot, solution.certificate
    if robot is None or not period.replayed:
        return {}
    time, way = period_of(solution), period.distance * robot.length
    unit = robot.torque_unit(solution.problem.grade)
    facts = {
        "period_s": time,
        "distance_per_cycle_m": way,
        "speed_m_per_s": way / time,
        "friction_work_per_cycle_J": unit * period.work,
    }
    if "driven_work" in period.values:
        motors, idle = unit * period.values["driven_work"], robot.idle_power * time
        facts |= {
            "motor_work_per_cycle_J": motors,
            "idle_energy_per_cycle_J": idle,
            "energy_J_per_m": (motors + idle) / way,
            "mean_battery_power_W": (motors + idle) / time,
        }
    return facts


@dataclass(frozen=True, eq=False)
class RobotSheet:
    """A gait on a robot, made by `colloc.Solution.robot`; ``print`` shows its data sheet.

    In SI units; `max_speed` and `max_torque` are limits of the motors, one or one each.
    `ProblemError` if a number is unusable, the body has no joints, or the gait is for another pace.
    """

    solution: Solution = field(repr=False)
    length: float
    mass: float
    period: float
    gravity: float = GRAVITY
    max_speed: float | Sequence[float] | None = None
    max_torque: float | Sequence[float] | None = None

    def __post_init__(self) -> None:
        sizes = {name: getattr(self, name) for name in ("length", "mass", "period", "gravity")}
        check_range(1 / LARGEST, LARGEST, **sizes)
        problem, froude = self.solution.problem, self.solution.froude
        if froude and abs(self.froude / froude - 1.0) > _SAME_PACE:
            needed = math.sqrt(self.length / (self.pressing * froude))
            cure, of_robot = f"froude={self.froude:.4g}", stated_robot(self.solution)
            if of_robot:
                changes = (f"{x}={y:.4g}" for x, y in sizes.items() if y != of_robot[x])
                cure = f"{', '.join(changes)} in its robot"
            raise ProblemError(
                f"{problem.name} is the best gait for the Froude number {froude:.4g}: a robot of "
                f"{self.length:g} m needs {needed:.4g} s per cycle, not {self.period:g} s: "
                f"solve again with {cure}."
            )
        paced = problem.froude or not rate_independent(problem.law)
        for name in ("max_speed", "max_torque"):
            if (limit := getattr(self, name)) is not None:
                each = one_each(limit, problem.n_motor, f"joint {name[4:]} limit")
                object.__setattr__(self, name, each)
                if paced and problem.robot is None:
                    raise ProblemError(
                        f"{name} needs another pace, and torques depend on it, as "
                        f"{problem.paced_by}: leave it out, or solve again for that pace."
                    )

    @property
    def pressing(self) -> float:
        return pressing(self.solution, self.gravity)

    @property
    def torque_unit(self) -> float:
        """m g L [N m]."""
        return self.mass * self.pressing * self.length

    @property
    def froude(self) -> float:
        """L / (g T^2)."""
        return self.length / (self.pressing * self.period**2)

    @cached_property
    def _with_inertia(self) -> _MotionWithInertia | None:
        with suppress(*UNKNOWN):
            if not self.solution.problem.froude:
                return _MotionWithInertia(self.solution, self.froude)
        return None

    def torques(self, t: np.ndarray) -> np.ndarray:
        """Return joint torques [N m], ``(n_joint, n_time)``, at ascending phases in [0, 1]."""
        moving = self._with_inertia
        other = () if moving is None else (moving.sample(t), self.froude)
        return self.torque_unit * joint_torques(self.solution, t, *other)

    @cached_property
    def columns(self) -> dict[str, Column]:
        """Motion over a cycle: values, units and dimensions by name."""
        n = max(_INSTANTS, _A_SIDE * (len(self.solution.gait.corner_phases) + 1))
        t = np.arange(n + 1) / n
        motion = (self._with_inertia or self.solution).sample(t)
        angles, rates = self.solution.gait.motor_gait(t)
        torques, speeds = self.torques(t), rates / self.period
        joint, axis = ("joint", "t"), ("axis", "t")
        return {
            "t": Column(t * self.period, "s", ("t",)),
            "joint_angles": Column(angles, "rad", joint),
            "joint_speeds": Column(speeds, "rad/s", joint),
            "joint_torques": Column(torques, "N m", joint),
            "joint_powers": Column(torques * speeds, "W", joint),
            "theta": Column(motion.theta, "rad", ("t",)),
            "centre": Column(self.length * motion.centre, "m", axis),
            "tail": Column(self.length * motion.tail, "m", axis),
        }

    def to_xarray(self) -> xarray.Dataset:
        """Return the motion over a cycle as an xarray Dataset in SI units."""
        attributes = {name: value for name, value in self.facts.items() if value is not None}
        return motion_dataset(self.columns, attributes)

    def plot(self, ax: Any = None, panel: str = "torque") -> Any:
        """Draw torque, speed and power of every joint over a cycle as a matplotlib Figure; with a
        matplotlib Axes `ax` the panel "torque", "speed" or "power" there, and return the Axes."""
        return higher("pictures.figure:plot_robot")(self, ax, panel)

    @cached_property
    def facts(self) -> dict[str, Any]:
        """All numbers, by names that end in their units, as JSON can hold them; those that are not
        known, or of limits that are not stated, are missing."""
        solution, problem, moving = self.solution, self.solution.problem, self._with_inertia
        motion, values = moving or solution.measured, self.columns
        # the last sample repeats the first
        rows = {x: values[f"joint_{x}s"].values[:, :-1] for x in ("torque", "speed", "power")}
        work, powers = self.torque_unit * motion.work, rows["power"]
        facts = {
            "name": problem.name,
            "status": solution.status,
            "length_m": float(self.length),
            "mass_kg": float(self.mass),
            "period_s": float(self.period),
            "gravity_m_per_s2": float(self.gravity),
            "speed_m_per_s": motion.distance * self.length / self.period,
            "body_lengths_per_period": motion.distance,
            "travels": direction_of_travel(values["centre"].values, values["tail"].values),
            "work_per_period_J": work,
            "motor_work_per_period_J": self.period * float(powers.clip(0).mean(axis=1).sum()),
            "mean_power_W": work / self.period,
            "peak_power_W": float(powers.sum(axis=0).max()),
            "cost_of_transport": motion.work / motion.distance * self.pressing / self.gravity,
            "froude_number": self.froude,
        }
        for name, unit in (("torque", "N_m"), ("speed", "rad_per_s")):
            facts[f"peak_{name}_{unit}"] = np.abs(rows[name]).max(axis=1).tolist()
            facts[f"rms_{name}_{unit}"] = np.sqrt((rows[name] ** 2).mean(axis=1)).tolist()
            if (limits := getattr(self, f"max_{name}")) is not None:
                facts[f"max_{name}_{unit}"] = limits.tolist()
                facts[f"{name}_used"] = (facts[f"peak_{name}_{unit}"] / limits).tolist()
        facts["peak_joint_power_W"] = powers.max(axis=1).tolist()
        if problem.froude:
            with suppress(NotConvergedError):
                facts["played_slowly"] = solution.played_slowly
        elif not problem.regime.slides:
            if moving is not None:
                facts["inertia_takes"] = 1.0 - moving.distance / moving.work / solution.efficiency
                facts["rotation_by_inertia_rad"] = moving.rotation - solution.rotation
            with suppress(*UNKNOWN):
                if rate_independent(problem.law):
                    slow = self.length / (self.gravity * solution.slow_enough(SLOW_ENOUGH))
                    facts["slow_enough_period_s"] = math.sqrt(slow)
        if self.max_speed is not None and not problem.froude:
            gait, limits = solution.gait.motor_gait, np.asarray(self.max_speed)
            shortest = facts["shortest_period_s"] = shortest_period(gait, limits, keep_pace=True)
            with suppress(*UNKNOWN):
                paced = _MotionWithInertia(solution, self.froude * (self.period / shortest) ** 2)
                speed = paced.distance * self.length / shortest
                facts["speed_at_shortest_period_m_per_s"] = speed
            if not problem.paced_by:
                facts["shortest_period_paced_by_speed_s"] = shortest_period(gait, limits)
        if self.max_torque is not None and moving is not None:
            slowly = joint_torques(solution, np.arange(_INSTANTS) / _INSTANTS)
            used = self.torque_unit * np.abs(slowly).max(axis=1) / self.max_torque
            facts["torque_used_slowly"] = used.tolist()
        return facts

    def __str__(self) -> str:
        law, coordinate = self.solution.problem.law, self.solution.gait.motor_gait.coordinate
        text: str = higher("pictures:render")(
            "robot.txt", robot=self, f=self.facts, coordinate=coordinate, degrees=math.degrees,
            paced=not rate_independent(law), with_inertia=self._with_inertia is not None,
        )  # fmt: skip
        return text.rstrip()

    def sentences(self) -> list[str]:
        return str(self).rpartition("\n\n")[2].replace("\n  ", "\n").strip().splitlines()


_EVENLY = np.arange(2000) / 2000
_BINDS, _MARGIN = 0.99, 1.01  # share of a limit at which it binds; of a bound at which it cannot
_FIELDS = {"joint speed": "speed_limit", "torque": "torque_limit", "power": "power_limit"}


def _units(problem: Problem) -> dict[str, tuple[str, str, float]]:
    units = {}
    for name, unit, of_robot, in_si in (
        ("speed_limit", "rad per period", "max_speed", "rad/s"),
        ("torque_limit", "weight x body length", "max_torque", "N m"),
        ("power_limit", "weight x body length per period", "", ""),
    ):
        units[name], limit = (name, unit, 1.0), getattr(problem, name)
        if problem.robot is not None and limit and in_si:  # no speed where the period is sought
            size = np.ravel(getattr(problem.robot, of_robot))[0] / np.ravel(limit)[0]
            units[name] = of_robot, in_si, float(size)
    return units


def limit_shares(solution: Solution) -> dict[str, float]:
    """Largest utilisation of every limit over a period, by name; empty for default limits."""
    problem, body, limits = solution.problem, solution.problem.body, solution.problem.path_limits
    limited = problem.joint_limit != body.defaults.limit or limits.each or problem.largest_speeds
    if not (problem.gait.free and limited):
        return {}
    motion = solution.sample(_EVENLY)
    stretched, limit = under_one_limit(motion.angles, problem.joint_limit)
    name = body.defaults.limit_name.replace("limits", "angles")
    used = {name: float(body.bounded_angles.largest(stretched).max()) / limit}
    if problem.largest_speeds:
        fastest = np.abs(solution.gait.motor_gait.rates(_EVENLY)).max(axis=1)
        used["joint speed"] = float((fastest / problem.largest_speeds).max())
    if limits.each:
        forces = limits.needs_forces
        z, load = (motion.z, problem.regime.pull(motion.theta[None])) if forces else (None, None)
        at = (body, problem.law, motion.angles, motion.rates, solution.delta_per_period)
        now = Instants(*at, z, load=load, joint_map=problem.joint_map)
        if forces and problem.froude:
            moments = joint_torques(solution, _EVENLY, motion)
            now = Instants(*at, moments=moments, froude=solution.froude)
        each_used = iter(limits.sizes(limits.at(now)).max(axis=1))
        used |= {x.name: max(float(next(each_used)) for _ in x.names) for x in limits.each}
    return used


def limit_lines(solution: Solution) -> list[str]:
    """Utilisations in a line, and a line for each limit that seems to be in other units."""
    problem, used, texts = solution.problem, limit_shares(solution), []
    units = _units(problem)
    for name, share in used.items():
        text = f"{name} {100 * share:.{0 if share >= 0.01 else 2}f} %"
        field = _FIELDS.get(name, "")
        limit, (_, unit, size) = getattr(problem, field, None), units.get(field, ("", "", 1.0))
        if problem.robot is not None and name == SPEED_OF_ROBOT:
            limit, unit = problem.robot.max_speed, "rad/s"
        if limit and not isinstance(limit, tuple):
            text += f" of {limit * size:g} {unit}"
        texts.append(text)
    if not used:
        return []
    if problem.joint_map is not None:  # motors share what their joints need
        return [", ".join(texts)]
    return [", ".join(texts), *_hints(problem, used.get("joint speed", 0.0))]


def _hints(problem: Problem, speed_used: float) -> Iterator[str]:
    """Limits that cannot bind: torques by statics where no link is accelerated, speeds of a Fourier
    series by Bernstein's inequality, powers by both. Binding speed limits: in a period a joint
    swings to and fro by half of what it can cover."""
    n, gait, limit = problem.body.n_joint, problem.gait, problem.joint_limit
    half = 0.5 * np.ptp(joint_ranges(limit, n), axis=1)
    torque, speed = np.full(n, np.inf), np.full(n, np.inf)
    if not problem.froude and isinstance(problem.body, Chain) and rate_independent(problem.law):
        torque = largest_moments(problem.body, problem.friction, problem.grade)
    if isinstance(gait, Harmonic) and problem.body.bounded_angles.rows.shape == (n, n):
        speed = 2 * math.pi * gait.harmonics * half
    bounds = speed, torque, torque * np.minimum(speed, problem.largest_speeds or np.inf)
    units = _units(problem)
    for (name, (called, unit, size)), bound in zip(units.items(), bounds, strict=True):
        limit = getattr(problem, name)
        if not isinstance(limit, tuple):  # of all joints: it matters if it does to one of them
            bound = bound.max(keepdims=True)
        limits = of_each(limit, bound.size)
        if limits and (np.array(limits) > _MARGIN * bound).any():
            joint = int(np.argmax(limits / bound))
            of = f" of joint {joint + 1}" * isinstance(limit, tuple)
            yield (
                f"{called} {size * limits[joint]:g}{of} cannot matter: no gait needs more than "
                f"{size * bound[joint]:.3g} {unit}, its unit"
            )
    if speed_used > _BINDS:
        most = np.array(problem.largest_speeds) / 2
        joint = int(np.argmin(most / half))
        if most[joint] < 2 * half[joint]:
            swing, largest = np.degrees([most[joint], 2 * half[joint]])
            called, unit, size = units["speed_limit"]
            yield (
                f"{called} {2 * size * most[joint]:g} {unit}, its unit, lets a joint "
                f"swing by {swing:.3g} of {largest:.3g} degrees at most"
            )
