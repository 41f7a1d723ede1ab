"""Compiled code under the address sanitizer."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from research.guarantee.c_compiler import c_compiler

ROOT = Path(__file__).resolve().parents[2]


def stays_within_its_arrays(code):
    """Run Python that has its C compiled with the sanitizer, in a process of its own."""
    found = subprocess.run(
        [c_compiler(), "-print-file-name=libasan.so"], capture_output=True, text=True
    ).stdout.strip()
    if not os.path.isabs(found):
        pytest.skip("the compiler has no address sanitizer")
    own = {"LD_PRELOAD": found, "ASAN_OPTIONS": "detect_leaks=0"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **own},
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-2000:]
