"""What is imported only when it is asked for: functions of higher packages by name, and libraries
that may be missing.

So a lower package can offer what it must not import; the face of the library says where that is.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from types import FunctionType
from typing import Any

from colloc.system.errors import CollocError

_WHERE: dict[str, str] = {}


def bind(places: Mapping[str, str]) -> None:
    """Say where functions are: name to ``"module:function"``."""
    _WHERE.update(places)


def bound(name: str) -> Callable[..., Any]:
    """The function of that name, which checks its arguments, but for axes, of which drawings know
    more to say. `KeyError` if nobody has said where it is."""
    from colloc.system.arguments import checked_arguments

    module, _, function = _WHERE[name].partition(":")
    with _whatever_backend():
        found = getattr(importlib.import_module(module), function)
    return (
        checked_arguments(found)
        if isinstance(found, FunctionType) and not name.startswith("plot")
        else found
    )


@contextmanager
def _whatever_backend() -> Iterator[None]:
    """Matplotlib cannot be imported where the environment names a backend that is not installed, as
    a notebook's terminal does. In this block it can; nothing is drawn here with that backend, and
    where there is one others get it."""
    named = None if "matplotlib" in sys.modules else os.environ.pop("MPLBACKEND", None)
    try:
        yield
    finally:
        if named is not None:
            os.environ["MPLBACKEND"] = named
            if named and "matplotlib" in sys.modules:
                with suppress(ValueError):
                    sys.modules["matplotlib"].rcParams["backend"] = named


def optional(library: str) -> Any:
    """A library that colloc can do without. `CollocError` if it is not installed."""
    try:
        return importlib.import_module(library)
    except ImportError:
        raise CollocError(
            f"this needs {library}, which is not installed: pip install {library}."
        ) from None
