"""A body and a class of gaits of one's own, as the documentation writes them."""

import re
import sys
import types
from pathlib import Path

import numpy as np
import pytest

import colloc
from colloc import Harmonic, Objective, PathLimit, Problem, Quantity, ellipse, load, save, solve
from colloc.gaits import gait_fields
from colloc.mechanics.balance import joint_moments
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import DRIVEN_WORK
from tests.shared.cases import slow

DOCS = Path(__file__).resolve().parents[1] / "docs/howto"


def run(page, monkeypatch):
    """All code of a page in one module; what it registers is forgotten afterwards."""
    for kinds in ("BODIES", "CLASSES"):
        monkeypatch.setattr(gait_fields, kinds, list(getattr(gait_fields, kinds)))
    module = types.ModuleType("own_parts")
    monkeypatch.setitem(sys.modules, "own_parts", module)
    text, multi = (DOCS / page).read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    for block in re.findall(r"^```python\n(.*?)^```", text, multi):
        exec(compile(block, page, "exec"), module.__dict__)
    return module


def test_a_body_of_your_own_is_solved_certified_kept_and_read(monkeypatch, tmp_path, capsys):
    own = run("own_body.md", monkeypatch)
    assert capsys.readouterr().out == "solved\n"
    found, body = own.found, own.problem.body
    assert isinstance(body, Body)
    read = load(save(found, tmp_path / "tapered.h5"))
    assert (read.problem.body, read.problem.hash) == (body, found.problem.hash)
    same = colloc.Chain(body.lengths)
    np.testing.assert_allclose(body.lengths[1:], 0.8 * np.array(body.lengths[:-1]))
    again = solve(found.problem.with_(body=same), 1)
    assert again.value == pytest.approx(found.value, rel=1e-9)


def test_a_body_that_says_its_outline_alone_has_its_centre_of_mass():
    body, angles = colloc.Chain((0.2, 0.5, 0.3)), np.random.default_rng(3).normal(size=(2, 6))
    np.testing.assert_allclose(Body.centre(body, angles), body.centre(angles), atol=1e-14)


class Tents:
    """No class of gaits, as it does not derive from one."""

    symmetry = "none"


def test_what_is_no_class_of_gaits_is_told_what_it_lacks(monkeypatch):
    monkeypatch.setattr(gait_fields, "CLASSES", [*gait_fields.CLASSES, Tents])
    with pytest.raises(
        colloc.ProblemError, match=r"a Tents does not say its .*functions.*gaits\.linear"
    ):
        Problem("tents", gait=Tents(), delta=1e-2)


def test_a_class_of_your_own_is_searched_certified_kept_and_read(monkeypatch, tmp_path, capsys):
    own = run("own_gait_class.md", monkeypatch)
    assert capsys.readouterr().out == "solved\n"
    gait = own.found.gait
    np.testing.assert_array_equal(gait.cos[0, 1], 0.0)
    np.testing.assert_array_equal([gait.cos[1, 0], gait.sin[1, 0]], 0.0)
    read = load(save(own.found, tmp_path / "eight.h5"))
    assert type(read.problem.gait) is own.OwnHarmonics
    assert read.problem.hash == own.problem.hash


@pytest.mark.slow
def test_a_class_that_is_no_fourier_series_is_one_file_too(monkeypatch, tmp_path):
    own = run("own_gait_class.md", monkeypatch)
    found = solve(Problem("pulses", gait=own.Pulses(6, symmetry="antipodal"), **COARSELY), starts=1)
    assert found.status == "solved", found.message
    read = load(save(found, tmp_path / "pulses.h5"))
    assert (type(read.problem.gait), read.problem.hash) == (own.Pulses, found.problem.hash)


def moments_at(solution, t):
    """In the joints, by the balance at phases that no quadrature of the library has."""
    body, law, delta = solution.problem.body, solution.problem.friction, solution.delta_per_period
    angles, rates = solution.gait(t)
    z = body.solve(law, angles, rates, delta).z
    return joint_moments(body, angles, body.forces(law, angles, rates, z, delta)), rates


