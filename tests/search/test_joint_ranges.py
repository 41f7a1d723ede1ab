"""Joints that bend farther to one side than to the other."""

import numpy as np
import pytest

from colloc import Fourier, Friction, Harmonic, Polygon, Problem, load, save
from colloc.search.solve import solve

LAW = Friction(mu_t=3, mu_f=1, mu_b=1)
ONE_SIDED = ((-0.6, 1.5), (-1.5, 0.6))


def problem(joint_limit, gait=None, **changes):
    stated = {"friction": LAW, "gait": gait or Harmonic(1), "delta": 1e-3, "mesh_tolerance": 1e-4}
    return Problem("ranges", joint_limit=joint_limit, **(stated | changes))


@pytest.fixture(scope="module")
def one_sided():
    return solve(problem(ONE_SIDED, Harmonic(1, "bilateral")), starts=4)


def test_the_answer_keeps_both_sides_and_uses_one(one_sided, tmp_path):
    assert one_sided.success
    first, second = one_sided.gait.angles(np.linspace(0, 1, 4001))
    low, high = first.min(), first.max()
    assert low == pytest.approx(-0.6, abs=1e-5)
    assert high == pytest.approx(1.5, abs=1e-5)
    assert second.max() < 0.6 + 1e-5
    read = load(save(one_sided, tmp_path / "r.h5"))
    assert read.problem.joint_limit == ONE_SIDED
    assert read.problem.hash == one_sided.problem.hash


def test_mirrored_ranges_give_the_mirrored_gait(one_sided):
    mirrored = solve(
        problem(tuple((-high, -low) for low, high in ONE_SIDED), Harmonic(1, "bilateral")), starts=4
    )
    assert mirrored.efficiency == pytest.approx(one_sided.efficiency, rel=1e-6)


def test_polygons_keep_both_sides_use_them_and_mirror():
    gait = Polygon(3, "bilateral")
    aside = Fourier([0.5, -0.5], [[0.9], [-0.9]], [[0.5], [0.5]])
    stated = Problem("paths", gait=gait, delta=1e-2, mesh_tolerance=1e-2, smallest_shape_speed=0.4)
    here = solve(stated.with_(joint_limit=((-1, 2), (-2, 1)), guess=aside), starts=1)
    there = solve(stated.with_(joint_limit=((-2, 1), (-1, 2)), guess=aside.scaled(-1.0)), starts=1)
    assert here.success
    assert there.efficiency == pytest.approx(here.efficiency, rel=1e-9)
    first, second = here.gait.angles(np.linspace(0, 1, 4001))
    assert first.max() == pytest.approx(2.0, abs=1e-5)
    assert first.min() > -1.0 - 1e-5
    assert second.max() < 1.0 + 1e-5


def test_a_range_that_is_even_is_a_limit_and_one_may_go_to_half_a_turn():
    assert problem(((-1, 1), 2.0)).joint_limit == problem((1.0, 2.0)).joint_limit
    assert problem(((-np.pi, 1), (-1, np.pi))).joint_limit == ((-np.pi, 1), (-1, np.pi))
