"""Does the suite catch a wrong program? One small fault at a time is put into a copy of colloc, and its tests are run.

    python -m benchmarks.mutation --mutants 200 [--seed 0] [--first K]

Faults are drawn from the packages that results rest on: an operator, a comparison, a constant, a sign, a condition or an
`abs`, `min`, `max` is changed, in Python and in the C of the kernel. For each the default tests of the folders that mirror
the package run until one fails. A mutant that takes ten times as long as they do counts as caught (it hangs). Those that
survive are printed with their line: they are a gap of the tests, or a change without consequences.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import os
import random
import re
import resource
import shutil
import sys
import tempfile
import time
import tokenize
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import h5py  # noqa: F401  (what all children need)
import numpy  # noqa: F401
import pytest
import scipy.optimize  # noqa: F401

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("colloc", "tests", "benchmarks", "problems", "studies", "scripts", "docs", "results", "pyproject.toml", "README.md")
TESTS = {
    "colloc/mechanics": ("tests/mechanics", "tests/hard", "tests/verification"),
    "colloc/bounds": ("tests/bounds",),
    "colloc/verification": ("tests/verification", "tests/results"),
    "colloc/results": ("tests/results", "tests/commands/test_verify_and_compare.py"),
    "colloc/system": ("tests/system", "tests/results", "tests/studies"),
}
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
_SECONDS = 200
"""Processor time of one mutant's tests."""


class Mutant(NamedTuple):
    """One fault: a span of a file and what it is replaced by."""

    package: str
    file: str
    start: int
    end: int
    new: str

    def described(self, copy: Path) -> str:
        text = (copy / self.file).read_text(encoding="utf-8")
        number = text.count("\n", 0, self.start) + 1
        line = text.splitlines()[number - 1].strip()
        return f"{self.file}:{number}: {text[self.start : self.end]!r} -> {self.new!r} in: {line}"


def mutants() -> Iterator[Mutant]:
    """Every fault that can be put in."""
    for package in TESTS:
        for path in sorted((ROOT / package).rglob("*")):
            if path.suffix in (".py", ".c", ".h"):
                file, text = str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")
                for start, end, new in _python_faults(text) if path.suffix == ".py" else _c_faults(text):
                    yield Mutant(package, file, start, end, new)


def _faulty(word: str) -> str | None:
    """What a token becomes; None if it is left alone."""
    if word in _SWAPS:
        return _SWAPS[word]
    if re.fullmatch(r"\d+", word):
        return str(int(word) + 1)
    if re.fullmatch(r"(\d+\.\d*|\.\d+)(e[-+]?\d+)?|\d+e[-+]?\d+", word):
        return f"(1.5 * {word} + {0.1 if float(word) == 0 else 0})".replace(" + 0)", ")")
    return None


def _python_faults(text: str) -> Iterator[tuple[int, int, str]]:
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


def _c_faults(text: str) -> Iterator[tuple[int, int, str]]:
    code = re.sub(r"/\*.*?\*/|//[^\n]*|^\s*#[^\n]*", lambda m: " " * len(m.group()), text, flags=re.DOTALL | re.MULTILINE)
    for match in re.finditer(r" ([-+*/]|<=?|>=?|==|!=) |\b(fabs|fmin|fmax|break|\d+\.\d+|\d+)\b", code):
        word = match.group(1) or match.group(2)
        start = match.start(1) if match.group(1) else match.start(2)
        new = _faulty(word)
        if new is not None:
            yield start, start + len(word), new


def outcome(mutant: Mutant | None, copy: Path, cache: Path, tests: tuple[str, ...]) -> str:
    """ "caught", "survived" or "hangs": the tests in a child of this process, so that libraries are imported once."""
    file = copy / mutant.file if mutant else None
    text = file.read_text(encoding="utf-8") if file else ""
    if mutant and file:
        file.write_text(text[: mutant.start] + mutant.new + text[mutant.end :], encoding="utf-8")
    child = os.fork()
    if child == 0:
        code = 1
        try:
            code = _tests_in(copy, cache, tests)
        except BaseException:  # whatever it is, it ends here
            traceback.print_exc()
        finally:  # never back into the parent's program
            os._exit(code)
    _, status = os.waitpid(child, 0)
    if file:
        file.write_text(text, encoding="utf-8")
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (24, 9):
        return "hangs"
    return "survived" if status == 0 else "caught"


def _tests_in(copy: Path, cache: Path, tests: tuple[str, ...]) -> int:
    """Exit code of pytest, told to stop at the first failure; what it says is in a file beside the copy."""
    os.chdir(copy)
    resource.setrlimit(resource.RLIMIT_CPU, (_SECONDS, _SECONDS + 5))
    os.environ |= {"PYTHONPATH": str(copy), "COLLOC_CODE": str(cache), "PYTHONDONTWRITEBYTECODE": "1"}
    sys.dont_write_bytecode = True
    sys.path = [str(copy), *(entry for entry in sys.path if Path(entry or ".").resolve() != ROOT)]
    for name in [name for name in sys.modules if name.split(".")[0] == "benchmarks"]:
        del sys.modules[name]
    said = os.open(copy.parent / "said.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(said, 1)
    os.dup2(said, 2)
    return int(pytest.main(["-x", "-n", "0", "-p", "no:cacheprovider", *tests]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, default=200, metavar="N")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, metavar="K", help="go on with this one")
    parser.add_argument("--seconds", type=float, default=1e9, metavar="S", help="begin no other after so long")
    parser.add_argument("--record", type=Path, default=Path("results/mutation.jsonl"), help="one line a mutant is added here")
    parser.add_argument("--only", default="", metavar="TEXT", help="files whose path holds this")
    options = parser.parse_args()
    found = [mutant for mutant in mutants() if options.only in mutant.file]
    chosen = random.Random(options.seed).sample(found, min(options.mutants, len(found)))[options.first :]
    begin, counts = time.monotonic(), dict.fromkeys(("caught", "hangs", "survived"), 0)
    options.record.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        copy, cache = Path(folder) / "colloc", Path(folder) / "cache"
        copy.mkdir()
        for name in COPIED:
            source = ROOT / name
            (shutil.copytree if source.is_dir() else shutil.copy)(source, copy / name)
        cache.mkdir()
        for package in () if options.first else dict.fromkeys(mutant.package for mutant in chosen):
            if outcome(None, copy, cache, TESTS[package]) != "survived":
                said = (copy.parent / "said.txt").read_text(encoding="utf-8")
                raise SystemExit(f"the tests of {package} fail without any fault:\n{said[-3000:]}")
        for index, mutant in enumerate(chosen, options.first):
            if time.monotonic() - begin > options.seconds:
                print(f"stopped before {index}; go on with --first {index}")
                break
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            what = outcome(mutant, copy, cache, TESTS[mutant.package])
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            counts[what] += 1
            with options.record.open("a", encoding="utf-8") as record:
                line = {"seed": options.seed, "index": index, "outcome": what, "mutant": mutant.described(copy)}
                record.write(json.dumps(line) + "\n")
            seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            print(f"{index:4d} {what:9s} {seconds:6.1f} s  {mutant.described(copy)}", flush=True)
    print(f"{sum(counts.values())} mutants: {counts}")


if __name__ == "__main__":
    main()
