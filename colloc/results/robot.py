"""A gait on a robot of so many metres and kilograms: the one module that knows units.

Everything else counts lengths in body lengths L, forces in weights m g and time in periods T. So a
torque is one in m g L, work too, a power in m g L / T, and a speed in L / T; the cost of transport
W / (m g d) has no unit. The numbers are those at the robot's pace, with inertia: what that does
depends on the *Froude number* Fr = L / (g T^2) alone. Where the body has no masses, or the motion
with inertia is not found, they are those of slow motion, which is said.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
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
_STEP = 1e-5  # of a period, over which velocities of links are differentiated
_SAME_PACE = 0.01  # relative difference of Froude numbers up to which a robot has a gait's pace
_ACCURACY = 1e-6  # of the momenta in the motion with inertia
_SMALLEST_LOSS, _SMALLEST_TURN = 1e-3, 0.1
"""Share of the efficiency, and degrees a period, below which effects of inertia are not stated."""
_LARGEST = 1e9  # of the metres, kilograms and seconds of a robot; one over it is the smallest
_INSTANTS, _A_SIDE = 2000, 8
"""Samples of a period at least, and of every side of a polygon."""


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
    (angles, rates), z = solution.gait(t), motion.z
    load = problem.regime.pull(motion.theta[None])
    if not froude:
        return quasi_static_torques(solution, angles, rates, load, start=z)
    against_friction = quasi_static_torques(solution, angles, rates, load, z)
    return against_friction + _inertial_torques(solution, t, z, load, froude)


def quasi_static_torques(
    solution: Solution,
    angles: np.ndarray,
    rates: np.ndarray,
    load: np.ndarray | None,
    z: np.ndarray | None = None,
    start: np.ndarray | None = None,
) -> np.ndarray:
    """Torques of the motors against friction, and a pull on the centre of mass ``(2, n_time)`` if
    there is one, [weight x body length], at any angles and rates of joints ``(n_joint, n_time)``
    and tail velocities z; by default these balance, and are sought near `start`."""
    body: Any = solution.problem.body
    law, delta = solution.problem.law, solution.delta_per_period
    if z is None:
        balance = body.solve if load is None else partial(solve_balance, body, load=load)
        z = balance(law, angles, rates, delta, start=start).z
    forces = body.forces(law, angles, rates, z, delta)
    return solution.problem.of_motors(joint_moments(body, angles, forces, load))


def _inertial_torques(
    solution: Solution, t: np.ndarray, z: np.ndarray, load: np.ndarray | None, froude: float
) -> np.ndarray:
    """Torques of the motors that change how the links move, at phases with tail velocities z."""
    problem, how = solution.problem, {"delta": solution.delta_per_period, "froude": froude}
    body, joints = checked_mass(problem.body), solution.gait
    angles, rates = joints(t)
    link = body.velocity(body.posture(angles), rates, z)
    states = momenta(body, body.posture(angles), link)
    changes = momentum_rates(body, problem.law, angles, rates, states, **how).rates
    if load is not None:
        changes[:2] += load / froude

    def link_velocity(by: float) -> LinkVelocity:
        then, pace = joints(t + by)
        tail = tail_velocity(body, then, pace, states + by * changes)
        return body.velocity(body.posture(then), pace, tail)

    pairs = zip(link_velocity(-_STEP), link_velocity(_STEP), strict=True)
    growth = LinkVelocity(*((after - before) / (2 * _STEP) for before, after in pairs))
    return problem.of_motors(froude * inertial_moments(body, angles, link, growth))


class _MotionWithInertia:
    """The periodic motion of a gait with inertia at a Froude number.

    Distance, work and rotation are those of a period, the distance as in `colloc.results.arc.Arc`.
    `ProblemError` if gait or body cannot move with inertia, `NotConvergedError` if no motion is
    found.
    """

    def __init__(self, solution: Solution, froude: float) -> None:
        from colloc.verification.inertial_motion import GaitWithInertia  # loads what integrates

        problem, self._gait = solution.problem, solution.gait
        moving = GaitWithInertia(
            problem.body, problem.law, self._gait, solution.delta_per_period,
            froude=froude, breaks=self._gait.corner_phases, regime=problem.regime,
        )  # fmt: skip
        self._chain, rough = moving.body, moving.find_period()
        self._course = moving.periodic_run(rough.momenta, _ACCURACY, rough.slopes).course
        totals = moving.totals(self._course.states)
        self.work, self.rotation, self.distance = (
            totals[name] for name in ("work", "rotation", "distance")
        )
        self._ahead = 0.0
        if not problem.regime.slides:
            way = self._course.at(np.linspace(0.0, 1.0, _INSTANTS + 1))[4:6]
            self.distance = arc(self.rotation, way).chord
            end = self._course.states[4:6, -1]
            self._ahead = float(np.arctan2(end[1], end[0])) - 0.5 * self.rotation

    def sample(self, t: np.ndarray) -> SampledMotion:
        """At ascending phases in [0, 1], in the axes of `Solution.sample`."""
        states, (angles, rates) = self._course.at(t), self._gait(t)
        theta, centre = states[3] - self._ahead, turned(states[4:6], -self._ahead)
        z = tail_velocity(self._chain, angles, rates, states[:3])
        tail = centre - turned(np.array(self._chain.centre(angles)), theta)
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
        problem, froude = self.solution.problem, self.solution.froude
        if froude and abs(self.froude / froude - 1.0) > _SAME_PACE:
            needed = math.sqrt(self.length / (self.pressing * froude))
            raise ProblemError(
                f"{problem.name} is the best gait for the Froude number {froude:.4g}: a robot of "
                f"{self.length:g} m has to take {needed:.4g} s a period, not {self.period:g}: "
                f"solve again with froude={self.froude:.4g}."
            )
        for name, what in (("max_speed", "speed"), ("max_torque", "torque")):
            if (limit := getattr(self, name)) is not None:
                each = one_each(limit, problem.n_motor, f"joint {what} limit")
                object.__setattr__(self, name, each)
                if problem.froude or not rate_independent(problem.law):
                    raise ProblemError(
                        f"{name} asks for another pace, and torques depend on it, as "
                        f"{problem.paced_by}: leave it out, or solve again for that pace."
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
    def _with_inertia(self) -> _MotionWithInertia | None:
        """Where the result has no inertia, and the motion with it is found."""
        with suppress(ProblemError, NotConvergedError):
            if not self.solution.problem.froude:
                return _MotionWithInertia(self.solution, self.froude)
        return None

    def torques(self, t: np.ndarray) -> np.ndarray:
        """Of the joints [N m] at ascending phases t in [0, 1] ``(n_time,)``, ``(n_joint,
        n_time)``."""
        moving = self._with_inertia
        other = () if moving is None else (moving.sample(t), self.froude)
        return self.torque_unit * joint_torques(self.solution, t, *other)

    @cached_property
    def columns(self) -> dict[str, Column]:
        """The motion over a period at the gait's own pace: name to values, units and dimensions."""
        n = max(_INSTANTS, _A_SIDE * (len(self.solution.gait.corner_phases) + 1))
        t = np.arange(n + 1) / n
        motion = (self._with_inertia or self.solution).sample(t)
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
        stated = {name: value for name, value in self.facts.items() if value is not None}
        return motion_dataset(self.columns, stated)

    def plot(self, ax: Any = None, panel: str = "torque") -> Any:
        """Torque, speed and power of every joint over a period, as a matplotlib Figure; with `ax`,
        a matplotlib Axes, one of them there, "torque", "speed" or "power", and the Axes is
        returned."""
        if ax is None:
            return bound("plot_robot")(self)
        return bound("plot_robot_panel")(ax, self, panel)

    @cached_property
    def facts(self) -> dict[str, Any]:
        """All numbers by names that end in their units (JSON)."""
        motion = self._with_inertia or self.solution.measured
        work, values = (
            self.torque_unit * motion.work,
            {k: c.values for k, c in self.columns.items()},
        )
        torques, speeds, powers = (values[f"joint_{x}"] for x in ("torques", "speeds", "powers"))
        peak = np.abs(torques).max(axis=1)
        facts = {
            "name": self.solution.problem.name,
            "status": self.solution.status,
            "length_m": float(self.length),
            "mass_kg": float(self.mass),
            "period_s": float(self.period),
            "gravity_m_per_s2": float(self.gravity),
            "speed_m_per_s": motion.distance * self.length / self.period,
            "body_lengths_per_period": motion.distance,
            "travels": direction_of_travel(values["centre"], values["tail"]),
            "work_per_period_J": work,
            "motor_work_per_period_J": self.period * float(_mean(np.maximum(powers, 0.0)).sum()),
            "mean_power_W": work / self.period,
            "peak_power_W": float(powers.sum(axis=0).max()),
            "cost_of_transport": motion.work / motion.distance * self.pressing / self.gravity,
            "froude_number": self.froude,
            "peak_torque_N_m": peak.tolist(),
            "rms_torque_N_m": np.sqrt(_mean(torques**2)).tolist(),
            "peak_speed_rad_per_s": np.abs(speeds).max(axis=1).tolist(),
            "rms_speed_rad_per_s": np.sqrt(_mean(speeds**2)).tolist(),
            "peak_joint_power_W": powers.max(axis=1).tolist(),
        }
        return facts | dict(self._inertia_facts()) | dict(self._motor_facts(peak))

    def _inertia_facts(self) -> Iterator[tuple[str, Any]]:
        """What inertia takes at this pace, and at which it takes little."""
        solution, problem, moving = self.solution, self.solution.problem, self._with_inertia
        if problem.froude:
            with suppress(NotConvergedError):
                yield "played_slowly", solution.played_slowly
        elif not problem.regime.slides:
            if moving is not None:
                lost = 1.0 - moving.distance / moving.work / solution.efficiency
                yield "inertia_takes", lost
                yield "rotation_by_inertia_rad", moving.rotation - solution.rotation
            with suppress(ProblemError, NotConvergedError):
                if rate_independent(problem.law):
                    froude = solution.slow_enough(SLOW_ENOUGH)
                    yield "slow_enough_period_s", math.sqrt(self.length / (self.gravity * froude))

    def _motor_facts(self, peak: np.ndarray) -> Iterator[tuple[str, Any]]:
        """What the motors' data say; nothing of what is not given."""
        solution, gait = self.solution, self.solution.gait.driven
        if self.max_speed is not None:
            limits = np.asarray(self.max_speed)
            shortest = shortest_period(gait, limits, keep_pace=True)
            yield "max_speed_rad_per_s", limits.tolist()
            yield "shortest_period_s", shortest
            with suppress(ProblemError, NotConvergedError):
                moving = _MotionWithInertia(solution, self.froude * (self.period / shortest) ** 2)
                speed = moving.distance * self.length / shortest
                yield "speed_at_shortest_period_m_per_s", speed
            if not solution.problem.paced_by:
                yield "shortest_period_paced_by_speed_s", shortest_period(gait, limits)
        if self.max_torque is not None:
            yield "max_torque_N_m", np.asarray(self.max_torque).tolist()
            yield "torque_used", (peak / self.max_torque).tolist()
            if self._with_inertia is not None:
                slow = np.abs(joint_torques(solution, np.arange(_INSTANTS) / _INSTANTS)).max(axis=1)
                yield "torque_used_slowly", (self.torque_unit * slow / self.max_torque).tolist()

    def lines(self) -> list[str]:
        """The sheet for people."""
        f, coordinate = self.facts, self.solution.gait.driven.coordinate
        columns = (
            f[name]
            for name in (
                "peak_torque_N_m",
                "rms_torque_N_m",
                "peak_speed_rad_per_s",
                "rms_speed_rad_per_s",
                "peak_joint_power_W",
            )
        )
        rows = (
            f"  {coordinate} {j:<3d}" + "".join(f"  {value:<7.3g}" for value in row).rstrip()
            for j, row in enumerate(zip(*columns, strict=True), 1)
        )
        return [
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
            *rows,
            "",
            *(f"  {sentence}" for sentence in self.sentences()),
        ]

    def sentences(self) -> list[str]:
        """What has to be known of the numbers."""
        law = self.solution.problem.law
        sentences = [*self._speed_sentences(), *self._torque_sentences()]
        if not rate_independent(law):
            sentences.append(
                f"Torques depend on the pace under {law.label}: its coefficients are taken to be "
                f"those in units of this period."
            )
        return [*sentences, self._inertia_sentence()]

    def _speed_sentences(self) -> Iterator[str]:
        f = self.facts
        if "shortest_period_s" not in f:
            return
        speed = f.get("speed_at_shortest_period_m_per_s")
        paced = f.get("shortest_period_paced_by_speed_s")
        yield (
            f"Shortest period for these joint speeds: {f['shortest_period_s']:.3g} s at the "
            f"gait's own pace{'' if speed is None else f' ({speed:.4g} m/s)'}"
            f"{'' if paced is None else f', {paced:.3g} s as colloc export --max-speed paces it'}."
        )
        if f["shortest_period_s"] > self.period * (1 + 1e-9):
            yield (
                f"That is more than {self.period:g} s, at which the numbers above are: the "
                f"joints cannot follow."
            )

    def _torque_sentences(self) -> Iterator[str]:
        f = self.facts
        if "torque_used" not in f:
            return
        worst = int(np.argmax(f["torque_used"]))
        peak, limit = f["peak_torque_N_m"][worst], f["max_torque_N_m"][worst]
        if f["torque_used"][worst] <= 1:
            yield (
                f"The torques suffice at this pace: joint {worst + 1} uses "
                f"{100 * peak / limit:.3g} % of its own."
            )
        elif max(f.get("torque_used_slowly", f["torque_used"])) <= 1:
            yield (
                f"Joint {worst + 1} needs {peak:.3g} N m at this pace and has {limit:.3g}; played "
                f"slowly no joint needs more than it has: take a longer period."
            )
        else:
            limits = ", ".join(f"{each / self.torque_unit:.4g}" for each in f["max_torque_N_m"])
            yield (
                f"Joint {worst + 1} needs {peak:.3g} N m and has {limit:.3g}. Played slowly "
                f"motors are too weak as well, so a longer period does not help: solve with "
                f"torque_limit=({limits})."
            )

    def _inertia_sentence(self) -> str:
        f, solution, objective = self.facts, self.solution, self.solution.problem.objective
        if solution.problem.froude:
            text = "Torques and power include inertia"
            if (value := f.get("played_slowly")) is not None:
                text += (
                    f"; played slowly the gait would have {objective.short} {value:.4g} instead of "
                    f"{solution.measured.value:.4g}"
                )
            return f"{text}."
        pace = f"at this pace (Froude number L/(g T^2) = {f['froude_number']:.2g})"
        slow, lost = f.get("slow_enough_period_s"), f.get("inertia_takes")
        more = "" if slow is None else f"; it changes 1 % or less from {slow:.3g} s a period"
        if self._with_inertia is None:
            return f"All this is slow motion. What inertia does {pace} could not be computed{more}."
        if lost is None:
            text = f"All this includes inertia {pace}"
        else:
            least = f"less than {100 * _SMALLEST_LOSS:g} %"
            share = f"{100 * abs(lost):.2g} %" if abs(lost) > _SMALLEST_LOSS else least
            text = (
                f"All this includes inertia. Inertia {'takes' if lost >= 0 else 'adds'} {share} of "
                f"the efficiency {pace}{more}"
            )
            turns = math.degrees(f["rotation_by_inertia_rad"])
            if abs(turns) > _SMALLEST_TURN:
                text += f". It also turns the robot by {turns:.2g}° a period: its way is an arc"
        slowly = solution.distance * self.length / self.period
        return f"{text}. At this period slow motion would be {slowly:.4g} m/s."

    def __str__(self) -> str:
        return "\n".join(self.lines())


def _mean(values: np.ndarray) -> np.ndarray:
    """Over a period of equal steps, whose last instant is the first again."""
    return np.asarray(values[..., :-1].mean(axis=-1))
