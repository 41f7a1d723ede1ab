"""For every command alike: refusals in one sentence or one JSON object, help, completion, codes."""

import json
import os
import subprocess
import sys

import pytest

from colloc import ProblemError, save
from colloc.commands.main import SUBCOMMANDS
from colloc.commands.main import main as colloc
from colloc.search.options import Tolerances

PROBLEM = "from colloc import *\nPROBLEM = Problem('quick', gait=Harmonic(1, 'bilateral'))\n"
STUDY = """from colloc import *
STUDY = Study("quick", (Axis("mu_t", (1, 2)),), lambda mu_t: Problem("q", friction=Friction(mu_t=mu_t)))
"""
GOOD = """
from colloc import *
PROBLEM = Problem(name="quick", gait=Harmonic(1, "bilateral"), guess=ellipse(0.0, 1.4, 0.8),
                  delta=0.3, delta_start=0.3, intervals=12, mesh_tolerance=1e-4)
"""


CHANGES = {"delta": 0.01, "delta_start": 0.2, "intervals": 30, "mesh_tolerance": 1e-3}
CHANGES |= {"scheme": "gauss-2", "formulation": "implicit velocity"}
REFUSED = """
init | nowhere/below.py | new.py --links x
init x.txt -> end in .py
init problem.py -> is there already
init a,b.py -> letters, digits
init new.py --links 2 -> 3 to 12
init new.py --feet 99 -> colloc: body.feet must be 0 (a line) to 20
init | new.py --links 1 1e-9 1
solve | folder.py | fails.py | empty.py | text.h5 | problem.py --delta nan | problem.py --starts 0 | problem.py --seconds 0 | problem.py --search no
solve nope.py -> there is no problem file
solve good.h5 -> is a results file (HDF5), not a problem file
solve LONG -> there is no problem file
solve problem.py --delta x -> --delta must be a number, not 'x'
solve problem.py --delta 0 -> delta must be a positive finite number
solve problem.py --delta 1e-30 -> delta must be at least 1e-14
solve problem.py --mesh x -> --mesh must be a whole number, not 'x'
solve problem.py --mesh 1 -> mesh is too small
solve problem.py --scheme euler -> unknown scheme
solve problem.py --start nope.h5 -> there is no file
solve four.py --start good.h5 -> the gait of good.h5 cannot be the guess: guess has 2 joints
solve problem.py --start study.py -> not a readable colloc solution: it is no HDF5 file
solve problem.py --search full --starts 5 -> the full search is from the guess alone: starts must be 1, not 5
solve problem.py --output /proc/nowhere/x.h5 -> cannot
solve problem.py --output out.txt -> out.txt should end in .h5
solve problem.py --output LONG.h5 -> too long
solve problem.py --output LONG -> File name too long
solve problem.py --turbo -> unrecognized arguments: --turbo
multistart | nope.py | fails.py | problem.py --workers 0 | problem.py --sampler no
multistart problem.py --starts 0 -> --starts must be at least 1
multistart problem.py --time-limit 0 -> --time-limit must be positive, not 0
multistart | problem.py --seed -1 | problem.py --time-limit nan
multistart wave.py --quiet -> prescribed motion
pareto wave.py -> prescribed motion
multistart | nope.h5 | text.h5 | good.h5 --start 1 | problem.py --start 1
multistart good.h5 -> good.h5 is no archive of starts, or good.sqlite, which holds its rows, is not beside it
sweep | fails.py | problem.py | study.py --workers 0 | study.py --workers x
sweep nope.py -> there is no study file
sweep study.py --chunk 0 -> --chunk must be at least 1
sweep study.py --output z.h5 -> z.h5 should end in .nc; a folder of that name is written z.h5/
sweep study.py --output text.h5/x -> cannot write text.h5/x/quick.nc: Not a directory
verify | nope.h5 | text.h5 | problem.py | good.h5 --tolerance 0 | good.h5 --tolerance nan
verify good.h5 --compare good.h5 --tolerance 1e-8 --dry -> leave --tolerance, --dry out
verify LONG -> File name too long
verify | good.h5 --compare | good.h5 --compare nope.h5 | text.h5 --compare good.h5
report | nope.h5 | text.h5 | good.h5 --problem nope.py | good.h5 --period 1
report good.h5 --output x.htm -> x.htm should end in .html
animate | nope.h5 | text.h5 | good.h5 --periods 0 | good.h5 --seconds nan | good.h5 --fps 1e9 | good.h5 --width 5 | good.h5 --format avi
animate good.h5 --fps 0 -> --fps must be positive, not 0.0
animate good.h5 --from-rest -> has no inertia, and is under way at once
animate | good.h5 nope.h5 | good.h5 text.h5 | good.h5 good.h5 good.h5
animate good.h5 --output x.avi -> x.avi should end in .gif or .mp4
animate good.h5 --format mp4 --output x.gif -> x.gif should end in .mp4
export | nope.h5 | text.h5 | good.h5 | good.h5 --period 4 --rate nan | good.h5 --period 4 --mass 1
export | good.h5 --period 4 --max-speed 0 | good.h5 --period 4 --max-speed 1 2 3 | good.h5 --period 4 --periods 0
export good.h5 --format x -> --format must be one of 'csv', 'json', 'pulses', 'ros', 'c', 'mjcf', 'urdf', not 'x'
export good.h5 --format urdf -> state the robot's length [m], mass [kg] and period [s]
export good.h5 --length 1 --mass 3 --period 5 --format urdf --max-speed 2 -> holds no motion: leave max_speed out
export good.h5 --period 4 --output x.xlsx -> x.xlsx should end in .csv or .json
export good.h5 --period 4 --format ros --degrees -> degrees are for angles in CSV and JSON
export good.h5 --period 4 --format ros --neutral 1500 -> pulses of servos are written as .csv or .h
export good.h5 --period 4 --sign 2 -> sign of servos must be 1 or -1, not [2]
export good.h5 --period 4 --clamp 500 -> clamp of servos must be pairs of a low and a high number
export good.h5 --period 4 --clamp 2500 500 -> clamp of servos must be pairs of a low and a high number
export good.h5 --period 4 --scale 1 2 3 -> scale of servos is given for 3 joints of 2
evaluate | problem.py | problem.py nope.csv | nope.py text.h5 | problem.py text.h5 | problem.py text.h5 --period x
evaluate text.h5 problem.py -> text.h5 is no problem file in Python (.py); one comes first.
evaluate problem.py good.h5 -> good.h5 is no text of numbers in UTF-8: a CSV file is read here
identify | problem.py | problem.py nope.csv | nope.py text.h5 | problem.py text.h5 | problem.py text.h5 --length 0
robot | nope.h5 --length 1 --mass 1 --period 1 | good.h5 | good.h5 --length 1 --mass 1 | good.h5 --length 0 --mass 1 --period 1 | good.h5 --length 1 --mass nan --period 1 | good.h5 --length 1 --mass 1 --period -5 | good.h5 --length 1 --mass 1 --period 1 --max-torque 1 2 3
robot good.h5 --max-speed -1 -> --max-speed must be positive, not -1.0
steer | nope.py | fails.py | empty.py | good.h5 | problem.py --turn 200 | problem.py --turn x | problem.py --output x.txt
pareto | nope.py | fails.py | empty.py | good.h5 | problem.py --points 1 | problem.py --objectives speed no
sensitivity | nope.h5 | text.h5 | problem.py | good.h5 --no-such
"""
BAD_PROBLEMS = {
    "x = 1": "states no PROBLEM",
    "PROBLEM = 3": "PROBLEM must be a Problem",
    "a = 1\nb = = 2": "line 2",
    "a = 1\n\nb = 1/0": "line 3",
    "import sys\nsys.exit(0)": "p.py, line 2: the file ends the program",
    "x = 1\nraise SystemExit": "p.py, line 2: the file ends the program",
    "x = 1\nraise GeneratorExit": "p.py, line 2: ",
    "x = 1\nraise type('Own', (BaseException,), {})('no')": "p.py, line 2: ",
    "x = 1\nraise BaseExceptionGroup('x', [GeneratorExit()])": "p.py, line 2: ",
    GOOD.replace("delta=0.3", "delta=-1e-4"): "delta must be a positive finite number",
    GOOD.replace('"quick"', '"../quick"'): "name must be",
}


