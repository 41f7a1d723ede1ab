"""Every file of problems/ does what it says, through the command that takes it."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAMES = sorted(path.stem for path in (ROOT / "problems").glob("*.py") if path.stem != "__init__")


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_problem_file_is_solved_by_its_command(name, tmp_path):
    file = ROOT / "problems" / f"{name}.py"
    command = ["-m", "colloc", "solve", str(file), "--output", f"{tmp_path}/"]
    saved = re.escape(f"saved {tmp_path}/{name}.h5, {tmp_path}/{name}.png")
    heading = rf"{name}: solved in [\d.]+ s( \([^\n]*\))?\n"
    value = r"  (efficiency d/W|speed d/L|turning θ/W|towing d²/W) +\d+\.\d+ "
    # scripts are no part of what is installed
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, *command],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert re.search(rf"{heading}{value}(.|\n)*{saved}\n$", done.stdout), done.stdout
    assert "Traceback" not in done.stderr
