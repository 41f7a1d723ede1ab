"""Problems with inertia, at one Froude number or at the best one of a range."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np

from colloc.gaits.regime import LEVEL, Regime
from colloc.gaits.sloped import OnSlope, Slope
from colloc.gaits.static_parameters import WithStaticParameter, with_static_parameter
from colloc.gaits.symmetry import ANTIPODAL, NONE
from colloc.mechanics.bodies import FULL
from colloc.mechanics.inertia import GRAVITY, checked_mass
from colloc.numerics.schemes import scheme
from colloc.system.arguments import is_number
from colloc.system.errors import ProblemError

_PACED = {"distance", "work", "rotation", "period"}


class Free(NamedTuple):
    """A range of Froude numbers L/(g T^2) in which the pace of a gait is sought with it.

    Parameters
    ----------
    low, high : float
        Above 0; where they are one the pace is given. The best pace of the plain efficiency is the
        slowest, unless inertia helps: a term in the "period" says what time is worth.

    Examples
    --------
    >>> import colloc
    >>> colloc.Problem("mine", froude=colloc.Free(0.01, 1),
    ...     objective="distance / (work + 0.1 * period)")
    <Problem mine: best distance / (work + 0.1 * period), 2 joints, friction (1, 1, 1), Froude
    number 0.01 to 1, 1 harmonic, \
