"""Sensitivity of the best value to every number of a problem.

At an optimum the derivative of the best value is that of the Lagrangian ``L = f + sum_i lambda_i
(g_i - b_i)`` with gait and multipliers held fixed (envelope theorem). L is differentiated by
central differences of relative step 1e-5, which Newton solves to 1e-11 allow.

The slope is off to first order in the distance of the gait from the optimum without a mesh, some
1e-4 rad. So the gait is optimised again on much finer meshes; the spread of their slopes is the
error: halves of the answer's intervals, and quarters whose knots lie elsewhere, for meshes with
knots on the same kinks err alike. With inertia halves and the answer's intervals are enough.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.gait import NONE, delta_per_period
from colloc.gaits.parameters import Parameter, parameters
from colloc.gaits.problem import Problem
from colloc.mechanics.contact import far_pairs
from colloc.numerics.sqp import stationarity
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.results.answer import EVALUATED, Answer
from colloc.results.checks import UNCERTIFIED
from colloc.results.solution import Solution
from colloc.search.iterate import space_near, space_of
from colloc.search.optimise import optimise
from colloc.search.options import FINE, MEDIUM
from colloc.search.solve import finish
from colloc.system.environment import higher
from colloc.system.errors import ProblemError
from colloc.verification.replay import replayer

CHANGE = 0.1
_STEP = 1e-5  # relative; on three problems steps from 1e-4 to 1e-7 agree to 1e-7
_NOTHING = 1e-9  # relative slope that counts as none


@dataclass(frozen=True, eq=False)
class Again:
    """The best value where a number differs, and that of the gait on file there."""

    change: float  # of the number
    value: float  # of the re-optimised gait, certified; NaN if it is not
    error: float
    status: str
    on_file: float  # of the gait on file, replayed there
    on_file_error: float
    breaks: str  # limits that it does not keep there

    @property
    def behind(self) -> float:
        """Loss of the gait on file against the best one there; negative where it breaks a limit."""
        return self.value - self.on_file


@dataclass(frozen=True, eq=False)
class Effect:
    name: str
    now: float  # the number
    relative: bool  # whether changes are parts of the number, or of a link for places of feet
    slope: float  # derivative of the best value; one-sided where the number can only be smaller
    error: float  # change of the slope on other meshes and with twice the step
    sides: tuple[int, ...] = (-1, 1)  # whether the number can be smaller (-1) and larger (1)
    again: tuple[Again, ...] = ()


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Effects of the numbers of a problem on its best value, which is as certified."""

    name: str
    objective: str
    value: float
    error: float
    effects: tuple[Effect, ...]

    def __repr__(self) -> str:
        return f"<Sensitivity of {self.name} to {len(self.effects)} numbers>"

    def __getitem__(self, name: str) -> Effect:
        effects = {effect.name: effect for effect in self.effects}
        if name not in effects:
            raise KeyError(f"{name!r}: there is {', '.join(effects)}")
        return effects[name]

    def __str__(self) -> str:
        render = higher("pictures:render")
        return render("sensitivity.txt", slopes=self, isfinite=np.isfinite).rstrip()

    def facts(self) -> dict[str, Any]:
        """Plain numbers (JSON); None for what there is not."""

        def plain(again):
            every = (vars(again) | {"behind": again.behind}).items()
            return {name: None if x in (np.inf, -np.inf) or x != x else x for name, x in every}

        effects = [vars(each) | {"again": [*map(plain, each.again)]} for each in self.effects]
        return vars(self) | {"effects": effects}

    @property
    def of_first_order(self) -> list[Effect]:
        """Effects of first order."""
        least = _NOTHING * abs(self.value)
        return [effect for effect in self.effects if not abs(effect.slope) <= least]

    def beside(self, effect: Effect) -> list[str]:
        """First-order values where a number is a tenth smaller and larger; "-" where it cannot
        be."""
        values = {side: f"{self.value + side * CHANGE * effect.slope:.4f}" for side in effect.sides}
        return [values.get(side, "-") for side in (-1, 1)]


def sensitivity(solution: Solution, resolve: bool = False, change: float = CHANGE) -> Sensitivity:
    """Derivatives of the best value with respect to every number of the problem.

    With `resolve` the gait is re-optimised with each number that matters smaller and larger by
    `change`, and the gait on file replayed there, in a second or two for each. `ProblemError` if
    the gait is no optimum: it was given, or the solve did not end well.
    """
    if solution.answer.program == EVALUATED or not solution.problem.gait.free:
        raise ProblemError("this gait was not optimised: only an optimum has a sensitivity.")
    if not solution.success:
        raise ProblemError(
            f"only an optimum has a sensitivity, and this solve ended as: {solution.status}."
        )
    answer, certificate, effects = solution.answer, solution.certificate, []
    finest, *others = _lagrangians(answer)
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
    problem, value, error = solution.problem, certificate.value, certificate.value_error
    return Sensitivity(problem.name, problem.objective.short, value, error, tuple(effects))


