"""The statement of a problem."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from colloc.gaits import gait_fields
from colloc.gaits.gait import ANTIPODAL, BILATERAL, NONE, fraction
from colloc.gaits.gait_fields import AnyClass, AnyGait, check_kind
from colloc.gaits.harmonic import Harmonic, Prescribed
from colloc.gaits.linear import LinearClass
from colloc.gaits.objective import EFFICIENCY, Objective, integrals_of, least_values, objective_from
from colloc.gaits.regime import LEVEL, Free, Regime, regime_of
from colloc.gaits.robot import (
    DERIVED,
    Limit,
    Robot,
    checked_actuator_limit,
    checked_limit,
    joint_ranges,
    of_each,
)
from colloc.gaits.starts import check_guess, default_guess
from colloc.mechanics.bodies import FULL, Body
from colloc.mechanics.chain import Chain, formulations
from colloc.mechanics.contact import crossing_depth
from colloc.mechanics.densities import (
    JointMap,
    PathLimit,
    PathLimits,
    Quantity,
    stated_limit,
    torque_and_power,
)
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law, rate_independent
from colloc.numerics.schemes import scheme
from colloc.smooth.smooth_body import schedule
from colloc.system.arguments import (
    STATED_IF_SET,
    check_choice,
    check_count,
    check_finite,
    check_positive,
    is_whole,
    named_arguments,
)
from colloc.system.errors import ProblemError
from colloc.system.files import check_name

SMALLEST_DELTA = 1e-14  # differences of speeds of order 1 are rounded to less
LARGEST_DELTA = 1e3  # body lengths per period, far above the speeds of any gait
MOST_INTERVALS, MOST_COORDINATES = 100_000, 100
"""Contact is checked in every pair of links at thousands of phases, which takes 10 s at so many."""


@named_arguments
@dataclass(frozen=True)
class Problem:
    """Maximise an objective over a class of gaits: by default the efficiency d/W.

    Parameters
    ----------
    name : str
        Of files: letters, digits, ``_``, ``-`` and ``.``, at most 200, and no ending that colloc
        itself gives to files.
    guess : Fourier, Combination or Corners, optional
        An admissible gait of any class to start from. By default a travelling wave
        (`colloc.gaits.starts`).
    body : Chain or ModalBody
        Or any other `colloc.mechanics.bodies.Body`.
    friction : Friction
        Or any other `colloc.mechanics.law.Law` (docs/howto/laws.md).
    gait : Harmonic, BSpline or Polygon
        The class of gaits, which decides the answer (docs/gait_classes.md). By default one
        harmonic, or the motion of a body whose motion is prescribed.
    delta : float
        Regularisation speed of friction at which the problem is finally solved, in body lengths per
        period; for polygons in body lengths per radian of path. By default 1e-4 for chains; 1e-2
        for smooth bodies, whose panels have to resolve it.
    delta_start : float
        Where the continuation in delta begins; by default 0.1 (smooth bodies: 0.3), 0.02 on a
        slope, and 0.01 for polygons.
    joint_limit : float, or sequence of float or (float, float)
        Largest |joint angle| [rad], at most pi, of all joints or of each, or the least and the
        largest of a joint, as in ``((-1, 2), 1.5)``; of a smooth body, largest |tangent angle| from
        its mean direction, at most pi/2.
    smallest_shape_speed : float
        Lower bound on the root-mean-square shape speed [rad per radian of phase], that is on the
        length of a path over 2 pi. Where speeds sink to delta, regularised friction is viscous and
        efficiency meaningless.
    intervals : int
        Intervals of the first mesh, on the solved part of the cycle.
    scheme : str
        Collocation scheme, see `colloc.numerics.schemes.scheme`.
    formulation : {"full", "implicit velocity"}
        Of the program whose solution is the answer (`colloc.transcription.full_program`): with
        link velocities and forces as variables and the balance as constraints, as usual for chains,
        or with the velocities tied to those of the balance solver, as for smooth bodies.
    mesh_tolerance : float
        Relative error of the objective to which the mesh is refined at the final delta; 0 keeps the
        uniform mesh.
    objective : Objective or str
        What is maximised: "efficiency", "speed", "turning", "driven efficiency", or an expression
        of distance, work, rotation, length, driven_work and, with inertia, period.
    rotation : float or None
        Net rotation over a cycle [rad], counter-clockwise; None leaves it free. Other values than
        0 need a class without symmetry.
    at_least : mapping or pairs of (Objective or str, float)
        Values of a cycle that must be reached, as ``{"distance": 0.3}``.
    torque_limit, power_limit : float or sequence of float, optional
        Of all motors or of each: magnitude of the moment [weight x body length], power delivered
        [weight x body length / period]. With a power limit the pace matters.
    limits : PathLimit or sequence of PathLimit, optional
        Others, on functions of an instant of your own (docs/howto/motors.md).
    speed_limit : float or sequence of float, optional
        Largest speed of all motors or of each [rad per period]: that of a motor [rad/s] times the
        period [s]. The pace matters.
    grade : float
        Tangent of the inclination of the ground; 0 is the level (docs/howto/slopes.md). On a slope
        "distance" is the climb and "work" that of the joints, and where the body points is sought
        with the gait.
    towards : float, optional
        Direction on a slope whose way counts instead of the climb, with none across it, from
        straight uphill to the left [rad].
    froude : float or Free
        Froude number L/(g T^2) at which gaits are played: length over gravity and the period
        squared; 0 is so slow that inertia does not matter (docs/howto/pace.md). What counts is its
        ratio to the coefficient of friction. ``Free(low, high)``: the pace is sought with the gait,
        where the objective speaks of the "period" [sqrt(length / gravity)].
    motion : Regime, optional
        A kind of motion of your own, instead of `grade` and `froude` (`colloc.gaits.regime`).
    robot : Robot, optional
        The robot in SI units. Its pace, motors and electronics say `froude`, `speed_limit`,
        `torque_limit` and, where none is stated, the objective: least energy per metre.
    least_distance : float, optional
        Distance that a gait must go in a cycle [body lengths], or half of what the farthest one
        goes, if that is less than this.
    shrinking : bool
        Whether a gait may be the answer that shrank until nobody sees it move. By default the best
        gait of finite size is, if there is one.

    Examples
    --------
    >>> from colloc import Chain, Friction, Harmonic, Problem
    >>> problem = Problem(
    ...     name="mine",
    ...     body=Chain((0.3, 0.2, 0.2, 0.3)),
    ...     friction=Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3),
    ...     gait=Harmonic(harmonics=2, symmetry="bilateral"),
    ... )
    >>> problem
    <Problem mine: 3 joints, friction (1.7, 1, 1.3), 2 harmonics, symmetry bilateral, delta 1e-04>
    >>> problem.with_(delta=1e-6).delta
    1e-06
    """

    name: str
    guess: AnyGait = None
    body: Body = Chain()
    friction: Law = Friction()
    gait: AnyClass = None
    delta: float = None  # type: ignore[assignment]
    delta_start: float = None  # type: ignore[assignment]
    joint_limit: Limit = None  # type: ignore[assignment]
    smallest_shape_speed: float = 0.1
    intervals: int = None  # type: ignore[assignment]
    scheme: str = "gauss-3"
    formulation: str = None  # type: ignore[assignment]
    mesh_tolerance: float = 3e-5
    objective: Objective = field(default=None, metadata=STATED_IF_SET)  # type: ignore[assignment]
    rotation: float | None = field(default=0.0, metadata=STATED_IF_SET)
    at_least: tuple[tuple[Objective, float], ...] = field(default=(), metadata=STATED_IF_SET)
    torque_limit: Limit | None = field(default=None, metadata=STATED_IF_SET)
    power_limit: Limit | None = field(default=None, metadata=STATED_IF_SET)
    speed_limit: Limit | None = field(default=None, metadata=STATED_IF_SET)
    limits: tuple[PathLimit, ...] = field(default=(), metadata=STATED_IF_SET)
    grade: float = field(default=0.0, metadata=STATED_IF_SET)
    towards: float | None = field(default=None, metadata=STATED_IF_SET)
    froude: float | Free = field(default=0.0, metadata=STATED_IF_SET)
    motion: Regime | None = field(default=None, metadata=STATED_IF_SET)
    robot: Robot | None = field(default=None, metadata=STATED_IF_SET)
    least_distance: float | None = field(default=None, metadata=STATED_IF_SET)
    shrinking: bool = field(default=False, metadata=STATED_IF_SET)

    def __post_init__(self) -> None:
        # asked first: to look what else a body answers can take gigabytes
        coordinates = getattr(self.body, "n_joint", 0)
        if is_whole(coordinates, MOST_COORDINATES + 1):
            name = self.body.defaults.coordinate
            raise ProblemError(
                f"the body has {coordinates} {name}s, and {MOST_COORDINATES} are "
                f"allowed: fewer links, or a smooth body of a few modes, come near it."
            )
        check_kind("body", self.body, gait_fields.BODIES, Body)
        stages, usual, n_joint = schedule(self.body), self.body.defaults, self.body.n_joint
        self._fill(gait=Prescribed(stages, self.body.symmetries[0]) if stages else Harmonic())
        check_name(self.name)
        check_kind("friction", self.friction, gait_fields.LAWS, Law)
        check_kind("gait", self.gait, gait_fields.CLASSES, LinearClass)
        motion = LEVEL if self.motion is None else self.motion
        check_kind("motion", motion, [Regime, *gait_fields.MOTIONS])
        if self.gait.free == bool(stages):
            what = "a prescribed motion has no class of gaits"
            what = what if self.gait.free else "this body's motion is not prescribed"
            raise ProblemError(f"{what}; leave gait out, or take another body.")
        self._derive()
        self._set(objective=objective_from(self.objective), at_least=least_values(self.at_least))
        regime, froude = self.regime, self.froude
        start = regime.delta_start(self.gait) or usual.delta_start
        paces = isinstance(froude, (list, tuple))
        self._set(froude=Free(*map(float, froude)) if paces else float(froude))  # type: ignore[arg-type]
        self._fill(
            delta=usual.delta,
            delta_start=start if self.law.regularised else usual.delta,
            joint_limit=usual.limit,
            formulation=formulations(self.body)[0],
            intervals=self.usual_intervals,
        )
        self._check_discretisation()
        limits = self.limits if isinstance(self.limits, Iterable) else (self.limits,)
        self._set(
            delta_start=max(self.delta, self.delta_start),
            joint_limit=checked_limit(self.body, self.joint_limit),
            limits=tuple(map(stated_limit, limits)),
            **{
                name: checked_actuator_limit(name, getattr(self, name), self.n_motor)
                for name in ("torque_limit", "power_limit", "speed_limit")
            },
        )
        self._check_aims()
        regime.check(self)
        self._check_gaits()
        if self.guess is None:
            free, none = self.gait.free, np.empty(0)
            self._set(guess=default_guess(self) if free else self.gait.member(none, n_joint))
        check_kind("guess", self.guess, gait_fields.GAITS)
        check_guess(self)

    def _set(self, **values: object) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @cached_property
    def _usual(self) -> dict[str, Any]:
        """Values of fields that follow from others, unless they are stated."""
        if self.robot is None:
            return {"objective": EFFICIENCY}
        return self.robot.dimensionless(self.grade, self.law.smallest)

    def _derive(self) -> None:
        if self.robot is not None:
            check_kind("robot", self.robot, [Robot])
            for name in DERIVED:
                if getattr(self, name) != getattr(type(self), name):
                    raise ProblemError(
                        f"{name} follows from the robot, in SI units: leave it out, or the robot."
                    )
            self._set(**{name: self._usual[name] for name in DERIVED})
        self._fill(objective=self._usual["objective"])

    @property
    def derived_fields(self) -> set[str]:
        """Names of the fields that follow from others."""
        if self.objective == self._usual["objective"]:
            return {*self._usual}
        return {*self._usual} - {"objective"}

    def _fill(self, **defaults: object) -> None:
        self._set(**{name: x for name, x in defaults.items() if getattr(self, name) is None})

    def _check_discretisation(self) -> None:
        check_finite(delta_start=self.delta_start, mesh_tolerance=self.mesh_tolerance)
        check_positive(self, "delta", "smallest_shape_speed")
        if self.delta < SMALLEST_DELTA:
            raise ProblemError(
                f"delta must be at least {SMALLEST_DELTA:g}, not {self.delta:g}: slower speeds are "
                f"lost in rounding."
            )
        if max(self.delta, self.delta_start) > LARGEST_DELTA:
            raise ProblemError(
                f"delta and delta_start must be at most {LARGEST_DELTA:g}: at such speeds friction "
                f"would be viscous."
            )
        if self.mesh_tolerance != 0 and not 1e-9 <= self.mesh_tolerance < 1:
            raise ProblemError(
                f"mesh_tolerance must be 0 or lie in [1e-9, 1), not {self.mesh_tolerance:g}."
            )
        check_choice(formulations(self.body), formulation=self.formulation)
        collocation = scheme(self.scheme)
        if self.gait.relative_delta and collocation.left:
            raise ProblemError(
                f"the class {type(self.gait).__name__} needs a gauss-N or radau-N scheme, not "
                f"{self.scheme}."
            )
        fewest, what = self.gait.fewest_intervals(collocation.s - collocation.left)
        check_count(MOST_INTERVALS, intervals=self.intervals)
        if self.intervals < fewest:
            raise ProblemError(
                f"the mesh is too small: {self.intervals} intervals of {self.scheme} cannot "
                f"resolve {what}; use at least {fewest}."
            )

    def _check_aims(self) -> None:
        if self.uses("period") and not self.froude:
            raise ProblemError(
                "the objective or a requirement uses the period: state the pace, froude=0.05 or "
                "froude=Free(0.001, 1)."
            )
        if self.least_distance is not None:
            check_positive(self, "least_distance")
        if self.rotation is not None:
            check_finite(rotation=self.rotation)
        if self.rotation == 0 and self.uses("rotation"):
            raise ProblemError(
                "the objective uses the rotation, which is 0 unless rotation says otherwise "
                "(None: free)."
            )
        if self.rotation != 0 and self.gait.symmetry != NONE:
            raise ProblemError(
                f"no {self.gait.symmetry} gait turns the body: rotation must be 0, or the class "
                f"without symmetry."
            )
        has_aims = self.objective != EFFICIENCY or self.at_least or self.speed_limit is not None
        has_aims = has_aims or self.least_distance is not None
        if has_aims and not self.gait.free:
            raise ProblemError(
                "nothing is free in a prescribed motion; leave objective, at_least and "
                "speed_limit out."
            )
        forced = [each.name for each in self.integrals if each.needs_forces]
        forced += [f"a limit on the {each.name}" for each in self.path_limits.each]
        if forced and self.formulation != FULL:
            raise ProblemError(
                f"{forced[0]} needs the forces on the body's parts: a chain, and the formulation "
                f"{FULL!r}."
            )
        if any(x.needs_pace for x in (*self.limits, *self.integrals)) and not self.regime.free:
            raise ProblemError("the speed of a joint is one of a free pace, froude=Free(...).")
        most = float(np.linalg.norm(self.largest_speeds)) if self.speed_limit else np.inf
        if most <= (least := 2 * np.pi * self.smallest_shape_speed):
            raise ProblemError(
                f"speed_limit leaves no gait: joints together move at most at {most:.3g} rad per "
                f"period, and smallest_shape_speed asks for {least:.3g}. Make that smaller."
            )

    def _check_gaits(self) -> None:
        gaits, symmetry = self.gait, self.gait.symmetry
        if symmetry not in self.body.symmetries:
            raise ProblemError(
                f"gaits of symmetry {symmetry} need a body whose lengths, weights and feet read "
                f"the same from both ends; gaits of this one may have the symmetry "
                f"{' or '.join(self.body.symmetries)}."
            )
        for name in ("joint_limit", "torque_limit", "power_limit", "speed_limit"):
            limit = getattr(self, name)
            ranges = joint_ranges(0.0 if limit is None else limit, 1)
            images = -ranges[:: -1 if symmetry == BILATERAL else 1, ::-1]
            if symmetry != NONE and (ranges != images).any():
                alike = "mirrored joints" if symmetry == BILATERAL else "to both sides"
                raise ProblemError(
                    f"gaits of symmetry {symmetry} bend {alike} alike: give them the same {name}."
                )
        if self.joint_map is not None:
            if not isinstance(self.body, Chain):
                raise ProblemError(
                    f"Coupled is for the joints of a Chain, not of a {type(self.body).__name__}."
                )
            if crossing_depth(self.body, self.joint_map.offset).any():
                raise ProblemError("links cross where joints are stuck.")
        gaits.check_joints(self.body.n_joint)
        if gaits.relative_delta and self.paced_by:
            raise ProblemError(
                f"the class {type(gaits).__name__} leaves the pace open, but {self.paced_by}; "
                f"use Harmonic (period 1)."
            )
        alone = self.body.n_joint == 1
        if self.law.reversible and not self.froude and (alone or _retraces(self)):
            coordinate = self.body.defaults.coordinate
            which = f"a body with one {coordinate}" if alone else f"the class ({gaits.describe()})"
            more = f"the body a second {coordinate}" if alone else "the class more freedom"
            raise ProblemError(
                f"no gait of {which} goes anywhere when mu_f = mu_b: it retraces its path, and "
                f"reversed rates reverse the motion (the scallop theorem). Give {more}, mu_b "
                f"different from mu_f, or the problem a froude."
            )
        if self.keeps_heading and self.rotation:
            raise ProblemError("two equal links never turn when mu_f = mu_b: rotation must be 0.")
        if self.keeps_heading and symmetry == ANTIPODAL:
            raise ProblemError(
                "no antipodal gait of two equal links goes anywhere when mu_f = mu_b: take the "
                "class without symmetry, links that differ, or mu_b different from mu_f."
            )

    @property
    def path_limits(self) -> PathLimits:
        """Limits of motors, joint by joint, and `limits`."""
        n = self.n_motor
        motors = torque_and_power(of_each(self.torque_limit, n), of_each(self.power_limit, n))
        speeds = self.robot.speed_limits(self.grade, n) if self.robot else ()
        return PathLimits((*motors, *speeds, *(each.on(n) for each in self.limits)))

    @property
    def largest_speeds(self) -> tuple[float, ...]:
        """`speed_limit` joint by joint [rad per period]; empty without one."""
        return of_each(self.speed_limit, self.n_motor)

    @property
    def joint_map(self) -> JointMap | None:
        """The map from motors to joints, if several joints hang on one or some are stuck."""
        return self.gait.joint_map(self.body.n_joint)

    @property
    def n_motor(self) -> int:
        return self.body.n_joint if self.joint_map is None else self.joint_map.n_motor

    def of_motors(self, moments: np.ndarray) -> np.ndarray:
        """Moments of the motors, from those of the joints."""
        return moments if self.joint_map is None else self.joint_map.motor_moments(moments)

    def joint_path(self, angles: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles and rates of the joints, from those of the motors."""
        joints = self.joint_map
        if joints is None:
            return angles, rates
        return joints.joint_angles(angles), joints.joint_rates(rates)

    @property
    def law(self) -> Law:
        """The law of friction of all contacts: `friction`, unless feet have their own."""
        body = self.body
        return body.law(self.friction) if isinstance(body, Chain) else self.friction

    @cached_property
    def regime(self) -> Regime:
        """The kind of motion. `ProblemError` if there is none like it."""
        return regime_of(self)

    @property
    def usual_intervals(self) -> int:
        """Intervals of the first mesh, if nothing else is stated."""
        usual = self.gait.intervals(self.body.n_joint)
        return round(usual * self.fraction / self.gait.fraction)

    @property
    def fraction(self) -> float:
        return fraction(self.regime.motion_symmetry(self.gait.symmetry))

    @property
    def scene(self) -> str:
        """The kind of motion in words; empty for slow motion on the level."""
        return self.regime.describe()

    @property
    def paced_by(self) -> str:
        """Why the pace of a gait matters; empty if it does not."""
        if self.power_limit is not None:
            return "the joints' power is limited"
        if self.speed_limit is not None:
            return "the joints' speed is limited"
        if limited := [each.name for each in self.limits if each.pace_degree != 0.0]:
            return f"the {limited[0]} is limited"
        if self.regime.pace:
            return self.regime.pace
        if paced := [each.name for each in self.integrals if each.pace_degree != 1.0]:
            return f"the {paced[0]} of a path depends on how fast it is followed"
        if not rate_independent(self.law):
            return f"work depends on the pace under {self.law.label}"
        return ""

    @property
    def aims(self) -> tuple[Objective, ...]:
        """The objective, then those of `at_least`."""
        return (self.objective, *(aim for aim, _ in self.at_least))

    def uses(self, quantity: str) -> bool:
        return any(quantity in aim.uses for aim in self.aims)

    @property
    def integrals(self) -> tuple[Quantity, ...]:
        """Quantities in the `aims` that are integrals of functions of an instant."""
        return integrals_of(self.aims)

    @property
    def keeps_heading(self) -> bool:
        """True if the body is its own mirror image in every shape, and so never turns."""
        return (
            self.body.n_joint == 1
            and self.law.reversible
            and self.body.reversal is not None
            and not self.grade
        )

    def __repr__(self) -> str:
        n_joint, coordinate = self.body.n_joint, self.body.defaults.coordinate
        best = "" if self.objective == EFFICIENCY else f"best {self.objective.name}, "
        return (
            f"<Problem {self.name}: {best}{n_joint} {coordinate}{'s' * (n_joint > 1)}, "
            f"{self.law.label}{self.regime.label}, {self.gait.describe()}, delta {self.delta:.0e}>"
        )

    def with_(self, **changes: object) -> Problem:
        """A copy with some fields changed, validated anew."""
        values = {name: getattr(type(self), name) for name in self.derived_fields} | changes
        return dataclasses.replace(self, **values)

    @property
    def without_robot(self) -> Problem:
        """The same problem, in which the numbers that follow from the robot are stated."""
        if self.robot is None:
            return self
        values = {name: getattr(self, name) for name in ("objective", *DERIVED)}
        limits = *self.robot.speed_limits(self.grade, self.n_motor), *self.limits
        return self.with_(robot=None, limits=limits, **values)

    def to_dict(self) -> dict:
        """All fields as plain numbers, strings and lists (JSON); those `STATED_IF_SET` only if they
        are not the default."""
        plain: dict[str, Any] = {
            name: gait_fields.fields(part)
            for name in gait_fields.kinds_of_parts()
            if (part := getattr(self, name)) is not None
        }
        plain |= {
            "objective": self.objective.fields(),
            "at_least": [[aim.fields(), least] for aim, least in self.at_least],
            "limits": [limit.fields() for limit in self.limits],
        }
        return {
            f.name: plain.get(f.name, value)
            for f in dataclasses.fields(self)
            if f.name not in self.derived_fields
            and ((value := getattr(self, f.name)) != f.default or f.metadata != STATED_IF_SET)
        }

    @classmethod
    def from_dict(cls, statement: dict) -> Problem:
        """The problem that `to_dict` wrote.

        Raises
        ------
        ProblemError
            If a field is missing, unknown or has an unusable value.
        """
        try:
            parts = {
                name: gait_fields.part_from(kinds, statement[name])
                for name, kinds in gait_fields.kinds_of_parts().items()
                if name in statement or name not in ("motion", "robot")
            }
            return cls(**statement | parts)
        except ProblemError:
            raise
        except (AttributeError, KeyError, OverflowError, TypeError, ValueError) as error:
            raise ProblemError(f"not the description of a problem: {error}.") from None

    @property
    def hash(self) -> str:
        """SHA-256 of the fields: equal problems have equal hashes."""
        return gait_fields.statement_hash(self.to_dict())


def _retraces(problem: Problem) -> bool:
    """True if every gait of a class goes back the way it came: the rates of a random member have
    one direction."""
    gaits, n_joint = problem.gait, problem.body.n_joint
    if not gaits.free:
        return False
    rates = gaits.angle_matrix(gaits.instants, n_joint, 1)
    direction = np.random.default_rng(0).normal(size=rates.shape[2])
    return bool(np.linalg.matrix_rank(rates @ direction) <= 1)
