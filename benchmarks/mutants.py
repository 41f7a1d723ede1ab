"""Do the tests see a wrong sign? The library is broken in one random place at a time, and the tests
are run against it.

    python -m benchmarks.mutants --number 40 --seed 1

A place is a comparison (made its opposite: `<=` for `<` changes nothing among real numbers), an
operation, a sign, an `and`, a `not`, a `min` or an index off by one, drawn evenly from all of
`colloc/`. All tests are run once on the whole library, in which every place drawn notes the tests
that come by; a mutant is then tried with these, the quickest first, and where what many tests share
comes by (a fixture, an import) with all of that file: the others cannot see it. A file that fails
on the whole library sees nothing. What is done is kept in results/mutants-SEED.jsonl: an
interrupted run goes on where it stopped. A mutant that no test sees is one that changes nothing, or
a test that lacks.
"""

from __future__ import annotations

import ast
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from scripts.program import command_line

ROOT = Path(__file__).resolve().parents[1]
OTHERS: dict[type, str] = {
    ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "==",
    ast.And: "or", ast.Or: "and",
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*",
}  # fmt: skip
EXTREMES = {
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "argmin": "argmax",
    "argmax": "argmin",
}
MEMORY = 8 << 30
"""Of a process of the tests, in bytes."""
SLOWEST = 10
"""Tests that take so many times as long as on the whole library, and a minute, go round in circles:
they have seen a mutant."""
PASSING = """import os, sys
def by(place, seen=set()):
    test, _, stage = os.environ.get("PYTEST_CURRENT_TEST", "*").rpartition(" ")
    if sys._getframe(1).f_code.co_name == "<module>":
        test, stage = "", "*"  # whichever test came first
    now = place, test if stage == "(call)" else test.split("::")[0] or stage
    if now not in seen:
        seen.add(now)
        with open({kept!r}, "a") as file:
            print(*now, sep="\t", file=file)
"""
"""A module of the tree in which all places drawn note who passes."""


class Mutant(NamedTuple):
    """A module with one place exchanged, which is these bytes of it."""

    module: str
    line: int
    before: str
    after: str
    begin: int
    end: int

    def within(self, tree: Path) -> bytes:
        """Its module of a tree with the place exchanged."""
        whole = (tree / self.module).read_bytes()
        return whole[: self.begin] + self.after.encode() + whole[self.end :]


def mutants(path: Path) -> Iterator[Mutant]:
    """All of a module."""
    source = path.read_text()
    lines = source.encode().splitlines(keepends=True)
    for node in _nodes(ast.parse(source)):
        for at, text in _exchanges(node):
            part = ast.get_source_segment(source, at) or ""
            begin = len(b"".join(lines[: at.lineno - 1])) + at.col_offset
            yield Mutant(
                str(path.relative_to(ROOT)),
                at.lineno,
                part,
                text,
                begin,
                begin + len(part.encode()),
            )


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
        case ast.BinOp(left, op, right) if type(op) in OTHERS and not isinstance(
            left, ast.Constant | ast.JoinedStr
        ):
            yield node, f"(({ast.unparse(left)}) {OTHERS[type(op)]} ({ast.unparse(right)}))"
        case ast.BoolOp(op, values):
            yield (
                node,
                "("
                + f" {OTHERS[type(op)]} ".join(f"({ast.unparse(value)})" for value in values)
                + ")",
            )
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
    everything = [
        mutant for path in sorted((ROOT / "colloc").rglob("*.py")) for mutant in mutants(path)
    ]
    return [
        everything[k] for k in np.random.default_rng(seed).permutation(len(everything))[:number]
    ]


