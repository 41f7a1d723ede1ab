"""What is proved is compiled as C++, which a compiler of C need not know."""

import subprocess
from functools import cache

import pytest

from research.guarantee.c_compiler import c_compiler


@cache
def knows_cpp():
    command = [c_compiler(), "-x", "c++", "-fsyntax-only", "-"]
    if command[0] is None:
        return False
    return not subprocess.run(command, input=b"#include <cmath>\n", capture_output=True).returncode


@pytest.fixture(autouse=True)
def compiler():
    if not knows_cpp():
        pytest.skip("no C++ compiler")
