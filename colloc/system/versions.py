"""Versions of what a result depends on."""

from __future__ import annotations

import platform
from functools import cache


@cache
def version_of(library: str) -> str:
    """Version of an installed library, or "source tree"."""
    from importlib import metadata  # slow to import

    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return "source tree"


def versions() -> dict[str, str]:
    """Versions by name, Python's among them."""
    names = ("colloc", "casadi", "numpy", "scipy", "h5py")
    return {"python": platform.python_version(), **{name: version_of(name) for name in names}}
