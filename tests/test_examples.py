"""The plain programs of examples/ against a replay of their gaits, and the rows that
docs/collocation.md names against those of the full program."""

import re
from pathlib import Path

import pytest

import colloc
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
