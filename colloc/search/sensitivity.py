"""Sensitivity of the best value to every number of a problem.

At an optimum the derivative of the best value is that of the Lagrangian ``L = f + sum_i lambda_i
(g_i - b_i)`` with gait and multipliers held fixed (envelope theorem). L is differentiated by
central differences of relative step 1e-5, which Newton solves to 1e-11 allow.

The slope is off to first order in the distance of the gait from the optimum without a mesh, some
1e-4 rad. So the gait is optimised again on much finer meshes; the spread of their slopes is the
error: halves of the answer's intervals, and quarters whose knots lie elsewhere, for meshes with
knots on the same kinks err alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.gait import delta_per_period
from colloc.gaits.parameters import Parameter, parameters
from colloc.gaits.problem import Problem
from colloc.gaits.symmetry import NONE
from colloc.mechanics.contact import far_pairs
from colloc.numerics.sqp import stationarity
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.results.answer import EVALUATED, Answer
from colloc.results.checks import UNCERTIFIED
from colloc.results.solution import Solution
from colloc.search.converge import optimise
from colloc.search.options import FINE, MEDIUM
from colloc.search.solve import finish
from colloc.search.spaces import on_mesh_of, space_near, space_of, with_far
from colloc.system.errors import ProblemError
from colloc.verification.adaptive_motion import Replay
from colloc.verification.replay import replayer

CHANGE = 0.1
_STEP = 1e-5
"""Relative step of differences; on three problems steps from 1e-4 to 1e-7 agree to 1e-7."""
_NOTHING = 1e-9  # relative slope that counts as none
_FINEST = 8  # parts of each interval of the answer's mesh
_STATIONARY = 1e-4
"""Largest gradient of the Lagrangian, over the value, at which there are multipliers."""
_EXCESS, _TURNS = 1e-5, 1e-4
"""Excess over limits [rad, or relative] and rotation [rad] that count as none."""


@dataclass(frozen=True, eq=False)
class Again:
    """The best value where a number differs, and that of the gait on file there.

    Attributes
    ----------
    change : float
        Of the number.
    value, error : float
        Of the re-optimised gait, certified; NaN if it is not.
    status : str
    kept, kept_error : float
        Of the gait on file, replayed there.
    breaks : str
        Limits that the gait on file does not keep there.
    """

    change: float
    value: float
    error: float
    status: str
    kept: float
    kept_error: float
    breaks: str

    @property
    def behind(self) -> float:
        """Loss of the gait on file against the best one there; negative where it breaks a limit."""
        return self.value - self.kept

    def facts(self) -> dict[str, Any]:
        """Plain numbers; None for what there is not."""
        names = ("change", "value", "error", "kept", "kept_error", "behind")
        numbers = {name: float(getattr(self, name)) for name in names}
        finite = {name: x if np.isfinite(x) else None for name, x in numbers.items()}
        return finite | {"status": self.status, "breaks": self.breaks}


@dataclass(frozen=True, eq=False)
class Effect:
    """Effect of one number of a problem on the best value.

    Attributes
    ----------
    name : str
    now : float
        The number.
    relative : bool
        Whether changes are parts of the number, or of a link for places of feet.
    slope : float
        Derivative of the best value along that change; one-sided where the number can only become
        smaller.
    error : float
        Change of the slope on other meshes and with twice the step.
    sides : tuple of int
        Whether the number can be smaller (-1) and larger (1).
    again : tuple of Again
    """

    name: str
    now: float
    relative: bool
    slope: float
    error: float
    sides: tuple[int, ...] = (-1, 1)
    again: tuple[Again, ...] = ()


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Effects of the numbers of a problem on its best value.

    Attributes
    ----------
    name, objective : str
    value, error : float
        As certified.
    effects : tuple of Effect
    note : str
        What the errors of slopes leave out.
    """

    name: str
    objective: str
    value: float
    error: float
    effects: tuple[Effect, ...]
    note: str = ""

    def __repr__(self) -> str:
        return f"<Sensitivity of {self.name} to {len(self.effects)} numbers>"

    def __getitem__(self, name: str) -> Effect:
        effects = {effect.name: effect for effect in self.effects}
        if name not in effects:
            raise KeyError(f"{name!r}: there is {', '.join(effects)}")
        return effects[name]

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def facts(self) -> dict[str, Any]:
        """Plain numbers (JSON)."""
        effects = [
            vars(effect) | {"again": [each.facts() for each in effect.again]}
            for effect in self.effects
        ]
        own = {key: value for key, value in vars(self).items() if key != "effects"}
        return own | {"effects": effects}

    @property
    def seen(self) -> list[Effect]:
        """Effects of first order."""
        least = _NOTHING * abs(self.value)
        return [effect for effect in self.effects if not abs(effect.slope) <= least]

    def beside(self, effect: Effect) -> list[str]:
        """First-order values where a number is a tenth smaller and larger; "-" where it cannot
        be."""
        values = {side: f"{self.value + side * CHANGE * effect.slope:.4f}" for side in effect.sides}
        return [values.get(side, "-") for side in (-1, 1)]

    def lines(self) -> list[str]:
        """Lines of a table for a terminal."""
        seen = self.seen
        width = max((len(effect.name) for effect in seen), default=0)
        lines = [
            f"{self.name}: {self.objective} = {self.value:.6f} +- {self.error:.0e}; the best "
            f"gait's elsewhere, to first order:",
            f"  {'':<{width}}  {'now':>8s}  {'10 % less':>9s}  {'10 % more':>9s}  slope",
        ]
        for effect in seen:
            less, more = self.beside(effect)
            lines.append(
                f"  {effect.name:<{width}}  {effect.now:8.4g}  {less:>9s}  {more:>9s}  "
                f"{effect.slope:+.5f} +- {effect.error:.0e}"
                f"{'' if effect.relative else '  (a tenth of its link)'}"
            )
        if without := [effect.name for effect in self.effects if effect not in seen]:
            lines.append(f"  no effect to first order: {', '.join(without)}")
        lines += [f"  {self.note}"] if self.note else []
        rows = [f"  {e.name:<{width}}  {self._row(e, x)}" for e in self.effects for x in e.again]
        head = (
            f"{'change':>7s}  {'first order':>11s}  {'best there':>10s}  {'on file':>8s}  behind by"
        )
        return [*lines, "", f"  {'':<{width}}  {head}", *rows] if rows else lines

    def _row(self, effect: Effect, there: Again) -> str:
        unit = (100, " %") if effect.relative else (1, "")
        change = f"{there.change * unit[0]:+.3g}{unit[1]}"
        first, best = self.value + there.change * effect.slope, f"{there.value:.4f}"
        behind = f"{there.behind:9.1e}"
        if not np.isfinite(there.value):
            best, behind = "-", f"  {there.status}"
        return (
            f"{change:>7s}  {first:11.4f}  {best:>10s}  {there.kept:8.4f}  {behind}  {there.breaks}"
        ).rstrip()


