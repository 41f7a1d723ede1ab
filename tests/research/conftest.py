"""What is proved is compiled as C++, which a compiler of C need not know."""

import subprocess
from functools import cache

import pytest

from research.guarantee.c_compiler import c_compiler


@cache
def knows_cpp():
    compiler = c_compiler()
    if compiler is None:
        return False
    command = [compiler, "-x", "c++", "-fsyntax-only", "-"]
    return (
        subprocess.run(
            command, input=b"#include <cmath>\n", capture_output=True, check=False
        ).returncode
        == 0
    )


@pytest.fixture(autouse=True)
def compiler():
    if not knows_cpp():
        pytest.skip("no C++ compiler")
