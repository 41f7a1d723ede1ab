"""Ctrl-C, which compiled code would swallow or turn into another error: it is remembered, and stays an interruption.

CasADi reports a KeyboardInterrupt inside a callback on standard error, in nine lines, and lets IPOPT end as if a function
had failed. So a solve is not interrupted by an exception: it asks between iterations whether to stop (`interrupted`).
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from types import FrameType

from colloc.system.early_interruption import end_at_once


@dataclass
class _Heard:
    """Whether Ctrl-C came since the outermost block began, and whether the code that runs asks for it by itself."""

    asked: bool = False
    polled: bool = False


_heard = _Heard()  # of the process, as signals are; only the main thread writes to it


def interrupted() -> bool:
    """Whether Ctrl-C came, for code within `interruptible` that can stop by itself."""
    return _heard.asked and threading.current_thread() is threading.main_thread()


def _hear(number: int, frame: FrameType | None) -> None:
    again, _heard.asked = _heard.asked, True
    if again or not _heard.polled:
        raise KeyboardInterrupt


@contextlib.contextmanager
def interruptible(*, polled: bool = True) -> Iterator[None]:
    """A block that ends in KeyboardInterrupt if Ctrl-C came inside it and became an error there, or nothing at all.

    Only the main thread receives signals, and a handler that somebody else has installed is left alone.

    Parameters
    ----------
    polled : bool
        The block asks `interrupted` now and then: the first Ctrl-C raises nothing before its end, a second one does at once.
        False, for a whole command: every Ctrl-C raises at once, and the command may end well after it.
    """
    handler = signal.getsignal(signal.SIGINT) if threading.current_thread() is threading.main_thread() else None
    if handler not in (signal.default_int_handler, end_at_once, _hear):
        yield
        return
    outermost = handler is not _hear
    if outermost:
        _heard.asked = False
        signal.signal(signal.SIGINT, _hear)
    elif _heard.asked:  # swallowed before the block began
        raise KeyboardInterrupt
    outer, _heard.polled = _heard.polled, polled
    try:
        yield
    except Exception:
        if _heard.asked:  # what became of the interruption
            raise KeyboardInterrupt from None
        raise
    finally:
        _heard.polled = outer
        if outermost:
            signal.signal(signal.SIGINT, handler)
    if _heard.asked and polled:
        raise KeyboardInterrupt
