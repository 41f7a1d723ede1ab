"""``python -m colloc.solve problems/three_link.py``: the same as ``colloc solve``.

Importing this module makes it the attribute ``solve`` of the package, where `colloc.solve(problem)`
is expected. So it can be called, and is that function.
"""

import sys
from types import ModuleType

from colloc.__main__ import start


class _Callable(ModuleType):
    def __call__(self, *given: object, **named: object) -> object:
        from colloc.studies.calls import solve

        return solve(*given, **named)  # type: ignore[arg-type]


sys.modules[__name__].__class__ = _Callable

if __name__ == "__main__":
    start(["solve", *sys.argv[1:]])
