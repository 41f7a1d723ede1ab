"""What can be asked of a problem whose gaits are played so fast that the body's inertia counts."""

from __future__ import annotations

from typing import Any

from colloc.gaits.symmetry import ANTIPODAL, NONE
from colloc.mechanics.bodies import FULL
from colloc.mechanics.inertia import checked_mass
from colloc.numerics.schemes import scheme
from colloc.system.arguments import is_number
from colloc.system.errors import ProblemError


def check_paced(problem: Any) -> None:
    """A `ProblemError` for a Froude number that is none, and for what cannot be asked beside it."""
    froude = problem.froude
    if not is_number(froude) or froude < 0:
        raise ProblemError(
            f"froude must be a number that is not negative, length over (gravity times period^2), not {froude!r}."
        )
    checked_mass(problem.body)
    if problem.slope is not None:
        raise ProblemError("on a slope inertia is not known yet: leave froude or grade out.")
    if not problem.gait.free:
        raise ProblemError("a prescribed motion is played with inertia by colloc.inertial_motion: leave froude out.")
    if not problem.gait.unit_speed and problem.gait.symmetry not in (NONE, ANTIPODAL):
        raise ProblemError(
            f"gaits of symmetry {problem.gait.symmetry} run backwards in half of their period, as nothing with inertia does: "
            f"take symmetry {ANTIPODAL!r} or {NONE!r}."
        )
    if problem.path_limits.names or any(each.needs_forces for each in problem.integrals):
        raise ProblemError("what single joints have to do with inertia is not known yet: leave driven work and limits out.")
    if problem.formulation != FULL:
        raise ProblemError(f"with inertia there is only the formulation {FULL!r}.")
    if scheme(problem.scheme).left:
        raise ProblemError(f"with inertia a gauss-N or radau-N scheme is needed, not {problem.scheme}.")
