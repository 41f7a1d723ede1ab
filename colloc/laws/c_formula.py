"""Formulas of `colloc.numerics.expression` as C, for a compiled kernel of a law's own (folder `colloc/mechanics/native`)."""

from __future__ import annotations

import ast
from typing import Any

_SIGNS: dict[type, str] = {ast.Gt: ">", ast.GtE: ">=", ast.Lt: "<", ast.LtE: "<="}
_FUNCTIONS = {"sqrt": "sqrt", "exp": "exp", "log": "log", "tanh": "tanh", "abs": "fabs"}
_NUMBERS = {
    ast.Constant: "{}", ast.USub: "(-{})", ast.Add: "({} + {})", ast.Sub: "({} - {})", ast.Mult: "({} * {})",
    ast.Div: "({} / {})", ast.Pow: "pow({}, {})", ast.Compare: "({} {} {})", ast.Call: "{}({})",
}  # fmt: skip
"""How C writes each node of a formula of doubles."""
_DUALS = {
    ast.Constant: "constant({})", ast.USub: "sub(constant(0.0), {})", ast.Add: "add({}, {})", ast.Sub: "sub({}, {})",
    ast.Mult: "mul({}, {})", ast.Div: "quotient({}, {})", ast.Pow: "power({}, {})", ast.Compare: "({}.v {} {}.v)",
    ast.Call: "dual_{}({})",
}  # fmt: skip
"""The same of numbers that carry their derivatives (dual.h)."""
_ARGUMENTS = "(double vs_, double vn_, double delta_"


def own_law_header(tangential: str, normal: str, potential: str = "") -> str:
    """The header own_law.h of a law stated by formulas that were checked, as for `colloc.laws.own_law.OwnLaw`: its force per
    length, derivatives, and the potential whose gradient is minus the force, or nothing."""
    speed = "sqrt(vs_ * vs_ + vn_ * vn_ + delta_ * delta_)"
    numbers = f"const double vs = vs_, vn = vn_, delta = delta_, speed = {speed};"
    unused = "(void)vs, (void)vn, (void)delta, (void)speed;"
    duals = (
        f"const double r = {speed};\n    const Dual vs = {{vs_, 1.0, 0.0}}, vn = {{vn_, 0.0, 1.0}}, "
        "speed = {r, vs_ / r, vn_ / r}, delta = {delta_, 0.0, 0.0};"
    )
    rows = [_written(_tree(text), _DUALS) for text in (tangential, normal)]
    return "\n".join(
        [
            '#pragma once\n\n#include "dual.h"\n',
            f"static inline void density{_ARGUMENTS}, double f[2])\n{{\n    {numbers}\n    {unused}",
            f"    f[0] = {_written(_tree(tangential), _NUMBERS)};\n    f[1] = {_written(_tree(normal), _NUMBERS)};\n}}\n",
            f"static inline void density_slopes{_ARGUMENTS}, double d[2][2])\n{{\n    {duals}\n    {unused}",
            f"    const Dual fs = {rows[0]}, fn = {rows[1]};",
            "    d[0][0] = fs.s, d[0][1] = fs.n, d[1][0] = fn.s, d[1][1] = fn.n;\n}\n",
            f"static inline double potential{_ARGUMENTS})\n{{\n    {numbers}\n    {unused}",
            f"    return {_written(_tree(potential or '0'), _NUMBERS)};\n}}\n",
        ]
    )


def _tree(text: str) -> ast.expr:
    return ast.parse(text.strip(), mode="eval").body


def _value(node: ast.expr) -> float:
    """Of a formula without variables."""
    return float(eval(compile(ast.Expression(node), "<number>", "eval"), {"__builtins__": {}}))


def _written(node: Any, style: dict[type, str]) -> str:
    """A formula in C, each node in the given style."""

    def written(part: Any) -> str:
        return _written(part, style)

    match node:
        case ast.Constant():
            return style[ast.Constant].format(repr(_value(node)))
        case ast.Name(id=name):
            return name
        case ast.UnaryOp(op=ast.USub(), operand=a):
            return style[ast.USub].format(written(a))
        case ast.UnaryOp(operand=a):
            return written(a)
        case ast.BinOp(left=a, op=ast.Pow(), right=b):
            return style[ast.Pow].format(written(a), repr(_value(b)))
        case ast.BinOp(left=a, op=op, right=b):
            return style[type(op)].format(written(a), written(b))
        case ast.Compare(left=a, ops=[op], comparators=[b]):
            return style[ast.Compare].format(written(a), _SIGNS[type(op)], written(b))
        case ast.Call(func=ast.Name(id="where"), args=[condition, a, b]):
            return f"({written(condition)} ? {written(a)} : {written(b)})"
        case ast.Call(func=ast.Name(id=name), args=[a]):
            return style[ast.Call].format(_FUNCTIONS[name], written(a))
    raise AssertionError(ast.dump(node))
