"""Every file in problems/ is solved, agrees with its own reference, and with the numbers that the
gallery prints; those that are scripts are run, and draw."""

import json
import re

import numpy as np
import pytest
from PIL import Image

from colloc.gaits.problem_file import read_problem_file
from scripts.gallery import FILES, PICTURES, TABLE, solution_of, solved_row

NUMBERS = json.loads(TABLE.read_text())
SLOW = 1.3
"""Files that took longer [s of processor time], or whose time is not known, are left to the slow
tests."""
SCRIPTS = {file.stem for file in FILES if "__main__" in file.read_text(encoding="utf-8")}
CLOSE_OPTIMA = {"three_link_spline"}
"""Classes so rich that rounding chooses between optima: 0.41348 and 0.41368 on four processors."""


def cases():
    for file in FILES:
        slow = NUMBERS.get(file.stem, {}).get("cpu_seconds", np.inf) > SLOW
        yield pytest.param(file, id=file.stem, marks=[pytest.mark.slow] if slow else [])


def last_numbers(printed):
    """Those of the last line of what a script prints."""
    line = printed.strip().splitlines()[-1]
    return [float(number) for number in re.findall(r"-?\d+\.\d*", line)]


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
    if file.stem in CLOSE_OPTIMA:
        allowed = reference.tolerance
    assert row["efficiency"] == pytest.approx(before["efficiency"], abs=allowed)
    if file.stem in SCRIPTS:
        with Image.open(f"{file.stem}.gif") as film:
            assert film.n_frames > 1
        Image.open(f"{file.stem}.png").verify()
        assert last_numbers(capsys.readouterr().out) == pytest.approx(
            last_numbers(before["printed"]), rel=1e-3, abs=1e-3
        )


def test_the_gallery_has_the_numbers_of_all_files_and_the_pictures_of_all_scripts():
    assert set(NUMBERS) == {file.stem for file in FILES} | {"versions"}
    drawn = {f"{name}.{ending}" for name in SCRIPTS for ending in ("gif", "png")}
    assert {path.name for path in PICTURES.iterdir()} == drawn