@pytest.fixture
def place(three_link, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save(three_link, tmp_path / "good.h5")
    (tmp_path / "folder.py").mkdir()
    texts = {"text.h5": "hello", "fails.py": "1 / 0\n", "empty.py": "x = 1\n", "study.py": STUDY}
    texts["wave.py"] = PROBLEM.replace("gait=Harmonic(1, 'bilateral')", "body=Wave('sine')")
    four = PROBLEM.replace("gait", "body=Chain((0.25,) * 4), gait")
    for name, text in {**texts, "problem.py": PROBLEM, "four.py": four}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def contents(folder):
    return {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def refused(name):
    for line in REFUSED.strip().splitlines():
        words, _, message = line.partition(" -> ")
        if words.split()[0] == name:
            for each in words.removeprefix(name).split(" | "):
                yield each.replace("LONG", "x" * 300).split(), message


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_bad_input_is_refused_in_one_sentence_and_as_one_json_object(name, place, capsys):
    before = contents(place)
    assert list(refused(name))
    for words, message in refused(name):
        said = []
        for more in ([], ["--json"]):
            assert colloc([name, *words, *more]) == 2, words
            printed = capsys.readouterr()
            assert printed.err.startswith("colloc: "), words
            assert printed.err.count("\n") == 1, words
            assert message in printed.err
            said.append(printed)
        assert said[0].out == "", words
        sentence = said[0].err.removeprefix("colloc: ").rstrip("\n")
        known = {"status": "error", "message": sentence, "exit_code": 2}
        assert json.loads(said[1].out) == known, words
    assert contents(place) == before


@pytest.mark.parametrize("text", BAD_PROBLEMS, ids=lambda text: BAD_PROBLEMS[text])
def test_bad_problems_get_one_clear_sentence_and_exit_code_two(text, tmp_path, capsys):
    (tmp_path / "p.py").write_text(text, encoding="utf-8")
    assert colloc(["solve", f"{tmp_path}/p.py", "--output", f"{tmp_path}/out"]) == 2
    said, complaint = capsys.readouterr()
    assert BAD_PROBLEMS[text] in complaint
    assert (said, complaint[:8], complaint.count("\n")) == ("", "colloc: ", 1)


def test_a_good_problem_is_solved_saved_and_drawn(tmp_path, capsys):
    known = "REFERENCE = Reference(0.3, 0.1, 'a paper')\n"
    (tmp_path / "p.py").write_text(GOOD + known, encoding="utf-8")
    assert (
        colloc(["solve", f"{tmp_path}/p.py", "--output", f"{tmp_path}/out", "--pdf", "--dry"]) == 0
    )
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"quick.h5", "quick.png", "quick.pdf"}
    printed = capsys.readouterr().out
    assert "efficiency d/W" in printed
    assert "a paper" in printed
    assert "dry friction    between 0." in printed
    assert colloc(["verify", f"{tmp_path}/out/quick.h5"]) == 0
    assert "delta had to be lowered from 0.3" in printed


def test_options_of_a_solve_are_what_the_search_is_asked_for(tmp_path, monkeypatch):
    asked = {}

    def resume(stated, path, *, progress, **how):
        asked.update(how, **{name: getattr(stated.problem, name) for name in CHANGES})
        raise ProblemError("enough")

    monkeypatch.setattr("colloc.studies.solve.resume", resume)
    (tmp_path / "p.py").write_text(GOOD, encoding="utf-8")
    words = [
        f"--{x.replace('_', '-').replace('intervals', 'mesh')}={y}" for x, y in CHANGES.items()
    ]
    how = {"starts": 1, "seconds": 7.0, "search": "full", "fresh": True}
    words += ["--starts=1", "--seconds=7", "--search=full", "--fresh", f"--output={tmp_path}/"]
    assert colloc(["solve", f"{tmp_path}/p.py", *words]) == 2
    assert asked == CHANGES | how


def test_a_failed_solve_is_kept_apart_and_replaces_no_good_result(tmp_path, capsys, monkeypatch):
    (tmp_path / "p.py").write_text(GOOD, encoding="utf-8")
    good = tmp_path / "quick.h5"
    good.write_bytes(b"a good result")
    monkeypatch.setattr("colloc.search.confirm.TOLERANCES", Tolerances(kkt=1e-30))
    words = f"{tmp_path}/p.py --output {tmp_path} --no-figure --front"
    assert colloc(["solve", *words.split()]) == 3
    said, complaint = capsys.readouterr()
    assert "not converged" in said
    assert "no front, as the answer is not verified" in complaint
    assert good.read_bytes() == b"a good result"
    assert (tmp_path / "quick.failed.h5").exists()


def test_a_sensitivity_is_told_as_a_table_and_as_json(place, capsys):
    assert colloc(["sensitivity", "good.h5"]) == 0
    table = capsys.readouterr().out
    assert colloc(["sensitivity", "good.h5", "--json"]) == 0
    for effect in json.loads(capsys.readouterr().out)["effects"]:
        assert effect["name"] in table
        if abs(effect["slope"]) > 1e-6:
            assert f"{effect['slope']:+.5f}" in table


def test_every_subcommand_answers_help_without_casadi():
    code = (
        "import sys; from colloc.commands.main import SUBCOMMANDS, main\n"
        "for name in SUBCOMMANDS:\n"
        "    try: main([name, '--help'])\n"
        "    except SystemExit as ended: print(name, ended.code, 'casadi' in sys.modules)"
    )
    words = [sys.executable, "-c", code]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    for name in SUBCOMMANDS:
        assert f"usage: colloc {name} " in printed
        assert f"\n{name} 0 False\n" in printed
    assert printed.count("--json") >= printed.count("Exit codes") >= len(SUBCOMMANDS)


def test_the_entry_point_lists_commands_and_suggests_the_nearest(capsys):
    assert colloc(["--help"]) == 0
    printed = capsys.readouterr().out
    assert all(f"  {name} " in printed for name in SUBCOMMANDS)
    assert colloc([]) == 2
    capsys.readouterr()
    for word, hint in (
        ("repot", "colloc report?"),
        ("x.py", "colloc solve x.py?"),
        ("compare", "colloc verify --compare?"),
        ("zzzz", "choose one of init,"),
    ):
        assert colloc([word]) == 2
        assert hint in capsys.readouterr().err
    assert colloc(["--version"]) == 0
    assert "casadi" in capsys.readouterr().out


@pytest.fixture
def completed(tmp_path):
    """A function from a line, with the cursor at its end, to what a shell may put there."""
    pytest.importorskip("argcomplete")

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
