"""The command line: exit codes, one clear sentence for bad input, and failed solves that harm
nothing."""

import pytest

from colloc.commands.solve import solve as main

GOOD = """
from colloc import *
PROBLEM = Problem(name="quick", gait=Harmonic(1, "bilateral"), guess=ellipse(0.0, 1.4, 0.8),
                  delta=0.3, delta_start=0.3, intervals=12, mesh_tolerance=1e-4)
"""


@pytest.fixture
def problem(tmp_path):
    def write(text):
        path = tmp_path / "problem.py"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


@pytest.mark.parametrize(
    ("options", "kinds"), [([], {"h5", "png"}), (["--pdf"], {"h5", "png", "pdf"})]
)
def test_a_good_problem_is_solved_saved_and_drawn(options, kinds, problem, tmp_path, capsys):
    code = main([problem(GOOD), "--output", str(tmp_path / "out"), *options])
    printed = capsys.readouterr().out
    assert code == 0
    assert {p.name for p in (tmp_path / "out").iterdir()} == {f"quick.{kind}" for kind in kinds}
    assert "efficiency d/W" in printed
    assert "delta had to be lowered from 0.3" in printed


BAD = {
    "no PROBLEM": ("x = 1\n", "states no PROBLEM"),
    "wrong type": ("PROBLEM = 3\n", "must be a colloc.Problem"),
    "syntax": ("a = 1\nb = = 2\n", "line 2"),
    "python error": ("a = 1\n\nb = 1/0\n", "line 3"),
    "negative friction": (
        GOOD.replace(
            "PROBLEM = Problem(", "PROBLEM = Problem(friction=Friction(mu_t=-1, mu_f=1, mu_b=1), "
        ),
        "mu_t",
    ),
    "nan friction": (
        GOOD.replace(
            "PROBLEM = Problem(",
            "PROBLEM = Problem(friction=Friction(mu_t=1, mu_f=float('nan'), mu_b=1), ",
        ),
        "mu_f",
    ),
    "delta": (GOOD.replace("delta=0.3", "delta=-1e-4"), "delta must be positive"),
    "joint limit": (GOOD.replace("1.4, 0.8", "4.0, 0.8"), "inadmissible: joint"),
    "crossing": (
        "from colloc import *\nPROBLEM = Problem('x', Fourier([2.4, 2.4], [[0.3], [0.1]], [[0.0], "
        "[0.2]]))\n",
        "cross each other",
    ),
    "mesh": (GOOD.replace("intervals=12", "intervals=1"), "mesh is too small"),
    "joints": (GOOD.replace("ellipse(0.0, 1.4, 0.8)", "Fourier([0], [[1]], [[1]])"), "1 joints"),
    "name": (GOOD.replace('"quick"', '"../quick"'), "name must be"),
    "still guess": (GOOD.replace("1.4, 0.8", "0.0, 0.0"), "hardly moves"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_problems_get_one_clear_sentence_and_exit_code_two(case, problem, tmp_path, capsys):
    text, message = BAD[case]
    assert main([problem(text), "--output", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.startswith("colloc: ")
    assert printed.err.count("\n") == 1
    assert "Traceback" not in printed.err
    assert printed.out == ""


def test_bad_options_and_files(problem, tmp_path, capsys):
    assert main([str(tmp_path / "none.py")]) == 2
    assert "there is no problem file" in capsys.readouterr().err
    good = problem(GOOD)
    for options, message in (
        (["--scheme", "euler"], "unknown scheme"),
        (["--delta", "0"], "delta must be positive"),
        (["--mesh", "1"], "mesh is too small"),
        (["--output", "/proc/nowhere/x.h5"], "cannot"),
        (["--start", str(tmp_path / "none.h5")], "there is no file"),
        (["--start", good], "not a readable colloc solution"),
    ):
        assert main([good, *options]) == 2
        assert message in capsys.readouterr().err
    assert main([good, "--turbo"]) == 2
    assert "unrecognized arguments: --turbo" in capsys.readouterr().err


def test_a_failed_solve_is_kept_apart_and_never_replaces_a_good_result(
    problem, tmp_path, capsys, monkeypatch
):
    good = tmp_path / "quick.h5"
    good.write_bytes(b"a good result")
    monkeypatch.setattr("colloc.search.ipopt.EXACT", 1e-30)
    assert main([problem(GOOD), "--output", str(tmp_path), "--no-figure"]) == 3
    assert "not converged" in capsys.readouterr().out
    assert good.read_bytes() == b"a good result"
    assert (tmp_path / "quick.failed.h5").exists()
