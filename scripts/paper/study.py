"""Resumable studies: named parts, each a function from settings to named arrays, computed once and
kept in HDF5, on several processes.

A part is finished when its file carries the fingerprint of its settings, of the source text of its
module and of every colloc or scripts module that one leads to, and of the parts it needs. Change
any of them, and it is computed again. This module, which only carries numbers about, does not count.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import h5py
from rich.console import Console
from rich.progress import track

import colloc
from colloc.system.environment import versions
from colloc.system.errors import ProblemError, StoreError
from colloc.system.store_file import array, attribute, mark, new_file, open_file, put, put_attribute

Arrays = dict[str, Any]
Task = TypeVar("Task")
Result = TypeVar("Result")
_FORMAT = "colloc arrays", 2
_PACKAGES = "colloc", "scripts", "problems"


def parallel_map(
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    *,
    processes: int = 1,
    label: str = "",
) -> list[Result]:
    """``[function(task) for task in tasks]`` on several processes, with a bar on the terminal."""
    count = min(processes, len(tasks))
    hidden = not label or not sys.stderr.isatty()
    bar: Any = {"total": len(tasks), "console": Console(stderr=True), "disable": hidden}
    if count <= 1:
        return list(track(map(function, tasks), label, **bar))
    with ProcessPoolExecutor(count) as pool:
        each = pool.map(function, tasks, chunksize=max(1, len(tasks) // (8 * count)))
        return list(track(each, label, **bar))


def write_arrays(path: Path, arrays: Arrays, *, units: Mapping[str, str], **about: Any) -> None:
    """Write arrays (numbers, strings or NumPy arrays by name; "a/b" makes a group) with what
    describes them."""
    described = {
        "command": " ".join(sys.orig_argv[1:]),
        "versions": versions(),
        "conventions": (colloc.__doc__ or "").strip(),
    }
    with new_file(path) as file:
        mark(file, *_FORMAT)
        for key, value in arrays.items():
            put(file, key, value, units=units.get(key, "1"))
        for key, value in (described | about).items():
            text = value if isinstance(value, str | int | float) else json.dumps(value)
            put_attribute(file, key, text)


def read_arrays(path: Path) -> Arrays:
    """All arrays of a file by name; strings decoded, scalars as NumPy scalars."""
    names: list[str] = []
    with open_file(path, *_FORMAT) as file:
        file.visititems(
            lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None
        )
        return {name: array(file, name) for name in names}


@dataclass(frozen=True)
class Context:
    """What a part is computed with: its settings, the arrays of the parts it needs by name, and
    processes to use."""

    settings: Mapping[str, Any]
    needed: Mapping[str, Arrays]
    processes: int


@dataclass(frozen=True)
class Part:
    """A part of a study."""

    name: str
    compute: Callable[[Context], Arrays]
    settings: Mapping[str, Any] = field(default_factory=dict)
    quick: Mapping[str, Any] = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)


@cache
def source_closure(module: str) -> dict[str, str]:
    """Source text of a module and of all modules of the project it imports, directly or not, by
    name."""
    found: dict[str, str] = {}
    todo = [module]
    while todo:
        name = todo.pop()
        try:
            spec = importlib.util.find_spec(name) if name not in {*found, __name__} else None
        except ModuleNotFoundError:  # a name in a module, not a module
            spec = None
        if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
            continue
        found[name] = Path(spec.origin).read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(found[name])):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(_PACKAGES):
                todo += [str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)]
    return found


class PaperStudy:
    """Parts in order of dependence, and the folder of their files."""

    def __init__(self, parts: Sequence[Part], folder: Path, *, quick: bool = False) -> None:
        self.parts = {part.name: part for part in parts}
        self.folder = Path(folder)
        self.quick = quick
        # now, while the source on disk is the source that runs
        self._fingerprints = {name: self._fingerprint(name) for name in self.parts}

    def select(self, names: Sequence[str]) -> list[str]:
        """The named parts and all they need, in order."""
        unknown = [name for name in names if name not in self.parts]
        if unknown:
            raise ProblemError(
                f"there is no part {unknown[0]!r}; the parts are {', '.join(self.parts)}."
            )
        wanted = set(names)
        for name in reversed(self.parts):
            if name in wanted:
                wanted.update(self.parts[name].needs)
        return [name for name in self.parts if name in wanted]

    def path(self, name: str) -> Path:
        return self.folder / f"{name}.h5"

    def settings(self, name: str) -> dict[str, Any]:
        part = self.parts[name]
        return {**part.settings, **(part.quick if self.quick else {})}

    def _fingerprint(self, name: str) -> str:
        """SHA-256 of what the part's arrays depend on."""
        part = self.parts[name]
        sources = sorted(source_closure(part.compute.__module__).items())
        needs = [self._fingerprint(need) for need in part.needs]
        text = json.dumps([self.settings(name), sources, needs], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def finished(self, name: str) -> bool:
        try:
            with open_file(self.path(name), *_FORMAT) as file:
                return attribute(file, "fingerprint") == self._fingerprints[name]
        except StoreError:
            return False

    def arrays(self, name: str) -> Arrays:
        """The arrays of a part, from its file."""
        return read_arrays(self.path(name))

    def compute(self, name: str, processes: int) -> float:
        """Compute one part and write its file; returns the seconds it took."""
        part, settings = self.parts[name], self.settings(name)
        needed = {need: self.arrays(need) for need in part.needs}
        start = time.perf_counter()
        arrays = part.compute(Context(settings, needed, processes))
        seconds = time.perf_counter() - start
        about = {"fingerprint": self._fingerprints[name], "settings": settings, "seconds": seconds}
        write_arrays(self.path(name), arrays, units=part.units, processes=processes, **about)
        return seconds
