"""Small faults that can be put into a program: an operator, a comparison, a constant, a sign, a condition, `abs`, `min`."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator

Fault = tuple[int, int, str]
"""First character, one past the last, and what stands there instead."""
_SWAPS = {
    "+": "-",
    "-": "+",
    "*": "/",
    "/": "*",
    "<": "<=",
    "<=": "<",
    ">": ">=",
    ">=": ">",
    "==": "!=",
    "!=": "==",
    "and": "or",
    "or": "and",
    "not": "",
    "True": "False",
    "False": "True",
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "abs": "float",
    "fmin": "fmax",
    "fmax": "fmin",
    "fabs": "",
    "cumsum": "cumprod",
    "argmin": "argmax",
    "argmax": "argmin",
    "break": "continue",
}


def faults_of(text: str, *, python: bool) -> Iterator[Fault]:
    """Every fault of a source, in Python or in C."""
    return _python_faults(text) if python else _c_faults(text)


def _faulty(word: str) -> str | None:
    """What a token becomes; None if it is left alone."""
    if word in _SWAPS:
        return _SWAPS[word]
    if re.fullmatch(r"\d+", word):
        return str(int(word) + 1)
    if re.fullmatch(r"(\d+\.\d*|\.\d+)(e[-+]?\d+)?|\d+e[-+]?\d+", word):
        return f"(1.5 * {word} + {0.1 if float(word) == 0 else 0})".replace(" + 0)", ")")
    return None


def _python_faults(text: str) -> Iterator[Fault]:
    """Of tokens outside annotations, imports, documentation and messages."""
    lines = [0]
    for line in text.splitlines(keepends=True):
        lines.append(lines[-1] + len(line))
    silent = list(_silent(ast.parse(text)))
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in (tokenize.OP, tokenize.NAME, tokenize.NUMBER):
            continue
        new = _faulty(token.string)
        if token.string == "abs" and token.line[: token.start[1]].endswith("np."):
            new = "positive"
        (row, column), (_, end) = token.start, token.end
        if new is None or any(first <= row <= last for first, last in silent):
            continue
        line = token.line
        if token.string in "*/" and (line[column - 1] in "(, " and line[end : end + 1].strip() and line[end] != " "):
            continue  # an unpacked argument, or a mark between arguments
        if token.string in "*/" and re.match(r"\s*[,)]", line[end:]):
            continue
        yield lines[row - 1] + column, lines[row - 1] + end, new


def _silent(tree: ast.AST) -> Iterator[tuple[int, int]]:
    """First and last lines of what a fault would not change: imports, documentation, errors, signatures."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom, ast.Raise, ast.Expr)) and (
            not isinstance(node, ast.Expr) or isinstance(node.value, ast.Constant)
        ):
            yield node.lineno, node.end_lineno or node.lineno
        elif isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.lineno, node.body[0].lineno - 1


def _c_faults(text: str) -> Iterator[Fault]:
    code = re.sub(r"/\*.*?\*/|//[^\n]*|^\s*#[^\n]*", lambda m: " " * len(m.group()), text, flags=re.DOTALL | re.MULTILINE)
    for match in re.finditer(r" ([-+*/]|<=?|>=?|==|!=) |\b(fabs|fmin|fmax|break|\d+\.\d+|\d+)\b", code):
        word = match.group(1) or match.group(2)
        start = match.start(1) if match.group(1) else match.start(2)
        new = _faulty(word)
        if new is not None:
            yield start, start + len(word), new
