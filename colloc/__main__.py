"""``python -m colloc``: the same as the command ``colloc``."""

import sys

from colloc.command import main

sys.exit(main())
