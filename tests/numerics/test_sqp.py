"""SQP with quasi-Newton updates: known optima, constraints that contradict each other at first,
kinks, boxes."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from colloc.numerics.conic import quadratic_step
from colloc.numerics.sqp import minimize, stationarity


class Program:
    """A program from functions and their derivatives."""

    def __init__(self, f, g, c, a, row_lower, row_upper, n, lower=-np.inf, upper=np.inf):
        self.objective, self.gradient, self.rows, self.row_slopes = f, g, c, a
        self.row_lower, self.row_upper = (
            np.array(row_lower, dtype=float),
            np.array(row_upper, dtype=float),
        )
        self.lower, self.upper = np.full(n, lower), np.full(n, upper)


def hock_schittkowski_71():
    """min x1 x4 (x1 + x2 + x3) + x3 with x1 x2 x3 x4 >= 25, |x|^2 = 40, 1 <= x <= 5; optimum
    17.0140173."""
    return Program(
        lambda x: x[0] * x[3] * x[:3].sum() + x[2],
        lambda x: np.array([x[3] * (2 * x[0] + x[1] + x[2]), x[0] * x[3], x[0] * x[3] + 1,
        x[0] * x[:3].sum()]),
        lambda x: np.array([np.prod(x), x @ x]),
        lambda x: np.array([np.prod(x) / x, 2 * x]),
        [25, 40], [np.inf, 40], 4, 1.0, 5.0,
    )  # fmt: skip


def test_a_textbook_program_with_equation_inequality_and_bounds():
    program = hock_schittkowski_71()
    found = minimize(program, np.array([1.0, 5.0, 5.0, 1.0]), np.inf, 1e-12)
    conditions = stationarity(program, found.v)
    assert found.objective == pytest.approx(17.0140173, abs=1e-7)
    assert max(conditions.kkt_error, conditions.violation, conditions.complementarity) < 1e-6


def test_known_curvature_saves_iterations_and_changes_no_answer():
    stiff = np.geomspace(1.0, 100.0, 12)
    program = Program(
        lambda x: 0.5 * (stiff * x) @ x + 0.25 * (x**4).sum(),
        lambda x: stiff * x + x**3,
        lambda x: np.array([x.sum()]),
        lambda x: np.ones((1, 12)),
        [1.0], [1.0], 12,
    )  # fmt: skip
    first = minimize(program, np.ones(12), np.inf, 1e-12)
    beside = first.v + 0.1 * np.sin(np.arange(12.0))
    again = minimize(program, beside, np.inf, 1e-12, curvature=first.curvature)
    anew = minimize(program, beside, np.inf, 1e-12)
    assert again.objective == pytest.approx(first.objective, abs=1e-10)
    assert again.iterations <= 0.7 * anew.iterations


def test_rows_that_contradict_each_other_where_they_are_linearised_are_approached():
    # at (0, 0.001) the linearised circle asks for a height of 500, and x1 >= 0.5 leaves the box no
    # way there
    program = Program(
        lambda x: x[0],
        lambda x: np.array([1.0, 0.0]),
        lambda x: np.array([x[0] ** 2 + x[1] ** 2, x[0]]),
        lambda x: np.array([[2 * x[0], 2 * x[1]], [1.0, 0.0]]),
        [1.0, 0.5], [1.0, np.inf], 2,
    )  # fmt: skip
    found = minimize(program, np.array([0.0, 1e-3]), 2.0, 1e-12)
    assert found.v == pytest.approx([0.5, np.sqrt(0.75)], abs=1e-8)


def test_a_kink_of_the_objective_is_found():
    """|x1| + (x2 - 1)^2: the second derivative does not exist where the optimum is."""
    program = Program(
        lambda x: abs(x[0]) + (x[1] - 1) ** 2,
        lambda x: np.array([np.sign(x[0]), 2 * (x[1] - 1)]),
        lambda x: np.zeros(0), lambda x: np.zeros((0, 2)), [], [], 2,
    )  # fmt: skip
    found = minimize(program, np.array([0.7, -0.4]), np.inf, 1e-10)
    assert found.objective < 1e-3


def of_one(f, slope, lower=-np.inf, upper=np.inf):
    """A program of one number without rows."""
    return Program(
        f,
        lambda x: slope(x).reshape(1),
        lambda x: np.zeros(0),
        lambda x: np.zeros((0, 1)),
        [],
        [],
        1,
        lower,
        upper,
    )


def test_where_no_step_is_an_improvement_the_start_is_what_is_found():
    found = minimize(of_one(lambda x: x[0], lambda x: -np.ones(1)), np.array([0.3]), 1.0, 1e-12)
    assert (found.v[0], found.objective, found.iterations) == (0.3, 0.3, 1)


def test_steps_that_lead_away_from_what_a_row_asks_for_are_cut():
    """Newton's method for arctan(x) = 0 diverges from beyond 1.39."""
    program = Program(
        lambda x: 0.0,
        lambda x: np.zeros(1),
        lambda x: np.arctan(x),
        lambda x: 1 / (1 + x[None] ** 2),
        [0.0],
        [0.0],
        1,
    )
    assert minimize(program, np.array([3.0]), np.inf, 1e-12).v[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("least_at", "bound", "v", "on_edge"),
    [(0.6, 1, 0.6, False), (2, 1, 0.9, True), (-2, 1, -0.1, True), (2, 0.7, 0.7, False)],
)
def test_only_the_box_has_an_edge_and_the_bounds_of_a_program_have_none(
    least_at, bound, v, on_edge
):
    for way in (1, -1):
        mirrored = of_one(
            lambda x, c=way * least_at: 0.5 * (x[0] - c) ** 2,
            lambda x, c=way * least_at: x - c,
            -bound,
            bound,
        )
        found = minimize(mirrored, np.array([0.4 * way]), 0.5, 1e-12)
        assert (found.v[0], found.on_edge) == (pytest.approx(way * v), on_edge)


