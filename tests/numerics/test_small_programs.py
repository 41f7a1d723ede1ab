"""Small programs that are solved without SciPy's optimize: least squares with signs, and linear
programs."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from colloc.numerics.conic import linear_maximum
from colloc.numerics.sqp import nonnegative
from colloc.system.errors import NotConvergedError


@pytest.mark.parametrize("seed", range(40))
def test_nonnegative_least_squares_meet_the_conditions_of_a_minimum(seed):
    """Which are sufficient, as the program is convex; up to what rounding leaves of the sums that
    slopes are."""
    rng = np.random.default_rng(seed)
    matrix, right = rng.standard_normal(rng.integers(1, 9, 2)), rng.standard_normal(9)
    if seed % 2:  # an equation is a column and its reverse
        matrix = np.hstack([matrix[:, :4], -matrix[:, :4]])
    right = right[: len(matrix)]
    x = nonnegative(matrix, right)
    slope = matrix.T @ (matrix @ x - right)
    rounding = 1e-14 * np.abs(matrix.T) @ (np.abs(matrix) @ x + np.abs(right))
    assert x.min() >= 0
    assert (slope >= -rounding).all()
    assert (np.abs(slope) * x <= rounding * x).all()


def test_a_linear_program_meets_its_dual():
    rng = np.random.default_rng(1)
    equations, gain = rng.standard_normal((4, 60)), rng.standard_normal(60)
    equations[-1] = np.abs(equations[-1]) + 0.1
    right = np.array([0.0, 0.0, 0.0, 1.0])
    value, x, multipliers = linear_maximum(gain, equations, right)
    np.testing.assert_allclose(equations @ x, right, atol=1e-12)
    assert x.min() >= 0
    assert np.count_nonzero(x) <= 4
    assert gain @ x == pytest.approx(value, abs=1e-12)
    assert multipliers @ right == pytest.approx(value, abs=1e-12)
    assert (gain - multipliers @ equations).max() <= 1e-9


def test_linear_programs_on_two_threads_are_what_they_are_one_after_another():
    def solved(seed):
        rng = np.random.default_rng(seed)
        equations, gain = rng.standard_normal((4, 60)), rng.standard_normal(60)
        equations[-1] = np.abs(equations[-1]) + 0.1
        value, x, multipliers = linear_maximum(gain, equations, np.array([0.0, 0.0, 0.0, 1.0]))
        return np.concatenate([[value], x, multipliers])

    alone = [solved(seed) for seed in range(100)]
    with ThreadPoolExecutor(2) as threads:
        np.testing.assert_array_equal(list(threads.map(solved, range(100))), alone)


@pytest.mark.parametrize(("column", "why"), [(-1.0, "Unbounded"), (1.0, "Infeasible")])
def test_a_linear_program_without_a_solution_says_so(column, why):
    with pytest.raises(NotConvergedError, match=why):
        linear_maximum(np.ones(2), np.array([[1.0, column]]), np.array([-column]))
