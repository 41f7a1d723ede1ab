"""What a gait is to be best at: one expression of what a period comes to.

The expression is stated once, as text. It is evaluated with floats for a value, with numbers that carry their gradient for the
search in the reduced space and for error bars, and with CasADi's symbols for the full program.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from colloc.system.errors import ProblemError

QUANTITIES = {
    "distance": "displacement of the centre of mass over a period [body lengths]",
    "work": "work against friction over a period",
    "rotation": "net rotation over a period, counter-clockwise [rad]",
    "length": "length of the path in shape space [rad]",
    "driven_work": "work of the actuators where none takes energy back",
}
"""What an expression may speak of."""
_SAMPLES = (
    {"distance": 0.4, "work": 1.7, "rotation": 0.3, "length": 7.0, "driven_work": 1.9},
    {"distance": 0.7, "work": 2.9, "rotation": 0.8, "length": 11.0, "driven_work": 3.3},
)
"""Periods at which an expression is tried when it is stated."""
_PROPORTIONAL_TO_FRICTION = ("work", "driven_work")
_LONGEST = 300
"""Characters of an expression; it is evaluated by recursion."""
_OPERATIONS: dict[type, Callable] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv, ast.Pow: operator.pow,
    ast.USub: operator.neg, ast.UAdd: operator.pos,
}  # fmt: skip
_FUNCTIONS: dict[str, Callable] = {"sqrt": lambda a: a**0.5, "abs": abs}
Number = TypeVar("Number")


@dataclass(frozen=True, eq=False)
class Dual:
    """A number and its gradient: arithmetic follows the rules of differentiation."""

    value: float
    slope: np.ndarray | float = 0.0

    __array_ufunc__ = None  # so that NumPy's numbers leave the arithmetic to this class

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    def __pos__(self) -> Dual:
        return self

    def __abs__(self) -> Dual:
        return Dual(abs(self.value), np.sign(self.value) * self.slope)

    def __add__(self, other: Dual | float) -> Dual:
        b = _dual(other)
        return Dual(self.value + b.value, self.slope + b.slope)

    def __sub__(self, other: Dual | float) -> Dual:
        b = _dual(other)
        return Dual(self.value - b.value, self.slope - b.slope)

    def __mul__(self, other: Dual | float) -> Dual:
        b = _dual(other)
        return Dual(self.value * b.value, self.value * b.slope + b.value * self.slope)

    def __truediv__(self, other: Dual | float) -> Dual:
        b = _dual(other)
        quotient = self.value / b.value
        return Dual(quotient, (self.slope - quotient * b.slope) / b.value)

    def __pow__(self, power: float) -> Dual:
        return Dual(self.value**power, power * self.value ** (power - 1) * self.slope)

    def __rsub__(self, other: float) -> Dual:
        return _dual(other) - self

    def __rtruediv__(self, other: float) -> Dual:
        return _dual(other) / self

    __radd__, __rmul__ = __add__, __mul__


def _dual(number: Dual | float) -> Dual:
    return number if isinstance(number, Dual) else Dual(number)


@dataclass(frozen=True)
class Objective:
    """A value of what a period comes to.

    Parameters
    ----------
    expression : str
        Of `QUANTITIES`: numbers, ``+ - * / **``, brackets, ``sqrt()`` and ``abs()``; powers have constant exponents.
    name : str, optional
        By default that of `NAMED`, or the expression.

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
    """

    expression: str
    name: str = ""
    _tree: ast.expr = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        known = NAMED.get(self.expression)
        tree = _parsed(known or self.expression)
        object.__setattr__(self, "expression", ast.unparse(tree))
        object.__setattr__(self, "_tree", tree)
        names = {expression: name for name, expression in NAMED.items()}
        object.__setattr__(self, "name", self.name or names.get(self.expression, self.expression))
        try:
            values = [self(sample) for sample in _SAMPLES]
            rises = [self.partials(sample).get("distance", 0.0) for sample in _SAMPLES]
        except (ArithmeticError, TypeError, ValueError):
            values, rises = [np.nan], []
        if not all(isinstance(value, float) and np.isfinite(value) for value in values):
            raise ProblemError(f"the objective {self.expression!r} has no value for a usual gait: {_SAMPLES[0]}.")
        if min(rises, default=0.0) < 0:
            raise ProblemError(
                f"the objective {self.expression!r} falls with the distance; a body counts its distance in the direction in "
                "which it moves, so it can only be asked to go far."
            )

    def __call__(self, period: Mapping[str, Number]) -> Number:
        """The value for quantities of a period: floats, `Dual` numbers or CasADi's symbols."""
        return _evaluated(self._tree, period)

    @cached_property
    def uses(self) -> tuple[str, ...]:
        """The quantities that it speaks of, in the order of `QUANTITIES`."""
        named = {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}
        return tuple(name for name in QUANTITIES if name in named)

    @cached_property
    def degree(self) -> float | None:
        """The power of the friction coefficients that the value is proportional to; None if to none."""
        powers = []
        for sample in _SAMPLES:
            for factor in (2.0, 16.0):
                scaled = {k: v * factor if k in _PROPORTIONAL_TO_FRICTION else v for k, v in sample.items()}
                ratio = self(scaled) / self(sample) if self(sample) else np.nan
                powers.append(np.log(ratio) / np.log(factor) if ratio > 0 else np.nan)
        near = float(np.round(powers[0], 6))
        return near if np.allclose(powers, near, rtol=0, atol=1e-9) else None

    def with_slopes(self, period: Mapping[str, float], slopes: Mapping[str, np.ndarray]) -> Dual:
        """The value and its gradient, from the quantities of a period and their gradients."""
        return _dual(self({name: Dual(period[name], slopes[name]) for name in self.uses}))

    def partials(self, period: Mapping[str, float]) -> dict[str, float]:
        """Derivative with respect to each quantity that it uses."""
        unit = np.eye(len(self.uses))
        slope = self.with_slopes(period, dict(zip(self.uses, unit, strict=True))).slope
        return dict(zip(self.uses, np.broadcast_to(slope, len(self.uses)).tolist(), strict=True))

    def shares(self, period: Mapping[str, float]) -> dict[str, float]:
        """What a small change of each quantity changes in the value, over its magnitude, per unit of the change."""
        size = max(abs(self(period)), 1e-300)
        return dict.fromkeys(QUANTITIES, 0.0) | {name: slope / size for name, slope in self.partials(period).items()}

    def relative_error(self, period: Mapping[str, float], errors: Mapping[str, Any]) -> Any:
        """Relative error of the value from those of quantities, numbers or arrays, whose signs are not known."""
        shares = self.shares(period)
        return sum(abs(shares[name]) * error for name, error in errors.items())

    @property
    def short(self) -> str:
        """For one line about a result: ``d/W``."""
        return _SHORT.get(self.name, self.name)

    @property
    def label(self) -> str:
        """For axes and tables: ``efficiency d/W``."""
        return f"{self.name} {self.short}" if self.short != self.name else self.name

    def fields(self) -> dict[str, str]:
        """As plain text (JSON)."""
        return {"expression": self.expression, "name": self.name}


