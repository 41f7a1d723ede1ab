"""A gait on a robot of so many metres and kilograms: the one module that knows units.

Everything else counts lengths in body lengths L, forces in weights m g and time in periods T. So a
torque is one in m g L, work too, a power in m g L / T, and a speed in L / T; the cost of transport
W / (m g d) has no unit. The numbers are those at the robot's pace, with inertia: what that does
depends on the *Froude number* Fr = L / (g T^2) alone. Where the body has no masses, or the motion
with inertia is not found, they are those of slow motion, which is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from colloc.mechanics.actuators import joint_moments
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.inertia import (
    GRAVITY,
    checked_mass,
    inertial_moments,
    momenta,
    momentum_rates,
    tail_velocity,
)
from colloc.mechanics.law import rate_independent
from colloc.mechanics.links import LinkVelocity
from colloc.results.arc import arc
from colloc.results.motion import Column, SampledMotion, motion_dataset, turned
from colloc.results.solution import Solution, direction_of_travel
from colloc.system.arguments import check_finite
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.late_binding import bound
from colloc.verification.trajectory import one_each, shortest_period

if TYPE_CHECKING:
    import xarray

SLOW_ENOUGH = 0.01
"""Part of the efficiency that inertia may take from a gait that is called slow."""
_MOMENT = 1e-5
"""Of a period, over which velocities of links are differentiated."""
_PACE = 0.01
"""Relative difference of the Froude numbers of a robot and of the gait, up to which it is played at
the pace that it is for."""
_ACCURACY = 1e-6
"""Of the momenta in the motion with inertia."""
_LITTLE = 1e-3
"""Share of the efficiency below which what inertia takes is not told apart."""
_LARGEST = 1e9
"""Of the metres, kilograms and seconds of a robot; one over it is the smallest."""
_TURNS = 0.1
"""Degrees a period, from which on a turn by inertia is said."""
_INSTANTS, _A_SIDE = 2000, 8
"""Of a period at least, and of every side of a polygon."""
_PHASES = np.arange(_INSTANTS) / _INSTANTS


def joint_torques(
    solution: Solution,
    t: np.ndarray,
    motion: SampledMotion | None = None,
    froude: float | None = None,
) -> np.ndarray:
    """Torques of the joints' motors [weight x body length] at phases t ``(n_time,)``, ``(n_joint,
    n_time)``.

    Those of the result, unless another `motion` at these phases is given, with the Froude number
    that it belongs to.

    Raises
    ------
    ProblemError
        If the body has no joints that forces on its parts would turn.
    """
    problem = solution.problem
    if not problem.body.force_names:
        raise ProblemError(
            f"{problem.name} is a smooth body: it has no joints whose torques could be told."
        )
    motion = motion or solution.sample(t)
    froude = solution.froude if froude is None else froude
    (angles, rates), z, load = solution.gait(t), motion.z, problem.regime.pull(motion.theta[None])
    if not froude:
        return slow_torques(solution, angles, rates, load, z)
    return _of_friction(solution, angles, rates, load, z) + _of_inertia(
        solution, t, z, load, froude
    )


def slow_torques(
    solution: Solution,
    angles: np.ndarray,
    rates: np.ndarray,
    load: np.ndarray | None,
    start: np.ndarray | None = None,
) -> np.ndarray:
    """Torques of the motors in balance [weight x body length] at any angles and rates of joints,
    ``(n_joint, n_time)``, with a pull on the centre of mass ``(2, n_time)`` if there is one; tail
    velocities are sought near `start`."""
    body: Any = solution.problem.body
    balanced = body.solve if load is None else partial(solve_balance, body, load=load)
    z = balanced(solution.problem.law, angles, rates, solution.delta_per_period, start=start).z
    return _of_friction(solution, angles, rates, load, z)


def _of_friction(
    solution: Solution,
    angles: np.ndarray,
    rates: np.ndarray,
    load: np.ndarray | None,
    z: np.ndarray,
) -> np.ndarray:
    """Torques of the motors against friction and pull, with tail velocities z."""
    body, law, delta = solution.problem.body, solution.problem.law, solution.delta_per_period
    forces = body.forces(law, angles, rates, z, delta)
    return solution.problem.of_motors(joint_moments(body, law, angles, forces, delta, load))


def _of_inertia(
    solution: Solution, t: np.ndarray, z: np.ndarray, load: np.ndarray | None, froude: float
) -> np.ndarray:
    """Torques of the motors that change how the links move, at phases with tail velocities z."""
    problem = solution.problem
    body, joints = checked_mass(problem.body), solution.gait
    angles, rates = joints(t)
    link = body.velocity(body.posture(angles), rates, z)
    states = momenta(body, body.posture(angles), link)
    grows = momentum_rates(
        body, problem.law, angles, rates, states, delta=solution.delta_per_period, froude=froude
    ).rates
    if load is not None:
        grows[:2] += load / froude

    def later(by: float) -> LinkVelocity:
        then, pace = joints(t + by)
        return body.velocity(
            body.posture(then), pace, tail_velocity(body, then, pace, states + by * grows)
        )

    growth = LinkVelocity(
        *(
            (after - before) / (2 * _MOMENT)
            for before, after in zip(later(-_MOMENT), later(_MOMENT), strict=True)
        )
    )
    return problem.of_motors(froude * inertial_moments(body, angles, link, growth))


class _Played:
    """The motion of a gait with inertia in which all periods are alike, at a Froude number.

    Attributes
    ----------
    distance, work, rotation : float
        Of a period; distance as in `colloc.results.arc.Arc`.

    Raises
    ------
    ProblemError
        If the gait or the body cannot be played with inertia.
    NotConvergedError
        If the motion is not found.
    """

    def __init__(self, solution: Solution, froude: float) -> None:
        from colloc.verification.inertial_motion import gait_with_inertia  # loads what integrates

        problem, self._gait = solution.problem, solution.gait
        self._body = problem.body
        how: Any = {
            "froude": froude,
            "breaks": solution.gait.corner_phases,
            "regime": problem.regime,
        }
        played = gait_with_inertia(
            problem.body, problem.law, solution.gait, solution.delta_per_period, **how
        )
        closed = played.closed_from(None)
        self._course = played.periodic_run(closed.momenta, _ACCURACY, closed.slopes).course
        passed = played.passed(self._course.states)
        self.work, self.rotation, self.distance = (
            passed["work"],
            passed["rotation"],
            passed["distance"],
        )
        self._ahead = 0.0
        if not problem.regime.slides:
            way = arc(self.rotation, self._course.at(np.linspace(0.0, 1.0, _INSTANTS + 1))[4:6])
            self.distance = way.chord
            end = self._course.states[4:6, -1]
            self._ahead = float(np.arctan2(end[1], end[0])) - 0.5 * self.rotation

    def sample(self, t: np.ndarray) -> SampledMotion:
        """At ascending phases in [0, 1], in the axes of `Solution.sample`."""
        states, (angles, rates) = self._course.at(t), self._gait(t)
        theta, centre = states[3] - self._ahead, turned(states[4:6], -self._ahead)
        z = tail_velocity(checked_mass(self._body), angles, rates, states[:3])
        tail = centre - turned(np.array(self._body.centre(angles)), theta)
        return SampledMotion(t, angles, rates, z, theta, centre, tail)


def pressing(solution: Solution, gravity: float) -> float:
    """The part of gravity that presses a robot on the ground: less than all of it on a slope."""
    return gravity * math.cos(math.atan(solution.problem.grade))


@dataclass(frozen=True, eq=False)
class Robot:
    """What a gait does on a robot: `colloc.Solution.robot` makes it, and ``print`` shows it.

    Parameters
    ----------
    solution : Solution
    length : float
        Of the robot, from tail to head, stretched [m].
    mass : float
        [kg]
    period : float
        Of the gait [s].
    gravity : float
        [m/s^2]
    max_speed, max_torque : float or (n_joint,), optional
        Of the motors [rad/s], [N m]: then the shortest period is told, and whether the torques at
        this one suffice.

    Raises
    ------
    ProblemError
        If a number is not positive, the body has no joints, the gait is for another pace, or
        `max_speed` or `max_torque` is given where torques depend on the pace.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> robot = colloc.solve(problem, starts=1).robot(length=1.2, mass=3, period=5)
    >>> round(robot.facts["work_per_period_J"], 1)
    36.5
    """

    solution: Solution = field(repr=False)
    length: float
    mass: float
    period: float
    gravity: float = GRAVITY
    max_speed: float | Sequence[float] | None = None
    max_torque: float | Sequence[float] | None = None

    def __post_init__(self) -> None:
        numbers = {name: getattr(self, name) for name in ("length", "mass", "period", "gravity")}
        check_finite(positive=True, **numbers)
        for name, value in numbers.items():
            if not 1 / _LARGEST <= value <= _LARGEST:
                raise ProblemError(
                    f"{name} must lie between {1 / _LARGEST:g} and {_LARGEST:g} in SI units, not "
                    f"{value:g}."
                )
        problem, n = self.solution.problem, self.solution.problem.n_motor
        if (own := self.solution.froude) and abs(self.froude / own - 1.0) > _PACE:
            needed = math.sqrt(self.length / (self.pressing * own))
            raise ProblemError(
                f"{problem.name} is the best gait for the Froude number {own:.4g}: a robot of "
                f"{self.length:g} m has "
                f"to take {needed:.4g} s a period, not {self.period:g}: solve again with "
                f"froude={self.froude:.4g}."
            )
        for name, unit in (("max_speed", "speed"), ("max_torque", "torque")):
            if getattr(self, name) is not None:
                object.__setattr__(
                    self, name, one_each(getattr(self, name), n, f"joint {unit} limit")
                )
                if problem.froude or not rate_independent(problem.law):
                    raise ProblemError(
                        f"{name} asks for another pace, and torques depend on it, as "
                        f"{problem.paced_by}: leave it out, or "
                        "solve again for that pace."
                    )

    @property
    def pressing(self) -> float:
        """The part of gravity that presses the robot on the ground [m/s^2]."""
        return pressing(self.solution, self.gravity)

    @property
    def torque_unit(self) -> float:
        """m g L [N m], which is that of work too [J]."""
        return self.mass * self.pressing * self.length

    @property
    def froude(self) -> float:
        """L / (g T^2)."""
        return self.length / (self.pressing * self.period**2)

    @cached_property
    def _played(self) -> _Played | None:
        """With inertia, where the result has none and the motion is found."""
        with suppress(ProblemError, NotConvergedError):
            return None if self.solution.problem.froude else _Played(self.solution, self.froude)
        return None

    def torques(self, t: np.ndarray) -> np.ndarray:
        """Of the joints [N m] at ascending phases t in [0, 1] ``(n_time,)``, ``(n_joint,
        n_time)``."""
        played = () if self._played is None else (self._played.sample(t), self.froude)
        return self.torque_unit * joint_torques(self.solution, t, *played)

    @cached_property
    def columns(self) -> dict[str, Column]:
        """The motion over a period at the gait's own pace: name to values, units and dimensions."""
        n = max(_INSTANTS, _A_SIDE * (len(self.solution.gait.corner_phases) + 1))
        t = np.arange(n + 1) / n
        motion = (self._played or self.solution).sample(t)
        angles, rates = self.solution.gait.driven(t)
        torques, speeds = self.torques(t), rates / self.period
        return {
            "t": Column(t * self.period, "s", ("t",)),
            "joint_angles": Column(angles, "rad", ("joint", "t")),
            "joint_speeds": Column(speeds, "rad/s", ("joint", "t")),
            "joint_torques": Column(torques, "N m", ("joint", "t")),
            "joint_powers": Column(torques * speeds, "W", ("joint", "t")),
            "theta": Column(motion.theta, "rad", ("t",)),
            "centre": Column(self.length * motion.centre, "m", ("axis", "t")),
            "tail": Column(self.length * motion.tail, "m", ("axis", "t")),
        }

    def to_xarray(self) -> xarray.Dataset:
        """The motion over a period as an xarray Dataset whose units are SI ones."""
        return motion_dataset(
            self.columns, {name: value for name, value in self.facts.items() if value is not None}
        )

    def plot(self, ax: Any = None, panel: str = "torque") -> Any:
        """Torque, speed and power of every joint over a period, as a matplotlib Figure; with `ax`,
        a matplotlib Axes, one of them there, "torque", "speed" or "power", and the Axes is
        returned."""
        return (
            bound("plot_robot")(self) if ax is None else bound("plot_robot_panel")(ax, self, panel)
        )

    @cached_property
    def facts(self) -> dict[str, Any]:
        """All numbers by names that end in their units (JSON)."""
        problem, motion = self.solution.problem, self._played or self.solution.measured
        distance = motion.distance
        torques, speeds, powers = (
            self.columns[f"joint_{name}"].values for name in ("torques", "speeds", "powers")
        )
        work, total = self.torque_unit * motion.work, powers.sum(axis=0)
        facts = {
            "name": problem.name,
            "status": self.solution.status,
            "length_m": float(self.length),
            "mass_kg": float(self.mass),
            "period_s": float(self.period),
            "gravity_m_per_s2": float(self.gravity),
            "speed_m_per_s": distance * self.length / self.period,
            "body_lengths_per_period": distance,
            "travels": direction_of_travel(
                *(self.columns[name].values for name in ("centre", "tail"))
            ),
            "work_per_period_J": work,
            "motor_work_per_period_J": self.period * float(_mean(np.maximum(powers, 0.0)).sum()),
            "mean_power_W": work / self.period,
            "peak_power_W": float(total.max()),
            "cost_of_transport": motion.work / distance * self.pressing / self.gravity,
            "froude_number": self.froude,
            "peak_torque_N_m": np.abs(torques).max(axis=1).tolist(),
            "rms_torque_N_m": np.sqrt(_mean(torques**2)).tolist(),
            "peak_speed_rad_per_s": np.abs(speeds).max(axis=1).tolist(),
            "rms_speed_rad_per_s": np.sqrt(_mean(speeds**2)).tolist(),
            "peak_joint_power_W": powers.max(axis=1).tolist(),
        }
        return facts | self._inertia() | self._motors(np.abs(torques).max(axis=1))

    def _inertia(self) -> dict[str, Any]:
        """What inertia takes at this pace, and at which it takes little."""
        solution, problem = self.solution, self.solution.problem
        found: dict[str, Any] = {}
        if problem.froude:
            with suppress(NotConvergedError):
                found["played_slowly"] = solution.played_slowly
            return found
        if problem.regime.slides:
            return found
        if self._played is not None:
            found["inertia_takes"] = (
                1.0 - self._played.distance / self._played.work / solution.efficiency
            )
            found["rotation_by_inertia_rad"] = self._played.rotation - solution.rotation
        with suppress(ProblemError, NotConvergedError):
            if rate_independent(problem.law):
                found["slow_enough_period_s"] = math.sqrt(
                    self.length / (self.gravity * solution.slow_enough(SLOW_ENOUGH))
                )
        return found

    def _motors(self, peak: np.ndarray) -> dict[str, Any]:
        """What the motors' data say; nothing of what is not given."""
        found: dict[str, Any] = {}
        if self.max_speed is not None:
            gait, limits = self.solution.gait.driven, np.asarray(self.max_speed)
            found["max_speed_rad_per_s"] = limits.tolist()
            found["shortest_period_s"] = shortest = shortest_period(gait, limits, keep_pace=True)
            with suppress(ProblemError, NotConvergedError):
                played = _Played(self.solution, self.froude * (self.period / shortest) ** 2)
                found["speed_at_shortest_period_m_per_s"] = played.distance * self.length / shortest
            if not self.solution.problem.paced_by:
                found["shortest_period_paced_by_speed_s"] = shortest_period(gait, limits)
        if self.max_torque is not None:
            found["max_torque_N_m"] = np.asarray(self.max_torque).tolist()
            found["torque_used"] = (peak / self.max_torque).tolist()
            if self._played is not None:
                slowly = np.abs(joint_torques(self.solution, _PHASES)).max(axis=1)
                found["torque_used_slowly"] = (self.torque_unit * slowly / self.max_torque).tolist()
        return found

    def lines(self) -> list[str]:
        """The sheet for people."""
        f = self.facts
        found = [
            f"{f['name']}: {self.length:g} m, {self.mass:g} kg, {self.period:g} s a period "
            f"({f['status']})",
            f"  speed              {f['speed_m_per_s']:.4g} m/s {f['travels']}; "
            f"{f['body_lengths_per_period']:.4g} body lengths a period",
            f"  work               {f['work_per_period_J']:.4g} J a period; "
            f"{f['motor_work_per_period_J']:.4g} J if motors take none back",
            f"  power              mean {f['mean_power_W']:.4g} W, peak {f['peak_power_W']:.4g} W",
            f"  cost of transport  {f['cost_of_transport']:.4g}",
            "",
            "             torque [N m]      speed [rad/s]     power [W]",
            "             peak     r.m.s.   peak     r.m.s.   peak",
        ]
        coordinate = self.solution.gait.driven.coordinate
        names = (
            "peak_torque_N_m",
            "rms_torque_N_m",
            "peak_speed_rad_per_s",
            "rms_speed_rad_per_s",
            "peak_joint_power_W",
        )
        for j, row in enumerate(zip(*(f[name] for name in names), strict=True), 1):
            found.append(
                f"  {coordinate} {j:<3d}" + "".join(f"  {value:<7.3g}" for value in row).rstrip()
            )
        return [*found, "", *(f"  {sentence}" for sentence in self.sentences())]

    def sentences(self) -> list[str]:
        """What has to be known of the numbers."""
        f, problem = self.facts, self.solution.problem
        said = []
        if "shortest_period_s" in f:
            paced, fast = (
                f.get("shortest_period_paced_by_speed_s"),
                f.get("speed_at_shortest_period_m_per_s"),
            )
            does = "" if fast is None else f" ({fast:.4g} m/s)"
            more = "" if paced is None else f", {paced:.3g} s as colloc export --max-speed paces it"
            said.append(
                f"Shortest period for these joint speeds: {f['shortest_period_s']:.3g} s at the "
                f"gait's own pace{does}{more}."
            )
            if f["shortest_period_s"] > self.period * (1 + 1e-9):
                said.append(
                    f"That is more than {self.period:g} s, at which the numbers above are: the "
                    f"joints cannot follow."
                )
        if "torque_used" in f:
            worst = int(np.argmax(f["torque_used"]))
            peak, has = f["peak_torque_N_m"][worst], f["max_torque_N_m"][worst]
            slowly = max(f.get("torque_used_slowly", f["torque_used"]))
            if f["torque_used"][worst] <= 1:
                said.append(
                    f"The torques suffice at this pace: joint {worst + 1} uses "
                    f"{100 * peak / has:.3g} % of its own."
                )
            elif slowly <= 1:
                said.append(
                    f"Joint {worst + 1} needs {peak:.3g} N m at this pace and has {has:.3g}; "
                    f"played slowly no joint needs more "
                    "than it has: take a longer period."
                )
            else:
                limit = ", ".join(f"{each / self.torque_unit:.4g}" for each in f["max_torque_N_m"])
                said.append(
                    f"Joint {worst + 1} needs {peak:.3g} N m and has {has:.3g}. Played slowly "
                    f"motors are too weak as well, so "
                    f"a longer period does not help: solve with torque_limit=({limit})."
                )
        if not rate_independent(problem.law):
            said.append(
                f"Torques depend on the pace under {problem.law.label}: its coefficients are taken "
                f"to be those in units "
                "of this period."
            )
        if problem.froude:
            said.append("Torques and power include inertia")
            if (slowly := f.get("played_slowly")) is not None:
                value = (
                    f"{problem.objective.short} {slowly:.4g} instead of "
                    f"{self.solution.measured.value:.4g}"
                )
                said[-1] += f"; played slowly the gait would have {value}"
            return [*said[:-1], f"{said[-1]}."]
        pace = f"at this pace (Froude number L/(g T^2) = {f['froude_number']:.2g})"
        lost, slow = f.get("inertia_takes"), f.get("slow_enough_period_s")
        more = "" if slow is None else f"; it changes 1 % or less from {slow:.3g} s a period"
        if self._played is None:
            return [
                *said,
                f"All this is slow motion. What inertia does {pace} could not be computed{more}.",
            ]
        said.append(f"All this includes inertia {pace}")
        if lost is not None:
            share = (
                f"{100 * abs(lost):.2g} %"
                if abs(lost) > _LITTLE
                else f"less than {100 * _LITTLE:g} %"
            )
            does = f"Inertia {'takes' if lost >= 0 else 'adds'} {share} of the efficiency {pace}"
            said[-1] = f"All this includes inertia. {does}{more}"
            if abs(turns := math.degrees(f["rotation_by_inertia_rad"])) > _TURNS:
                said[-1] += f". It also turns the robot by {turns:.2g}° a period: its way is an arc"
        slowly = self.solution.distance * self.length / self.period
        said[-1] += f". At this period slow motion would be {slowly:.4g} m/s."
        return said

    def __str__(self) -> str:
        return "\n".join(self.lines())


def _mean(values: np.ndarray) -> np.ndarray:
    """Over a period of equal steps, whose last instant is the first again."""
    return np.asarray(values[..., :-1].mean(axis=-1))
