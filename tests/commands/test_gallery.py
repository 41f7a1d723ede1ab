"""Every file in problems/ is solved, agrees with its own reference, and with the numbers that the
gallery prints."""

import json

import numpy as np
import pytest

from scripts.gallery import PICTURES, TABLE, examples, solved_row

NUMBERS = json.loads(TABLE.read_text())
SLOW = 4.0
"""Files that took longer [s of processor time], or whose time is not known, are left to the slow
tests."""

CLOSE_OPTIMA = {"three_link_spline"}
"""Classes so rich that rounding chooses between optima: 0.41348 and 0.41368 on four processors."""


def cases():
    for example in examples():
        slow = NUMBERS.get(example.name, {}).get("cpu_seconds", np.inf) > SLOW
        yield pytest.param(example, id=example.name, marks=[pytest.mark.slow] if slow else [])


@pytest.mark.parametrize("example", list(cases()))
def test_the_example_does_what_it_says(example, solved):
    row = solved_row(solved(example.name)[0])
    assert row["status"] == "solved"
    if example.reference is not None:
        assert row["efficiency"] == pytest.approx(
            example.reference.efficiency, abs=example.reference.tolerance
        )
    if example.name in NUMBERS:
        before = NUMBERS[example.name]
        allowed = 3e-5 + 3 * (before["error"] + row["error"])
        if example.name in CLOSE_OPTIMA:
            allowed = example.reference.tolerance
        assert row["efficiency"] == pytest.approx(before["efficiency"], abs=allowed)
        assert row["status"] == before["status"]


def test_the_gallery_has_no_entries_without_a_file():
    names = {example.name for example in examples()}
    assert set(NUMBERS) - {"versions"} <= names
    assert {path.stem for path in PICTURES.glob("*.png")} <= names