def passing(tree: Path, places: list[Mutant], workers: int) -> list[list[dict[str, float]]]:
    """For each place, the tests that come by, and the files to which it belongs that all tests of
    share: what to try in turn, and the seconds that each takes, the quickest first. Files that fail
    are left out."""
    added: defaultdict[str, list[tuple[int, bytes]]] = defaultdict(list)
    for k, place in enumerate(places):
        added[place.module] += [
            (place.begin, f"(__import__('colloc.passing').passing.by({k}) or (".encode()),
            (place.end, b"))"),
        ]
    whole = {module: (tree / module).read_bytes() for module in added}
    for module, parts in added.items():
        text = whole[module]
        for at, part in sorted(parts, key=lambda one: one[0], reverse=True):
            text = text[:at] + part + text[at:]
        (tree / module).write_bytes(text)
    kept, times = tree.parent / "passed", tree.parent / "times.xml"
    (tree / "colloc" / "passing.py").write_text(PASSING.format(kept=str(kept)))
    tested(tree, workers, None, "-o", "junit_family=xunit1", f"--junitxml={times}")
    for module, before in whole.items():
        (tree / module).write_bytes(before)
    (tree / "colloc" / "passing.py").unlink()
    seconds: defaultdict[str, float] = defaultdict(float)
    failed = set()
    for case in ElementTree.parse(times).iter("testcase"):
        for one in (case.attrib["file"], f"{case.attrib['file']}::{case.attrib['name']}"):
            seconds[one] += float(case.attrib["time"])
        if case.find("failure") is not None or case.find("error") is not None:
            failed.add(case.attrib["file"])
    print(
        f"Left out, since they fail on the whole library: {', '.join(sorted(failed)) or 'none'}.",
        flush=True,
    )
    good = {
        one: seconds[one]
        for one in sorted(seconds, key=seconds.__getitem__)
        if one.split("::")[0] not in failed
    }
    by: list[set[str]] = [set() for _ in places]
    for line in kept.read_text().splitlines():
        number, one = line.split("\t")
        by[int(number)] |= {one} if one != "*" else {each for each in good if "::" not in each}
    return [
        [
            {one: good[one] for one in good if one in of and ("::" in one) != whole}
            for whole in (False, True)
        ]
        for of in by
    ]


def tested(
    tree: Path, workers: int, seconds: float | None, *options: str
) -> subprocess.CompletedProcess[str]:
    """What pytest says of a tree."""
    environment = os.environ | {"PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-n",
        str(workers),
        *options,
    ]
    # what fills it has failed, not the machine
    limited = partial(resource.setrlimit, resource.RLIMIT_DATA, (MEMORY, MEMORY))
    how: dict[str, Any] = {
        "capture_output": True,
        "text": True,
        "timeout": seconds,
        "preexec_fn": limited,
    }
    return subprocess.run(command, cwd=tree, env=environment, **how)


def seen_by(tree: Path, workers: int, tests: dict[str, float]) -> str:
    """The first of these tests, or of files of them, that fails on a tree; "" if none does."""
    if not tests:
        return ""
    try:
        done = tested(tree, workers, 60 + SLOWEST * sum(tests.values()), "-x", "--tb=no", *tests)
    except subprocess.TimeoutExpired:
        return "time"
    failed = [
        line.split()[1] for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))
    ]
    return failed[0] if failed else "collection" if done.returncode else ""


def _unneeded(folder: str, names: list[str]) -> list[str]:
    """What is not copied of the top of the tree, and of results all but the curated ones."""
    unneeded = {".git", ".venv", "build", "dist", "site"} if Path(folder) == ROOT else set()
    return [
        n for n in names if n in unneeded or (Path(folder) == ROOT / "results" and n != "curated")
    ]


def main() -> None:
    options = command_line(__doc__, number=40, seed=1, workers=0)
    kept = ROOT / "results" / f"mutants-{options.seed}.jsonl"
    done = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder, "colloc")
        shutil.copytree(ROOT, tree, ignore=_unneeded)
        places = drawn(options.number, options.seed)[len(done) :]
        for mutant, near in zip(places, passing(tree, places, options.workers), strict=True):
            whole = (tree / mutant.module).read_bytes()
            (tree / mutant.module).write_bytes(mutant.within(tree))
            test = next(filter(None, (seen_by(tree, options.workers, tests) for tests in near)), "")
            (tree / mutant.module).write_bytes(whole)
            done.append(
                {**mutant._asdict(), "tests": len(near[0]), "files": len(near[1]), "seen by": test}
            )
            with kept.open("a") as file:
                file.write(json.dumps(done[-1]) + "\n")
    print("| place | before | after | seen by |\n|---|---|---|---|")
    for one in done:
        before, after = (
            one[key].replace("|", "\\|").replace("\n", " ") for key in ("before", "after")
        )
        print(
            f"| {one['module']}:{one['line']} | `{before}` | `{after}` | "
            f"{one['seen by'] or '**none**'} |"
        )
    print(f"\n{sum(bool(one['seen by']) for one in done)} of {len(done)} are seen.")


if __name__ == "__main__":
    main()
