"""What the library found when its results had been checked by other means, for inputs of many
kinds: it finds that still.

Not a proof of anything, but whatever changes a digit of these results is noticed: a fault, or a
change that was meant and has to be looked at. Those that changed are listed, and recorded anew, by

    python -m tests.recorded.record
"""

import json
from pathlib import Path

import pytest

from colloc.mechanics.native_kernel import native_kernel
from tests.recorded import bounds_cases, mechanics_cases, smooth_cases, verification_cases
from tests.recorded.digest import assert_same, digest

CASES = {
    f"{part.__name__.rpartition('.')[2].removesuffix('_cases')}: {name}": (
        case,
        part.PRECISION,
        part.FLOOR,
    )
    for part in (mechanics_cases, smooth_cases, bounds_cases, verification_cases)
    for name, case in vars(part).items()
    if callable(case)
    and getattr(case, "__module__", "") == part.__name__
    and not name.startswith("_")
}
KNOWN = Path(__file__).with_name("known.json")


def known():
    return json.loads(KNOWN.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", CASES)
def test_a_result_is_what_it_was(name):
    case, precision, floor = CASES[name]
    if name.startswith("bounds") and native_kernel() is None:
        pytest.skip("a bound needs a C compiler")
    assert_same(digest(case()), known()[name], precision, floor)


def test_nothing_is_recorded_that_nobody_asks_for():
    assert sorted(known()) == sorted(CASES)