def test_multipliers_and_violations_are_those_of_bounds_by_hand():
    """3 x - 2 y within a square is least in its corner (0, 1); a row that does not bind has no
    multiplier."""
    slopes = np.array([3.0, -2.0])
    program = Program(
        lambda x: slopes @ x,
        lambda x: slopes,
        lambda x: x[:1] + x[1:],
        lambda x: np.ones((1, 2)),
        [-5],
        [5],
        2,
        0,
        1,
    )
    for off in (0.0, 0.01):
        found = stationarity(program, np.array([-off, 1.0]))
        assert (found.kkt_error, found.violation, found.complementarity) == pytest.approx(
            (0.0, off, 3 * off)
        )
        assert (found.on_rows, found.on_bounds) == (
            pytest.approx([0.0]),
            pytest.approx([-3.0, 2.0]),
        )


def test_the_box_is_kept_and_its_edge_is_told():
    program = hock_schittkowski_71()
    found = minimize(program, np.array([1.0, 4.0, 4.5, 2.0]), 0.1, 1e-12)
    assert found.on_edge
    assert np.abs(found.v - [1.0, 4.0, 4.5, 2.0]).max() <= 0.1 + 1e-12


def test_a_step_meets_its_limits_exactly():
    rng = np.random.default_rng(0)
    n, m = 40, 10
    factor, slopes, gradient = rng.normal(size=(n, n)), rng.normal(size=(m, n)), rng.normal(size=n)
    b = np.eye(n) + factor @ factor.T
    step = quadratic_step(
        b,
        gradient,
        slopes,
        np.full(m, -np.inf),
        np.full(m, -0.1),
        np.full(n, -0.2),
        np.full(n, 0.2),
    )
    assert step is not None
    assert (slopes @ step.d).max() <= -0.1 + 1e-9
    free = np.abs(step.d) < 0.2 - 1e-9
    assert np.abs((b @ step.d + gradient + slopes.T @ step.on_rows)[free]).max() < 1e-9


def test_steps_in_several_threads_are_those_of_one():
    """Threads of a cluster's worker step at once; a solver that they shared crashed."""

    def steps(seed):
        rng, found = np.random.default_rng(seed), []
        for _ in range(300):
            q = rng.normal(size=(8, 8))
            limits = (np.full(6, -1.0), np.full(6, 1.0), np.full(8, -1.0), np.full(8, 1.0))
            found.append(
                quadratic_step(
                    q @ q.T + np.eye(8), rng.normal(size=8), rng.normal(size=(6, 8)), *limits
                ).d
            )
        return np.array(found)

    with ThreadPoolExecutor(3) as pool:
        together = list(pool.map(steps, range(3)))
    for seed, found in enumerate(together):
        np.testing.assert_array_equal(found, steps(seed))


def test_of_rows_that_contradict_each_other_a_part_is_removed():
    """Of d <= -1 and d >= 3 none, for what helps one harms the other."""
    low, high = np.array([-np.inf, 3.0]), np.array([-1.0, np.inf])
    step = quadratic_step(
        np.eye(1), np.zeros(1), np.ones((2, 1)), low, high, -np.full(1, 10.0), np.full(1, 10.0)
    )
    assert step.share == pytest.approx(0, abs=1e-9)
    assert step.d == pytest.approx([0.0], abs=1e-8)


def test_a_step_meets_rows_that_agree():
    low, high = np.array([1.0, 3.0]), np.array([np.inf, np.inf])
    step = quadratic_step(
        np.eye(1), np.zeros(1), np.ones((2, 1)), low, high, -np.full(1, 10.0), np.full(1, 10.0)
    )
    assert step.share == 1
    assert step.d == pytest.approx([3.0])
    assert step.on_rows == pytest.approx([0.0, -3.0])
