"""Laws of one's own, stated as formulas or in one file: read, differentiated, solved, and kept."""

import pickle
from dataclasses import dataclass

import numpy as np
import pytest

import colloc
from colloc import Chain, Friction, OwnLaw, Problem, Viscous, ellipse, load, replay, save, solve
from colloc.gaits import gait_fields
from colloc.mechanics.fixed_point import motion_and_derivatives

COULOMB = OwnLaw("-where(vs > 0, 1, 1.5)*vs/speed", "-2*vn/speed")


def test_traits_are_found_from_samples():
    assert (COULOMB.degree, COULOMB.reversible, COULOMB.regularised) == (0.0, False, True)
    drag = OwnLaw("-vs", "-1.8*vn")
    assert (drag.degree, drag.reversible, drag.regularised) == (1.0, True, False)
    weaker = OwnLaw("-vs/speed*(1 + exp(-speed))", "-vn/speed*(1 + exp(-speed))")
    assert (weaker.degree, weaker.reversible) == (None, True)
    assert weaker.smallest == pytest.approx(1 + np.exp(-1))


@pytest.mark.parametrize(
    ("own", "built_in"),
    [
        (COULOMB, Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5)),
        (OwnLaw("-vs", "-2*vn"), Viscous(normal=2.0, tangential=1.0)),
        (
            OwnLaw("-vs/sqrt(speed)", "-2*vn*speed**(-0.5)"),
            colloc.PowerLaw(0.5, mu_t=2.0, mu_f=1.0),
        ),
    ],
    ids=["Coulomb", "viscous", "power"],
)
def test_a_stated_law_moves_a_body_as_the_built_in_one_does(own, built_in):
    rng, body = np.random.default_rng(1), Chain()
    at = rng.uniform(-1.5, 1.5, (2, 10)), rng.normal(size=(2, 10)), 1e-4
    found = []
    for law in (own, built_in):
        solved = body.solve(law, *at).require()
        motion, slopes = motion_and_derivatives(body, law, *at, solved)
        found.append((motion.z, motion.power, slopes))
    for a, b in zip(*found, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-7 * np.abs(b).max())


def test_a_law_of_ones_own_goes_to_other_processes():
    """As many starts on several processes need it, also once it has been used."""
    law = OwnLaw("-vs/speed * (1 + exp(-speed))", "-2*vn/speed")
    one, delta = np.array([[0.3]]), np.array([[1e-3]])
    again = pickle.loads(pickle.dumps(law))
    assert again.density(one, one, delta) == law.density(one, one, delta)


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
    with pytest.raises(
        colloc.ProblemError, match="a Short does not say its reversible, associated"
    ):
        Problem("short", friction=Short())


@pytest.mark.slow
def test_it_is_solved_certified_kept_and_read(monkeypatch, tmp_path):
    monkeypatch.setattr(gait_fields, "LAWS", [*gait_fields.LAWS, Greased])
    asked = {"friction": Greased(), "gait": colloc.Harmonic(1, "bilateral"), "delta": 1e-2}
    problem = Problem("greased", ellipse(0, 2.8, 1.3), **asked)
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
