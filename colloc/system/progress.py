"""Progress in a terminal: one line that is rewritten; nothing where nobody watches."""

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
    """Line at the bottom of a terminal with what is being done, elapsed and remaining time.

    Rich redraws it twice a second. If the stream (standard error) is no terminal, or the line is
    not enabled, nothing is written and Rich is not imported.
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
        """Show a text from now on; `left` is the estimated remaining time [s], 0 if unknown."""
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
                redirect_stdout=False,
                redirect_stderr=True,  # warnings appear above the line
            )
            self._live.start()
        self._live.refresh()

    def clear(self) -> None:
        """Wipe the line, so that something else can be printed; `say` shows it again."""
        if self._live is not None:
            self._live.stop()
            self._live = None

    def _line(self) -> str:
        now = time.monotonic()
        line = f"{self._text}   {duration(now - self._begin)}"
        left = self._left - (now - self._since)
        return f"{line}, about {duration(left)} left" if left > 0.5 else line
