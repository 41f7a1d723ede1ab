"""What is imported only when asked for: functions of higher packages by name, libraries that may be missing; and versions.

So a lower package can offer what it must not import; the face of the library says where that is.
"""

from __future__ import annotations

import importlib
import platform
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


def version_of(library: str) -> str:
    """Version of an installed library, or that it is a source tree which nobody installed."""
    from importlib import metadata  # takes longer than all of the face

    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return "source tree"


def versions() -> dict[str, str]:
    """Versions of everything a result depends on."""
    names = ("colloc", "casadi", "numpy", "scipy", "h5py")
    return {"python": platform.python_version(), **{name: version_of(name) for name in names}}


def optional(library: str) -> Any:
    """A library that colloc can do without. `CollocError` if it is not installed."""
    try:
        return importlib.import_module(library)
    except ImportError:
        raise CollocError(f"this needs {library}, which is not installed: pip install {library}.") from None
