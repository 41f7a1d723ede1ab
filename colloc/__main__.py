"""``python -m colloc`` and the command ``colloc``."""

import sys
from collections.abc import Sequence

from colloc.system.early_interruption import leave, listen


def start(arguments: Sequence[str] | None = None) -> None:
    """Run a command as a process of its own: Ctrl-C is heard from here on, while everything else is imported."""
    listen()
    from colloc.commands.main import main

    leave(main(sys.argv[1:] if arguments is None else arguments))


if __name__ == "__main__":
    start()
