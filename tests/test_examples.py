"""The plain programs of examples/ against a replay of their gaits, and the rows that
docs/collocation.md names against those of the full program; every file in problems/ is solved,
agrees with its own reference and with the gallery's numbers, and runs and draws if it is a script."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import colloc
from colloc.gaits.problem_file import read_problem_file
from scripts.gallery import FILES, PICTURES, TABLE, solution_of, solved_row
from tests.shared.stages import program_of

ROOT = Path(__file__).resolve().parents[1]
MESH = 5e-4
"""What 48 intervals of equal length may change."""


@pytest.fixture
def examples(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    import three_link_in_one_page
    import three_link_lifted

    return three_link_in_one_page, three_link_lifted


def replayed(gait, delta):
    path = colloc.ellipse(*gait)
    return colloc.replay(colloc.Chain(), colloc.Friction(), path, delta).efficiency


@pytest.mark.slow
def test_the_literal_program_has_the_efficiency_of_a_replay_while_delta_is_large(examples):
    page, _ = examples
    ((delta, efficiency, gait, _, status),) = page.follow(page.literal, deltas=(0.1,))
    assert status == "Solve_Succeeded"
    assert efficiency == pytest.approx(replayed(gait, delta), rel=MESH)
    assert efficiency == pytest.approx(0.2477, abs=1e-4)


@pytest.mark.slow
def test_the_lifted_program_follows_the_optimum_to_dry_friction(examples, three_link):
    page, lifting = examples
    rows = page.follow(lifting.lifted)
    assert [row[0] for row in rows] == list(page.DELTAS)
    for delta, efficiency, gait, _, status in rows:
        assert status == "Solve_Succeeded"
        assert efficiency == pytest.approx(replayed(gait, delta), rel=MESH)
    assert rows[-1][1] == pytest.approx(three_link.certificate.efficiency, rel=MESH)


def test_the_rows_that_the_page_names_are_those_of_the_full_program():
    text = (ROOT / "docs/collocation.md").read_text(encoding="utf-8").partition("rows there")[2]
    names = re.findall(r"`([^`$]+)`", " ".join(re.findall(r"^- [^:]*\(([^:]*)\):", text, re.M)))
    gait, guess = colloc.Harmonic(1, "bilateral"), colloc.ellipse(0.0, 2.0, 1.0)
    program = program_of(colloc.Problem("plain", gait=gait, guess=guess))
    assert len(names) > 10
    for name in names:
        assert name in program.groups or hasattr(program, name), name


NUMBERS = json.loads(TABLE.read_text())
SLOW = 1.3
"""Files that took longer [s of processor time], or whose time is not known, are left to the slow
tests."""
SCRIPTS = {file.stem for file in FILES if "__main__" in file.read_text(encoding="utf-8")}


def cases():
    for file in FILES:
        slow = NUMBERS.get(file.stem, {}).get("cpu_seconds", np.inf) > SLOW
        yield pytest.param(file, id=file.stem, marks=[pytest.mark.slow] if slow else [])


def last_numbers(printed):
    """Those of the last line that a script prints, without signs: mirror images are as good."""
    line = printed.strip().splitlines()[-1]
    return [float(number) for number in re.findall(r"\d+\.\d*", line)]


@pytest.mark.parametrize("file", list(cases()))
def test_the_problem_file_does_what_it_says(file, solved, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    solution = solution_of(file) if file.stem in SCRIPTS else solved(file.stem)[0]
    row, reference = solved_row(solution), read_problem_file(file).reference
    assert row["status"] == "solved"
    if reference is not None:
        assert row["efficiency"] == pytest.approx(reference.efficiency, abs=reference.tolerance)
    before = NUMBERS[file.stem]
    allowed = 3e-5 + 3 * (before["error"] + row["error"])
    assert row["efficiency"] == pytest.approx(before["efficiency"], abs=allowed)
    if file.stem in SCRIPTS:
        with Image.open(f"{file.stem}.gif") as film:
            assert film.n_frames > 1
        Image.open(f"{file.stem}.png").verify()
        printed, now = (last_numbers(x) for x in (before["printed"], capsys.readouterr().out))
        assert now == pytest.approx(printed, rel=1e-3, abs=1e-3)


def test_the_gallery_has_the_numbers_of_all_files_and_the_pictures_of_all_scripts():
    assert set(NUMBERS) == {file.stem for file in FILES} | {"versions"}
    drawn = {f"{name}.{ending}" for name in SCRIPTS for ending in ("gif", "png")}
    assert {path.name for path in PICTURES.iterdir()} == drawn
