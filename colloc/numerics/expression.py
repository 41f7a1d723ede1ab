"""Formulas as text: evaluated on floats, NumPy arrays or CasADi symbols, and differentiated.

Nothing but arithmetic of known variables is ever evaluated.
"""

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import CodeType
from typing import Any

import numpy as np

from colloc.numerics.arrays import Array, namespace
from colloc.system.errors import ProblemError

FUNCTIONS = ("sqrt", "exp", "log", "tanh", "abs", "where")
_LONGEST = 500
_MOST_OPERATIONS = 32  # for the kernel
_NODES = (
    ast.Expression, ast.BinOp, ast.UnaryOp, ast.Call, ast.Name, ast.Load, ast.Constant, ast.Compare,
    ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.USub, ast.UAdd, ast.Gt, ast.GtE, ast.Lt,
    ast.LtE,
)  # fmt: skip


_CONSTANT, _VARIABLE, _NEGATIVE, _PLUS, _MINUS, _TIMES, _OVER, _POWER = map(float, range(8))
"""Operations of the kernel, as native/sqp.h numbers them."""
_ARITHMETIC = {ast.Add: _PLUS, ast.Sub: _MINUS, ast.Mult: _TIMES, ast.Div: _OVER}
_RULES: dict[type[ast.operator] | str, str] = {
    ast.Add: "da + db",
    ast.Sub: "da - db",
    ast.Mult: "da * b + a * db",
    ast.Div: "da / b - a * db / (b * b)",
    "sqrt": "0.5 / sqrt(a) * da",
    "exp": "exp(a) * da",
    "log": "da / a",
    "tanh": "(1.0 - tanh(a) * tanh(a)) * da",
    "abs": "where(a < 0.0, -1.0, 1.0) * da",
}


class _Substitution(ast.NodeTransformer):
    def __init__(self, nodes: Mapping[str, ast.expr]) -> None:
        self.nodes = nodes

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return self.nodes.get(node.id, node)


def _template(text: str, **nodes: ast.expr) -> ast.expr:
    return _Substitution(nodes).visit(ast.parse(text, mode="eval").body)


def _derivative(node: ast.expr, name: str) -> ast.expr:
    if not _has_name(node, name):
        return ast.Constant(0.0)
    if isinstance(node, ast.UnaryOp):
        return ast.UnaryOp(node.op, _derivative(node.operand, name))
    if isinstance(node, ast.Call):
        function, a = str(getattr(node.func, "id", "")), node.args[0]
        if function != "where":
            return _template(_RULES[function], a=a, da=_derivative(a, name))
        sides = (_derivative(side, name) for side in node.args[1:])
        return ast.Call(node.func, [a, *sides], [])
    if not isinstance(node, ast.BinOp):
        return ast.Constant(1.0)
    a, b, da = node.left, node.right, _derivative(node.left, name)
    if isinstance(node.op, ast.Pow):
        n = _evaluate(_compile(b), {})
        if n == 0:
            return ast.Constant(0.0)
        return _template("n * a ** m * da", a=a, da=da, n=ast.Constant(n), m=ast.Constant(n - 1.0))
    return _template(_RULES[type(node.op)], a=a, b=b, da=da, db=_derivative(b, name))


@dataclass(frozen=True, eq=False)
class Formula:
    """A parsed formula: `text` as Python writes it, the `names` of its variables and functions."""

    text: str
    names: frozenset[str]
    tree: ast.Expression

    @cached_property
    def _code(self) -> CodeType:
        return _compile(self.tree.body)

    @cached_property
    def _derivatives(self) -> dict[str, CodeType]:
        names = self.names - {*FUNCTIONS, "sum"}
        return {name: _compile(_derivative(self.tree.body, name)) for name in names}

    def __call__(self, at: Mapping[str, Array]) -> Array:
        return _evaluate(self._code, at)

    def partials(self, at: Mapping[str, Array]) -> dict[str, Array]:
        """Derivatives by each of its variables; not of a formula with ``sum``."""
        return {name: _evaluate(code, at) for name, code in self._derivatives.items()}

    def operations(self, variables: Sequence[str]) -> np.ndarray | None:
        """For the compiled kernel (native/sqp.h): how many operations there are, then each with its
        number, operands first. None for a formula with a function or with other variables."""
        steps: list[float] = []
        listed = _append_operations(self.tree.body, variables, steps)
        few = len(steps) <= 2 * _MOST_OPERATIONS
        return np.array([len(steps) / 2, *steps]) if listed and few else None


def _append_operations(node: ast.expr, variables: Sequence[str], steps: list[float]) -> bool:
    match node:
        case ast.Constant(float(value)):
            steps += _CONSTANT, value
        case ast.Name(name) if name in variables:
            steps += _VARIABLE, float(variables.index(name))
        case ast.UnaryOp(ast.USub(), operand) if _append_operations(operand, variables, steps):
            steps += _NEGATIVE, 0.0
        case ast.BinOp(base, ast.Pow(), exponent) if _append_operations(base, variables, steps):
            steps += _POWER, float(_evaluate(_compile(exponent), {}))
        case ast.BinOp(left, operator, right) if type(operator) in _ARITHMETIC:
            if not (
                _append_operations(left, variables, steps)
                and _append_operations(right, variables, steps)
            ):
                return False
            steps += _ARITHMETIC[type(operator)], 0.0
        case _:
            return False
    return True


def _compile(node: ast.expr) -> CodeType:
    return compile(ast.fix_missing_locations(ast.Expression(node)), "<formula>", "eval")


def _evaluate(code: CodeType, at: Mapping[str, Array]) -> Any:
    xp = namespace(*at.values())
    functions = {name: getattr(xp, name) for name in FUNCTIONS} | {"sum": xp.sum_rows}
    return eval(code, {"__builtins__": {}}, {**functions, **at})


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
            if not isinstance(node, ast.BinOp) or _has_name(node):
                continue
            if not isinstance(_evaluate(_compile(node), {}), float):
                raise ArithmeticError  # a root of a negative number
        parsed = Formula(written, names, tree)
        _ = parsed._code  # which says if it is nested too deeply
        return parsed
    except RecursionError:
        raise ProblemError(f"'{text}' is nested too deeply.") from None
    except ArithmeticError:
        raise ProblemError(
            f"'{text}' has numbers in it that come to no finite real number."
        ) from None


def _has_name(node: ast.AST, name: str = "") -> bool:
    return any(isinstance(part, ast.Name) and name in ("", part.id) for part in ast.walk(node))


def _check_node(
    text: str, node: ast.AST, known: tuple[str, ...], functions: tuple[str, ...]
) -> None:
    allowed = isinstance(node, _NODES)
    match node:
        case ast.BinOp(op=ast.Pow()) if _has_name(node.right):
            raise ProblemError(f"'{text}' has an exponent that is no number.")
        case ast.Name() if node.id not in known:
            raise ProblemError(f"'{text}' uses {node.id}; it may use {', '.join(known)}.")
        case ast.Constant():
            allowed = type(node.value) in (int, float)
        case ast.Compare():
            allowed = len(node.ops) == 1
        case ast.Call(func=ast.Name(id=name), args=given):
            count, allowed = 3 if name == "where" else 1, not node.keywords
            if len(given) != count:
                takes = f"takes {count} argument{'s' * (count > 1)}, not {len(given)}"
                raise ProblemError(f"'{text}': {name} {takes}.")
        case ast.Call():
            allowed = False
    if not allowed:
        raise ProblemError(
            f"'{text}' is no formula that can be differentiated; it may use numbers, + - * / **, "
            f"comparisons within where(condition, a, b), and {', '.join(functions)}."
        )