symmetry none, delta 1e-04>
    """

    low: float
    high: float


class AtFreePace(WithStaticParameter):
    """Members state log(period), at first the middle of the range."""

    static_name = "log_period"
    pace: Free

    @property
    def static_bounds(self) -> tuple[float, float]:
        longest, shortest = -0.5 * np.log(self.pace)
        return shortest, longest

    def static_value(self, gait: Any) -> float:
        ends = self.static_bounds
        return float(np.mean(ends) if gait.log_period is None else np.clip(gait.log_period, *ends))


@dataclass(frozen=True)
class Paced(Regime):
    """Inertial regime at a Froude number L/(g T^2), or the middle of a range of them."""

    froude: float  # type: ignore[misc]
    free: Free | None = None

    spent = "friction and kinetic energy"
    others = "that follow from slow motion and from rest"
    pace = "what is heavy takes time to move"

    @property
    def free_pace(self) -> bool:  # type: ignore[override]
        return self.free is not None

    @property
    def slowly(self) -> Regime:
        return LEVEL

    @property
    def label(self) -> str:
        return (
            f"{super().label}, Froude number "
            f"{' to '.join(f'{each:g}' for each in self.free or (self.froude,))}"
        )

    def at(self, gait: Any) -> Self:
        if self.free is None:
            return self
        if gait.log_period is None and self.free.low == self.free.high:
            return replace(self, free=None)
        if gait.log_period is None:
            raise ProblemError(
                "the gait does not say its pace: give it a log_period, or the problem one Froude "
                "number."
            )
        return replace(self, froude=float(np.exp(-2.0 * gait.log_period)), free=None)

    def class_of(self, gait_class: Any) -> Any:
        level = super().class_of(gait_class)
        if self.free is None:
            return level
        if not level.takes_static_parameters or level.relative_delta or not level.linear:
            raise ProblemError(
                f"a free pace is sought with a gait of a class Harmonic, not "
                f"{type(level).__name__}."
            )
        return with_static_parameter(AtFreePace, level, pace=self.free)

    def describe(self) -> str:
        if self.free is not None:
            return (
                f"played at the best Froude number from {self.free.low:.4g} to {self.free.high:.4g}"
            )
        period = 1 / np.sqrt(GRAVITY * self.froude)
        return (
            f"played at the Froude number {self.froude:.4g}: a body of 1 m takes "
            f"{period:.3g} s "
            f"a period"
        )

    def in_units_of(self, unit: float) -> Self:
        # where time counts the unit is 1
        return replace(super().in_units_of(unit), froude=self.froude / unit)

    def check(self, problem: Any) -> None:
        if self.free and not set(problem.objective.uses) & _PACED:
            raise ProblemError(
                f"a free pace needs an objective that depends on it, as distance and work do, not "
                f"{problem.objective.name!r}."
            )
        checked_mass(problem.body)
        if problem.joint_map is not None:
            raise ProblemError(
                "searches with inertia are for chains whose joints all have motors: leave froude "
                "or gears and stuck joints out."
            )
        if not problem.gait.free:
            raise ProblemError(
                "a prescribed motion is played with inertia by colloc.inertial_motion: leave "
                "froude out."
            )
        super().check(problem)
        if not problem.gait.relative_delta and problem.gait.symmetry not in (NONE, ANTIPODAL):
            raise ProblemError(
                f"gaits of symmetry {problem.gait.symmetry} run backwards in half of their period, "
                f"as nothing with inertia "
                f"does: take symmetry {ANTIPODAL!r} or {NONE!r}."
            )
        if any(each.needs_forces for each in problem.integrals):
            raise ProblemError(
                "the work of single joints with inertia is not known yet: leave driven work out."
            )
        if problem.path_limits.needs_forces:
            _check_accelerations(problem.gait, problem.body.n_joint)
        if problem.formulation != FULL:
            raise ProblemError(f"with inertia there is only the formulation {FULL!r}.")
        if scheme(problem.scheme).left:
            raise ProblemError(
                f"with inertia a gauss-N or radau-N scheme is needed, not {problem.scheme}."
            )


def _check_accelerations(gait_class: Any, n_joint: int) -> None:
    if gait_class.relative_delta:
        raise ProblemError(
            "with inertia torques are infinite where joint rates jump: limit them for gaits of a "
            "smooth class, such as Harmonic or BSpline."
        )
    t, step = np.array([0.123, 0.456]), 1e-6
    after, before = (gait_class.rate_matrix(t + by, n_joint) for by in (step, -step))
    error = np.abs(gait_class.angle_matrix(t, n_joint, 2) - (after - before) / (2 * step)).max()
    if not error < 1e-3 * np.abs(after).max():
        raise ProblemError(
            f"torques with inertia need second derivatives of the gait, which "
            f"{type(gait_class).__name__}.functions(t, 2) does not give."
        )


@dataclass(frozen=True)
class PacedOnSlope(Paced, Slope):
    grade: float = 0.0  # type: ignore[misc]
    froude: float = 0.0  # type: ignore[misc]

    spent = "friction, climb and kinetic energy"
    others_measured = True

    @property
    def slowly(self) -> Regime:
        return Slope(self.grade, self.towards)

    def describe(self) -> str:
        return f"{self.slowly.describe()}; {super().describe().split(':')[0]}"

    def class_of(self, gait_class: Any) -> Any:
        self.slowly.class_of(gait_class)  # refuses what has no place on a slope
        return with_static_parameter(OnSlope, Paced(self.froude, self.free).class_of(gait_class))


def paced_from(froude: Any, slope: Slope | None, *, timed: bool) -> Paced:
    """Regime for a stated Froude number or range; `timed` where objectives depend on the period."""
    free = None
    if isinstance(froude, (tuple, list)):
        if len(froude) != 2 or not all(map(is_number, froude)) or not 0 < froude[0] <= froude[1]:
            raise ProblemError(
                "froude=Free(low, high) needs two numbers above 0, the smaller one first, not "
                f"{' and '.join(map(repr, froude))}."
            )
        free, froude = Free(*map(float, froude)), float(np.sqrt(froude[0] * froude[1]))
    elif not is_number(froude) or froude < 0:
        raise ProblemError(
            f"froude must be a number that is not negative, length over (gravity times period^2), "
            f"not {froude!r}."
        )
    elif timed:
        free = Free(froude, froude)
    return (
        Paced(froude, free)
        if slope is None
        else PacedOnSlope(**vars(slope), froude=froude, free=free)
    )
