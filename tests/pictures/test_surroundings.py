"""Pictures are drawn whatever backend and style the surroundings name, and change neither."""

import os
import subprocess
import sys

import matplotlib
import pytest

from colloc.pictures.style import save as save_figure
from colloc.results.store import save

DRAW = """
import sys
from colloc.commands.main import main
sys.exit(max(main(words.split()) for words in sys.argv[1:]))
"""
COMMANDS = (
    "report one.h5",
    "animate one.h5 --periods 1 --seconds 0.2 --width 200",
    "robot one.h5 --length 1 --mass 1 --period 4 --figure",
)


def python(code, *words, folder=None, **environment):
    whole = {**os.environ, **environment}
    return subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, env=whole, cwd=folder)


@pytest.mark.parametrize(("backend", "commands"), [("no_such_name", COMMANDS), ("module://no.such_name", COMMANDS[2:])])
def test_commands_draw_where_the_environment_names_a_backend_that_there_is_not(backend, commands, three_link, tmp_path):
    """A notebook's terminal does: module://matplotlib_inline.backend_inline."""
    save(three_link, tmp_path / "one.h5")
    done = python(DRAW, *commands, folder=tmp_path, MPLBACKEND=backend)
    assert (done.returncode, done.stderr) == (0, "")
    drawn = {"one.html", "one.gif", "one.robot.png"} if len(commands) > 1 else {"one.robot.png"}
    assert {path.name for path in tmp_path.iterdir()} == {"one.h5", *drawn}


@pytest.mark.parametrize("before", ["", "matplotlib, "])
def test_a_backend_that_there_is_stays(before):
    code = f"import os, {before}colloc.pictures, matplotlib; print(matplotlib.rcParams['backend'], os.environ['MPLBACKEND'])"
    assert python(code, MPLBACKEND="svg").stdout == "svg svg\n"


def test_a_style_that_cannot_be_drawn_with_is_of_no_account_and_stays(three_link, tmp_path):
    with matplotlib.rc_context({"text.usetex": True, "figure.figsize": (1.0, 1.0), "font.family": "no such font"}):
        mine = dict(matplotlib.rcParams)
        drawn = save_figure(three_link.plot(), tmp_path / "styled", ("png",))
        assert dict(matplotlib.rcParams) == mine
    usual = save_figure(three_link.plot(), tmp_path / "usual", ("png",))
    assert drawn[0].read_bytes() == usual[0].read_bytes()