def sensitivity(solution: Solution, resolve: bool = False, change: float = CHANGE) -> Sensitivity:
    """Derivatives of the best value with respect to every number of the problem.

    Parameters
    ----------
    solution : Solution
        Solved.
    resolve : bool
        Whether to re-optimise the gait with each number that matters a little smaller and larger,
        and to replay the gait on file there; a second or two for each.
    change : float
        How much smaller and larger, then.

    Returns
    -------
    Sensitivity

    Raises
    ------
    ProblemError
        If the gait is no optimum: it was given, or the solve did not end well.

    Examples
    --------
    Forces are proportional to friction, so half as much of it costs half as much:

    >>> import colloc
    >>> solution = colloc.solve(colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"),
    ...     delta=1e-2), starts=1)
    >>> found = solution.sensitivity()
    >>> slopes = [found[f"friction {way}"].slope for way in ("sideways", "forwards", "backwards")]
    >>> bool(abs(sum(slopes) / solution.value + 1) < 1e-4)
    True
    """
    if solution.answer.program == EVALUATED or not solution.problem.gait.free:
        raise ProblemError(
            "the gait was given: only of an optimum is it known how the best value changes."
        )
    if not solution.success:
        raise ProblemError(
            f"only an optimum has a sensitivity, and this solve ended as: {solution.status}."
        )
    answer, certificate, effects = solution.answer, solution.certificate, []
    finest, *others = _on_meshes(answer)
    for parameter in parameters(answer.problem):
        sides = tuple(_neighbours(parameter, 4 * _STEP))  # as far as the differences go
        if not sides:  # such as the place of a pad as long as its link
            continue
        slope = _slope(finest, parameter, sides)
        error = max(abs(_slope(other, parameter, sides) - slope) for other in others)
        error += abs(_slope(finest, parameter, sides, 2 * _STEP) - slope)
        again: tuple[Again, ...] = ()
        if resolve and abs(slope) > _NOTHING * abs(solution.value):
            beside = _neighbours(parameter, change).items()
            again = tuple(_again(solution, problem, side * change) for side, problem in beside)
        at = parameter.name, parameter.value, parameter.relative
        effects.append(Effect(*at, slope, error, sides, again))
    problem, stated = solution.problem, (certificate.value, certificate.value_error)
    return Sensitivity(problem.name, problem.objective.short, *stated, tuple(effects))


