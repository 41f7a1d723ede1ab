r"""Objectives: expressions of the quantities of a cycle (`colloc.numerics.expression`); and totals
of a period, each with its errors.

A period that turns the body by alpha turns everything about one point of the floor. The
displacement of the centre of mass x then depends on the phase at which the period begins. The chord
of the circle's arc does not; it is the distance of a gait that is asked to turn,

    chord = (2 sin(alpha/2) / alpha) |integral of e^(-i alpha t) x'(t) dt|,

the way as seen from *axes that turn evenly*; for alpha = 0 it is the displacement.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from colloc.mechanics.densities import INTEGRALS, Quantity, quantities_of
from colloc.numerics.expression import Formula, formula
from colloc.system.arguments import is_number, named_arguments, shown
from colloc.system.errors import ProblemError

QUANTITIES = {
    "distance": "displacement of the centre of mass over a cycle, the chord of the arc if a turn "
    "is asked for [body lengths]",
    "work": "work against friction over a cycle",
    "rotation": "net rotation over a cycle, counter-clockwise [rad]",
    **{name: quantity.meaning for name, quantity in INTEGRALS.items()},
    "period": "time that a cycle takes, of a body with inertia [sqrt(length / gravity)]",
}
"""Variables of every expression."""
_SAMPLES = (
    {"distance": 0.4, "work": 1.7, "rotation": 0.3, "length": 7.0},
    {"distance": 0.7, "work": 2.9, "rotation": 0.8, "length": 11.0},
)
_OTHERS = 1.9, 3.3
"""Typical periods at which expressions are tried, and their other quantities."""
_FLATTEST = 1e-30  # least slope of an objective; its inverse is the largest


@named_arguments
@dataclass(frozen=True)
class Objective:
    """A function of the quantities of a cycle.

    Parameters
    ----------
    expression : str
        Of `QUANTITIES` and `quantities`: numbers, ``+ - * / **``, brackets, and
        `colloc.numerics.expression.FUNCTIONS`; powers have constant exponents.
    name : str, optional
        By default that of `NAMED`, or the expression.
    quantities : sequence of Quantity, optional
        Others that the expression speaks of.

    Raises
    ------
    ProblemError
        If the expression speaks of anything else, or has no value.

    Examples
    --------
    >>> thrifty = Objective("distance / (work + 0.1 * length)", name="thrift")
    >>> thrifty({"distance": 0.75, "work": 2.0, "length": 10.0})
    0.25
    >>> Objective("distance/work").name
    'efficiency'
    >>> heat = Quantity("heat", "sum(moment**2)")
    >>> Objective("distance / (work + 0.1 * heat)", quantities=[heat]).uses
    ('distance', 'work', 'heat')
    """

    expression: str
    name: str = ""
    quantities: tuple[Quantity, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "quantities", quantities_of(self.quantities))
        if any(each.name in INTEGRALS and each != INTEGRALS[each.name] for each in self.quantities):
            raise ProblemError(
                f"objective: a quantity has the name of another one; taken are "
                f"{', '.join(QUANTITIES)}."
            )
        try:
            expression = formula(NAMED.get(self.expression, self.expression), self._names)
        except (ProblemError, TypeError) as error:
            known = f"It may be one of {', '.join(NAMED)}, or a formula like 'distance / work'."
            raise ProblemError(f"objective: {error} {known}") from None
        names = {expression: name for name, expression in NAMED.items()}
        object.__setattr__(self, "expression", expression.text)
        object.__setattr__(self, "name", self.name or names.get(expression.text, expression.text))
        if not self.uses:
            raise ProblemError(
                f"the objective {expression.text!r} uses no quantity of a gait; it may use "
                f"{', '.join(self._names)}."
            )
        try:
            with np.errstate(all="ignore"):
                values = [self(sample) for sample in self._samples]
                partials = [self.partials(sample) for sample in self._samples]
        except (ArithmeticError, TypeError, ValueError):
            values, partials = [np.nan], [{}]
        steepest = [max(map(abs, each.values()), default=np.nan) for each in partials]
        if not all(isinstance(value, float) and np.isfinite(value) for value in values):
            wrong = f"has no finite value for a typical gait: {self._samples[0]}"
        elif not all(_FLATTEST < slope < 1 / _FLATTEST for slope in steepest):
            wrong = "does not distinguish typical gaits: it is too flat or too steep"
        elif min(each.get("distance", 0.0) for each in partials) < 0:
            wrong = (
                "falls with the distance; a body counts its distance in the direction in which it "
                "moves, so it can only be asked to go far"
            )
        else:
            return
        raise ProblemError(f"the objective {self.expression!r} {wrong}.")

    def __call__(self, period: Mapping[str, Any]) -> Any:
        """The value for quantities of a cycle: floats or CasADi's symbols."""
        value = self.formula(period)
        return float(value) if isinstance(value, np.ndarray) else value

    @property
    def formula(self) -> Formula:
        """The expression, parsed."""
        return formula(self.expression, self._names)

    @property
    def _integrals(self) -> dict[str, Quantity]:
        return INTEGRALS | {each.name: each for each in self.quantities}

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys([*QUANTITIES, *self._integrals]))

    @property
    def _samples(self) -> list[dict[str, float]]:
        pairs = zip(_SAMPLES, _OTHERS, strict=True)
        return [dict.fromkeys(self._names, other) | sample for sample, other in pairs]

    @cached_property
    def uses(self) -> tuple[str, ...]:
        """Names of its variables, in the order of `QUANTITIES`, its own last."""
        return tuple(name for name in self._names if name in self.formula.names)

    @cached_property
    def integrals(self) -> tuple[Quantity, ...]:
        """Its variables that are integrals of functions of an instant."""
        return tuple(self._integrals[name] for name in self.uses if name in self._integrals)

    @cached_property
    def degree(self) -> float | None:
        """Power of the friction coefficients that the value is proportional to, if to any."""
        degrees = {"work": 1.0} | {each.name: each.friction_degree for each in self.integrals}
        # a cycle depends on the ratio of weight to friction
        if "period" in self.uses or None in degrees.values():
            return None
        powers = []
        for sample in self._samples:
            for factor in (2.0, 16.0):
                scaled = {k: v * factor ** degrees.get(k, 0.0) for k, v in sample.items()}  # type: ignore[operator]
                ratio = self(scaled) / self(sample) if self(sample) else np.nan
                powers.append(np.log(ratio) / np.log(factor) if ratio > 0 else np.nan)
        degree = float(np.round(powers[0], 6))
        return degree if np.allclose(powers, degree, rtol=0, atol=1e-9) else None

    def gradient(
        self, period: Mapping[str, float], slopes: Mapping[str, np.ndarray]
    ) -> np.ndarray | float:
        """Gradient of the value, from the quantities of a cycle and their gradients."""
        return sum(slope * slopes[name] for name, slope in self.partials(period).items())

    def partials(self, period: Mapping[str, float]) -> dict[str, float]:
        partials = self.formula.partials({name: period[name] for name in self.uses})
        return {name: float(partials[name]) for name in self.uses}

    def shares(self, period: Mapping[str, float]) -> dict[str, float]:
        """Relative change of the value per unit of each quantity."""
        size = max(abs(self(period)), 1e-300)
        return dict.fromkeys(self._names, 0.0) | {
            name: slope / size for name, slope in self.partials(period).items()
        }

    def relative_error(self, period: Mapping[str, float], errors: Mapping[str, Any]) -> Any:
        """Relative error of the value, from errors of unknown sign of quantities."""
        shares = self.shares(period)
        return sum(abs(shares.get(name, 0.0)) * error for name, error in errors.items())

    @property
    def short(self) -> str:
        """Symbol, such as ``d/W``."""
        return _SHORT.get(self.name, self.name)

    @property
    def label(self) -> str:
        """Name and symbol, such as ``efficiency d/W``."""
        return f"{self.name} {self.short}" if self.short != self.name else self.name

    def fields(self) -> dict[str, Any]:
        plain: dict[str, Any] = {"expression": self.expression, "name": self.name}
        quantities = [each.fields() for each in self.quantities]
        return plain | ({"quantities": quantities} if quantities else {})


