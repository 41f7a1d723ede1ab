"""Ctrl-C in the first moments of a command, while Python still imports: one line and an exit code,
no traceback.

Nothing is imported here that Python has not loaded by itself.
"""

import os
import signal
import sys

INTERRUPTED = 130
_MESSAGE = "interrupted; nothing was written."


def end_at_once(number: int, frame: object) -> None:
    """A handler of Ctrl-C for a process that has nothing to lose."""
    if "--json" in sys.argv:
        os.write(
            1,
            f'{{"status": "interrupted", "message": "{_MESSAGE}", "exit_code": '
            f"{INTERRUPTED}}}\n".encode(),
        )
    os.write(2, f"colloc: {_MESSAGE}\n".encode())
    os._exit(INTERRUPTED)


def listen() -> None:
    """End the process in one line at Ctrl-C from now on, until
    `colloc.system.interruption.interruptible` takes over."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, end_at_once)


def leave(code: int) -> None:
    """End the process with an exit code; what Ctrl-C meets from now on is done, and ends with the
    same code."""
    if signal.getsignal(signal.SIGINT) is end_at_once:
        signal.signal(signal.SIGINT, lambda number, frame: os._exit(code))
    # Python ends a process by the signal itself if text that it executed was once interrupted, as
    # that of dataclasses is; it forgets that at the next text
    exec("")
    sys.exit(code)
