"""Formulas written as text: evaluated with floats, NumPy or CasADi, and differentiated, from the
one statement.

Text rather than functions, so that files can hold them; nothing but arithmetic of known variables
is ever evaluated. Derivatives are carried along with the values (forward mode), so they need no
second statement and no CasADi.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import CodeType, SimpleNamespace
from typing import Any

from colloc.numerics.arrays import Array, namespace
from colloc.system.errors import ProblemError

FUNCTIONS = ("sqrt", "exp", "log", "tanh", "abs", "where")
_LONGEST = 500
"""Characters of a formula."""
_NODES = (
    ast.Expression, ast.BinOp, ast.UnaryOp, ast.Call, ast.Name, ast.Load, ast.Constant, ast.Compare,
    ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.USub, ast.UAdd, ast.Gt, ast.GtE, ast.Lt,
    ast.LtE,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Dual:
    """A value and its derivatives along some directions."""

    value: Array
    slopes: tuple[Array, ...]

    def _with(self, other: Any, value: Array, own: Array, others: Array) -> Dual:
        """The result of an operation with given partial derivatives."""
        if not isinstance(other, Dual):
            return Dual(value, tuple(own * a for a in self.slopes))
        return Dual(
            value,
            tuple(own * a + others * b for a, b in zip(self.slopes, other.slopes, strict=True)),
        )

    def __add__(self, other: Any) -> Dual:
        return self._with(other, self.value + _value(other), 1.0, 1.0)

    def __mul__(self, other: Any) -> Dual:
        return self._with(other, self.value * _value(other), _value(other), self.value)

    def __truediv__(self, other: Any) -> Dual:
        under = _value(other)
        return self._with(other, self.value / under, 1.0 / under, -self.value / (under * under))

    def __rtruediv__(self, other: float) -> Dual:
        return self.scaled(other / self.value, -other / (self.value * self.value))

    def __pow__(self, power: float) -> Dual:
        return self.scaled(
            self.value**power, power * self.value ** (power - 1) if power else 0.0 * self.value
        )

    def scaled(self, value: Array, slope: Array) -> Dual:
        """A function of this one, with its value and derivative."""
        return Dual(value, tuple(slope * a for a in self.slopes))

    def __neg__(self) -> Dual:
        return self * -1.0

    def __pos__(self) -> Dual:
        return self

    def __sub__(self, other: Any) -> Dual:
        return self + -other

    def __rsub__(self, other: float) -> Dual:
        return -self + other

    __radd__, __rmul__ = __add__, __mul__

    def __gt__(self, other: Any) -> Array:
        return self.value > _value(other)

    def __ge__(self, other: Any) -> Array:
        return self.value >= _value(other)

    def __lt__(self, other: Any) -> Array:
        return self.value < _value(other)

    def __le__(self, other: Any) -> Array:
        return self.value <= _value(other)


def _value(a: Any) -> Any:
    return a.value if isinstance(a, Dual) else a


def _dual_functions(xp: SimpleNamespace, count: int) -> dict[str, Callable[..., Any]]:
    none = (0.0,) * count

    def where(condition: Array, a: Any, b: Any) -> Dual:
        slopes = zip(*(x.slopes if isinstance(x, Dual) else none for x in (a, b)), strict=True)
        return Dual(
            xp.where(condition, _value(a), _value(b)),
            tuple(xp.where(condition, p, q) for p, q in slopes),
        )

    def of(
        function: Callable[[Array], Array], slope: Callable[[Array, Array], Array]
    ) -> Callable[[Any], Any]:
        def applied(a: Any) -> Any:
            value = function(_value(a))
            return a.scaled(value, slope(a.value, value)) if isinstance(a, Dual) else value

        return applied

    return {
        "sqrt": of(xp.sqrt, lambda x, y: 0.5 / y),
        "exp": of(xp.exp, lambda x, y: y),
        "log": of(xp.log, lambda x, y: 1.0 / x),
        "tanh": of(xp.tanh, lambda x, y: 1.0 - y * y),
        "abs": of(xp.abs, lambda x, y: xp.where(x < 0, -1.0, 1.0)),
        "where": where,
    }


class _Floats(ast.NodeTransformer):
    """Whole numbers as floats: powers of those may fill the memory, these overflow."""

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:
        return ast.copy_location(ast.Constant(float(node.value)), node)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class Formula:
    """A formula that was read."""

    text: str
    """As Python writes it."""
    names: frozenset[str]
    """Variables and functions that it speaks of."""
    code: CodeType

    def __call__(self, at: Mapping[str, Array]) -> Array:
        """Its value, for floats, arrays or CasADi's symbols."""
        xp = namespace(*at.values())
        functions = {name: getattr(xp, name) for name in FUNCTIONS} | {"sum": xp.sum_rows}
        return eval(self.code, {"__builtins__": {}}, {**functions, **at})

    def differentiated(self, at: Mapping[str, Dual]) -> Dual:
        """Its value with its derivatives."""
        count = len(next(iter(at.values())).slopes)
        functions = _dual_functions(namespace(*(a.value for a in at.values())), count)
        found = eval(self.code, {"__builtins__": {}}, {**functions, **at})
        return found if isinstance(found, Dual) else Dual(found, (0.0,) * count)


