"""Every command in a terminal, to its end, as a person runs it: there progress is shown, and
nowhere else."""

import re
import sys

import numpy as np
import pytest

import colloc
from colloc.commands.main import SUBCOMMANDS
from colloc.commands.main import main as run
from tests.shared.terminal import run_in_terminal, screen

pytest.importorskip("pty")
QUICK = """
from colloc import *
PROBLEM = Problem("quick", ellipse(0.0, 2.8, 1.3), gait=Harmonic(1, "bilateral"), delta=1e-2, delta_start=1e-2)
"""
STUDY = """
from colloc import *
STUDY = Study(
    "few",
    (Axis("mu_t", (1.0,)),),
    lambda mu_t: Problem("few", friction=Friction(mu_t=mu_t), gait=Harmonic(1), delta=1e-2, delta_start=1e-2),
    cold_starts=1,
)
"""
ALSO = ["multistart quick.starts.h5 --start 0", "verify quick.h5 --compare quick.h5"]
COMMANDS = {
    "init": "new.py --links 3",
    "solve": "quick.py --starts 3 --output again.h5",
    "multistart": "quick.py --starts 1",
    "sweep": "study.py",
    "pareto": "quick.py --points 2 --starts 1",
    "steer": "quick.py --turn 0 5 --starts 1",
    "evaluate": "quick.py quick.csv",
    "identify": "quick.py path.csv",
    "verify": "quick.h5",
    "report": "quick.h5",
    "animate": "quick.h5 --periods 1 --seconds 0.2 --width 200",
    "export": "quick.h5 --period 4 --output other.csv",
    "robot": "quick.h5 --length 1 --mass 1 --period 4 --figure",
    "sensitivity": "quick.h5",
}
LONG = ("sweep", "multistart", "pareto")
CLOCK = re.compile(r"   \d+ s(, about \d+ s left)?$")
"""How a line of progress ends."""


@pytest.fixture(scope="session")
def quick(tmp_path_factory):
    """A folder with a problem, its solution, an archive of starts, joint angles and a study."""
    folder = tmp_path_factory.mktemp("quick")
    (folder / "quick.py").write_text(QUICK, encoding="utf-8")
    (folder / "study.py").write_text(STUDY, encoding="utf-8")
    solution = colloc.solve(folder / "quick.py", starts=1, output=folder / "quick.h5")
    colloc.multistart(solution.problem, 1, archive=folder / "quick.starts.h5")
    assert run(["export", f"{folder}/quick.h5", "--period", "4", "--quiet"]) == 0
    motion = solution.sample(t := np.arange(50) / 50)
    rows = np.column_stack([t, *motion.angles, *motion.centre])
    names = "t,joint_1,joint_2,x,y"
    np.savetxt(folder / "path.csv", rows, delimiter=",", header=names, comments="")
    return folder


def shown(words, folder, code=0, **environment):
    """What stands on the screen after a program, which ends with that exit code, hides no cursor
    and leaves no progress."""
    ended, written = run_in_terminal([sys.executable, "-m", *words], folder, **environment)
    lines, cursor = screen(written)
    assert ended == code, written
    assert "Traceback" not in written
    assert cursor
    assert not [line for line in lines if CLOCK.search(line)]
    return "\n".join(lines), written


def place(quick, folder, *names):
    """Some files of the folder, in a new one."""
    for name in names:
        (folder / name).write_bytes((quick / name).read_bytes())
    return folder


def test_no_command_is_left_out():
    assert COMMANDS.keys() == SUBCOMMANDS.keys()


CASES = (
    pytest.param(f"{name} {words}", id=name, marks=[pytest.mark.slow] * (name in LONG))
    for name, words in COMMANDS.items()
)


@pytest.mark.parametrize("words", [*CASES, *ALSO])
def test_every_command_ends_well_in_a_terminal(words, quick, tmp_path):
    place(quick, tmp_path, *(path.name for path in quick.iterdir() if path.is_file()))
    shown(["colloc", *words.split()], tmp_path)


def test_the_first_command_of_the_readme_shows_how_far_it_is_and_then_the_answer_alone(
    quick, tmp_path
):
    place(quick, tmp_path, "quick.py")
    said, written = shown(["colloc.solve", "quick.py"], tmp_path)
    assert "quick: explore, 0 of 32; best d/W = 0." in written
    assert "quick: certify, 0 of 1; best d/W = 0." in written
    assert " left" not in written  # nobody knows how many starts will be enough
    assert said.startswith("quick: solved in ")
    assert said.rstrip().endswith("saved results/quick.h5, results/quick.png")