def _parsed(expression: object) -> ast.expr:
    if not isinstance(expression, str) or len(expression) > _LONGEST:
        raise ProblemError(f"an objective is a text like 'distance / work', not {expression!r}.")
    try:
        tree = ast.parse(expression.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError):
        raise ProblemError(f"the objective {expression!r} is no expression; write one like 'distance / work'.") from None
    _check(tree, expression)
    return tree


def _check(node: ast.expr, text: str) -> None:
    """Refuse what is not arithmetic of known quantities: expressions come from files, and nothing of a file is executed."""
    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int() | float()):
            return
        case ast.Name(id=name) if name in QUANTITIES:
            return
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATIONS:
            return _check(operand, text)
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant() | ast.UnaryOp(operand=ast.Constant()) as power):
            _check(power, text)
            return _check(base, text)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATIONS and not isinstance(op, ast.Pow):
            _check(left, text)
            return _check(right, text)
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in _FUNCTIONS:
            return _check(argument, text)
    raise ProblemError(
        f"the objective {text!r} holds {ast.unparse(node)!r}; it may speak of {', '.join(QUANTITIES)}, numbers, + - * / **, "
        f"{' and '.join(f'{name}()' for name in _FUNCTIONS)}, or be one of {', '.join(NAMED)}."
    )


def _evaluated(node: ast.expr, period: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=value):
            return float(value)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return period[name]
        case ast.UnaryOp(op=op, operand=operand):
            return _OPERATIONS[type(op)](_evaluated(operand, period))
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATIONS[type(op)](_evaluated(left, period), _evaluated(right, period))
        case ast.Call(func=ast.Name(id=name), args=[argument]):
            return _FUNCTIONS[name](_evaluated(argument, period))
    raise AssertionError(ast.dump(node))


NAMED = {
    "efficiency": "distance / work",
    "speed": "distance / length",
    "turning": "rotation / work",
    "driven efficiency": "distance / driven_work",
    "towing": "distance ** 2 / work",
}
"""Objectives that a problem may name: distance per work; per path in shape space, which is the speed of a body whose shape
changes at unit rate; rotation per work; distance per work where no actuator recovers energy from being driven backwards
(`colloc.mechanics.actuators`); and for viscous drag, whose work grows with the pace, Lighthill's efficiency: the work of
towing the straight body as far in the same time, at unit drag along it, per work."""
_SHORT = {"efficiency": "d/W", "speed": "d/L", "turning": "θ/W", "driven efficiency": "d/W+", "towing": "d²/W"}
EFFICIENCY, SPEED, TURNING, DRIVEN, TOWING = (Objective(name) for name in NAMED)


def objective_from(stated: object) -> Objective:
    """An objective, as it is, by its name or expression, or as `Objective.fields` wrote it."""
    if isinstance(stated, Objective):
        return stated
    return Objective(**stated) if isinstance(stated, dict) else Objective(stated)  # type: ignore[arg-type]


def least_values(stated: object) -> tuple[tuple[Objective, float], ...]:
    """Objectives and the values that they must reach at least, from a mapping or pairs."""
    pairs: Sequence = list(stated.items()) if isinstance(stated, Mapping) else list(stated or ())  # type: ignore[call-overload]
    found = []
    for what, least in pairs:
        if isinstance(least, bool) or not isinstance(least, (int, float, np.number)) or not np.isfinite(least):
            raise ProblemError(f"at_least needs a finite number for {what!r}, not {least!r}.")
        found.append((objective_from(what), float(least)))
    return tuple(found)
