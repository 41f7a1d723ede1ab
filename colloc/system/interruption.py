"""Ctrl-C, which compiled code would swallow or turn into another error: it is remembered, and stays
an interruption.

CasADi reports a KeyboardInterrupt inside a callback on standard error, in nine lines, and lets
IPOPT end as if a function had failed. So a solve is not interrupted by an exception: it asks
between iterations whether to stop (`interrupted`).
"""

from __future__ import annotations

import _thread
import contextlib
import ctypes
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from dataclasses import dataclass
from types import FrameType
from typing import Any

from colloc.system.early_interruption import end_at_once


@dataclass
class _Heard:
    """Whether Ctrl-C came since the outermost block began, and whether the code that runs asks for
    it by itself."""

    asked: bool = False
    polled: bool = False


_heard = _Heard()  # of the process, as signals are; only the main thread writes to it
_DEADLINE: ContextVar[float] = ContextVar("deadline", default=float("inf"))


def interrupted() -> bool:
    """Whether Ctrl-C came, or a `time_limit` is over, for code within `interruptible` that can stop
    by itself."""
    return (_heard.asked and _in_main_thread()) or _time_is_over()


def _time_is_over() -> bool:
    return time.monotonic() > _DEADLINE.get()


def heeded() -> None:
    """Say that what an interrupt asked for was done: the process goes on."""
    if _in_main_thread():
        _heard.asked = False


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


@contextlib.contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """A block that ends in KeyboardInterrupt, as by Ctrl-C, when so many seconds are over.

    It does so wherever the block is, in the main thread if `interruptible` is around it; compiled
    code that calls Python has to ask `interrupted`.
    """
    if seconds == float("inf"):
        yield
        return
    token = _DEADLINE.set(time.monotonic() + seconds)
    # signals reach the main thread alone
    here = None if _in_main_thread() else threading.get_ident()
    timer = threading.Timer(
        seconds, _again if here is None else lambda: _raise_in(here, KeyboardInterrupt)
    )
    timer.daemon = True
    try:
        try:
            timer.start()  # where it is over at once, this is where it comes
            yield
        finally:
            try:
                timer.cancel()
                if timer.is_alive():
                    timer.join()
            except KeyboardInterrupt:
                # Sent to a thread whose block had just ended. It has to come: CPython 3.11 looks
                # for a withdrawn one for ever, and a profiler or debugger that is switched on later
                # stands still at the first function.
                if here is None:
                    raise
    finally:
        _DEADLINE.reset(token)


def _raise_in(thread: int, error: type[BaseException]) -> None:
    """Let an exception come in a thread as soon as it runs Python."""
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(error))


def _hear(number: int, frame: FrameType | None) -> None:
    again, _heard.asked = _heard.asked, True
    if again or not _heard.polled:
        raise KeyboardInterrupt


_MOMENT = 0.01


def _again() -> None:
    if signal.getsignal(signal.SIGINT) is not _hear:
        return  # what was to be interrupted has ended
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:  # a main thread that sleeps hears this when it wakes up
        _thread.interrupt_main()


def _hushed(before: Callable[[Any], object]) -> Callable[[Any], object]:
    """What to do with exceptions that Python cannot raise, as in a weak reference's callback, where
    Ctrl-C may fall too.

    Python would print it and go on; so it comes again a moment later, without a word.
    """

    def hook(unraisable: Any) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            before(unraisable)
            return
        timer = threading.Timer(_MOMENT, _again)
        timer.daemon = True
        timer.start()

    return hook


@contextlib.contextmanager
def interruptible(*, polled: bool = True) -> Iterator[None]:
    """A block that ends in KeyboardInterrupt if Ctrl-C came inside it and became an error there, or
    nothing at all.

    Only the main thread receives signals, and a handler that somebody else has installed is left
    alone.

    Parameters
    ----------
    polled : bool
        The block asks `interrupted` now and then: the first Ctrl-C raises nothing before its end, a
        second one does at once. False, for a whole command: every Ctrl-C raises at once, and the
        command may end well after it.
    """
    handler = signal.getsignal(signal.SIGINT) if _in_main_thread() else None
    if handler not in (signal.default_int_handler, end_at_once, _hear):
        yield
        if polled and _time_is_over():
            raise KeyboardInterrupt
        return
    outermost = handler is not _hear
    if outermost:
        _heard.asked = False
        unraisable, sys.unraisablehook = sys.unraisablehook, _hushed(sys.unraisablehook)
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
            sys.unraisablehook = unraisable
    if _heard.asked and polled:
        raise KeyboardInterrupt
