"""What a person sees while they wait: one line that is rewritten, with the time left; nothing where nobody watches."""

from __future__ import annotations

import sys
import threading
import time
from typing import TextIO

_TICK = 0.5


def duration(seconds: float) -> str:
    """``42 s``, ``3 min 20 s`` or ``2 h 05 min``."""
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


class StatusLine:
    """A line at the bottom of the terminal: what is being done, for how long, and how long it will take.

    It is redrawn twice a second by a thread of its own, since a solve reports nothing for long, and vanishes at the end.
    Where the stream is not a terminal nothing is written.

    Parameters
    ----------
    stream : text stream, optional
        Standard error by default.
    enabled : bool
        False writes nothing anywhere.
    """

    def __init__(self, stream: TextIO | None = None, *, enabled: bool = True) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._shown = enabled and self._stream.isatty()
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._text, self._width = "", 0
        self._left: float | None = None
        self._begin = self._since = time.monotonic()
        self._thread = threading.Thread(target=self._tick, daemon=True)

    def __enter__(self) -> StatusLine:
        if self._shown:
            self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._stop.set()
        if self._shown:
            self._thread.join()
        self.clear()

    def say(self, text: str, left: float | None = None) -> None:
        """Show a text from now on; `left` are the seconds it will probably take from now."""
        with self._lock:
            self._text, self._left, self._since = text, left, time.monotonic()
        self._draw()

    def clear(self) -> None:
        """Wipe the line, so that something else can be printed there."""
        with self._lock:
            if self._shown and self._width:
                self._stream.write("\r" + " " * self._width + "\r")
                self._stream.flush()
                self._width = 0

    def _tick(self) -> None:
        while not self._stop.wait(_TICK):
            self._draw()

    def _draw(self) -> None:
        with self._lock:
            if not self._shown or not self._text or self._stop.is_set():
                return
            now = time.monotonic()
            line = f"{self._text}   {duration(now - self._begin)}"
            left = 0.0 if self._left is None else self._left - (now - self._since)
            if left > 0.5:  # an estimate that has run out is worth nothing
                line += f", about {duration(left)} left"
            self._stream.write("\r" + line.ljust(self._width))
            self._stream.flush()
            self._width = len(line)
