"""The result of a solve: its answer with certificate, and the motion at any instant by the scheme's
own interpolant."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from colloc.dynamics.slow_enough import slow_enough
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.mechanics.bodies import Sliding
from colloc.mechanics.inertia import checked_mass, tail_velocity
from colloc.numerics.mesh import Mesh
from colloc.results.answer import EVALUATED, PRESCRIBED, Alternative, Answer, Step
from colloc.results.checks import UNCERTIFIED, Certificate
from colloc.results.collocated_motion import CollocatedMotion
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
    part_speeds,
    rotate,
)
from colloc.system.arguments import checked_arguments
from colloc.system.environment import higher, versions
from colloc.system.errors import ProblemError
from colloc.transcription.layout import Layout
from colloc.verification.dry_friction import DryFriction, dry_friction
from colloc.verification.replay import replayer

if TYPE_CHECKING:
    import pandas
    import xarray

SOLVED = "solved"
NOT_CONVERGED = "not converged"
CERTIFICATE_FAILED = "certificate failed"
INTERRUPTED = "interrupted"
_HOLDS, _INSTANTS = 3.0, np.arange(2000) / 2000
"""Speed of a foot over delta below which it sticks; phases to count at."""
_MOST_OTHERS = 4


@dataclass(eq=False)
class Solution:
    """What a solve found.

    Attributes
    ----------
    problem : Problem
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
    versions : dict
    starts : int
        How many the gait is the best of.
    others : tuple of Alternative
        Distinct gaits they led to, the best first, of any size; empty for a single start.
    shrunk : Solution, optional
        A better gait that is so small that nobody sees it move; saved by itself.
    interrupted : bool
        Whether the search ended early, by Ctrl-C or because its time was over.

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
    versions: dict[str, str] = field(default_factory=lambda: versions())
    starts: int = 1
    others: tuple[Alternative, ...] = ()
    shrunk: Solution | None = None
    interrupted: bool = False

    def __repr__(self) -> str:
        replayed = "" if self.certificate.replayed else " (not replayed)"
        error = f" +- {self.certificate.value_error:.0e}" if self.certificate.replayed else ""
        number = f"{self.problem.objective.short} = {self.value:.6g}{error}{replayed}"
        return (
            f"<Solution {self.problem.name}, {self.status}, {number} at delta = "
            f"{self.answer.delta:.1e}>"
        )

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

    @property
    def value(self) -> float:
        """Value of the objective, by replay if there was one."""
        return self.measured.value

    @property
    def efficiency(self) -> float:
        """Distance over work, by replay if there was one."""
        return self.measured.efficiency

    @property
    def distance(self) -> float:
        """Displacement over a period, by replay if there was one."""
        return self.measured.distance

    @property
    def work(self) -> float:
        """Work over a period, by replay if there was one."""
        return self.measured.work

    @property
    def rotation(self) -> float:
        """Net rotation over a period [rad], counter-clockwise: of the replay if there was one, else
        as collocated."""
        return self.certificate.rotation if self.certificate.replayed else self.motion.rotation

    @property
    def arc(self) -> Arc:
        """Angle, radius and chord of a period, whatever phase it is begun at; straight on if no
        turn is asked for."""
        if self.problem.rotation is not None:
            return Arc(self.problem.rotation, self.distance)
        return arc(self.rotation, self.motion.sample(PHASES).centre)

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

    @property
    def played_slowly(self) -> float:
        """The objective of the same gait played so slowly that inertia does not matter;
        `NotConvergedError` if a slope does not hold it then."""
        p, at = self.problem, self.answer.delta_per_period
        asked: Any = {
            "quantities": p.objective.integrals,
            "turn": p.rotation or 0.0,
            "breaks": self.gait.corner_phases,
        }
        period = {"period": self.froude**-0.5} if self.froude else {}
        return float(
            p.objective(
                {
                    **replayer(p.regime.slowly)(p.body, p.law, self.gait, at, **asked).values,
                    **period,
                }
            )
        )

    def slow_enough(self, loss: float = 0.01) -> float:
        """The Froude number L/(g T^2) up to which inertia changes the efficiency by no more than
        the part `loss`.

        A body of length L [m] that takes T [s] a period, on a floor whose friction is f times the
        stated one, is slow enough if T is at least sqrt(L / (9.81 f Fr)). See `colloc.slow_enough`,
        which says what is raised.
        """
        if self.problem.regime.slides:
            raise ProblemError("on a slope it is not known how slow is slow enough.")
        at = self.problem.body, self.problem.law, self.gait, self.answer.delta_per_period
        return slow_enough(*at, loss, breaks=self.gait.corner_phases)

    def dry(self) -> DryFriction:
        """Distance, work and efficiency at delta = 0, between bounds: the same gait under friction
        that is not smoothed.

        Raises
        ------
        ProblemError
            Unless a chain crawls slowly on the level, under a law whose dry balance minimises the
            dissipation: isotropic friction or `Elliptic`.

        Examples
        --------
        >>> import colloc
        >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
        >>> solution = colloc.solve(problem, starts=1)
        >>> least, most = solution.dry().efficiency
        >>> most - least < 1e-4
        True
        """
        p = self.problem
        if not p.regime.slow_on_level:
            raise ProblemError("bounds for dry friction are there for slow gaits on the level.")
        return dry_friction(
            p.body, p.law, self.gait, breaks=self.gait.corner_phases, turn=p.rotation or 0.0
        )

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
        if self.starts == 1 or not self.others:
            return ["local optimum, from one start"]
        # others are as a coarse mesh sees them, and one that shrank may be better
        this = min(self.others, key=lambda other: abs(other.value - self.answer.value))
        others = [other for other in self.others if other is not this]
        lines = [f"local optimum, best of {self.starts} starts, {this.starts} of which met it"]
        if others:
            lines.append(
                "also met, on a coarse mesh: " + "; ".join(map(str, others[:_MOST_OTHERS]))
            )
        return lines

    @property
    def mesh(self) -> Mesh:
        return self.answer.mesh

    @property
    def layout(self) -> Layout:
        return self.answer.layout

    @property
    def gait(self) -> AnyGait:
        return self.answer.gait.with_coordinate(self.problem.body.defaults.coordinate)

    @property
    def delta_per_period(self) -> float:
        """Regularisation speed [body lengths per period]."""
        return self.answer.delta_per_period

    @property
    def motion(self) -> CollocatedMotion:
        return self.answer.motion

    def at_points(self) -> tuple[np.ndarray, Sliding]:
        return self.mesh.times, self.motion.at_points

    def sample(self, t: np.ndarray | float) -> SampledMotion:
        """The motion at phases t, any real numbers, period after period:
        `CollocatedMotion.sample`."""
        return self.motion.sample(t)

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
        # loads what integrates, which few need
        from colloc.verification.differential_motion import (
            motion_from_rest,
        )

        p, chain = self.problem, self.problem.body
        if not p.froude:
            raise ProblemError(
                f"{p.name} has no inertia, and is under way at once: from rest is for problems "
                f"with a froude."
            )
        played = p.law, self.gait, self.delta_per_period, self.froude
        begun: Any = {
            "grade": p.grade,
            "theta": getattr(self.gait, "theta", None) or 0.0,
            "breaks": self.gait.corner_phases,
        }
        ran = motion_from_rest(chain, *played, periods=max(1, int(np.ceil(t[-1]))), **begun)
        states = np.array([np.interp(t, ran.phases, row) for row in ran.states])
        (angles, rates), theta, centre = self.gait(t % 1.0), states[3], states[4:6]
        z = tail_velocity(checked_mass(chain), angles, rates, states[:3])
        return SampledMotion(
            t,
            angles,
            rates,
            z,
            theta,
            centre,
            centre - rotate(np.array(chain.centre(angles)), theta),
        )

    def holding(self, motion: SampledMotion) -> np.ndarray:
        """Sticking feet, slower than 3 delta, ``(n_foot, n_time)``; no rows without feet."""
        body = self.problem.body
        if not foot_kinds(body):
            return np.zeros((0, motion.t.size), dtype=bool)
        speeds = part_speeds(body, motion)[1]
        return speeds < _HOLDS * self.delta_per_period

    @property
    def share_held(self) -> np.ndarray:
        """Fraction of the period for which each foot sticks, ``(n_foot,)``, from the tail."""
        if not foot_kinds(self.problem.body):
            return np.empty(0)
        return self.holding(self.sample(_INSTANTS)).mean(axis=1)

    @property
    def travels(self) -> str:
        """Average direction of travel: "head first", "tail first" or "sideways"."""
        motion = self.sample(_INSTANTS)
        return direction_of_travel(motion.centre, motion.tail)

    def power(self, motion: SampledMotion) -> np.ndarray:
        """Power against friction at the instants of a motion, ``(n_time,)``."""
        return self.motion.sliding(motion.angles, motion.rates, motion.z).power[0]

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
    def report(self, path: str | os.PathLike[str], *, robot: Any = None) -> Path:
        """Write the web page of `colloc report`; with what `robot` returns also its sheet."""
        return higher("pictures.report_page:write_report")(self, Path(path), robot=robot)

    @checked_arguments
    def export(self, path: str | os.PathLike[str], **options: Any) -> dict[str, Any]:
        """Write joint angles over time for a robot, as CSV or JSON by the ending of `path`,
        ``solution.export("mine.csv", period=4)``, or the robot as a model for simulators (``.xml``,
        ``.urdf``); returns what the file says. Options as for
        `colloc.pictures.export.write_export`."""
        return higher("pictures.export:write_export")(self, Path(path), **options)

    def robot(self, length: float, mass: float, period: float, **options: Any) -> Any:
        """A `colloc.results.robot.Robot`: speed, power and torques of the gait on a robot of so
        many metres and kilograms.

        Options as there: `gravity`, `max_speed`, `max_torque`.

        Examples
        --------
        >>> import colloc
        >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
        >>> robot = colloc.solve(problem, starts=1).robot(length=1.2, mass=3, period=5)
        >>> round(robot.facts["cost_of_transport"], 2)
        3.95
        """
        return higher("results.robot:Robot")(self, length, mass, period, **options)

    @checked_arguments
    def sensitivity(self, resolve: bool = False) -> Any:
        """A `colloc.search.sensitivity.Sensitivity`: by how much the best value changes with every
        number of the problem.

        With `resolve` also what the best gait gets where each is a tenth smaller and larger, and
        what this one gets there.

        Examples
        --------
        >>> import colloc
        >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
        >>> round(colloc.solve(problem, starts=1).sensitivity()["friction sideways"].slope, 3)
        -0.061
        """
        return higher("search.sensitivity:sensitivity")(self, resolve)

    def to_xarray(self, t: np.ndarray | None = None) -> xarray.Dataset:
        """The motion at phases `t` (one period by default) as an xarray Dataset, named as in a
        result file's group motion."""
        about = {
            "name": self.problem.name,
            "status": self.status,
            "efficiency": self.measured.efficiency,
        }
        about |= {"rotation": self.rotation, "turning_radius": self.turning_radius}
        if self.problem.objective != EFFICIENCY:
            about |= {"objective": self.problem.objective.name, "value": self.measured.value}
        return motion_dataset(self.columns(t), about)

    def to_dataframe(self, t: np.ndarray | None = None) -> pandas.DataFrame:
        """The motion at phases `t` (one period by default) as a pandas DataFrame:
        ``joint_angles_1``, ``centre_x``, ...

        Of a body with modes for joints these are ``modes_1``, ``mode_rates_1``, and so in
        `to_xarray`.
        """
        return motion_frame(self.columns(t))

    def columns(self, t: np.ndarray | None = None) -> dict[str, Column]:
        """The motion at phases `t` (one period by default): name to values with their units and
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
