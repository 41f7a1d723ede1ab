"""Resumable studies, their files, and the table and figures made from them."""

import numpy as np
import pytest

from colloc import ProblemError
from scripts import reproduce_paper
from scripts.paper import figures, rows
from scripts.paper.study import Context, PaperStudy, Part, source_closure
from scripts.paper.three_link import third_slowest_dips


def _square(context: Context) -> dict:
    return {"y": np.array(context.settings["x"]) ** 2}


def _sum(context: Context) -> dict:
    return {"total": context.needed["square"]["y"].sum()}


def _study(folder, x=(1.0, 2.0), quick=False) -> PaperStudy:
    parts = [
        Part("square", _square, settings={"x": list(x)}, quick={"x": [1.0]}),
        Part("sum", _sum, needs=("square",)),
    ]
    return PaperStudy(parts, folder, quick=quick)


def test_parts_are_finished_until_their_inputs_change(tmp_path):
    study = _study(tmp_path)
    assert study.select(["sum"]) == ["square", "sum"]
    for name in study.select(["sum"]):
        assert not study.finished(name)
        study.compute(name, 1)
    assert study.arrays("sum")["total"] == 5.0
    assert all(_study(tmp_path).finished(name) for name in ("square", "sum"))
    changed = _study(tmp_path, x=(3.0,))
    assert not changed.finished("square")
    assert not changed.finished("sum")  # through what it needs
    assert not _study(tmp_path, quick=True).finished("square")
    with pytest.raises(ProblemError, match="no part 'cube'"):
        study.select(["cube"])


def test_source_closure_follows_imports():
    found = source_closure("scripts.paper.three_link")
    assert {"colloc.mechanics.fixed_point", "scripts.models.ellipses"} <= found.keys()
    assert not {"scripts.paper.figures", "scripts.paper.study"} & found.keys()


def test_verdicts():
    assert rows.number("x", "0.259", 0.2594, 0.0, "exact").verdict == "agrees"
    assert rows.number("x", "0.259", 0.2600, 1e-5, "exact").verdict == "printed value -0.4 %"
    assert rows.number("x", "0.259", 0.2600, 6e-4, "rough").verdict == "agrees"
    assert rows.statement("x", "small", "2", holds=False).verdict == "does not hold"


def test_dips_of_the_third_slowest_end():
    t = np.linspace(0, 1, 1001)
    moving = np.ones_like(t)
    speeds = np.stack([np.abs(t - 0.3), 2 * np.abs(t - 0.3), 0.01 + np.abs(t - 0.3), moving])
    when, speed = third_slowest_dips(t, speeds)
    assert when[0] == pytest.approx(0.3, abs=0.02)
    assert speed[0] <= 0.02


@pytest.mark.slow
def test_command_line_computes_resumes_and_draws(tmp_path, capsys):
    """Two small parts: computed, then skipped, drawn; the rest named as missing."""
    arguments = ["--quick", "--only", "instant", "flap", "--processes", "1"]
    arguments += ["--output", str(tmp_path)]
    assert reproduce_paper.main(arguments) == 0
    assert "flap: computing" in capsys.readouterr().out
    assert reproduce_paper.main(arguments) == 0
    assert "flap: finished before" in capsys.readouterr().out
    text = (tmp_path / "paper-quick.md").read_text()
    assert "figure 4: flap body" in text
    assert "no solution" in text
    assert "does not hold" not in text
    assert "`sweep`" in text.split("Not computed yet")[1]
    drawn = sorted(p.name for p in (tmp_path / "paper-quick").glob("*.p*"))
    assert [n for n in drawn if n.endswith(".png")] == [
        "figure-03-velocity-and-force.png",
        "figure-04-flap-body.png",
    ]
    assert len(drawn) == 4
    assert reproduce_paper.main(["--only", "nothing", "--output", str(tmp_path)]) == 1
    assert "there is no part 'nothing'" in capsys.readouterr().err


def test_every_part_has_rows_or_a_figure_and_these_their_parts():
    parts = set(reproduce_paper.study(reproduce_paper.Path("results"), quick=True).parts)
    assert parts == {name for _, needs in (*rows._ROWS.items(), *figures.FIGURES) for name in needs}
