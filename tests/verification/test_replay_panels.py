"""What halving panels says of the error: at kinks anywhere, corners, in the distance."""

import json

import numpy as np
import pytest

from benchmarks.audit import path_of, random_problem
from colloc.verification.replay import (
    HALF,
    Panels,
    changes,
    first_panels,
    increments,
    poses,
    remaining_error,
    replay,
)
from tests.conftest import ROOT

WORK = 2


def at_rest(power):
    """Values at instants of a body that rests and does work: z, rates, power of joints, spread."""
    none = 0.0 * power
    vectors = np.stack([none] * 3, axis=-1)
    return vectors, np.stack([none, none, power], axis=-1).astype(complex), none, vectors


def panels_of(power, n=16, corner=None):
    """With a corner at the end of a panel or none."""
    left, width = np.arange(n) / n, np.full(n, 1 / n)
    t = left[:, None] + width[:, None] * np.linspace(0, 1, 5)
    if corner is not None:
        t[np.isclose(left, corner), 0] += 1e-12
        t[np.isclose(left + width, corner), 4] -= 1e-12
    return first_panels(left, width, at_rest(power(t)))


def stated_work(panels):
    return remaining_error(*changes(panels)[1:], panels.wider)[:, WORK].sum()


def slope_jump(x):
    return np.abs(x), x * np.abs(x) / 2


def slipping_through_rest(x):
    """A link slides on with its centre of rotation inside: the kink is x log|x|."""
    logarithm = np.log(np.abs(x) + 1e-300)
    return x * logarithm, x**2 * (logarithm / 2 - 0.25)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.8, 1.0])
def test_stated_errors_cover_a_kink_wherever_it_lies(share):
    """At many places the change of its panel is small by accident."""
    true, stated = [], []
    for at in np.random.default_rng(0).uniform(0.3, 0.7, 200):

        def kink(t, at=at):
            pairs = zip(slope_jump(t - at), slipping_through_rest(t - at), strict=True)
            return [(1 - share) * straight + share * curved for straight, curved in pairs]

        panels = panels_of(lambda t: kink(t)[0])
        exact = kink(1.0)[1] - kink(0.0)[1]
        true.append(abs(increments(panels)[WORK].sum() - exact))
        stated.append(stated_work(panels))
    assert np.all(np.array(true) <= stated)
    assert np.median(np.array(stated) / true) < 8


def test_corners_are_not_taken_for_kinks():
    """Beside a jump the power is linear: nothing is left, though the instants do not fit."""
    assert stated_work(panels_of(lambda t: np.where(t < 0.5, 1 + t, 3 - t), corner=0.5)) < 1e-14
    kept_in_view = panels_of(lambda t: np.where(t < 0.51, 1 + t, 3 - t))
    assert stated_work(kept_in_view) > 1e-3


@pytest.mark.parametrize("steady", [False, True])
def test_changes_are_those_of_the_distance_when_one_panel_is_halved(steady):
    """The rest of the path turns with the panel, all that changes where that is steady."""
    rng, n = np.random.default_rng(3), 8
    spin, centre = 1e-3 * rng.normal(size=(n, 5)), rng.normal(size=(n, 5, 2)) @ np.array([1, 1j])
    centre[:] = centre[:, :1] if steady else centre
    rates = np.stack([spin, centre, *rng.uniform(1, 2, (3, n, 5))], axis=-1)
    values = rng.normal(size=(n, 5, 3)), rates, spin, np.zeros((n, 5, 5))
    panels = Panels(np.arange(n) / n, np.full(n, 1 / n), *values, np.zeros((n, 5)))
    once, twice = increments(panels, HALF), increments(panels)

    def distance(turn, move):
        return abs(poses(turn, move)[1][-1])

    for k in range(n):
        turn, move = twice[0].copy(), twice[1].copy()
        turn[k], move[k] = once[0][k], once[1][k]
        change, rel = abs(distance(turn, move) - distance(*twice[:2])), 3e-2 if steady else 1e-3
        assert changes(panels)[0][k, 1] == pytest.approx(change, rel=rel, abs=1e-9)


AUDIT = (ROOT / "results/curated/audit.jsonl").read_text(encoding="utf-8")
OPTIMA = {row["number"]: row for row in map(json.loads, AUDIT.splitlines())}


@pytest.mark.parametrize("number", [35, 94, 162, 209, 558, 893])
def test_stated_errors_cover_optimised_gaits(number):
    """Their kinks repeat by symmetry in several panels: accidents do not average out."""
    problem, _, _ = random_problem(number)
    row = OPTIMA[number]
    result = replay(problem.body, problem.friction, path_of(row["gait"]), row["delta"])
    found = row["played"]  # by another program
    assert abs(result.work - found["work"]) <= result.errors["work"]
    assert abs(result.distance - found["distance"]) <= result.errors["distance"]
    assert abs(result.efficiency - found["efficiency"]) <= result.error * result.efficiency
    assert result.error < 1e-6