def _lagrangians(answer: Answer) -> list[Callable[[Problem], float]]:
    problem, gait, delta, edges = answer.problem, answer.gait, answer.delta, answer.edges
    far = far_pairs(problem.body)

    def on(parts, later=0.0):
        inner = edges[:-1, None] + (np.arange(parts) + later) / parts * np.diff(edges)[:, None]
        finer = np.unique([edges[0], *inner.flat, edges[-1]])
        optimum = optimise(*space_near(problem, gait, finer, answer.scheme, far), delta, FINE)
        return _lagrangian(optimum.space, optimum.v, delta)

    solved = _lagrangian(*space_near(problem, gait, edges, answer.scheme, far), delta)
    if problem.froude:  # momenta smooth kinks, and meshes of a motion with states cost more
        return [on(2), solved, on(1, 0.5)]
    fixed = problem.gait.relative_delta or not problem.gait.free
    return [on(8), on(2), solved if fixed else on(4, 0.5)]


def _lagrangian(space: SearchSpace, v: np.ndarray, delta: float) -> Callable[[Problem], float]:
    """Lagrangian of the reduced program on one mesh at its optimum, in units of the objective, as a
    function of the problem: with the rows at the worst instants of the gait."""
    optimum = ReducedProgram(space, delta)
    optimum.place_rows(v)
    conditions = stationarity(optimum, v)
    if not conditions.kkt_error <= 1e-4 * abs(optimum.objective(v)):
        why = f"the gradient of the Lagrangian does not vanish ({conditions.kkt_error:.0e})"
        raise ProblemError(f"the gait has no sensitivity: {why}, as at a kink.")
    rows = zip(optimum.row_names, conditions.on_rows, strict=True)
    on_rows = {name: float(multiplier) for name, multiplier in rows if multiplier}

    def beyond(x, low, high, on):
        """Multipliers, positive at upper bounds, times (value - bound)."""
        return float(on @ (x - np.select([on > 0, on < 0], [high, low], x)))

    def lagrangian(problem):
        there = space_of(problem, space.edges, space.scheme, space.far)
        program = ReducedProgram(there, problem.delta)
        program.place_rows(v)
        at = {name: k for k, name in enumerate(program.row_names)}
        if missing := on_rows.keys() - at.keys():
            what = f"the bound {min(missing)[0]!r}, which holds the gait back, vanishes beside it"
            raise ProblemError(f"the gait has no sensitivity: {what}.")
        rows = (program.rows(v), program.row_lower, program.row_upper)
        which = [at[name] for name in on_rows]
        values, low, high = (row[which] for row in rows)
        left = beyond(values, low, high, np.array([*on_rows.values()]))
        left += beyond(v, program.lower, program.upper, conditions.on_bounds)
        return program.value(program.objective(v)) + program.value(1.0) * left

    return lagrangian


def _neighbours(parameter: Parameter, step: float) -> dict[int, Problem]:
    changed = {}
    for side in (-1, 1):
        with suppress(ProblemError):
            changed[side] = parameter.changed(side * step)
    return changed


def _slope(
    value: Callable[[Problem], float],
    parameter: Parameter,
    sides: tuple[int, ...],
    step: float = _STEP,
) -> float:
    if len(sides) == 2:
        return (value(parameter.changed(step)) - value(parameter.changed(-step))) / (2 * step)
    (side,) = sides
    here, beside, farther = (value(parameter.changed(side * k * step)) for k in range(3))
    return side * (4 * beside - 3 * here - farther) / (2 * step)


def _again(solution: Solution, problem: Problem, change: float) -> Again:
    gait, delta, turn = solution.answer.gait, problem.delta, problem.rotation or 0.0
    space, v = space_near(problem, gait)
    end = finish(problem, optimise(space, v, delta, MEDIUM))
    best = end.certificate if end.success else UNCERTIFIED
    on_file = replayer(problem.regime)(
        *(problem.body, problem.law, gait, delta_per_period(problem.gait, gait, delta)),
        breaks=gait.corner_phases,
        objective=problem.objective,
        quantities=problem.integrals,
        turn=turn,
    )
    breaks, rotation = [], on_file.rotation - turn
    excess = ReducedProgram(space, delta).place_rows(v)
    if excess > 1e-5:  # [rad], or relative
        breaks.append(f"{excess:.2g} beyond its limits")
    closing = problem.regime.closing_symmetry(problem.gait.symmetry)
    if problem.rotation is not None and closing == NONE and abs(rotation) > 1e-4:
        breaks.append(f"turns {np.degrees(rotation):+.2g}° too far per cycle")
    for aim, least in problem.at_least:
        if aim(on_file.values) < least * (1 - 1e-5):
            breaks.append(f"{aim.name} {aim(on_file.values):.4g}, not {least:.4g}")
    here = on_file.value, on_file.error * abs(on_file.value)
    return Again(change, best.value, best.value_error, end.status, *here, "; ".join(breaks))
