"""``python -m colloc``: the same as the command ``colloc``."""

import sys

from colloc.commands.main import main

sys.exit(main())
