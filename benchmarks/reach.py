"""Which tests run which lines of colloc, and how long they take: a plugin of pytest, for `benchmarks.mutation`.

    python -m benchmarks.reach results/reach.json tests/mechanics tests/bounds ...

A fixture of a module or session is set up in its first test only; what it calls is ascribed to every test that asks for it.
Python programs that a test starts write down their calls themselves (`traced_children`), but not their lines.
A line is known by its text, so that the record outlives changes elsewhere in the file.
"""

from __future__ import annotations

import argparse
import json
import linecache
import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, NamedTuple

import pytest

_LIBRARY = f"{Path(__file__).resolve().parents[1] / 'colloc'}{os.sep}"
_FOLLOWED = 50
"""The first calls of a function by a test are followed from line to line; all of them would take minutes."""
_TRACED_CHILDREN = str(Path(__file__).with_name("traced_children"))


class Test(NamedTuple):
    """A test: its name for pytest, processor seconds, and all it runs: ``file::function``, and ``file: text`` of lines; of
    programs that it starts ``file::function*``."""

    name: str
    seconds: float
    calls: frozenset[str]


def _named(code: CodeType) -> str:
    """``colloc/bounds/sampled.py::efficiency_bound`` of a function."""
    return f"colloc/{code.co_filename.removeprefix(_LIBRARY)}::{code.co_qualname}"


def named_line(file: str, text: str) -> str:
    """``colloc/bounds/sampled.py: return 0`` of a line."""
    return f"{file}: {text.strip()}"


def _seconds() -> float:
    """Processor time of this process and its children so far."""
    return sum(os.times()[:4])


class Recorder:
    """Writes down what every test calls."""

    def __init__(self) -> None:
        self.tests: list[Test] = []
        self.failed: set[str] = set()
        self._by_fixture: dict[Any, set[str]] = {}

    @contextmanager
    def _calls(self) -> Iterator[set[str]]:
        """The set of what is called in the block, complete at its end."""
        unseen: dict[CodeType, set[int]] = {}
        followed: dict[CodeType, int] = {}
        found: set[str] = set()

        def called(frame: FrameType, event: str, argument: Any) -> Any:
            code = frame.f_code
            if code not in unseen:
                own = code.co_filename.startswith(_LIBRARY)
                unseen[code], followed[code] = {line for _, _, line in code.co_lines() if line} if own else set(), 0
            followed[code] += 1
            return at_line if unseen[code] and followed[code] < _FOLLOWED else None

        def at_line(frame: FrameType, event: str, argument: Any) -> Any:
            lines = unseen[frame.f_code]
            lines.discard(frame.f_lineno)
            return at_line if lines else None

        before, outer = sys.gettrace(), os.environ.get("COLLOC_REACH", "")
        with tempfile.NamedTemporaryFile("r", encoding="utf-8") as of_children:
            os.environ["COLLOC_REACH"] = of_children.name
            threading.settrace(called)
            sys.settrace(called)
            try:
                yield found
            finally:
                sys.settrace(before)
                threading.settrace(before)
                os.environ["COLLOC_REACH"] = outer
                found |= set(of_children.read().splitlines())
                for code, rest in unseen.items():
                    if code.co_filename.startswith(_LIBRARY):
                        file = _named(code).partition("::")[0]
                        run = {line for _, _, line in code.co_lines() if line} - rest
                        found |= {_named(code)} | {named_line(file, linecache.getline(code.co_filename, i)) for i in run}

    @pytest.hookimpl(hookwrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any, request: Any) -> Iterator[None]:
        with self._calls() as calls:
            yield
        self._by_fixture.setdefault(fixturedef, set()).update(calls)

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: Any, nextitem: Any) -> Iterator[None]:
        begin = _seconds()
        with self._calls() as calls:
            yield
        for fixtures in item._fixtureinfo.name2fixturedefs.values():
            calls |= self._by_fixture.get(fixtures[-1], set())
        self.tests.append(Test(item.nodeid, _seconds() - begin, frozenset(calls)))

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed:
            self.failed.add(report.nodeid)


def recorded(folders: tuple[str, ...]) -> tuple[list[Test], int]:
    """The default tests of some folders, run once, and pytest's exit code; without those that fail when they are traced."""
    recorder = Recorder()
    paths = (_TRACED_CHILDREN, os.environ.get("PYTHONPATH", ""))
    os.environ |= {"PYTHONPATH": os.pathsep.join(filter(None, paths)), "COLLOC_REACH_IN": _LIBRARY, "COLLOC_REACH": ""}
    # Dask ends a process that is traced, and signals that are sent to traced code come too late
    options = ["-n", "0", "-p", "no:cacheprovider", "-k", "not dask", "--ignore=tests/system/test_interruption.py"]
    code = pytest.main([*options, *folders], plugins=[recorder])
    if code == pytest.ExitCode.TESTS_FAILED:
        print("not used, as they fail when traced:", *sorted(recorder.failed))
        code = 0
    return [test for test in recorder.tests if test.name not in recorder.failed], int(code)


def save(tests: list[Test], path: Path) -> None:
    names = sorted({call for test in tests for call in test.calls})
    place = {name: i for i, name in enumerate(names)}
    rows = [[test.name, test.seconds, sorted(map(place.__getitem__, test.calls))] for test in tests]
    path.write_text(json.dumps({"names": names, "tests": rows}), encoding="utf-8")


def load(path: Path) -> list[Test]:
    known = json.loads(path.read_text(encoding="utf-8"))
    names = known["names"]
    return [Test(name, seconds, frozenset(names[i] for i in calls)) for name, seconds, calls in known["tests"]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, help="JSON to write")
    parser.add_argument("tests", nargs="+", help="folders or files of tests")
    options = parser.parse_args()
    found, code = recorded(tuple(options.tests))
    save(found, options.file)
    sys.exit(code)


if __name__ == "__main__":
    main()
