"""Formulas as text: evaluated on floats, NumPy arrays or CasADi symbols, and differentiated in
forward mode. Nothing but arithmetic of known variables is ever evaluated."""

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

    def chain(self, value: Array, slope: Array) -> Dual:
        """A function of this one, from its value and derivative."""
        return Dual(value, tuple(slope * a for a in self.slopes))

    def _combine(self, other: Any, value: Array, d_self: Array, d_other: Array) -> Dual:
        """A function of this and another, from its value and partial derivatives."""
        if not isinstance(other, Dual):
            return self.chain(value, d_self)
        pairs = zip(self.slopes, other.slopes, strict=True)
        return Dual(value, tuple(d_self * a + d_other * b for a, b in pairs))

    def __add__(self, other: Any) -> Dual:
        return self._combine(other, self.value + _value(other), 1.0, 1.0)

    def __mul__(self, other: Any) -> Dual:
        return self._combine(other, self.value * _value(other), _value(other), self.value)

    def __truediv__(self, other: Any) -> Dual:
        under = _value(other)
        return self._combine(other, self.value / under, 1.0 / under, -self.value / (under * under))

    def __rtruediv__(self, other: float) -> Dual:
        return self.chain(other / self.value, -other / (self.value * self.value))

    def __pow__(self, power: float) -> Dual:
        slope = power * self.value ** (power - 1) if power else 0.0 * self.value
        return self.chain(self.value**power, slope)

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
    derivatives: dict[str, Callable[[Array, Array], Array]] = {
        "sqrt": lambda x, y: 0.5 / y,
        "exp": lambda x, y: y,
        "log": lambda x, y: 1.0 / x,
        "tanh": lambda x, y: 1.0 - y * y,
        "abs": lambda x, y: xp.where(x < 0, -1.0, 1.0),
    }

    def where(condition: Array, a: Any, b: Any) -> Dual:
        a, b = (x if isinstance(x, Dual) else Dual(x, (0.0,) * count) for x in (a, b))
        slopes = zip(a.slopes, b.slopes, strict=True)
        value = xp.where(condition, a.value, b.value)
        return Dual(value, tuple(xp.where(condition, p, q) for p, q in slopes))

    def lift(name: str) -> Callable[[Any], Any]:
        function = getattr(xp, name)

        def apply(a: Any) -> Any:
            if not isinstance(a, Dual):
                return function(a)
            value = function(a.value)
            return a.chain(value, derivatives[name](a.value, value))

        return apply

    return {"where": where} | {name: lift(name) for name in derivatives}


@dataclass(frozen=True, eq=False)
class Formula:
    """A parsed formula: `text` as Python writes it, the `names` of its variables and functions."""

    text: str
    names: frozenset[str]
    code: CodeType

    def __call__(self, at: Mapping[str, Array]) -> Array:
        xp = namespace(*at.values())
        functions = {name: getattr(xp, name) for name in FUNCTIONS} | {"sum": xp.sum_rows}
        return eval(self.code, {"__builtins__": {}}, {**functions, **at})

    def differentiated(self, at: Mapping[str, Dual]) -> Dual:
        """Value and derivatives; not of a formula with ``sum``."""
        count = len(next(iter(at.values())).slopes)
        functions = _dual_functions(namespace(*(a.value for a in at.values())), count)
        result = eval(self.code, {"__builtins__": {}}, {**functions, **at})
        return result if isinstance(result, Dual) else Dual(result, (0.0,) * count)


class _Floats(ast.NodeTransformer):
    """Whole numbers as floats: powers of integers may fill the memory, those of floats overflow."""

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:
        return ast.copy_location(ast.Constant(float(node.value)), node)  # type: ignore[arg-type]


@lru_cache(maxsize=64)
def formula(
    text: str, variables: tuple[str, ...], functions: tuple[str, ...] = FUNCTIONS
) -> Formula:
    """Parse a formula; `functions` may have ``sum`` besides. Objects hold the text, as code cannot
    be pickled. `ProblemError` for anything but the variables, numbers and functions."""
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
        _check_node(text, node, functions if id(node) in called else variables, functions)
    names = frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
    try:
        written, tree = ast.unparse(tree), _Floats().visit(tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.BinOp) and not _has_name(node):
                number = compile(ast.Expression(node), "<formula>", "eval")
                if not isinstance(eval(number, {"__builtins__": {}}), float):
                    raise ArithmeticError  # a root of a negative number
        return Formula(written, names, compile(tree, "<formula>", "eval"))
    except RecursionError:
        raise ProblemError(f"'{text}' is nested too deeply.") from None
    except ArithmeticError:
        raise ProblemError(
            f"'{text}' has numbers in it that come to no finite real number."
        ) from None


def _has_name(node: ast.AST) -> bool:
    return any(isinstance(part, ast.Name) for part in ast.walk(node))


def _check_node(
    text: str, node: ast.AST, known: tuple[str, ...], functions: tuple[str, ...]
) -> None:
    allowed = isinstance(node, _NODES)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and _has_name(node.right):
        raise ProblemError(f"'{text}' has an exponent that is no number.")
    if isinstance(node, ast.Name) and node.id not in known:
        raise ProblemError(f"'{text}' speaks of {node.id}; it may use {', '.join(known)}.")
    if isinstance(node, ast.Constant):
        allowed = type(node.value) in (int, float)
    if isinstance(node, ast.Compare):
        allowed = len(node.ops) == 1
    if isinstance(node, ast.Call):
        allowed = isinstance(node.func, ast.Name) and not node.keywords
        if isinstance(node.func, ast.Name):
            name, count = node.func.id, 3 if node.func.id == "where" else 1
            if len(node.args) != count:
                raise ProblemError(
                    f"'{text}': {name} takes {count} argument{'s' * (count > 1)}, not "
                    f"{len(node.args)}."
                )
    if not allowed:
        raise ProblemError(
            f"'{text}' is no formula that can be differentiated; it may use numbers, + - * / **, "
            f"comparisons within where(condition, a, b), and {', '.join(functions)}."
        )
