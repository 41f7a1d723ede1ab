"""``python -m colloc.solve problems/three_link.py`` is ``colloc solve``.

Importing this module makes it the attribute ``colloc.solve``, so it can be called as that function.
"""

import sys
from types import ModuleType

from colloc.__main__ import start


class _Callable(ModuleType):
    def __call__(self, *given: object, **named: object) -> object:
        from colloc.studies.solve import solve
        from colloc.system.arguments import checked_arguments

        return checked_arguments(solve)(*given, **named)  # type: ignore[arg-type]


sys.modules[__name__].__class__ = _Callable

if __name__ == "__main__":
    start(["solve", *sys.argv[1:]])
