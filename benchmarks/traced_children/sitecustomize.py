"""Found first by the Python programs that a test starts: they write down what they call of colloc (`benchmarks.reach`)."""

import os
import sys
import threading
from types import CodeType, FrameType

_FILE, _LIBRARY = os.environ.get("COLLOC_REACH", ""), os.environ.get("COLLOC_REACH_IN", "")
_known: set[CodeType] = set()


def _called(frame: FrameType, event: str, argument: object) -> None:
    code = frame.f_code
    if code in _known:
        return
    _known.add(code)
    if code.co_filename.startswith(_LIBRARY):
        # at once, as a test may kill the program
        with open(_FILE, "a", encoding="utf-8") as calls:
            calls.write(f"colloc/{code.co_filename.removeprefix(_LIBRARY)}::{code.co_qualname}*\n")


if _FILE:
    threading.settrace(_called)
    sys.settrace(_called)
