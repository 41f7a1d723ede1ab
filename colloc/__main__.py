"""``python -m colloc`` and the command ``colloc``."""

import os
import sys
from collections.abc import Sequence

from colloc.system.early_interruption import leave, listen


def start(arguments: Sequence[str] | None = None) -> None:
    """Run a command as a process of its own: Ctrl-C is heard from here on, while everything else is
    imported."""
    listen()
    os.environ["MPLBACKEND"] = (
        "Agg"  # the one of a notebook's terminal may not be installed, and none is drawn with
    )
    from colloc.commands.main import main

    leave(main(sys.argv[1:] if arguments is None else arguments))


if __name__ == "__main__":
    start()
