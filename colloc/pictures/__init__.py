"""Figures and films of solutions, their report, and joint angles for robots."""

import os
import sys
from contextlib import suppress

if "matplotlib" not in sys.modules:
    # it cannot be imported where the environment names a backend that is not installed, as the terminals of some notebooks
    # do; nothing here draws with that backend, and where there is one others still get it
    _backend = os.environ.pop("MPLBACKEND", "")
    import matplotlib

    if _backend:
        os.environ["MPLBACKEND"] = _backend
        with suppress(ValueError):
            matplotlib.rcParams["backend"] = _backend
