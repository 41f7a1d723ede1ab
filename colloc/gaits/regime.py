"""How gaits are played: slowly on the level, unless a problem has a `grade` or a `froude`.

On a slope of grade g, the tangent of its inclination, the weight pulls the body down the fall line
with g, in units of the normal force. *Distance* is the climb of the centre of mass, or its way in
the direction asked for; *work* is that of the joints, against friction and weight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np

from colloc.gaits.gait import ANTIPODAL, DELTA_START, NONE
from colloc.mechanics.bodies import FULL, Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.inertia import GRAVITY, checked_mass
from colloc.mechanics.law import Law, rate_independent
from colloc.numerics.arrays import Array, namespace
from colloc.numerics.schemes import scheme
from colloc.system.arguments import check_finite, check_range, is_number
from colloc.system.errors import ProblemError

_ON_SLOPE = 0.02, 0.2 * DELTA_START
"""First delta of a search, also where it is relative to the shape speed: with more regularisation
the body creeps down faster than it crawls up."""


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


@dataclass(frozen=True, kw_only=True)
class Regime:
    """Gravity and inertia. A regime of one's own derives from it and says its `dynamics`, a class
    like those of `colloc.dynamics.dynamics`, its ``replay`` and its ``reference``."""

    grade: float = 0.0  # tangent of the inclination; +x is straight uphill
    towards: float | None = None  # from straight uphill to the left [rad]; None: the climb counts
    froude: float = 0.0  # L/(g T^2), or the middle of a range
    free: Free | None = None  # the pace is a static parameter of the gait

    @property
    def slow_on_level(self) -> bool:
        return self == LEVEL

    @property
    def slides(self) -> bool:
        """True if the body may slide back."""
        return self.grade > 0

    @property
    def ahead(self) -> float:
        """Direction of travel that counts [rad]."""
        return self.towards or 0.0

    @property
    def spent(self) -> str:
        """What the joints' work goes into."""
        if not self.froude:
            return "friction and climb" if self.slides else "friction"
        return f"friction{', climb' * self.slides} and kinetic energy"

    @property
    def pace(self) -> str:
        """Why the pace of a gait matters; empty if it does not."""
        return "inertia counts" if self.froude else ""

    @property
    def label(self) -> str:
        paces = "" if not self.froude else " to ".join(f"{x:g}" for x in self.free or [self.froude])
        on = f", grade {self.grade:g}" if self.slides else ""
        return f"{on}, Froude number {paces}" if paces else on

    def describe(self) -> str:
        if self.towards is None:
            way = "the climb"
        else:
            way = f"the way {np.degrees(self.towards):.4g}° to the left of straight uphill"
        slope = f"slope of grade {self.grade:g}: d is {way}, W the work of the joints"
        words = [slope] if self.slides else []
        if self.free is not None:
            low, high = self.free
            words.append(f"played at the best Froude number from {low:.4g} to {high:.4g}")
        elif self.froude:
            words.append(f"played at the Froude number {self.froude:.4g}")
            if not self.slides:
                period = 1 / np.sqrt(GRAVITY * self.froude)
                words[-1] += f": {period:.3g} s per cycle for a body of 1 m"
        return "; ".join(words)

    @property
    def slowly(self) -> Self:
        """The quasi-static regime."""
        return replace(self, froude=0.0, free=None)

    def at(self, gait: Any) -> Self:
        """The regime at the pace that a gait states, where that is free."""
        if self.free is None:
            return self
        if gait.log_period is not None:
            return replace(self, froude=float(np.exp(-2.0 * gait.log_period)), free=None)
        if self.free.low == self.free.high:
            return replace(self, free=None)
        raise ProblemError(
            "the gait does not say its pace: give it a log_period, or the problem one Froude "
            "number."
        )

    def in_units_of(self, unit: float) -> Self:
        """The regime where friction is a part `unit` of what it was; at a free pace that is 1."""
        return replace(self, grade=self.grade / unit, froude=self.froude / unit)

    def motion_symmetry(self, symmetry: str) -> str:
        """Symmetry of the motion of gaits of a symmetry."""
        return NONE if self.slides else symmetry

    def closing_symmetry(self, symmetry: str) -> str:
        """Symmetry that closes the net rotation; on a slope bilateral gaits keep every heading
        (docs/howto/slopes.md)."""
        return NONE if self.slides and symmetry == ANTIPODAL else symmetry

    def delta_start(self, gait_class: Any) -> float | None:
        """First delta of a search in a class; None: the body's default."""
        if self.slides:
            return _ON_SLOPE[gait_class.relative_delta]
        return gait_class.delta_start

    def travel_along(self, way: complex) -> complex:
        """Distance that counts, and across it as the imaginary part."""
        return way * np.exp(-1j * self.ahead) if self.slides else complex(abs(way))

    def pull(self, theta: Array) -> Array | None:
        """Weight in body axes, ``(2, n_time)``, at tail headings theta ``(1, n_time)`` from
        straight uphill; None on the level. NumPy and CasADi."""
        if not self.slides:
            return None
        xp = namespace(theta)
        return xp.stack([-self.grade * xp.cos(theta), self.grade * xp.sin(theta)])

    def check(self, problem: Any) -> None:
        """Raise `ProblemError` for what this regime cannot do."""
        if not self.slides and not self.froude:
            return
        gaits, name, where = problem.gait, type(problem.gait).__name__, "on a slope"
        free_joints = problem.joint_map is None
        if self.slides:
            if not free_joints:
                raise ProblemError(
                    f"on a slope gaits say where the body points, which those of the class {name} "
                    f"cannot: take Harmonic, BSpline, Basis or Polygon."
                )
            if gaits.relative_delta and gaits.symmetry != NONE:
                raise ProblemError(
                    f"on a slope no part of a cycle follows from another: take {name}(..., "
                    f"symmetry='none'), which has gaits of symmetry {gaits.symmetry}, too."
                )
        if self.free and not (free_joints and gaits.linear and not gaits.relative_delta):
            raise ProblemError(
                f"a free pace is sought with a gait of a class Harmonic, not {name}."
            )
        if self.froude:
            where = "with inertia"
            self._check_inertia(problem)
        if self.slides and problem.rotation != 0:
            raise ProblemError(
                "on a slope a body that a cycle turns has no gait that repeats, as its weight "
                "then pulls from another side: leave rotation at 0, and out of what is asked for."
            )
        if problem.formulation != FULL:
            raise ProblemError(f"{where} there is only the formulation {FULL!r}.")
        if scheme(problem.scheme).left:
            raise ProblemError(
                f"{where} a gauss-N or radau-N scheme is needed, not {problem.scheme}."
            )

    def _check_inertia(self, problem: Any) -> None:
        gaits = problem.gait
        of_shapes = {each.name for each in problem.objective.integrals if not each.needs_forces}
        if self.free and of_shapes.issuperset(problem.objective.uses):
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
        if not gaits.relative_delta and gaits.symmetry not in (NONE, ANTIPODAL):
            raise ProblemError(
                f"gaits of symmetry {gaits.symmetry} run backwards in half of each cycle, as "
                f"nothing with inertia does: take symmetry {ANTIPODAL!r} or {NONE!r}."
            )
        if not any(each.needs_forces for each in (problem.path_limits, *problem.integrals)):
            return
        if gaits.relative_delta:
            raise ProblemError(
                "with inertia torques are infinite where joint rates jump: take gaits of a smooth "
                "class, such as Harmonic or BSpline."
            )
        t, step, n_joint = np.array([0.123, 0.456]), 1e-6, problem.body.n_joint
        after, before = (gaits.angle_matrix(t + by, n_joint, 1) for by in (step, -step))
        error = np.abs(gaits.angle_matrix(t, n_joint, 2) - (after - before) / (2 * step)).max()
        if not error < 1e-3 * np.abs(after).max():
            raise ProblemError(
                f"torques with inertia need second derivatives of the gait, which "
                f"{type(gaits).__name__}.functions(t, 2) does not give."
            )


