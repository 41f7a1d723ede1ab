"""Formulas of `colloc.numerics.expression` as C, for a compiled kernel of a law's own (folder `colloc/mechanics/native`)."""

from __future__ import annotations

import ast
from typing import Any

_SIGNS: dict[type, str] = {ast.Gt: ">", ast.GtE: ">=", ast.Lt: "<", ast.LtE: "<="}
_OPERATORS: dict[type, tuple[str, str]] = {
    ast.Add: ("+", "add"), ast.Sub: ("-", "sub"), ast.Mult: ("*", "mul"), ast.Div: ("/", "quotient"),
}  # fmt: skip
_FUNCTIONS = {"sqrt": "sqrt", "exp": "exp", "log": "log", "tanh": "tanh", "abs": "fabs"}
_ARGUMENTS = "(double vs_, double vn_, double delta_"


def own_law_header(tangential: str, normal: str, potential: str = "") -> str:
    """The header own_law.h of a law stated by formulas that were checked: its force per length, derivatives and potential.

    Parameters
    ----------
    tangential, normal : str
        In terms of vs, vn, speed and delta, as for `colloc.laws.own_law.OwnLaw`.
    potential : str
        Whose gradient is minus the force, or nothing.
    """
    speed = "sqrt(vs_ * vs_ + vn_ * vn_ + delta_ * delta_)"
    numbers = f"const double vs = vs_, vn = vn_, delta = delta_, speed = {speed};"
    unused = "(void)vs, (void)vn, (void)delta, (void)speed;"
    duals = (
        f"const double r = {speed};\n    const Dual vs = {{vs_, 1.0, 0.0}}, vn = {{vn_, 0.0, 1.0}}, "
        "speed = {r, vs_ / r, vn_ / r}, delta = {delta_, 0.0, 0.0};"
    )
    rows = [_dual(_tree(text)) for text in (tangential, normal)]
    return "\n".join(
        [
            '#pragma once\n\n#include "dual.h"\n',
            f"static inline void density{_ARGUMENTS}, double f[2])\n{{\n    {numbers}\n    {unused}",
            f"    f[0] = {_number(_tree(tangential))};\n    f[1] = {_number(_tree(normal))};\n}}\n",
            f"static inline void density_slopes{_ARGUMENTS}, double d[2][2])\n{{\n    {duals}\n    {unused}",
            f"    const Dual fs = {rows[0]}, fn = {rows[1]};",
            "    d[0][0] = fs.s, d[0][1] = fs.n, d[1][0] = fn.s, d[1][1] = fn.n;\n}\n",
            f"static inline double potential{_ARGUMENTS})\n{{\n    {numbers}\n    {unused}",
            f"    return {_number(_tree(potential or '0'))};\n}}\n",
        ]
    )


def _tree(text: str) -> ast.expr:
    return ast.parse(text.strip(), mode="eval").body


def _value(node: ast.expr) -> float:
    """Of a formula without variables."""
    return float(eval(compile(ast.Expression(node), "<number>", "eval"), {"__builtins__": {}}))


def _number(node: Any) -> str:
    """A formula of doubles."""
    match node:
        case ast.Constant():
            return repr(_value(node))
        case ast.Name(id=name):
            return name
        case ast.UnaryOp(op=ast.USub(), operand=a):
            return f"(-{_number(a)})"
        case ast.UnaryOp(operand=a):
            return _number(a)
        case ast.BinOp(left=a, op=ast.Pow(), right=b):
            return f"pow({_number(a)}, {_value(b)!r})"
        case ast.BinOp(left=a, op=op, right=b):
            return f"({_number(a)} {_OPERATORS[type(op)][0]} {_number(b)})"
        case ast.Compare(left=a, ops=[op], comparators=[b]):
            return f"({_number(a)} {_SIGNS[type(op)]} {_number(b)})"
        case ast.Call(func=ast.Name(id="where"), args=[condition, a, b]):
            return f"({_number(condition)} ? {_number(a)} : {_number(b)})"
        case ast.Call(func=ast.Name(id=name), args=[a]):
            return f"{_FUNCTIONS[name]}({_number(a)})"
    raise AssertionError(ast.dump(node))


def _dual(node: Any) -> str:
    """The same formula of numbers that carry their derivatives (dual.h)."""
    match node:
        case ast.Constant():
            return f"constant({_value(node)!r})"
        case ast.Name(id=name):
            return name
        case ast.UnaryOp(op=ast.USub(), operand=a):
            return f"sub(constant(0.0), {_dual(a)})"
        case ast.UnaryOp(operand=a):
            return _dual(a)
        case ast.BinOp(left=a, op=ast.Pow(), right=b):
            return f"power({_dual(a)}, {_value(b)!r})"
        case ast.BinOp(left=a, op=op, right=b):
            return f"{_OPERATORS[type(op)][1]}({_dual(a)}, {_dual(b)})"
        case ast.Compare(left=a, ops=[op], comparators=[b]):
            return f"({_dual(a)}.v {_SIGNS[type(op)]} {_dual(b)}.v)"
        case ast.Call(func=ast.Name(id="where"), args=[condition, a, b]):
            return f"({_dual(condition)} ? {_dual(a)} : {_dual(b)})"
        case ast.Call(func=ast.Name(id=name), args=[a]):
            return f"dual_{_FUNCTIONS[name]}({_dual(a)})"
    raise AssertionError(ast.dump(node))
