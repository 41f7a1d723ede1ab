"""Faults of the sources that results rest on, a sample of them, and the tests that a fault meets (`benchmarks.mutation`)."""

from __future__ import annotations

import ast
import random
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.faults import faults_of
from benchmarks.reach import Test, named_line

ROOT = Path(__file__).resolve().parents[1]
MUTATED = ("bounds", "smooth", "mechanics", "results", "verification", "system")
_NOT_MUTATED = ("dask_pool", "interruption", "progress", "processors", "late_binding", "task_pool", "arguments")
"""What no result rests on."""
TESTS = {
    "bounds": ("tests/bounds", "tests/recorded"),
    "smooth": ("tests/smooth", "tests/recorded"),
    "mechanics": ("tests/mechanics", "tests/hard", "tests/recorded"),
    "results": ("tests/results", "tests/recorded"),
    "verification": ("tests/verification", "tests/recorded"),
    "system": ("tests/system",),
    "laws": ("tests/laws",),
}
"""What mirrors a package comes first; the rest of the suite is for those that survive it."""
_OF_ALL_CALLS = "colloc/mechanics/native_kernel.py::address"
_OF_OWN_LAWS = "colloc/laws/formula_law.py::FormulaLaw.kernel"
_OF_CALLS = {
    "motion.h": "colloc/mechanics/native_kernel.py::compiled_motion",
    "link_quadrature.h": _OF_OWN_LAWS,
    "dual.h": _OF_OWN_LAWS,
}
"""The Python that calls the C of a file; any call at all for the other files."""
_OF_CLASSES, _OUTSIDE = "tests/test_data_classes.py", "*"
"""Tests that look at classes and call nothing: for faults that stand outside functions, which are marked so."""
_MOST = 20.0
"""Recorded processor seconds of the tests that one fault is met with; two thirds of it for those that mirror its package."""
_LEAST_SHARE = 20
"""At least one mutant in so many is of each package."""


class Mutant(NamedTuple):
    """One fault: a span of a file and what it is replaced by."""

    file: str
    start: int
    end: int
    new: str

    @property
    def package(self) -> str:
        return self.file.split("/")[1]

    def described(self, texts: dict[str, str]) -> str:
        text = texts[self.file]
        number = text.count("\n", 0, self.start) + 1
        line = text.splitlines()[number - 1].strip()
        return f"{self.file}:{number}: {text[self.start : self.end]!r} -> {self.new!r} in: {line}"

    def reached_by(self, texts: dict[str, str]) -> Iterator[set[str]]:
        """What a test runs that meets it, as `benchmarks.reach` names it: its line, or else the statement, the function."""
        if not self.file.endswith(".py"):
            function = _OF_CALLS.get(Path(self.file).name, _OF_ALL_CALLS)
            yield {function, f"{function}*"}
            return
        text, number = texts[self.file], texts[self.file].count("\n", 0, self.start) + 1
        lines, tree = text.splitlines(), ast.parse(text)
        function = f"{self.file}::{_function_at(tree, number)}"
        around = [n for n in ast.walk(tree) if isinstance(n, ast.stmt) and n.lineno <= number <= (n.end_lineno or n.lineno)]
        if function.endswith("::"):  # of the module: those that use what it says
            inner = sorted(around, key=lambda node: node.lineno)[-1:]
            targets = [name.id for node in inner for name in ast.walk(node) if isinstance(name, ast.Name)]
            yield {
                _OUTSIDE,
                *(named_line(self.file, line) for line in lines if set(targets[:1]) & set(re.findall(r"\w+", line))),
            }
        else:
            for line in (number, max((n.lineno for n in around), default=number)):
                yield {named_line(self.file, lines[line - 1]), f"{function}*"}
            yield {function, f"{function}*"}


def _function_at(node: ast.AST, number: int, outer: str = "") -> str:
    """Qualified name of the innermost function that holds a line."""
    for inner in ast.iter_child_nodes(node):
        if getattr(inner, "lineno", number) <= number <= (getattr(inner, "end_lineno", number) or number):
            if isinstance(inner, ast.ClassDef):
                return _function_at(inner, number, f"{outer}{inner.name}.")
            if isinstance(inner, ast.FunctionDef):
                return _function_at(inner, number, f"{outer}{inner.name}.<locals>.") or outer + inner.name
            if found := _function_at(inner, number, outer):
                return found
    return ""


def _rank(test: Test) -> float:
    """Cheap tests come first, and those that speak of little else."""
    return test.seconds * len(test.calls)


def tests_of(mutant: Mutant, texts: dict[str, str], known: dict[str, list[Test]]) -> tuple[list[str], float]:
    """Names and processor seconds of the tests that run its line, or else its function, or anything of its file."""
    every = [test for tests in known.values() for test in tests]
    for reached in mutant.reached_by(texts):
        if meeting := [test for test in every if reached & test.calls]:
            break
    else:
        meeting = [test for test in every if any(name.startswith(f"{mutant.file}::") for name in test.calls)]
    if next(mutant.reached_by(texts)) & {_OUTSIDE}:
        meeting += [test for test in every if test.name.startswith(_OF_CLASSES)]
    mirroring = tuple(f"{folder}/" for folder in TESTS[mutant.package])
    chosen, spent = [], 0.0
    for test in sorted(meeting, key=lambda test: (not test.name.startswith(mirroring), _rank(test))):
        if spent + test.seconds < (_MOST * 2 / 3 if test.name.startswith(mirroring) else _MOST):
            chosen.append(test.name)
            spent += test.seconds
    return chosen, spent


def sources() -> dict[str, str]:
    """Texts of the files that faults are put in."""
    files = [path for package in MUTATED for path in sorted((ROOT / "colloc" / package).rglob("*"))]
    mutated = (path for path in files if path.suffix in (".py", ".c", ".h") and path.stem not in _NOT_MUTATED)
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in mutated}


def mutants(texts: dict[str, str]) -> Iterator[Mutant]:
    """Every fault that can be put in."""
    for file, text in texts.items():
        for start, end, new in faults_of(text, python=file.endswith(".py")):
            yield Mutant(file, start, end, new)


def drawn(found: list[Mutant], number: int, seed: int) -> list[Mutant]:
    """A sample: of each package as many as it has of all, but at least one in `_LEAST_SHARE`."""
    packages = Counter(mutant.package for mutant in found)
    room = {name: max(number // _LEAST_SHARE, number * packages[name] // len(found)) for name in packages}
    room[max(room, key=lambda name: room[name])] += number - sum(room.values())
    chosen = []
    for mutant in random.Random(seed).sample(found, len(found)):
        if room[mutant.package] > 0:
            room[mutant.package] -= 1
            chosen.append(mutant)
    return chosen
