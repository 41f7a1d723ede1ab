"""A body and a class of gaits that the library does not know, as the documentation writes them: one file each."""

import pickle
import re
import sys
import types
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from colloc import Problem, ProblemError
from colloc.gaits import gait_fields
from colloc.gaits.gait import ClassOfGaits
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.mechanics.bodies import Body, Moved, Shaped
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law
from colloc.results.store import load, save
from colloc.search.solve import solve

DOCS = Path(__file__).resolve().parents[1] / "docs/howto"


def run(page, monkeypatch):
    """All code of a page in one module; what it registers is forgotten afterwards."""
    monkeypatch.setattr(gait_fields, "BODIES", list(gait_fields.BODIES))
    monkeypatch.setattr(gait_fields, "CLASSES", gait_fields.CLASSES)
    module = types.ModuleType("own_parts")
    monkeypatch.setitem(sys.modules, "own_parts", module)
    for block in re.findall(r"^```python\n(.*?)^```", (DOCS / page).read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL):
        exec(compile(block, page, "exec"), module.__dict__)
    return module


def test_a_body_of_your_own_is_solved_certified_kept_and_read(monkeypatch, tmp_path, capsys):
    own = run("own_body.md", monkeypatch)
    assert capsys.readouterr().out == "solved\n"
    found, body = own.found, own.problem.body
    assert isinstance(body, Body)
    read = load(save(found, tmp_path / "belts.h5"))
    assert (read.problem.body, read.problem.hash) == (body, found.problem.hash)
    # the joints follow the belts, and move as those of the chain do
    joints = body.joint_angles(found.sample([0.3]).angles)
    np.testing.assert_allclose(body.outline(found.sample([0.3]).angles), Chain((0.2,) * 5).outline(joints), atol=1e-14)


@pytest.mark.parametrize("part", [Moved, Shaped, Body, Law])
def test_no_part_is_asked_more_than_fifteen_questions(part):
    assert 10 <= len([name for name in vars(part) if not name.startswith("_")]) <= 15


def test_a_body_that_says_its_outline_alone_looks_like_one_that_says_everything():
    """The defaults, asked of a chain that answers better."""
    body, rng = Chain((0.2, 0.5, 0.3)), np.random.default_rng(3)
    angles, rates, z = rng.normal(size=(2, 6)), rng.normal(size=(2, 6)), rng.normal(size=(3, 6))
    np.testing.assert_allclose(Body.centre(body, angles), body.centre(angles), atol=1e-14)
    np.testing.assert_allclose(Body.speeds(body, angles, rates, z)[1], body.speeds(angles, rates, z)[1], atol=1e-8)
    places, force = Body.rubbing(body, Friction(), angles, rates, 1e-9, z, 3)
    x, y = body.outline(angles)
    np.testing.assert_allclose(places, np.stack([0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1])]), atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(force, axis=0), 1.0, atol=1e-12)  # dry, and alike in all directions


@pytest.mark.slow
def test_four_motors_do_better_than_two(monkeypatch):
    own = run("own_body.md", monkeypatch)
    gait = own.found.gait
    guess = Fourier(*(np.array(own.problem.body.gears) @ part for part in (gait.mean, gait.cos, gait.sin)))
    free = solve(own.problem.with_(body=Chain((0.2,) * 5), guess=guess), 1)
    assert free.status == "solved"
    assert free.efficiency > own.found.efficiency


@dataclass(frozen=True)
class Tents(ClassOfGaits):
    """Angles that are linear between values at equally spaced phases: linear in their parameters, and no Fourier series."""

    values: int = 8
    symmetry: str = "none"

    def intervals(self, n_joint):
        return 4 * self.values

    def describe(self):
        return f"{self.values} values a joint"

    def series(self, harmonics):
        return Harmonic(harmonics)

    def size(self, n_joint, n_interval):
        return n_joint * self.values


@pytest.mark.parametrize("starts", [1, 2])
def test_a_class_without_a_search_is_refused_in_words(monkeypatch, starts):
    monkeypatch.setattr(gait_fields, "CLASSES", (*gait_fields.CLASSES, Tents))
    with pytest.raises(ProblemError, match="no search is known for the class Tents: derive it from LinearClass"):
        solve(Problem("tents", gait=Tents(), delta=1e-2), starts=starts)


def test_a_class_of_your_own_is_searched_certified_kept_and_read(monkeypatch, tmp_path, capsys):
    own = run("own_gait_class.md", monkeypatch)
    assert capsys.readouterr().out == "solved\n"
    gait = own.found.gait
    np.testing.assert_array_equal(gait.cos[0, 1], 0.0)
    np.testing.assert_array_equal([gait.cos[1, 0], gait.sin[1, 0]], 0.0)
    read = load(save(own.found, tmp_path / "eight.h5"))
    assert type(read.problem.gait) is own.OwnHarmonics
    assert read.problem.hash == own.problem.hash


def test_a_class_that_is_no_fourier_series_is_one_file_too(monkeypatch, tmp_path):
    own = run("own_gait_class.md", monkeypatch)
    found = solve(Problem("pulses", gait=own.Pulses(6, symmetry="antipodal")), starts=3)
    assert found.status == "solved", found.message
    read = load(save(found, tmp_path / "pulses.h5"))
    assert (type(read.problem.gait), read.problem.hash) == (own.Pulses, found.problem.hash)


@pytest.mark.slow
def test_a_class_of_your_own_can_be_put_on_a_slope_and_taken_off_it(monkeypatch, capsys):
    own = run("own_gait_class.md", monkeypatch)
    level, uphill = own.problem, own.problem.with_(grade=0.02, friction=Friction(10, 1, 1.5), delta=1e-2)
    assert isinstance(uphill.gait, own.OwnHarmonics)
    assert uphill.gait.describe() == level.gait.describe()
    assert uphill.gait.size(2) == level.gait.size(2) + 1  # where it points
    assert uphill.with_(grade=0.0).gait == level.gait
    assert Problem.from_dict(uphill.to_dict()).hash == uphill.hash
    assert pickle.loads(pickle.dumps(Problem("up", gait=Harmonic(1), grade=0.1).gait)).level == Harmonic(1)
    found = solve(uphill, starts=1)
    assert found.status == "solved", found.message
    np.testing.assert_array_equal([*found.gait.cos[[0, 1], [1, 0]], *found.gait.sin[[0, 1], [1, 0]]], 0.0)
    assert found.distance > 0
