"""``python -m colloc.solve problems/three_link.py``: the same as ``colloc solve``."""

import sys
from collections.abc import Sequence

from colloc.commands.main import main as colloc


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``colloc solve``; returns the exit code."""
    return colloc(["solve", *(sys.argv[1:] if arguments is None else arguments)])


if __name__ == "__main__":
    sys.exit(main())
