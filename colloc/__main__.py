"""``python -m colloc`` and the command ``colloc``."""

import os
import signal
import sys
from collections.abc import Sequence

from colloc.system.interruption import end_at_once


def start(arguments: Sequence[str] | None = None) -> None:
    """Run a command as a process of its own; Ctrl-C is handled during its imports."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, end_at_once)
    os.environ["MPLBACKEND"] = "Agg"  # a notebook's backend may not be installed
    from colloc.commands.main import main

    code = main(sys.argv[1:] if arguments is None else arguments)
    if signal.getsignal(signal.SIGINT) is end_at_once:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # what it would end is done
    exec("")  # else CPython ends by the signal where Ctrl-C once fell into executed text
    sys.exit(code)


if __name__ == "__main__":
    start()
