"""What holds for every command alike: options, and refusals in one sentence or one JSON object."""

import json

import pytest

from colloc.commands.main import SUBCOMMANDS
from colloc.commands.main import main as colloc
from colloc.results.store import save

PROBLEM = "from colloc import *\nPROBLEM = Problem('quick', gait=Harmonic(1, 'bilateral'))\n"
STUDY = """from colloc import *
STUDY = Study("quick", (Axis("mu_t", (1, 2)),), lambda mu_t: Problem("q", friction=Friction(mu_t=mu_t)))
"""


@pytest.fixture
def place(three_link, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save(three_link, tmp_path / "good.h5")
    (tmp_path / "text.h5").write_text("hello")
    (tmp_path / "fails.py").write_text("1 / 0\n")
    (tmp_path / "empty.py").write_text("x = 1\n")
    (tmp_path / "folder.py").mkdir()
    (tmp_path / "problem.py").write_text(PROBLEM)
    (tmp_path / "study.py").write_text(STUDY)
    return tmp_path


REFUSED = {
    "init": [
        "",
        "x.txt",
        "problem.py",
        "nowhere/below.py",
        "a,b.py",
        "new.py --links 2",
        "new.py --links x",
    ],
    "solve": ["", "nope.py", "folder.py", "fails.py", "empty.py", "good.h5", "text.h5"]
    + [
        f"problem.py --{option}"
        for option in ("delta nan", "delta x", "mesh 1.5", "scheme no", "start nope.h5", "starts 0")
    ]
    + [
        f"problem.py --{option}"
        for option in ("seconds 0", "seconds nan", "search no", "output x.txt", "no-such")
    ],
    "multistart": ["", "nope.py", "fails.py", "good.h5"]
    + [
        f"problem.py --{option}"
        for option in ("starts 0", "workers 0", "seed -1", "sampler no", "time-limit nan")
    ],
    "open": ["", "nope.h5", "text.h5", "good.h5", "good.h5 --start 1"],
    "sweep": [
        "",
        "nope.py",
        "fails.py",
        "problem.py",
        "study.py --workers 0",
        "study.py --chunk 0",
        "study.py --workers x",
    ],
    "verify": [
        "",
        "nope.h5",
        "text.h5",
        "problem.py",
        "good.h5 --tolerance 0",
        "good.h5 --tolerance nan",
    ],
    "compare": ["", "good.h5", "good.h5 nope.h5", "text.h5 good.h5"],
    "report": [
        "",
        "nope.h5",
        "text.h5",
        "good.h5 --problem nope.py",
        "good.h5 --output x.txt",
        "good.h5 --period 1",
    ],
    "animate": ["", "nope.h5", "text.h5"]
    + [
        f"good.h5 --{option}"
        for option in ("periods 0", "seconds nan", "fps 0", "width 0", "format avi", "output x.avi")
    ],
    "export": ["", "nope.h5", "text.h5", "good.h5"]
    + [
        f"good.h5 --period 4 --{option}"
        for option in (
            "rate nan",
            "max-speed 0",
            "max-speed 1 2 3",
            "periods 0",
            "format x",
            "mass 1",
        )
    ],
    "evaluate": [
        "",
        "problem.py",
        "problem.py nope.csv",
        "nope.py text.h5",
        "problem.py text.h5",
        "problem.py good.h5",
        "problem.py text.h5 --period x",
    ],
    "robot": [
        "",
        "nope.h5 --length 1 --mass 1 --period 1",
        "good.h5",
        "good.h5 --length 1 --mass 1",
    ]
    + [
        f"good.h5 --{words}"
        for words in ("length 0 --mass 1 --period 1", "length 1 --mass nan --period 1")
    ]
    + [
        f"good.h5 --length 1 --mass 1 --period {words}"
        for words in ("-5", "1 --max-speed 0", "1 --max-torque 1 2 3")
    ],
    "steer": ["", "nope.py", "fails.py", "empty.py", "good.h5"]
    + [
        f"problem.py --{option}"
        for option in ("turn 200", "turn x", "turn nan", "starts 0", "output x.txt")
    ],
    "pareto": ["", "nope.py", "fails.py", "empty.py", "good.h5"]
    + [
        f"problem.py --{option}"
        for option in ("points 1", "points x", "starts 0", "objectives speed no", "output x.txt")
    ],
    "sensitivity": ["", "nope.h5", "text.h5", "problem.py", "good.h5 --no-such"],
}


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_bad_input_is_refused_in_one_sentence_and_as_one_json_object(name, place, capsys):
    before = sorted(place.iterdir())
    for words in REFUSED[name]:
        said = []
        for more in ([], ["--json"]):
            assert colloc([name, *words.split(), *more]) == 2, words
            printed = capsys.readouterr()
            assert printed.err.startswith("colloc: "), words
            assert printed.err.count("\n") == 1, words
            said.append(printed)
        assert said[0].out == "", words
        told = json.loads(said[1].out)
        assert told == {
            "status": "error",
            "message": said[0].err.removeprefix("colloc: ").rstrip("\n"),
            "exit_code": 2,
        }, words
    assert sorted(place.iterdir()) == before


def test_what_is_wrong_is_named_without_words_of_programmers(place, capsys):
    for words, message in (
        ("solve problem.py --mesh x", "--mesh must be a whole number, not 'x'"),
        ("solve problem.py --delta x", "--delta must be a number, not 'x'"),
        ("multistart problem.py --starts 0", "--starts must be at least 1"),
        ("multistart problem.py --time-limit 0", "--time-limit must be positive, not 0"),
        ("sweep study.py --chunk 0", "--chunk must be at least 1"),
        ("sweep nope.py", "there is no study file"),
        (
            "export good.h5 --format x",
            "--format must be one of 'csv', 'json', 'mjcf', 'urdf', not 'x'",
        ),
        (
            "evaluate problem.py good.h5",
            "good.h5 is no text of numbers in UTF-8: a CSV file is read here",
        ),
        (
            "open good.h5",
            "good.h5 is no archive of starts, or good.sqlite, which holds its rows, is not "
            "beside it",
        ),
    ):
        assert colloc(words.split()) == 2
        assert message in capsys.readouterr().err


def test_a_sensitivity_is_told_as_a_table_and_as_json(place, capsys):
    assert colloc(["sensitivity", "good.h5"]) == 0
    table = capsys.readouterr().out
    assert colloc(["sensitivity", "good.h5", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    for effect in told["effects"]:
        assert effect["name"] in table
        if abs(effect["slope"]) > 1e-6:
            assert f"{effect['slope']:+.5f}" in table
