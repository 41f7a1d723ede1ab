"""Ctrl-C and time limits.

CasADi would swallow a KeyboardInterrupt raised in a callback, so compiled solves poll
`is_interrupted` between iterations. Nothing slow is imported here.
"""

import _thread
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import FrameType
from typing import Any

INTERRUPTED = 130
_NOTHING = "interrupted; nothing was written."
_MOMENT = 0.01  # seconds after which Ctrl-C that Python could not raise comes again
_DEADLINE: ContextVar[float] = ContextVar("deadline", default=float("inf"))
_requested = False  # Ctrl-C came since the outermost `interruptible` began
_polled = False  # the innermost `interruptible` polls


def end_at_once(number: int, frame: FrameType | None) -> None:
    """Handle Ctrl-C in a process that has nothing to lose: one line, and an exit code."""
    if "--json" in sys.argv:
        line = f'{{"status": "interrupted", "message": "{_NOTHING}", "exit_code": {INTERRUPTED}}}\n'
        os.write(1, line.encode())
    os.write(2, f"colloc: {_NOTHING}\n".encode())
    os._exit(INTERRUPTED)


def is_interrupted() -> bool:
    """True if code within `interruptible` should stop: Ctrl-C, or the end of a `time_limit`."""
    return (_requested and _in_main_thread()) or time.monotonic() > _DEADLINE.get()


def clear_interrupt() -> None:
    """Go on after an interrupt that has been dealt with."""
    global _requested
    if _in_main_thread():
        _requested = False


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Interrupt the block after so many seconds: as by Ctrl-C in the main thread within
    `interruptible`; in other threads where the block polls `is_interrupted`."""
    if seconds == float("inf"):
        yield
        return
    token = _DEADLINE.set(time.monotonic() + seconds)
    timer = threading.Timer(seconds, _press_again)
    timer.daemon = True
    try:
        try:
            if _in_main_thread():  # which alone receives signals
                timer.start()
            yield
        finally:
            timer.cancel()
            if timer.is_alive():
                timer.join()  # what it sends arrives here
    finally:
        _DEADLINE.reset(token)


def _handle(number: int, frame: FrameType | None) -> None:
    global _requested
    again, _requested = _requested, True
    if again or not _polled:
        raise KeyboardInterrupt


def _press_again() -> None:
    if signal.getsignal(signal.SIGINT) is not _handle:
        return  # the block has ended
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:
        _thread.interrupt_main()


def _unraisable(before: Callable[[Any], object]) -> Callable[[Any], object]:
    """Have Ctrl-C in a weak reference's callback, where Python cannot raise it, come again."""

    def hook(unraisable):
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            before(unraisable)
            return
        timer = threading.Timer(_MOMENT, _press_again)
        timer.daemon = True
        timer.start()

    return hook


@contextmanager
def interruptible(*, polled: bool = True) -> Iterator[None]:
    """End the block in KeyboardInterrupt if Ctrl-C came inside, also where it became another error.

    With `polled` the block asks `is_interrupted` now and then: a first Ctrl-C raises at its end, a
    second one at once. Otherwise every Ctrl-C raises at once. Handlers of others are left alone.
    """
    global _requested, _polled
    handler = signal.getsignal(signal.SIGINT) if _in_main_thread() else None
    if handler not in (signal.default_int_handler, end_at_once, _handle):
        yield
        if polled and time.monotonic() > _DEADLINE.get():
            raise KeyboardInterrupt
        return
    outermost, hook = handler is not _handle, sys.unraisablehook
    if outermost:
        _requested = False
        sys.unraisablehook = _unraisable(hook)
        signal.signal(signal.SIGINT, _handle)
    elif _requested:  # swallowed before the block began
        raise KeyboardInterrupt
    outer, _polled = _polled, polled
    try:
        yield
    except Exception:
        if _requested:
            raise KeyboardInterrupt from None
        raise
    finally:
        _polled = outer
        if outermost:
            signal.signal(signal.SIGINT, handler)
            sys.unraisablehook = hook
    if _requested and polled:
        raise KeyboardInterrupt
