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
    quiet = {"capture_output": True, "text": True}
    asked = [c_compiler(), "-print-file-name=libasan.so"]
    library = subprocess.run(asked, **quiet).stdout.strip()
    if not os.path.isabs(library):
        pytest.skip("the compiler has no address sanitizer")
    environment = {**os.environ, "LD_PRELOAD": library, "ASAN_OPTIONS": "detect_leaks=0"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, cwd=ROOT, **quiet)
    assert done.returncode == 0, done.stderr[-2000:]
