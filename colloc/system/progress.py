"""Progress in a terminal: one line that is rewritten, with the time left; nothing where nobody
watches."""

from __future__ import annotations

import math
import sys
import time
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.live import Live


def duration(seconds: float) -> str:
    """``42 s``, ``3 min 20 s`` or ``2 h 05 min``."""
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


class StatusLine:
    """A line at the bottom of the terminal: what is being done, for how long, and how long it will
    take where that is known.

    Rich redraws it twice a second, since a solve reports nothing for long, and it vanishes at the
    end. Where the stream (by default standard error) is not a terminal, or the line is not enabled,
    nothing is written, and Rich is not loaded.
    """

    def __init__(self, stream: TextIO | None = None, *, enabled: bool = True) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._shown = enabled and self._stream.isatty()
        self._live: Live | None = None
        self._text, self._left = "", 0.0
        self._begin = self._since = time.monotonic()

    def __enter__(self) -> StatusLine:
        return self

    def __exit__(self, *error: object) -> None:
        self.clear()

    def say(self, text: str, left: float = 0.0) -> None:
        """Show a text from now on; `left` are the seconds it will probably take, 0 if unknown."""
        self._text, self._since = text, time.monotonic()
        self._left = left if math.isfinite(left) else 0.0
        if not self._shown:
            return
        if self._live is None:
            from rich.console import Console
            from rich.live import Live

            self._live = Live(
                get_renderable=self._line,
                console=Console(file=self._stream, highlight=False, markup=False),
                refresh_per_second=2,
                transient=True,
                # it may go elsewhere; what is for this terminal is printed after `clear`
                redirect_stdout=False,
                redirect_stderr=True,  # warnings stand above the line
            )
            self._live.start()
        self._live.refresh()

    def clear(self) -> None:
        """Wipe the line, so that something else can be printed there; `say` shows it again."""
        if self._live is not None:
            self._live.stop()
            self._live = None

    def _line(self) -> str:
        now = time.monotonic()
        line = f"{self._text}   {duration(now - self._begin)}"
        left = self._left - (now - self._since)
        # one that has run out is worth nothing
        return f"{line}, about {duration(left)} left" if left > 0.5 else line
