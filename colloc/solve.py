"""``python -m colloc.solve problems/three_link.py``: the same as ``colloc solve``.

Importing this module makes it the attribute ``solve`` of the package, where `colloc.solve(problem)` is expected. So it can be
called, and is that function.
"""

import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Any

from colloc.commands.main import main as colloc


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``colloc solve``; returns the exit code."""
    return colloc(["solve", *(sys.argv[1:] if arguments is None else arguments)])


class _Callable(ModuleType):
    def __call__(self, *given: Any, **named: Any) -> Any:
        from colloc.studies.calls import solve

        return solve(*given, **named)


sys.modules[__name__].__class__ = _Callable

if __name__ == "__main__":
    sys.exit(main())
