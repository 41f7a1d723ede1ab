"""Pictures are drawn whatever backend and style the surroundings name, and change neither."""

import os
import subprocess
import sys

import matplotlib
import pytest

from colloc import save
from colloc.pictures.style import save as save_figure

COMMANDS = ("report one.h5", "animate one.h5 --periods 1 --seconds 0.2 --width 200")


def python(*words, folder=None, **environment):
    how = {"capture_output": True, "text": True, "env": os.environ | environment, "cwd": folder}
    done = subprocess.run([sys.executable, *words], **how)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_draw_where_the_environment_names_a_backend_that_there_is_not(
    command, three_link, tmp_path
):
    """A notebook's terminal does: module://matplotlib_inline.backend_inline."""
    save(three_link, tmp_path / "one.h5")
    python("-m", "colloc", *command.split(), folder=tmp_path, MPLBACKEND="no_such_name")
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    ("before", "backend"), [("", "module://no.such_name"), ("matplotlib, ", "svg")]
)
def test_a_script_draws_whatever_backend_is_named_and_one_that_there_is_stays(
    before, backend, three_link, tmp_path
):
    save(three_link, tmp_path / "one.h5")
    drawn = f"import os, {before}colloc; colloc.load('one.h5').plot().savefig('one.png')"
    asked = "print(matplotlib.rcParams['backend'] == 'svg', os.environ['MPLBACKEND'])"
    script = f"{drawn}; import matplotlib; {asked}"
    said = python("-c", script, folder=tmp_path, MPLBACKEND=backend)
    assert (tmp_path / "one.png").exists()
    assert said == f"{backend == 'svg'} {backend}\n"


def test_a_style_that_cannot_be_drawn_with_is_of_no_account_and_stays(three_link, tmp_path):
    with matplotlib.rc_context(
        {"text.usetex": True, "figure.figsize": (1.0, 1.0), "font.family": "no such font"}
    ):
        mine = dict(matplotlib.rcParams)
        drawn = save_figure(three_link.plot(), tmp_path / "styled", ("png",))
        assert dict(matplotlib.rcParams) == mine
    usual = save_figure(three_link.plot(), tmp_path / "usual", ("png",))
    assert drawn[0].read_bytes() == usual[0].read_bytes()
