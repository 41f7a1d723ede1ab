"""The result of a solve: its answer with certificate, and the motion at any instant by the scheme's
own interpolant."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from colloc.dynamics.dynamics import slow_enough
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.mechanics.chain import Chain
from colloc.mechanics.inertia import checked_mass
from colloc.results.answer import EVALUATED, PRESCRIBED, Alternative, Answer, Step
from colloc.results.checks import UNCERTIFIED, Certificate
from colloc.results.motion import (
    PHASES,
    SAMPLES,
    Arc,
    Column,
    SampledMotion,
    arc,
    foot_kinds,
    motion_columns,
    motion_dataset,
    motion_frame,
    motion_with_inertia,
    part_speeds,
)
from colloc.system.arguments import checked_arguments
from colloc.system.environment import higher, versions
from colloc.system.errors import ProblemError
from colloc.verification.dry_friction import DryFriction, dry_friction
from colloc.verification.replay import replayer

if TYPE_CHECKING:
    import pandas
    import xarray

SOLVED = "solved"
NOT_CONVERGED = "not converged"
CERTIFICATE_FAILED = "certificate failed"
INTERRUPTED = "interrupted"
_INSTANTS = np.arange(2000) / 2000  # to count at
_MOST_CYCLES, _ALIKE, _ROUGHLY = 40, 0.02, 1e-4  # from rest; error of a cycle
_TINY_SWING, _TINY_DISTANCE = math.radians(8), 0.02


def _measured(name: str, what: str) -> property:
    return property(attrgetter(f"measured.{name}"), doc=f"{what}, by replay if there was one.")


@dataclass(eq=False)
class Solution:
    """What a solve found.

    Attributes
    ----------
    answer : Answer
        The gait, as a point of the full program of direct collocation.
    certificate : Certificate
        `UNCERTIFIED` if the solve did not converge.
    seconds : float
        Wall time of the whole solve.
    source : str
        Text of the problem file, if there was one.
    message : str
        What went wrong and what to try, if something did.
    starts : int
        How many the gait is the best of.
    others : tuple of Alternative
        Distinct gaits they led to, the best first, of any size; empty for a single start.
    shrunk : Solution, optional
        A better gait that is so small that nobody sees it move; saved by itself.
    interrupted : bool
        Whether the search ended early, by Ctrl-C or because its time was over.
    settings : dict
        Tolerances and options of the search (`colloc.search.options`).

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> solution = colloc.solve(problem, starts=1)
    >>> solution.success, solution.message
    (True, '')
    >>> motion = solution.sample([0, 0.5])
    >>> motion.angles.shape, motion.z.shape
    ((2, 2), (3, 2))
    """

    problem: Problem
    answer: Answer
    certificate: Certificate = UNCERTIFIED
    seconds: float = 0.0
    source: str = ""
    message: str = ""
    versions: dict[str, str] = field(default_factory=versions)
    starts: int = 1
    others: tuple[Alternative, ...] = ()
    shrunk: Solution | None = None
    interrupted: bool = False
    settings: dict[str, dict[str, float]] = field(default_factory=dict)

    def __repr__(self) -> str:
        error = " (not replayed)"
        if self.certificate.replayed:
            error = f" +- {self.certificate.value_error:.0e}"
        number = f"{self.problem.objective.short} = {self.value:.6g}{error}"
        at = f"delta = {self.answer.delta:.1e}"
        return f"<Solution {self.problem.name}, {self.status}, {number} at {at}>"

    @property
    def status(self) -> str:
        """ "solved", "not converged", "certificate failed" or "interrupted"."""
        reached = self.answer.optimal and self.answer.delta <= self.problem.delta * (1 + 1e-9)
        solved = reached and self.certificate.replayed and self.certificate.passed
        if self.interrupted and not solved:
            return INTERRUPTED
        if not reached or not self.certificate.replayed:
            return NOT_CONVERGED
        return SOLVED if solved else CERTIFICATE_FAILED

    @property
    def success(self) -> bool:
        return self.status == SOLVED

    @property
    def history(self) -> tuple[Step, ...]:
        """Steps of the search; the last one is the answer."""
        return self.answer.history or (self.answer.step,)

    @property
    def measured(self) -> Certificate | Answer:
        """Certificate if there was a replay, else the answer."""
        return self.certificate if self.certificate.replayed else self.answer

    value = _measured("value", "Value of the objective")
    efficiency = _measured("efficiency", "Distance over work")
    distance = _measured("distance", "Displacement over a cycle")
    work = _measured("work", "Work over a cycle")
    rotation = _measured("rotation", "Net rotation over a cycle [rad], counter-clockwise")
    mesh = property(attrgetter("answer.mesh"), doc="Mesh of the collocation, in phases.")
    delta_per_period = property(
        attrgetter("answer.delta_per_period"), doc="Regularisation speed [body lengths per period]."
    )

    @property
    def arc(self) -> Arc:
        """Angle, radius and chord of a cycle, whatever phase it is begun at; straight on if no
        turn is asked for."""
        if self.problem.rotation is not None:
            return Arc(self.problem.rotation, self.distance)
        return arc(self.rotation, self.answer.sample(PHASES).centre)

    @property
    def turning_radius(self) -> float:
        """Radius of the circle about which the gait crawls [body lengths]; infinite straight on."""
        return self.arc.radius

    @property
    def turning(self) -> str:
        """Turn of the gait in words; "" straight on."""
        if self.problem.rotation == 0:
            return ""
        side = "counter-clockwise" if self.rotation > 0 else "clockwise"
        turned = f"turns {math.degrees(abs(self.rotation)):.4g}° {side}"
        return f"{turned}, on a circle of radius {self.turning_radius:.4g} body lengths"

    def played_by(self, play: Callable[..., Any], *more: Any, **how: Any) -> Any:
        """What a replay or another player of gaits returns for this one."""
        at = self.problem.body, self.problem.law, self.gait, self.delta_per_period
        return play(*at, *more, breaks=self.gait.corner_phases, **how)

    @cached_property
    def quasi_static(self) -> Any:
        """Replay without inertia, with the chord of its arc, whatever phase it begins at;
        `NotConvergedError` if a slope does not hold it."""
        play, integrals = replayer(self.problem.regime.slowly), self.problem.objective.integrals
        turn = self.played_by(play, turn=self.problem.rotation or 0.0).rotation
        return self.played_by(play, turn=turn, quantities=integrals)

    @property
    def played_slowly(self) -> float:
        """The objective of the same gait without inertia, at this period."""
        period = {"period": self.froude**-0.5} if self.froude else {}
        return float(self.problem.objective({**self.quasi_static.values, **period}))

    @property
    def cycles_from_rest(self) -> tuple[int, float]:
        """After how many cycles from rest, at most 40, a body with inertia goes as far in a cycle
        as once it has settled, within 2 %; and how far it goes in the last of them."""
        from colloc.verification.differential_motion import GaitWithInertia

        if not self.froude:
            raise ProblemError("without inertia all cycles are alike: state froude, or a robot.")
        state, way, cycles = np.zeros(7), 0.0, 0
        moving = self.played_by(GaitWithInertia, froude=self.froude, regime=self.problem.regime)
        state[3] = moving.theta
        while cycles < _MOST_CYCLES and abs(way - self.distance) > _ALIKE * self.distance:
            before, state = state, moving.run(state, _ROUGHLY).states[:, -1]
            way, cycles = float(np.hypot(*(state - before)[4:6])), cycles + 1
        return cycles, way

    def slow_enough(self, loss: float = 0.01) -> float:
        """The Froude number L/(g T^2) up to which inertia changes the efficiency by no more than
        the part `loss`.

        A body of length L [m] that takes T [s] per cycle, on a floor whose friction is f times the
        stated one, is slow enough if T is at least sqrt(L / (9.81 f Fr)). See `colloc.slow_enough`,
        which says what is raised.
        """
        if self.problem.regime.slides:
            raise ProblemError("on a slope it is not known how slow is slow enough.")
        return float(self.played_by(slow_enough, loss))

    def dry(self) -> DryFriction:
        """Distance, work and efficiency at delta = 0, between bounds: the same gait under friction
        that is not smoothed.

        Raises
        ------
        ProblemError
            Unless a chain crawls slowly on the level, under a law whose dry balance minimises the
            dissipation: isotropic friction, `Elliptic` or `Axle`.
        """
        p = self.problem
        if not p.regime.slow_on_level:
            raise ProblemError("bounds for dry friction are there for slow gaits on the level.")
        how: Any = {"breaks": self.gait.corner_phases, "turn": p.rotation or 0.0}
        return dry_friction(p.body, p.law, self.gait, **how)

    def certify_dry(self) -> None:
        """Put the efficiency under dry friction into the certificate, which is saved with it;
        raises what `dry` does."""
        least, most = self.dry().efficiency
        self.certificate = replace(self.certificate, dry=(least, most))

    @property
    def standing(self) -> list[str]:
        """Number of starts, and other gaits that the search met."""
        if self.answer.program in (PRESCRIBED, EVALUATED):
            return ["none: the gait was given"]
        what = "local optimum" if self.answer.optimal else "no optimum"
        if self.starts == 1 or not self.others:
            return [f"{what}, from one start"]
        # others are as a coarse mesh sees them, and one that shrank may be better
        this = min(self.others, key=lambda other: abs(other.value - self.answer.value))
        others = "; ".join([str(other) for other in self.others if other is not this][:4])
        first = f"{what}, best of {self.starts} starts; {this.starts} converged to it"
        return [first, f"also met, on a coarse mesh: {others}"] if others else [first]

    @property
    def gait(self) -> AnyGait:
        return self.answer.gait.with_coordinate(self.problem.body.defaults.coordinate)

    def sample(self, t: np.ndarray | float) -> SampledMotion:
        """The motion at phases t, any real numbers, period after period: `Answer.sample`."""
        return self.answer.sample(t)

    @property
    def froude(self) -> float:
        """Froude number L/(g T^2) at which the gait is played; 0: slowly."""
        return self.problem.regime.at(self.gait).froude

    def from_rest(self, t: np.ndarray) -> SampledMotion:
        """The motion at ascending phases t, 0 and more, of a body with inertia that is at rest
        before its joints begin.

        Raises
        ------
        ProblemError
            If the problem states no pace: without inertia the first period is like all others.
        """
        from colloc.verification.differential_motion import motion_from_rest

        p = self.problem
        if not p.froude:
            raise ProblemError(
                f"{p.name} has no inertia, and is under way at once: from rest is for problems "
                f"with a froude."
            )
        how: Any = {"grade": p.grade, "theta": self.gait.theta or 0.0}
        how["periods"] = max(1, math.ceil(t[-1]))
        motion = self.played_by(motion_from_rest, self.froude, **how)
        states = np.array([np.interp(t, motion.phases, row) for row in motion.states])
        return motion_with_inertia(checked_mass(p.body), self.gait, t, states)

    def holding(self, motion: SampledMotion) -> np.ndarray:
        """Sticking feet, slower than 3 delta, ``(n_foot, n_time)``; no rows without feet."""
        body = self.problem.body
        if not foot_kinds(body):
            return np.zeros((0, motion.t.size), dtype=bool)
        return part_speeds(body, motion)[1] < 3.0 * self.delta_per_period

    @property
    def share_held(self) -> np.ndarray:
        """Fraction of the cycle for which each foot sticks, ``(n_foot,)``, from the tail."""
        return self.holding(self.sample(_INSTANTS)).mean(axis=1)

    @property
    def swings(self) -> np.ndarray:
        """Angles between the ends of the movement of each motor [rad], ``(n_motor,)``."""
        return np.ptp(self.gait.motor_gait.angles(_INSTANTS), axis=1)

    @property
    def is_tiny(self) -> bool:
        """True if hardly anybody would see the gait: all joints of a chain move by less than 8
        degrees, or the body by less than a fiftieth of its length per cycle."""
        if self.answer.program == PRESCRIBED:
            return False
        chain = isinstance(self.problem.body, Chain)
        return bool((chain and self.swings.max() < _TINY_SWING) or self.distance < _TINY_DISTANCE)

    @property
    def travels(self) -> str:
        """Average direction of travel: "head first", "tail first" or "sideways"."""
        motion = self.sample(_INSTANTS)
        return direction_of_travel(motion.centre, motion.tail)

    def power(self, motion: SampledMotion) -> np.ndarray:
        """Power against friction at the instants of a motion, ``(n_time,)``."""
        return self.answer.sliding(motion.angles, motion.rates, motion.z).power[0]

    def plot(self, ax: Any = None, panel: str = "gait") -> Any:
        """The figure of `colloc solve`, as a matplotlib Figure: notebooks show it,
        ``.savefig("mine.png")`` writes it.

        With `ax`, a matplotlib Axes, one panel is drawn there, and the Axes returned: the gait (its
        path in the plane of two shape coordinates, of one or more than two their course in time),
        or another one of ``colloc report --figures``: "filmstrip", "lab", "angles", "speeds",
        "power", "convergence", "mesh", "shape-1-2". `ProblemError` if there is none of that name.
        """
        return higher("pictures.figure:plot_solution")(self, ax, panel)

    @checked_arguments
    def animate(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write the motion as GIF or MP4, by the ending of `path`; options as for
        `colloc.pictures.movie.write_movie`."""
        return higher("pictures.movie:write_movie")(self, Path(path), **options)

    @checked_arguments
    def report(
        self,
        path: str | os.PathLike[str],
        *,
        robot: Any = None,
        front: Any = None,
        beside: Solution | None = None,
    ) -> Path:
        """Write the web page of `colloc report`; with what `robot` and `colloc.pareto_front` return
        also those, and with another solution `beside` this one."""
        sections = {"robot": robot, "front": front, "beside": beside}
        return higher("pictures.report_page:write_report")(self, Path(path), **sections)

    @checked_arguments
    def export(self, path: str | os.PathLike[str], **options: Any) -> dict[str, Any]:
        """Write joint angles over time for a robot, as CSV or JSON by the ending of `path`,
        ``solution.export("mine.csv", period=4)``, or the robot as a model for simulators (``.xml``,
        ``.urdf``); returns what the file says. Options as for
        `colloc.pictures.export.write_export`."""
        return higher("pictures.export:write_export")(self, Path(path), **options)

    def robot(
        self,
        length: float | None = None,
        mass: float | None = None,
        period: float | None = None,
        **options: Any,
    ) -> Any:
        """A `colloc.results.robot.RobotSheet`: speed, power and torques of the gait on a robot of
        so many metres and kilograms; by default on the problem's robot.

        Options as there: `gravity`, `max_speed`, `max_torque`.
        """
        robot = higher("results.robot:stated_robot")(
            self, length=length, mass=mass, period=period, **options
        )
        if not robot:
            raise ProblemError("state the robot's length [m], mass [kg] and period [s].")
        return higher("results.robot:RobotSheet")(self, **robot)

    @checked_arguments
    def sensitivity(self, resolve: bool = False) -> Any:
        """A `colloc.search.sensitivity.Sensitivity`: by how much the best value changes with every
        number of the problem.

        With `resolve` also what the best gait gets where each is a tenth smaller and larger, and
        what this one gets there.
        """
        return higher("search.sensitivity:sensitivity")(self, resolve)

    def to_xarray(self, t: np.ndarray | None = None) -> xarray.Dataset:
        """The motion at phases `t` (one cycle by default) as an xarray Dataset, named as in a
        result file's group motion."""
        names = ("status", "efficiency", "rotation", "turning_radius")
        about = {"name": self.problem.name} | {name: getattr(self, name) for name in names}
        if self.problem.objective != EFFICIENCY:
            about |= {"objective": self.problem.objective.name, "value": self.value}
        return motion_dataset(self.columns(t), about)

    def to_dataframe(self, t: np.ndarray | None = None) -> pandas.DataFrame:
        """The motion at phases `t` (one cycle by default) as a pandas DataFrame:
        ``joint_angles_1``, ``centre_x``, ...

        Of a body with modes for joints these are ``modes_1``, ``mode_rates_1``, and so in
        `to_xarray`.
        """
        return motion_frame(self.columns(t))

    def columns(self, t: np.ndarray | None = None) -> dict[str, Column]:
        """The motion at phases `t` (one cycle by default): name to values with their units and
        dimensions."""
        motion = self.sample(np.linspace(0.0, 1.0, SAMPLES) if t is None else t)
        return motion_columns(motion, self.power(motion), self.problem.body)

    def _repr_html_(self) -> str:
        return higher("pictures.report_page:solution_card")(self)


def direction_of_travel(centre: np.ndarray, tail: np.ndarray) -> str:
    """ "head first", "tail first" or "sideways", from places of centre of mass and tail, ``(2,
    n_time)``."""
    (x, y), (ahead, aside) = (centre - tail).mean(axis=1), centre[:, -1] - centre[:, 0]
    along, across = x * ahead + y * aside, abs(x * aside - y * ahead)
    return "sideways" if abs(along) <= across else "head first" if along > 0 else "tail first"
