"""``colloc solve`` and ``colloc animate`` on a class of relaxed gaits."""

import contextlib
import io
import json

import pytest

from colloc.commands.main import main

FILE = """
from colloc import Friction, Problem, Relaxed
PROBLEM = Problem(
    "loops", friction=Friction(1, 1, 1), gait=Relaxed(2, "both"), delta=2e-4, delta_start=1e-2, joint_limit=2.5, intervals=8
)
"""


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """The folder of the result, and what the command said."""
    folder = tmp_path_factory.mktemp("relaxed")
    (folder / "loops.py").write_text(FILE)
    with contextlib.redirect_stdout(io.StringIO()) as said:
        assert main(["solve", str(folder / "loops.py"), "--starts", "1", "--json", "--output", f"{folder}/"]) == 0
    return folder, json.loads(said.getvalue())


@pytest.fixture
def folder(solved):
    return solved[0]


def test_solve_reports_the_best_finite_gait_and_what_it_tends_to(solved):
    folder, told = solved
    found = told["certificate"]["efficiency"]
    assert found < told["relaxed"]["efficiency"]
    assert found == max(each["efficiency"] for each in told["relaxed"]["realised"])
    assert (folder / "loops.png").exists()


def test_animate_draws_the_finite_gait(folder):
    result = next(folder.glob("loops*.h5"))
    assert (
        main(["animate", str(result), "--seconds", "0.4", "--fps", "5", "--periods", "1", "--output", f"{folder}/a.gif"]) == 0
    )
    assert (folder / "a.gif").read_bytes().startswith(b"GIF")


def test_verify_replays_the_relaxed_gait_and_all_finite_ones(folder, capsys):
    result = next(folder.glob("loops*.h5"))
    code = main(["verify", str(result), "--json"])
    told = json.loads(capsys.readouterr().out)
    assert told["value"] == pytest.approx(max(gait["efficiency"] for gait in told["gaits"][1:]), rel=1e-6)
    assert len(told["gaits"]) == 4
    assert not any(gait["complaint"] for gait in told["gaits"])
    assert told["certified"] == (code == 0)


def test_report_export_and_compare_take_the_finite_gait(folder, capsys):
    result = next(folder.glob("loops*.h5"))
    assert main(["report", str(result), "--output", f"{folder}/"]) == 0
    page = result.with_suffix(".html").read_text()
    assert "finite gaits tend to" in page
    assert main(["export", str(result), "--period", "10", "--format", "json", "--output", f"{folder}/"]) == 0
    told = json.loads((folder / "loops.json").read_text())
    assert len(told["angles_rad"]) == 2
    assert main(["compare", str(result), str(result)]) == 0
    assert "the same optimum" in capsys.readouterr().out
