"""A law of friction that the library does not know, in this file alone: solved, certified, kept and
read like any other."""

from dataclasses import dataclass

import pytest

from colloc import (
    Friction,
    Harmonic,
    OwnLaw,
    Problem,
    ProblemError,
    ellipse,
    load,
    replay,
    save,
    solve,
)
from colloc.gaits import gait_fields


@dataclass(frozen=True)
class Greased(OwnLaw):
    """Dry friction, twice as large sideways, and drag that grows with the speed."""

    drag: float = 0.02

    @property
    def formulas(self):
        return f"-vs/speed - {self.drag}*vs", f"-2*vn/speed - {self.drag}*vn"

    @property
    def label(self):
        return f"greased ({self.drag:g})"

    def describe(self):
        return f"dry friction (1, 2) and a drag of {self.drag:g} times the speed"


@dataclass(frozen=True)
class Short:
    """One that does not say everything."""

    label = "short"
    degree = 0.0


def test_what_a_law_does_not_say_is_named(monkeypatch):
    monkeypatch.setattr(gait_fields, "LAWS", [*gait_fields.LAWS, Short])
    with pytest.raises(ProblemError, match="a Short does not say its reversible, associated"):
        Problem("short", friction=Short())


@pytest.mark.slow
def test_it_is_solved_certified_kept_and_read(monkeypatch, tmp_path):
    monkeypatch.setattr(gait_fields, "LAWS", [*gait_fields.LAWS, Greased])
    problem = Problem(
        "greased",
        ellipse(0, 2.8, 1.3),
        friction=Greased(),
        gait=Harmonic(1, "bilateral"),
        delta=1e-2,
    )
    found = solve(problem, starts=1)
    assert found.status == "solved", found.message
    read = load(save(found, tmp_path / "greased.h5"))
    assert (read.problem.law, read.certificate) == (Greased(), found.certificate)
    same, dry = (
        replay(problem.body, law, found.gait, 1e-2)
        for law in (OwnLaw(*Greased().formulas), Friction(mu_t=2.0))
    )
    assert found.efficiency == pytest.approx(same.efficiency, rel=1e-6)
    assert found.efficiency < dry.efficiency
