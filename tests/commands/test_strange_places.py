"""Where people run it: without a home, a language or a place to keep code; odd folders, names and
file masks; old files."""

import os
import subprocess
import sys

import casadi
import pytest

from colloc import load, save

QUICK = """# Länge der Schlange: µ_t = 1
from colloc import *
PROBLEM = Problem("quick", ellipse(0.0, 1.4, 0.8), gait=Harmonic(1, "bilateral"), delta=0.3, delta_start=0.3, intervals=12)
"""
pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="POSIX environments and permissions"
)


def run(words, without=(), **environment):
    """``colloc`` in a process of its own whose environment has been changed."""
    kept = {name: value for name, value in os.environ.items() if name not in without}
    return subprocess.run(
        [sys.executable, "-m", "colloc", *map(str, words)],
        capture_output=True,
        env=kept | environment,
    )


@pytest.fixture
def place(tmp_path):
    """A folder with blanks and letters beyond ASCII in its name, and a problem in it."""
    folder = tmp_path / "a földer, 名前"
    folder.mkdir()
    (folder / "quick.py").write_text(QUICK, encoding="utf-8")
    return folder


NO_LANGUAGE = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"}
# CasADi before 3.8 ends the process where Python cannot read the name of the folder that it is in
if casadi.__file__.isascii() or [*map(int, casadi.__version__.split(".")[:2])] >= [3, 8]:
    NO_LANGUAGE["PYTHONUTF8"] = "0"
NO_CACHE = {"XDG_CACHE_HOME": "/proc/nowhere", "MPLCONFIGDIR": "/proc/nowhere"}
OF_A_USER = ("HOME", "USER", "LOGNAME", "XDG_CACHE_HOME", "LANG")


def solved_and_verified(place, words, without, environment):
    done = run(
        ["solve", place / "quick.py", "--output", f"{place}/", *words], without, **environment
    )
    assert done.returncode in (0, 4), done.stderr
    assert b"Traceback" not in done.stderr
    result = next(place.glob("quick*.h5"))
    assert load(result).source == QUICK
    checked = run(["verify", result], without, **environment)
    assert checked.returncode == done.returncode
    slowly = b"colloc: the balance is solved by NumPy, 10 to 60 times more slowly: "
    assert checked.stderr == b"" or (
        checked.stderr.startswith(slowly) and checked.stderr.count(b"\n") == 1
    )


def test_a_solve_needs_nothing_of_the_user(place):
    solved_and_verified(
        place, ["--no-figure"], OF_A_USER, {**NO_LANGUAGE, "PYTHONIOENCODING": "cp1252"}
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("without", "environment"),
    [((), NO_LANGUAGE), ((), {"PYTHONIOENCODING": "cp1252"}), (OF_A_USER, {}), ((), NO_CACHE)],
    ids=["no language", "Windows letters", "no home", "no cache"],
)
def test_nor_does_a_figure(without, environment, place):
    solved_and_verified(place, [], without, environment)


@pytest.mark.slow
def test_text_files_are_utf_8_whatever_the_language(place, three_link):
    result = save(three_link, place / "Länge.h5")
    for words, name in (
        (["export", result, "--period", "4"], "*.csv"),
        (["report", result], "*.html"),
    ):
        done = run([*words, "--output", f"{place}/"], **NO_LANGUAGE)
        assert done.returncode == 0, done.stderr
        (written,) = place.glob(name)
        written.read_text(encoding="utf-8")


def test_a_name_as_long_as_systems_allow_is_kept(three_link, tmp_path):
    # 203 bytes; with those of the temporary file below 255
    path = save(three_link, tmp_path / ("ä" * 100 + ".h5"))
    assert load(path).certificate == three_link.certificate