def integrals_of(aims: Iterable[Objective]) -> tuple[Quantity, ...]:
    """The integrals of objectives. `ProblemError` if two of them have one name."""
    by_name: dict[str, Quantity] = {}
    for each in (quantity for aim in aims for quantity in aim.integrals):
        if by_name.setdefault(each.name, each) != each:
            raise ProblemError(
                f"two quantities are called {each.name}: give one of them another name."
            )
    return tuple(by_name.values())


NAMED = {
    "efficiency": "distance / work",
    "speed": "distance / length",
    "turning": "rotation / work",
    "driven efficiency": "distance / driven_work",
    "towing": "distance ** 2 / work",
}
"""Speed is that of a body whose shape changes at unit rate. No actuator recovers energy from being
driven backwards in "driven efficiency". For viscous drag, whose work grows with the pace, "towing"
is Lighthill's efficiency: the work of towing the straight body as far in the same time, at unit
drag along it, per work."""
_SHORT = {
    "battery efficiency": "d/E",
    "efficiency": "d/W",
    "speed": "d/L",
    "turning": "θ/W",
    "driven efficiency": "d/W+",
    "towing": "d²/W",
}
EFFICIENCY, SPEED, TURNING, DRIVEN, TOWING = (Objective(name) for name in NAMED)


