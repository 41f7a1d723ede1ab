"""Laws of one's own, stated as formulas, in one file, or through measured coefficients: read,
differentiated, solved, and kept."""

import pickle
from dataclasses import dataclass

import numpy as np
import pytest

import colloc
from colloc import Chain, Friction, OwnLaw, Problem, fitted_friction, load, replay, save, solve
from colloc.gaits import gait_fields
from colloc.mechanics.fixed_point import motion_and_derivatives

COULOMB = OwnLaw("-where(vs > 0, 1, 1.5)*vs/speed", "-2*vn/speed")


def test_traits_are_found_from_samples():
    weaker = OwnLaw("-vs/speed*(1 + exp(-speed))", "-vn/speed*(1 + exp(-speed))")
    assert (weaker.degree, weaker.reversible) == (None, True)
    assert OwnLaw("-0.3*tanh(100*vs)", "-tanh(100*vn)").degree is None
    assert weaker.smallest == pytest.approx(1 + np.exp(-1))
    assert OwnLaw(*(f"-{v}/sqrt(vs**2 + vn**2 + delta**2)" for v in ("vs", "vn"))).regularised
    one, again = np.array([[0.3]]), pickle.loads(pickle.dumps(weaker))  # in another process
    assert again.density(one, one, 0.01 * one) == weaker.density(one, one, 0.01 * one)


ROOT = OwnLaw("-vs/sqrt(speed)", "-2*vn*speed**(-0.5)")


@pytest.mark.parametrize(
    ("own", "built_in"),
    [
        (COULOMB, Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5)),
        (OwnLaw("-vs", "-2*vn"), colloc.Viscous(normal=2.0, tangential=1.0)),
        (ROOT, colloc.PowerLaw(0.5, mu_t=2.0, mu_f=1.0)),
    ],
)
def test_a_stated_law_has_the_traits_of_the_built_in_one_and_moves_a_body_as_it_does(own, built_in):
    for trait in ("degree", "reversible", "regularised", "smallest", "largest"):
        assert getattr(own, trait) == pytest.approx(getattr(built_in, trait), rel=1e-4), trait
    rng, body = np.random.default_rng(1), Chain()
    at = rng.uniform(-1.5, 1.5, (2, 10)), rng.normal(size=(2, 10)), 1e-4
    found = []
    for law in (own, built_in):
        solved = body.solve(law, *at).require()
        motion, slopes = motion_and_derivatives(body, law, *at, solved)
        found.append((motion.z, motion.power, slopes))
    for a, b in zip(*found, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-7 * np.abs(b).max())


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
    with pytest.raises(colloc.ProblemError, match="Short does not say its reversible, associated"):
        Problem("short", friction=Short())


@pytest.mark.slow
def test_it_is_solved_certified_kept_and_read(monkeypatch, tmp_path):
    monkeypatch.setattr(gait_fields, "LAWS", [*gait_fields.LAWS, Greased])
    asked = {"friction": Greased(), "gait": colloc.Harmonic(1, "bilateral"), "delta": 1e-2}
    problem = Problem("greased", colloc.ellipse(0, 2.8, 1.3), **asked)
    found = solve(problem, starts=1)
    assert found.status == "solved", found.message
    read = load(save(found, tmp_path / "greased.h5"))
    assert (read.problem.law, read.certificate) == (Greased(), found.certificate)
    laws = OwnLaw(*Greased().formulas), Friction(mu_t=2.0)
    same, dry = (replay(problem.body, law, found.gait, 1e-2) for law in laws)
    assert found.efficiency == pytest.approx(same.efficiency, rel=1e-6)
    assert found.efficiency < dry.efficiency


SPEED = np.geomspace(0.01, 2.0, 25)


def stribeck(dry, more, v_s, drag=0.0):
    return dry + more * np.exp(-SPEED / v_s) + drag * SPEED


def table(*columns):
    return np.column_stack([SPEED, *columns])


def forces(law, speed, angle):
    vs, vn = (np.atleast_2d(speed * f(angle)) for f in (np.cos, np.sin))
    return np.array(law.density(vs, vn, 1e-12 + 0 * vs))[:, 0]


def test_a_law_is_found_again_from_its_coefficients():
    stated = OwnLaw(
        "-where(vs > 0, 0.3 + 0.2*exp(-speed/0.2), 0.5 + 0.1*speed)*vs/speed",
        "-(0.8 + 0.3*exp(-speed/0.2))*vn/speed",
    )
    along, across, back = (0.3, 0.2, 0.2), (0.8, 0.3, 0.2), (0.5, 0.0, 1.0, 0.1)
    found = fitted_friction(table(stribeck(*along), stribeck(*across), stribeck(*back)))
    assert found.largest < 1e-5
    for angle in np.linspace(0.1, 6.2, 9):
        own, known = (forces(law, SPEED, angle) for law in (found.law, stated))
        np.testing.assert_allclose(own, known, atol=2e-5)