@lru_cache(maxsize=64)
def formula(
    text: str, variables: tuple[str, ...], functions: tuple[str, ...] = FUNCTIONS
) -> Formula:
    """A formula of some variables, ready to be evaluated. Objects that hold one keep its text: code
    cannot be pickled. Of functions there may be ``sum`` besides, over the rows of arrays; such a
    formula cannot be `differentiated`. `ProblemError` if it is no formula, or speaks of anything
    but the variables, numbers and functions."""
    if not isinstance(text, str):
        raise ProblemError(f"a formula must be text, not {text!r}.")
    if len(text) > _LONGEST:
        raise ProblemError(f"a formula may have {_LONGEST} characters, not {len(text)}.")
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError) as error:
        raise ProblemError(f"'{text}' is no formula: {getattr(error, 'msg', error)}.") from None
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        exponent = (
            node.right
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow)
            else ast.Constant(1)
        )
        if any(isinstance(part, ast.Name) for part in ast.walk(exponent)):
            raise ProblemError(f"'{text}' has an exponent that is no number.")
        known = functions if id(node) in called else variables
        if isinstance(node, ast.Name) and node.id not in known:
            raise ProblemError(f"'{text}' speaks of {node.id}; it may use {', '.join(known)}.")
        number = not isinstance(node, ast.Constant) or type(node.value) in (int, float)
        plain = not isinstance(node, ast.Compare) or len(node.ops) == 1
        single = not isinstance(node, ast.Call) or (
            isinstance(node.func, ast.Name) and not node.keywords
        )
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            name, count = node.func.id, 3 if node.func.id == "where" else 1
            if len(node.args) != count:
                raise ProblemError(
                    f"'{text}': {name} takes {count} argument{'s' * (count > 1)}, not "
                    f"{len(node.args)}."
                )
        if not (isinstance(node, _NODES) and number and plain and single):
            allowed = (
                f"numbers, + - * / **, comparisons within where(condition, a, b), and "
                f"{', '.join(functions)}"
            )
            raise ProblemError(
                f"'{text}' is no formula that can be differentiated; it may use {allowed}."
            )
    names = frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
    try:
        written, tree = ast.unparse(tree), _Floats().visit(tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.BinOp) and not any(
                isinstance(part, ast.Name) for part in ast.walk(node)
            ):
                value = eval(
                    compile(ast.Expression(node), "<formula>", "eval"), {"__builtins__": {}}
                )
                if not isinstance(value, float):  # a root of what is negative
                    raise ArithmeticError
        return Formula(written, names, compile(tree, "<formula>", "eval"))
    except RecursionError:
        raise ProblemError(f"'{text}' is nested too deeply.") from None
    except ArithmeticError:
        raise ProblemError(
            f"'{text}' has numbers in it that come to no finite real number."
        ) from None
