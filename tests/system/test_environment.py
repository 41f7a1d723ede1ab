"""How many processors and threads a process uses."""

import os
import subprocess
import sys

PROGRAM = """
import os
from colloc.system.environment import one_thread_each
one_thread_each()
print(os.environ["OPENBLAS_NUM_THREADS"])
"""


def said(environment):
    return subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
    ).stdout.strip()


def test_linear_algebra_uses_one_thread_unless_the_environment_says_otherwise():
    bare = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    assert said(bare) == "1"
    assert said({**bare, "OPENBLAS_NUM_THREADS": "3"}) == "3"