@dataclass(frozen=True, eq=False)
class _Lagrangian:
    """Lagrangian of the reduced program on one mesh at its optimum, as a function of the
    problem."""

    space: SearchSpace  # the class of gaits on its mesh, for the problem as it was solved
    v: np.ndarray  # the gait
    on_rows: dict[tuple[str, int], float]  # multipliers by names of rows, positive at upper bounds
    on_bounds: np.ndarray  # of the parameters' bounds

    @classmethod
    def at_optimum(cls, space: SearchSpace, v: np.ndarray, delta: float) -> _Lagrangian:
        program = ReducedProgram(space, delta)
        program.place_rows(v)
        found = stationarity(program, v)
        if not found.kkt_error <= _STATIONARY * abs(program.objective(v)):
            why = f"the gradient of the Lagrangian does not vanish ({found.kkt_error:.0e})"
            raise ProblemError(f"the gait has no sensitivity: {why}, as where it rests on a kink.")
        named = zip(program.row_names, found.on_rows, strict=True)
        on_rows = {name: float(multiplier) for name, multiplier in named if multiplier}
        return cls(space, v, on_rows, found.on_bounds)

    def __call__(self, problem: Problem) -> float:
        """Value with the rows at the worst instants of the gait, in units of the objective."""
        program = ReducedProgram(
            space_of(problem, None, self.space.edges, self.space.scheme, self.space.far),
            problem.delta,
        )
        program.place_rows(self.v)
        at = {name: k for k, name in enumerate(program.row_names)}
        if missing := self.on_rows.keys() - at.keys():
            what = f"the bound {min(missing)[0]!r}, which holds the gait back, vanishes beside it"
            raise ProblemError(f"the gait has no sensitivity: {what}.")
        which = [at[name] for name in self.on_rows]
        rows, low, high = (
            row[which] for row in (program.rows(self.v), program.row_lower, program.row_upper)
        )
        left = _beyond(rows, low, high, np.array([*self.on_rows.values()]))
        left += _beyond(self.v, program.lower, program.upper, self.on_bounds)
        return program.stated(program.objective(self.v)) + program.stated(1.0) * left


def _beyond(
    values: np.ndarray, low: np.ndarray, high: np.ndarray, multipliers: np.ndarray
) -> float:
    """Multipliers times (value - bound)."""
    bounds = np.select([multipliers > 0, multipliers < 0], [high, low], values)
    return float(multipliers @ (values - bounds))


def _on_meshes(answer: Answer) -> list[_Lagrangian]:
    """Lagrangians at the optima of several meshes, the finest first."""
    edges = answer.edges
    space, v = space_near(answer.problem, answer.gait, edges, answer.scheme)
    far = far_pairs(answer.problem.body)
    solved = _Lagrangian.at_optimum(with_far(space, far), v, answer.delta)

    def on(parts: int, later: float = 0.0) -> _Lagrangian:
        inner = edges[:-1, None] + (np.arange(parts) + later) / parts * np.diff(edges)[:, None]
        finer = np.unique([edges[0], *inner.flat, edges[-1]])
        space = on_mesh_of(solved.space, answer.gait, finer, answer.scheme)
        found = optimise(space, space.parameters(answer.gait), answer.delta, FINE)
        return _Lagrangian.at_optimum(found.space, found.v, answer.delta)

    fixed = answer.problem.gait.relative_delta or not answer.problem.gait.free
    return [on(_FINEST), on(2), solved if fixed else on(4, 0.5)]


def _neighbours(parameter: Parameter, step: float) -> dict[int, Problem]:
    """Problems with a number a little smaller (-1) and larger (1), where that is possible."""
    found = {}
    for side in (-1, 1):
        with suppress(ProblemError):
            found[side] = parameter.changed(side * step)
    return found


def _slope(
    value: Callable[[Problem], float],
    parameter: Parameter,
    sides: tuple[int, ...],
    step: float = _STEP,
) -> float:
    """Central difference, or a one-sided one where the number can change to one side only."""
    if len(sides) == 2:
        return (value(parameter.changed(step)) - value(parameter.changed(-step))) / (2 * step)
    (side,) = sides
    here, beside, farther = (value(parameter.changed(side * k * step)) for k in range(3))
    return side * (4 * beside - 3 * here - farther) / (2 * step)


def _again(solution: Solution, problem: Problem, change: float) -> Again:
    gait, delta = solution.answer.gait, problem.delta
    space, v = space_near(problem, gait)
    found = finish(problem, optimise(space, v, delta, MEDIUM))
    best = found.certificate if found.success else UNCERTIFIED
    kept = replayer(problem.regime)(
        problem.body, problem.law, gait, delta_per_period(problem.gait, gait, delta),
        breaks=gait.corner_phases, objective=problem.objective, quantities=problem.integrals,
        turn=problem.rotation or 0.0,
    )  # fmt: skip
    breaks = "; ".join(_violations(problem, kept, ReducedProgram(space, delta).place_rows(v)))
    here = kept.value, kept.error * abs(kept.value)
    return Again(change, best.value, best.value_error, found.status, *here, breaks)


def _violations(problem: Problem, kept: Replay, excess: float) -> Iterator[str]:
    if excess > _EXCESS:
        yield f"{excess:.2g} beyond its limits"
    turned = kept.rotation - (problem.rotation or 0.0)
    asked = (
        problem.rotation is not None
        and problem.regime.closing_symmetry(problem.gait.symmetry) == NONE
    )
    if asked and abs(turned) > _TURNS:
        yield f"turns {np.degrees(turned):+.2g}° too far a period"
    for aim, least in problem.at_least:
        if aim(kept.values) < least * (1 - _EXCESS):
            yield f"{aim.name} {aim(kept.values):.4g}, not {least:.4g}"
