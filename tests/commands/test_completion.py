"""Shells complete commands, options and their values by the protocol of argcomplete."""

import os
import subprocess
import sys

import pytest

pytest.importorskip("argcomplete")


@pytest.fixture
def completed(tmp_path):
    """A function from a line, with the cursor at its end, to what a shell may put there."""

    def ask(line):
        answer = tmp_path / "answer"
        protocol = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line.encode()))}
        protocol |= {"_ARGCOMPLETE_STDOUT_FILENAME": str(answer), "_ARGCOMPLETE_IFS": "\n"}
        run = [sys.executable, "-m", "colloc"]
        ended = subprocess.run(run, env={**os.environ, **protocol}, cwd=tmp_path, check=True,
                               capture_output=True)  # fmt: skip
        assert ended.stdout == b""
        return {word.strip() for word in answer.read_text(encoding="utf-8").splitlines()}

    return ask


def test_a_command_an_option_a_value_and_a_file_are_completed(completed, tmp_path):
    (tmp_path / "mine.py").touch()
    assert completed("colloc s") == {"solve", "sweep", "steer", "sensitivity"}
    assert completed("colloc solve mine.py --delta") == {"--delta", "--delta-start"}
    assert completed("colloc animate x.h5 --format ") == {"gif", "mp4"}
    assert completed("colloc solve mi") == {"mine.py"}
    assert completed("colloc nothing --de") == set()