def test_a_quantity_of_your_own_is_optimised_certified_kept_and_read(tmp_path):
    heat = Quantity("heat", "sum(moment**2)", "loss in the windings")
    cool = Objective("distance / (work + 5 * heat)", name="coolness", quantities=[heat])
    asked = {"gait": Harmonic(1, "bilateral"), "objective": cool, "delta": 1e-3}
    problem = Problem("cool", ellipse(0.0, 2.8, 1.3), **asked)
    found = solve(problem, starts=1)
    assert found.status == "solved", found.message
    values, t = found.certificate.values, (np.arange(8000) + 0.3) / 8000
    # the heat is a fiftieth of what the distance is divided by, and that is replayed to 1e-6
    mean = (moments_at(found, t)[0] ** 2).sum(axis=0).mean()
    assert values["heat"] == pytest.approx(mean, rel=5e-5)
    value = values["distance"] / (values["work"] + 5 * values["heat"])
    assert found.value == pytest.approx(value, rel=1e-5)
    usual = solve(problem.with_(objective="efficiency"), starts=1)
    assert usual.efficiency > found.efficiency
    read = load(save(found, tmp_path / "cool.h5"))
    assert (read.problem.hash, read.certificate.values) == (problem.hash, values)
    assert read.problem.objective == cool
    with pytest.raises(colloc.ProblemError, match="the heat of a path depends on how fast it is"):
        problem.with_(gait=colloc.Polygon(4, "bilateral"))


@pytest.mark.parametrize(
    "gait", [Harmonic(1, "bilateral"), slow(colloc.Polygon(3, "bilateral"))], ids=["series", "path"]
)
def test_a_quantity_stated_anew_is_the_one_that_is_known(gait):
    mine = Objective("distance / mine", quantities=[Quantity("mine", DRIVEN_WORK.density)])
    known = Problem(
        "known", ellipse(0, 2.8, 1.3), gait=gait, objective="driven efficiency", delta=1e-2
    )
    first, second = (solve(each, starts=1) for each in (known, known.with_(objective=mine)))
    assert second.status == first.status == "solved"
    assert second.value == first.value
    assert second.certificate.values["mine"] == first.certificate.values["driven_work"]


def test_what_a_quantity_is_proportional_to_follows_from_its_formula():
    heat, effort = Quantity("heat", "sum(moment**2)"), Quantity("effort", "sum(abs(moment * rate))")
    mixed = Quantity("mixed", "sum(moment**2 + rate**2)")
    assert [each.friction_degree for each in (heat, effort, mixed)] == [2.0, 1.0, None]
    assert [each.pace_degree for each in (heat, effort, mixed)] == [0.0, 1.0, None]
    # with a scale of its own it is proportional to nothing, though beyond that scale it seems so
    soft = Quantity("soft", "sum(tanh((moment / 0.01)**2))")
    gears = Quantity("gears", "sum(abs(rate) * where(abs(rate) > 17, 9, 1))")
    assert soft.friction_degree is None
    assert gears.pace_degree is None
    assert Objective("distance * work / heat", quantities=[heat]).degree == -1.0
    assert Objective("distance / mixed", quantities=[mixed]).degree is None


COARSELY = {"delta": 1e-2}
WEAK = Problem(
    "weak", ellipse(0.0, 2.8, 1.3), gait=Harmonic(1, "bilateral"), torque_limit=0.053, delta=1e-2
)


def test_a_limit_of_your_own_is_kept_certified_stored_and_read(tmp_path):
    """On the sum of squared torques, which heats a motor: it binds here, and not elsewhere."""
    heat = PathLimit("heat", "sum(moment**2)", 0.005, both_ways=False)
    problem = WEAK.with_(torque_limit=None, limits=[heat])
    found = solve(problem, starts=1)
    assert found.status == "solved", found.message
    moments, _ = moments_at(found, np.linspace(0, 1, 4001))
    assert (moments**2).sum(axis=0).max() == pytest.approx(0.005, rel=1e-4)
    checks = {check.name: check for check in found.certificate.checks}
    assert "closest: heat" in checks["actuators"].meaning
    read = load(save(found, tmp_path / "warm.h5"))
    assert (read.problem.hash, read.problem.limits) == (problem.hash, problem.limits)


@pytest.mark.slow
def test_limits_stated_anew_are_those_that_are_known():
    """A torque as a row; a speed as rows, at the gait's fastest instants in the library."""
    mine = WEAK.with_(torque_limit=None, limits=[PathLimit("torque", "moment", 0.053)])
    assert solve(mine, starts=1).value == solve(WEAK, starts=1).value
    fast = WEAK.with_(torque_limit=None, speed_limit=9.0)
    own = fast.with_(speed_limit=None, limits=[PathLimit("speed", "rate", 9.0)])
    known, found = solve(fast, starts=1), solve(own, starts=1)
    assert known.status == found.status == "solved"
    assert found.value == pytest.approx(known.value, rel=1e-6)