def objective_from(statement: object) -> Objective:
    """An objective by itself, its name, its expression, or its `fields`."""
    if isinstance(statement, Objective):
        return statement
    if isinstance(statement, dict):
        return Objective(
            **statement
            | {"quantities": [Quantity(**each) for each in statement.get("quantities", ())]}
        )
    return Objective(statement)  # type: ignore[arg-type]


def least_values(statement: object) -> tuple[tuple[Objective, float], ...]:
    """Objectives and their least values, from a mapping or pairs; the largest one of each."""
    pairs = statement.items() if isinstance(statement, Mapping) else statement
    pairs = () if pairs is None else pairs
    if not isinstance(pairs, Iterable) or not all(
        isinstance(pair, (tuple, list)) and len(pair) == 2 for pair in pairs
    ):
        raise ProblemError(
            f"at_least must map objectives to required values, as {{'distance': 0.3}}, not "
            f"{shown(statement)}."
        )
    values: dict[str, tuple[Objective, float]] = {}
    for what, least in pairs:
        if not is_number(least):
            raise ProblemError(f"at_least needs a finite number for {what!r}, not {least!r}.")
        aim = objective_from(what)
        if aim.expression not in values or values[aim.expression][1] < least:
            values[aim.expression] = aim, float(least)
    return tuple(values.values())


def chord_per_way(turn: float) -> float:
    """Chord of an arc that turns by an angle [rad], over the way in axes that turn evenly."""
    return float(abs(np.sinc(turn / (2 * np.pi))))


@dataclass(frozen=True)
class Period:
    """Quantities of a period, by the names of `colloc.gaits.objective.QUANTITIES`; what nobody
    measured is left out.

    errors: how much each may be wrong by, of unknown sign. others: how much each could change at
    most if the body took any other of its balanced motions; empty where there is one.
    """

    values: Mapping[str, float] = field(hash=False)
    errors: Mapping[str, float] = field(hash=False)
    others: Mapping[str, float] = field(hash=False)

    @property
    def distance(self) -> float:
        """Displacement of the centre of mass, or the chord of the arc [body lengths]."""
        return self.values["distance"]

    @property
    def work(self) -> float:
        """Work of the joints [weight x body length]."""
        return self.values["work"]

    @property
    def rotation(self) -> float:
        """Net rotation, counter-clockwise [rad]."""
        return self.values["rotation"]

    @property
    def efficiency(self) -> float:
        return self.distance / self.work

    def error_of(self, objective: Objective) -> float:
        return float(objective.relative_error(self.values, self.errors))

    def ambiguity_of(self, objective: Objective) -> float:
        """Relative change of an objective by other balanced motions."""
        return float(objective.relative_error(self.values, self.others))
