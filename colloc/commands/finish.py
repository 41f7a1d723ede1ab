"""How a solve ends once its result is saved: the figure beside it, the last lines, the exit code."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from colloc.commands.ending import BAD_PROBLEM
from colloc.system.errors import CollocError
from colloc.system.progress import StatusLine


def finished(
    options: argparse.Namespace,
    path: Path,
    saved: Sequence[str],
    complaints: Sequence[str],
    figure: Callable[[], Any],
    code: int,
) -> int:
    """Draw the figure, say what was saved and what went wrong; returns the exit code, `code` if nothing went wrong.

    Parameters
    ----------
    options : argparse.Namespace
        With ``no_figure``, ``pdf``, ``quiet`` and ``json``.
    path : Path
        Of the result; the figure has its name.
    saved : sequence of str
        What was written so far.
    complaints : sequence of str
        What went wrong with things that nobody should lose a result for.
    figure : callable
        Makes the figure; not called if none is wanted.
    code : int
    """
    saved, complaints = list(saved), list(complaints)
    if not options.no_figure:
        from colloc.pictures.style import save

        with StatusLine(enabled=not (options.quiet or options.json)) as line:
            line.say("drawing")
            try:
                saved += map(str, save(figure(), path.with_suffix(""), ("png", "pdf")[: 1 + options.pdf]))
            except CollocError as error:
                complaints.append(f"no figure: {error}")
    if not options.json:
        print(f"  saved {', '.join(saved)}")
    for complaint in complaints:
        print(f"colloc: {complaint}", file=sys.stderr)
    return BAD_PROBLEM if complaints else code
