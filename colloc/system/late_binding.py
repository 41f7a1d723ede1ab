"""What is imported only when it is asked for: functions of higher packages by name, and libraries that may be missing.

So a lower package can offer what it must not import; the face of the library says where that is.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any

from colloc.system.errors import CollocError

_WHERE: dict[str, str] = {}


def bind(places: Mapping[str, str]) -> None:
    """Say where functions are: name to ``"module:function"``."""
    _WHERE.update(places)


def bound(name: str) -> Callable[..., Any]:
    """The function of that name. `KeyError` if nobody has said where it is."""
    module, _, function = _WHERE[name].partition(":")
    return getattr(importlib.import_module(module), function)


def optional(library: str) -> Any:
    """A library that colloc can do without. `CollocError` if it is not installed."""
    try:
        return importlib.import_module(library)
    except ImportError:
        raise CollocError(f"this needs {library}, which is not installed: pip install {library}.") from None
