"""Problems on a slope of grade g, the tangent of its inclination.

The weight pulls the body down the fall line with g, in units of the normal force. The motion
depends on the heading, so the initial one is a gait parameter. *Distance* is the climb of the
centre of mass, or its way in the direction asked for; *work* is that of the joints, against
friction and weight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from colloc.gaits.gait import DELTA_START
from colloc.gaits.regime import Regime
from colloc.gaits.static_parameters import WithStaticParameter, with_static_parameter
from colloc.gaits.symmetry import BILATERAL, NONE
from colloc.mechanics.bodies import FULL, Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.law import Law, rate_independent
from colloc.numerics.arrays import Array, namespace
from colloc.numerics.schemes import scheme
from colloc.system.arguments import is_number
from colloc.system.errors import ProblemError

_ANY_ANGLE = 100.0
"""Bound on where a body may point [rad]: none."""


@dataclass(frozen=True)
class Slope(Regime):
    """Grade, and the direction whose way counts, from straight uphill to the left [rad]; None: the
    climb."""

    grade: float  # type: ignore[misc]
    towards: float | None = None

    slides = True
    spent = "friction and climb"
    others_measured = False

    @property
    def ahead(self) -> float:
        return self.towards or 0.0

    @property
    def keeps_ahead(self) -> bool:
        return self.towards is not None

    @property
    def label(self) -> str:
        return f"{super().label}, grade {self.grade:g}"

    def in_units_of(self, unit: float) -> Self:
        # the weight's pull is a force, too
        return replace(super().in_units_of(unit), grade=self.grade / unit)

    def class_of(self, gait_class: Any) -> Any:
        level = super().class_of(gait_class)
        name = type(level).__name__
        if not level.takes_static_parameters:
            raise ProblemError(
                f"on a slope gaits say where the body points, which those of the class {name} "
                f"cannot: take Harmonic, BSpline, "
                "Basis or Polygon."
            )
        if level.relative_delta and level.symmetry != NONE:
            raise ProblemError(
                f"on a slope no part of a period follows from another: take {name}(..., "
                f"symmetry='none'), which has gaits of "
                f"symmetry {level.symmetry}, too."
            )
        return with_static_parameter(OnSlope, level)

    def travel_along(self, way: complex) -> complex:
        return way * np.exp(-1j * self.ahead)

    def pull(self, theta: Array) -> Array:
        """Weight in body axes, ``(2, n_time)``, at tail headings theta ``(1, n_time)`` from
        straight uphill."""
        xp = namespace(theta)
        return xp.stack([-self.grade * xp.cos(theta), self.grade * xp.sin(theta)])

    def check(self, problem: Any) -> None:
        if problem.rotation != 0:
            raise ProblemError(
                "on a slope a body that a period turns has no gait that repeats, as its weight "
                "then pulls from another side: "
                "leave rotation at 0, and out of what is asked for."
            )
        if problem.formulation != FULL:
            raise ProblemError(f"on a slope there is only the formulation {FULL!r}.")
        if scheme(problem.scheme).left:
            raise ProblemError(
                f"on a slope a gauss-N or radau-N scheme is needed, not {problem.scheme}."
            )

    def describe(self) -> str:
        way = (
            "the climb"
            if self.towards is None
            else f"the way {np.degrees(self.towards):.4g}° to the left of straight uphill"
        )
        return f"slope of grade {self.grade:g}: d is {way}, W the work of the joints"


class OnSlope(WithStaticParameter):
    """Members state the heading of the tail link at phase 0."""

    static_name = "theta"
    static_bounds = -_ANY_ANGLE, _ANY_ANGLE

    @property
    def delta_start(self) -> float:  # type: ignore[override]
        """Smaller than on level ground: with more regularisation the body creeps down faster than
        it crawls up."""
        return 0.2 * DELTA_START if self.relative_delta else 0.02

    @property
    def fraction(self) -> float:
        return 1.0

    @property
    def motion_symmetry(self) -> str:
        return NONE

    @property
    def closing_symmetry(self) -> str:
        """Bilateral gaits keep every heading (docs/howto/slopes.md)."""
        return BILATERAL if self.symmetry == BILATERAL else NONE

    def static_value(self, gait: Any) -> float:
        """NaN also where the nearest member starts in another phase."""
        return gait.theta if gait.theta is not None and self.in_phase(gait) else np.nan

    def parameters(self, gait: Any) -> np.ndarray:
        return super().parameters(gait) if np.isnan(self.static_value(gait)) else self.nearest(gait)


def _checked_grade(grade: object) -> float:
    if not is_number(grade) or grade < 0:
        raise ProblemError(
            f"grade must be a number that is not negative, the tangent of the inclination, not "
            f"{grade!r}."
        )
    return float(grade)


def checked_chain(body: Body, friction: Law, grade: float) -> Chain:
    """The body, or a `ProblemError` why it cannot be on a slope."""
    if not isinstance(body, Chain) or type(body).solve is not Chain.solve:
        raise ProblemError(
            f"only a Chain, whose joints are its own, can be put on a slope, not "
            f"{type(body).__name__}."
        )
    _checked_grade(grade)
    if rate_independent(body.law(friction)) and grade >= (most := body.contact.most_held(friction)):
        raise ProblemError(
            f"on a slope of grade {grade:g} the body slides down for ever: friction holds at most "
            f"{most:g} times the force "
            "that presses it on the ground."
        )
    return body


def slope_from(body: Body, friction: Law, grade: object, towards: object) -> Slope | None:
    """Slope of a problem; None for the level."""
    tangent = _checked_grade(grade)
    if towards is not None and not is_number(towards):
        raise ProblemError(
            f"towards must be a finite angle from straight uphill, or None, not {towards!r}."
        )
    if tangent == 0:
        if towards is not None:
            raise ProblemError("towards is a direction on a slope: give a grade, or leave it out.")
        return None
    checked_chain(body, friction, tangent)
    return Slope(tangent, None if towards is None else float(towards))
