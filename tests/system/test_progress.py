"""What a person sees while they wait, and a log does not; every command in a terminal, to its end."""

import io
import re
import sys
import time

import numpy as np
import pytest

import colloc
from colloc.commands.main import SUBCOMMANDS
from colloc.commands.main import main as run
from colloc.system.progress import StatusLine, duration
from tests.shared.terminal import run_in_terminal, screen

WIPED = "\x1b[1A\x1b[2K"  # up to the line, and the line erased
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
LONG = ("sweep", "multistart", "pareto", "steer", "identify", "robot", "sensitivity", "report")
CLOCK = re.compile(r"   \d+ s(, about \d+ s left)?$")  # how a line of progress ends


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (59.4, "59 s"), (60, "1 min 00 s"), (3599, "59 min 59 s"), (7500, "2 h 05 min")],
)
def test_durations_are_for_people(seconds, text):
    assert duration(seconds) == text


def test_the_line_says_what_and_how_long_and_vanishes():
    stream = Terminal()
    with StatusLine(stream) as line:
        line.say("solving", left=20.0)
        line.say("drawing")
    printed = stream.getvalue()
    assert "solving   0 s, about 20 s left" in printed
    assert "drawing   0 s" in printed
    # nothing is foretold of the drawing
    assert printed.count(" left") == printed.count("about 20 s left")
    assert printed.endswith(WIPED)


@pytest.mark.parametrize("left", [float("inf"), float("nan"), 0.0, -3.0])
def test_a_time_that_nobody_knows_is_not_told(left):
    stream = Terminal()
    with StatusLine(stream) as line:
        line.say("solving", left)
    assert "solving   0 s" in stream.getvalue()
    assert "left" not in stream.getvalue()


def test_what_is_printed_in_between_stands_on_a_line_of_its_own():
    stream = Terminal()
    with StatusLine(stream) as line:
        line.say("0 of 2 [starts]")
        line.clear()
        stream.write("a row\n")
        line.say("1 of 2 [starts]")
    before, after = stream.getvalue().split("a row\n")
    assert before.endswith(WIPED)
    assert "0 of 2 [starts]   0 s" in before
    assert "1 of 2 [starts]   0 s" in after
    assert after.endswith(WIPED)


def test_a_warning_while_the_line_is_shown_stands_on_a_line_of_its_own(monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := Terminal())
    with StatusLine() as line:
        line.say("solving")
        print("colloc: the disk is full", file=sys.stderr)
        line.say("drawing")
    lines, cursor = screen(stream.getvalue().replace("\n", "\r\n"))
    assert [line for line in lines if line] == ["colloc: the disk is full"]
    assert cursor


def test_the_line_ticks_by_itself_and_the_time_left_falls():
    stream = Terminal()
    with StatusLine(stream) as line:
        line.say("solving", left=20.0)
        time.sleep(1.3)
    assert "1 s, about 19 s left" in stream.getvalue()


def test_nothing_is_written_where_nobody_watches():
    log, muted = io.StringIO(), Terminal()
    for line in (StatusLine(log), StatusLine(muted, enabled=False)):
        with line:
            line.say("solving", left=3.0)
            line.clear()
    assert log.getvalue() == ""
    assert muted.getvalue() == ""


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
    """The screen after a program that ends with this code, its cursor seen and no progress left."""
    pytest.importorskip("pty")
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
    said, _ = shown(["colloc", *words.split()], tmp_path)
    if words.startswith("steer"):  # five degrees of a circle
        (line,) = (line for line in said.splitlines() if "+5.00°" in line)
        radius, chord, work, efficiency = map(float, re.findall(r"\d+\.\d{4,}", line))
        assert chord == pytest.approx(2 * radius * np.sin(np.radians(2.5)), rel=1e-4)
        assert efficiency == pytest.approx(chord / work, rel=1e-4)


def test_the_first_command_of_the_readme_shows_how_far_it_is_then_the_answer(quick, tmp_path):
    place(quick, tmp_path, "quick.py")
    said, written = shown(["colloc.solve", "quick.py"], tmp_path)
    assert "quick: explore, 0 of 32; best d/W = 0." in written
    assert "quick: certify, 0 of 1; best d/W = 0." in written
    assert " left" not in written  # nobody knows how many starts will be enough
    assert said.startswith("quick: solved in ")
    assert said.rstrip().endswith("saved results/quick.h5, results/quick.png")
