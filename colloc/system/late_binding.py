"""Functions of higher packages by name, so that a lower one can offer what it must not import.

The face of the library says where they are; they are imported when they are first called.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any

_WHERE: dict[str, str] = {}


def bind(places: Mapping[str, str]) -> None:
    """Say where functions are: name to ``"module:function"``."""
    _WHERE.update(places)


def bound(name: str) -> Callable[..., Any]:
    """The function of that name.

    Raises
    ------
    KeyError
        If nobody has said where it is.
    """
    module, _, function = _WHERE[name].partition(":")
    return getattr(importlib.import_module(module), function)
