"""A smooth body gets as many panels in a search as its gait needs."""

import numpy as np
import pytest

from colloc import Fourier, Friction, Harmonic, ModalBody, Problem, Solution, load, replay, save
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import evaluate_at, space_near
from colloc.search.optimise import on_more_panels
from tests.shared.stages import answer_near

GAIT = Fourier([0.0, 0.0], [[0.4562], [0.0]], [[0.0], [-1.429]])
USUAL = {"gait": Harmonic(1, "antipodal"), "intervals": 8}


def found(panels, delta=1e-2, **changes):
    stated = Problem("two-modes", GAIT, ModalBody(2, panels=panels), **USUAL, **changes)
    return evaluate_at(*space_near(stated, GAIT), delta)


def test_panels_are_added_where_a_point_at_rest_moves_over_them():
    coarse = found(8)
    finer, v = on_more_panels(coarse)
    exact = -found(96).objective
    assert 8 < finer.control.dynamics.body.panels <= 32  # at most fourfold at a time
    after = -ReducedProgram(finer, 1e-2).objective(v)
    assert abs(after - exact) < 0.2 * abs(-coarse.objective - exact)
    np.testing.assert_array_equal(finer.mesh.edges, coarse.space.mesh.edges)


def test_panels_stay_where_they_do_not_matter():
    assert on_more_panels(found(16, delta=0.5)) is None
    sideways = Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0)
    assert on_more_panels(found(8, friction=sideways, mesh_tolerance=1e-2)) is None
    # and a chain has none to add
    stated = Problem("chain", gait=Harmonic(1, "antipodal"))
    assert on_more_panels(evaluate_at(*space_near(stated, stated.guess), 0.1)) is None


@pytest.mark.slow
def test_a_gait_on_more_panels_is_replayed_and_kept(tmp_path):
    at = {"delta": 0.1, "delta_start": 0.1}
    stated = Problem("two-modes", GAIT, ModalBody(2, panels=4), **USUAL, **at)
    solution = Solution(stated, answer_near(stated))
    how = {"instants": 80, "tolerance": 1e-5}
    again = replay(stated.body, stated.friction, solution.gait, 0.1, **how)
    assert solution.answer.problem.body.panels > 4
    assert abs(solution.efficiency / again.efficiency - 1) < 1e-4
    read = load(save(solution, tmp_path / "two.h5"))
    assert read.answer.problem.body == solution.answer.problem.body != read.problem.body
    assert np.abs(read.motion.at_points.force).max() < 1e-6
