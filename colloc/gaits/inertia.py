"""What can be asked of a problem whose gaits are played so fast that the body's inertia counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.regime import Regime
from colloc.gaits.symmetry import ANTIPODAL, NONE
from colloc.mechanics.bodies import FULL
from colloc.mechanics.inertia import GRAVITY, checked_mass
from colloc.numerics.schemes import scheme
from colloc.system.arguments import is_number
from colloc.system.errors import ProblemError


@dataclass(frozen=True)
class Paced(Regime):
    """On the level, at a Froude number L/(g T^2), at which inertia counts."""

    froude: float  # type: ignore[misc]

    spent = "friction and kinetic energy"
    others = "that follow from slow motion and from rest"
    pace = "what is heavy takes time to move"

    @property
    def label(self) -> str:
        return f", Froude number {self.froude:g}"

    def describe(self) -> str:
        period = 1 / np.sqrt(GRAVITY * self.froude)
        return f"played at the Froude number {self.froude:.4g}: a body of 1 m takes {period:.3g} s a period"

    def in_units_of(self, unit: float) -> Paced:
        return Paced(self.froude / unit)  # it drives momenta

    def check(self, problem: Any) -> None:
        froude = self.froude
        if not is_number(froude) or froude < 0:
            raise ProblemError(
                f"froude must be a number that is not negative, length over (gravity times period^2), not {froude!r}."
            )
        checked_mass(problem.body)
        if problem.grade:
            raise ProblemError("on a slope inertia is not known yet: leave froude or grade out.")
        if not problem.gait.free:
            raise ProblemError("a prescribed motion is played with inertia by colloc.inertial_motion: leave froude out.")
        if not problem.gait.unit_speed and problem.gait.symmetry not in (NONE, ANTIPODAL):
            raise ProblemError(
                f"gaits of symmetry {problem.gait.symmetry} run backwards in half of their period, as nothing with inertia "
                f"does: take symmetry {ANTIPODAL!r} or {NONE!r}."
            )
        if problem.path_limits.names or any(each.needs_forces for each in problem.integrals):
            raise ProblemError("what single joints have to do with inertia is not known yet: leave driven work and limits out.")
        if problem.formulation != FULL:
            raise ProblemError(f"with inertia there is only the formulation {FULL!r}.")
        if scheme(problem.scheme).left:
            raise ProblemError(f"with inertia a gauss-N or radau-N scheme is needed, not {problem.scheme}.")
