"""Do the tests see a wrong sign? The library is broken in one random place at a time, and the tests are run against it.

    python -m benchmarks.mutants --number 40 --seed 1

A place is a comparison, an operation, a sign, an `and`, a `not`, a `min` or an index off by one, drawn evenly from all of
`colloc/`. First the tests of its package are run, then all of them. What is done is kept in results/mutants-SEED.jsonl: an
interrupted run goes on where it stopped. A mutant that no test sees is one that changes nothing, or a test that lacks.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
OTHERS: dict[type, str] = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==", ast.And: "or", ast.Or: "and",
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*",
}  # fmt: skip
EXTREMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "argmin": "argmax", "argmax": "argmin"}
LONGEST = 1500
"""Seconds after which tests that go round in circles have seen a mutant."""


class Mutant(NamedTuple):
    """A module with one place exchanged."""

    module: str
    line: int
    before: str
    after: str
    source: str


def mutants(path: Path) -> Iterator[Mutant]:
    """All of a module."""
    source = path.read_text()
    for node in _nodes(ast.parse(source)):
        for at, text in _exchanges(node):
            part = ast.get_source_segment(source, at) or ""
            lines = source.splitlines(keepends=True)
            begin = len("".join(lines[: at.lineno - 1]).encode()) + at.col_offset
            raw = source.encode()
            changed = raw[:begin] + text.encode() + raw[begin + len(part.encode()) :]
            yield Mutant(str(path.relative_to(ROOT)), at.lineno, part, text, changed.decode())


def _nodes(node: ast.AST) -> Iterator[ast.AST]:
    """All below a node, but for texts, in which Python 3.11 does not say where things are."""
    yield node
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.JoinedStr):
            yield from _nodes(child)


def _exchanges(node: ast.AST) -> Iterator[tuple[ast.expr, str]]:
    """Expressions, and what they are exchanged for."""
    match node:
        case ast.Compare(left, [op], [right]) if type(op) in OTHERS:
            yield node, f"({ast.unparse(left)} {OTHERS[type(op)]} {ast.unparse(right)})"
        case ast.BinOp(left, op, right) if type(op) in OTHERS and not isinstance(left, ast.Constant | ast.JoinedStr):
            yield node, f"(({ast.unparse(left)}) {OTHERS[type(op)]} ({ast.unparse(right)}))"
        case ast.BoolOp(op, values):
            yield node, "(" + f" {OTHERS[type(op)]} ".join(f"({ast.unparse(value)})" for value in values) + ")"
        case ast.UnaryOp(ast.Not() | ast.USub(), operand) if not isinstance(operand, ast.Constant):
            yield node, f"({ast.unparse(operand)})"
        case ast.Call(ast.Name(name) as called) if name in EXTREMES:
            yield called, EXTREMES[name]
        case ast.Call(ast.Attribute(value, name) as called) if name in EXTREMES:
            yield called, ast.unparse(ast.Attribute(value, EXTREMES[name], ast.Load()))
        case ast.Subscript(_, ast.Constant(int(index)) as place):
            yield place, str(index + 1)


def drawn(number: int, seed: int) -> list[Mutant]:
    """So many of the library's, without repetition."""
    everything = [mutant for path in sorted((ROOT / "colloc").rglob("*.py")) for mutant in mutants(path)]
    return [everything[k] for k in np.random.default_rng(seed).permutation(len(everything))[:number]]


def seen_by(tree: Path, mutant: Mutant, workers: int) -> str:
    """The first test that fails on it; "" if none does."""
    package = Path(mutant.module).parts[1]
    near = [f"tests/{package}"] if (tree / "tests" / package).is_dir() else []
    environment = os.environ | {"PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}
    for tests in (near, ["tests"]):
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-n", str(workers), *tests]
        try:
            done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=LONGEST)
        except subprocess.TimeoutExpired:
            return "time"
        if tests and done.returncode:
            failed = [line.split()[1] for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
            return failed[0] if failed else "collection"
    return ""


def _unneeded(folder: str, names: list[str]) -> list[str]:
    """What is not copied of the top of the tree, and of results all but the curated ones."""
    unneeded = {".git", ".venv", "build", "dist", "site"} if Path(folder) == ROOT else set()
    return [n for n in names if n in unneeded or (Path(folder) == ROOT / "results" and n != "curated")]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--number", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    kept = ROOT / "results" / f"mutants-{options.seed}.jsonl"
    done = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder, "colloc")
        shutil.copytree(ROOT, tree, ignore=_unneeded)
        for mutant in drawn(options.number, options.seed)[len(done) :]:
            whole = (tree / mutant.module).read_text()
            (tree / mutant.module).write_text(mutant.source)
            test = seen_by(tree, mutant, options.workers)
            (tree / mutant.module).write_text(whole)
            done.append({**mutant._asdict(), "seen by": test})
            del done[-1]["source"]
            with kept.open("a") as file:
                file.write(json.dumps(done[-1]) + "\n")
    print("| place | before | after | seen by |\n|---|---|---|---|")
    for one in done:
        before, after = (one[key].replace("|", "\\|").replace("\n", " ") for key in ("before", "after"))
        print(f"| {one['module']}:{one['line']} | `{before}` | `{after}` | {one['seen by'] or '**none**'} |")
    print(f"\n{sum(bool(one['seen by']) for one in done)} of {len(done)} are seen.")


if __name__ == "__main__":
    main()
