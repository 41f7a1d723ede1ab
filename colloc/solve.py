"""``python -m colloc.solve problems/three_link.py``: the same as ``colloc solve``."""

import sys

from colloc.commands.solve import main

if __name__ == "__main__":
    sys.exit(main())
