"""Imports made on use: functions of higher packages, and libraries that may be missing."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from colloc.system.errors import CollocError


def higher(place: str) -> Callable[..., Any]:
    """Import what a higher package offers, such as ``"pictures.movie:write_movie"``."""
    module, _, name = place.partition(":")
    # Matplotlib cannot be imported where $MPLBACKEND names a backend that is not installed, as a
    # notebook's terminal does; nothing is drawn here with it
    backend = None if "matplotlib" in sys.modules else os.environ.pop("MPLBACKEND", None)
    try:
        return getattr(importlib.import_module(f"colloc.{module}"), name)
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
            if backend and "matplotlib" in sys.modules:
                with suppress(ValueError):
                    sys.modules["matplotlib"].rcParams["backend"] = backend


def optional(library: str) -> Any:
    """Import a library that colloc can do without, or raise a `CollocError`."""
    try:
        return importlib.import_module(library)
    except ImportError:
        raise CollocError(
            f"this needs {library}, which is not installed: pip install {library}."
        ) from None