def test_samples_without_a_trend_are_dry_friction():
    noise = 0.02 * np.random.default_rng(4).normal(size=(3, 25))
    found = fitted_friction(table(0.5 + noise[0], 0.9 + noise[1], 0.7 + noise[2]))
    law = found.law
    assert isinstance(law, Friction)
    assert (law.mu_f, law.mu_t, law.mu_b) == pytest.approx((0.5, 0.9, 0.7), abs=0.015)
    assert found.rms == pytest.approx(0.02, rel=0.3)
    exact = fitted_friction(table(stribeck(0.5, 0, 1), stribeck(0.9, 0, 1))).law
    assert exact == Friction(mu_t=0.9, mu_f=0.5, mu_b=0.5)


def test_a_few_samples_are_not_read_as_more_than_a_number_or_two():
    """Noise in three numbers would have become a law that vanishes at rest."""
    for along in ((0.5, 0.52, 0.53), (0.5, 0.52, 0.51), (0.8, 0.5, 0.5, 0.5)):
        speed = 0.1 * np.arange(1, len(along) + 1)
        law = fitted_friction(np.column_stack([speed, along, along])).law
        assert isinstance(law, Friction)
        assert (law.mu_f, law.mu_t) == pytest.approx((np.mean(along), np.mean(along)))


@pytest.mark.parametrize("seed", range(4))
def test_noise_is_smoothed_and_makes_another_direction_no_less_exact(seed):
    noise = 0.02 * np.random.default_rng(seed).normal(size=25)
    true = stribeck(0.4, 0.4, 0.15)
    found = fitted_friction(table(true + noise, true + noise)).law
    assert np.sqrt(np.mean((-forces(found, SPEED, 0.0)[0] - true) ** 2)) < 0.6 * 0.02
    across = stribeck(0.8, 0.3, 0.2)
    law = fitted_friction(table(0.5 + noise, across)).law
    np.testing.assert_allclose(-forces(law, SPEED, np.pi / 2)[1], across, atol=1e-4)


def test_metres_and_seconds_are_the_same_law():
    """A robot of 0.5 m that takes 4 s: one body length per period is 0.125 m/s."""
    samples = table(stribeck(0.3, 0.2, 0.2), stribeck(0.8, 0.3, 0.2))
    own = fitted_friction(samples).law
    fitted = fitted_friction(samples * [0.125, 1, 1], length=0.5, period=4.0)
    metres = fitted.law
    assert "a body length per period is a speed of 0.125 (speed_unit)" in str(fitted)
    np.testing.assert_allclose(forces(metres, SPEED, 0.7), forces(own, SPEED, 0.7), rtol=1e-4)


def test_columns_of_a_file_are_known_by_their_names(tmp_path):
    path, values = tmp_path / "floor.csv", table(stribeck(0.7, -0.2, 0.5), stribeck(1.4, -0.4, 0.5))
    header = {"header": "speed,sideways,forward", "comments": ""}
    np.savetxt(path, values[:, [0, 2, 1]], delimiter=",", **header)
    law = fitted_friction(path).law
    stated = OwnLaw("-(0.7 - 0.2*exp(-2*speed))*vs/speed", "-(1.4 - 0.4*exp(-2*speed))*vn/speed")
    np.testing.assert_allclose(forces(law, SPEED, 0.7), forces(stated, SPEED, 0.7), rtol=1e-4)


def test_it_opposes_every_motion_whatever_the_samples():
    """`OwnLaw` itself refuses a law that gives energy; so no fit may come to one."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        rough = table(*(rng.uniform(0.4, 0.6, (3, 1)) + 0.05 * rng.normal(size=(3, 25))).clip(0.01))
        law = fitted_friction(rough).law
        assert law.smallest > 0


NAMED = "speed,along,across;"
UNUSABLE = {
    NAMED + "0.1,0.5,0.5;0.2,-0.1,0.5;0.3,0.5,0.5": "sample 2: the coefficient along is -0.1",
    "speed,along;0.1,0.5;0.2,0.5;0.3,0.4": "no column 'across': its columns are speed, along",
    "0.1,0.5;0.2,0.5;0.3,0.4": "has 2 columns: write the speed",
    NAMED + "0.1,0.5,x;0.2,0.1,0.5;0.3,0.5,0.5": "sample 1: '0.1,0.5,x' is not 3 finite numbers",
    NAMED + "0.1,0.5,0.5": "holds 1 samples: at least 3",
    NAMED + "-0.1,0.5,0.5;0.2,0.1,0.5;0.3,0.5,0.5": "speed -0.1 is negative",
    NAMED + "0,0.5,0.5;0,0.1,0.5;0,0.5,0.5": "all speeds are 0",
    "0.1,0.5,0.5;0.2,1e10,0.5;0.3,0.4,0.5": "must be below 1e",
    ";".join(f"{k},{0.2 + 0.8 * (k % 2)},0.5" for k in range(1, 12)): "no smooth curve is near",
}


@pytest.mark.parametrize(("rows", "words"), UNUSABLE.items())
def test_a_table_that_cannot_be_used_is_refused_in_a_sentence(rows, words, tmp_path):
    path = tmp_path / "floor.csv"
    path.write_text(rows.replace(";", "\n"))
    with pytest.raises(colloc.ProblemError, match=words):
        fitted_friction(path)