LEVEL = Regime()


def checked_chain(body: Body, friction: Law, grade: float) -> Chain:
    """The body, or a `ProblemError` why it cannot be on a slope."""
    if not isinstance(body, Chain) or type(body).solve is not Chain.solve:
        raise ProblemError(
            f"only a Chain, whose joints are its own, can be put on a slope, not "
            f"{type(body).__name__}."
        )
    check_range(0.0, grade=grade)
    if rate_independent(body.law(friction)) and grade >= (most := body.contact.most_held(friction)):
        raise ProblemError(
            f"on a slope of grade {grade:g} the body slides down for ever: friction holds at most "
            f"{most:g} times the force that presses it on the ground."
        )
    return body


def regime_of(problem: Any) -> Regime:
    grade, towards, froude = problem.grade, problem.towards, problem.froude
    check_range(0.0, grade=grade)
    if towards is not None:
        check_finite(towards=towards)
    if grade:
        checked_chain(problem.body, problem.friction, grade)
    elif towards is not None:
        raise ProblemError("towards is a direction on a slope: give a grade, or leave it out.")
    if problem.motion is not None:
        if grade or froude != 0:
            raise ProblemError(
                "a kind of motion of your own takes the place of grade and froude: leave these out."
            )
        return problem.motion
    free = None
    if isinstance(froude, (tuple, list)):
        if len(froude) != 2 or not all(map(is_number, froude)) or not 0 < froude[0] <= froude[1]:
            raise ProblemError(
                "froude=Free(low, high) needs two numbers above 0, the smaller one first, not "
                f"{' and '.join(map(repr, froude))}."
            )
        free, froude = Free(*map(float, froude)), np.sqrt(froude[0] * froude[1])
    else:
        check_range(0.0, froude=froude)
        if froude and problem.uses("period"):
            free = Free(froude, froude)
    towards = None if towards is None else float(towards)
    return Regime(grade=float(grade), towards=towards, froude=float(froude), free=free)
