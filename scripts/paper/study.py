"""Resumable studies: named parts, each a function from settings to named arrays, computed once and
kept in HDF5.

A part is finished when its file carries the fingerprint of its settings, of the source text of its
module and of every colloc or scripts module that one leads to, and of the parts it needs. Change
any of them, and it is computed again. Modules that only carry numbers about (this one, storing,
running in parallel) do not count.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from colloc.system.errors import ProblemError
from scripts.paper.array_store import read_arrays, read_attribute, write_arrays

Arrays = dict[str, Any]
_CARRIERS = {"scripts.paper.study", "scripts.paper.array_store", "scripts.paper.parallel"}


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


def _source(module: str) -> str | None:
    try:
        spec = importlib.util.find_spec(module)
    except ModuleNotFoundError:  # a name in a module, not a module
        return None
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return None
    return Path(spec.origin).read_text(encoding="utf-8")


@cache
def source_closure(
    module: str, packages: tuple[str, ...] = ("colloc", "scripts", "problems")
) -> dict[str, str]:
    """Source text of a module and of all modules of `packages` it imports, directly or not, by
    name."""
    found: dict[str, str] = {}
    todo = [module]
    while todo:
        name = todo.pop()
        text = _source(name) if name not in found and name not in _CARRIERS else None
        if text is None:
            continue
        found[name] = text
        for node in ast.walk(ast.parse(text)):
            if (
                isinstance(node, ast.ImportFrom)
                and node.module
                and node.module.split(".")[0] in packages
            ):
                todo += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
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

    def fingerprint(self, name: str) -> str:
        """SHA-256 of what the part's arrays depend on, as it was when the study was made."""
        return self._fingerprints[name]

    def _fingerprint(self, name: str) -> str:
        part = self.parts[name]
        text = json.dumps(
            [
                self.settings(name),
                sorted(source_closure(part.compute.__module__).items()),
                [self._fingerprint(need) for need in part.needs],
            ],
            sort_keys=True,
        )
        return hashlib.sha256(text.encode()).hexdigest()

    def finished(self, name: str) -> bool:
        return read_attribute(self.path(name), "fingerprint") == self.fingerprint(name)

    def arrays(self, name: str) -> Arrays:
        """The arrays of a part, from its file."""
        return read_arrays(self.path(name))

    def compute(self, name: str, processes: int) -> float:
        """Compute one part and write its file; returns the seconds it took."""
        part = self.parts[name]
        needed = {need: self.arrays(need) for need in part.needs}
        start = time.perf_counter()
        arrays = part.compute(Context(self.settings(name), needed, processes))
        seconds = time.perf_counter() - start
        attributes = {
            "fingerprint": self.fingerprint(name),
            "settings": self.settings(name),
            "seconds": seconds,
            "processes": processes,
        }
        write_arrays(self.path(name), arrays, units=part.units, attributes=attributes)
        return seconds
