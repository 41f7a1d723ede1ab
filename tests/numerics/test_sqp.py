"""SQP with quasi-Newton updates: known optima, constraints that clash at first, kinks, boxes."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from colloc import NotConvergedError
from colloc.numerics.conic import linear_maximum, quadratic_step
from colloc.numerics.sqp import minimize, nonnegative, stationarity, stationarity_around


class Program:
    """A program from functions and their derivatives."""

    def __init__(self, f, g, c, a, row_lower, row_upper, n, lower=-np.inf, upper=np.inf):
        self.objective, self.gradient, self.rows, self.row_slopes = f, g, c, a
        self.row_lower, self.row_upper = (np.array(b, dtype=float) for b in (row_lower, row_upper))
        self.lower, self.upper = np.full(n, lower), np.full(n, upper)


def hock_schittkowski_71():
    """min x1 x4 (x1 + x2 + x3) + x3 = 17.0140173: prod x >= 25, |x|^2 = 40, 1 <= x <= 5."""
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
    """At (0, 0.001) the circle asks for a height of 500; x1 >= 0.5 leaves the box no way there."""
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
    rows = lambda x: np.zeros(0), lambda x: np.zeros((0, 1)), [], []
    return Program(f, lambda x: slope(x).reshape(1), *rows, 1, lower, upper)


def test_where_no_step_is_an_improvement_the_start_is_what_is_found():
    found = minimize(of_one(lambda x: x[0], lambda x: -np.ones(1)), np.array([0.3]), 1.0, 1e-12)
    assert (found.v[0], found.objective, found.iterations) == (0.3, 0.3, 1)


def test_steps_that_lead_away_from_what_a_row_asks_for_are_cut():
    """Newton's method for arctan(x) = 0 diverges from beyond 1.39."""
    rows = np.arctan, lambda x: 1 / (1 + x[None] ** 2), [0.0], [0.0]
    program = Program(lambda x: 0.0, lambda x: np.zeros(1), *rows, 1)
    assert minimize(program, np.array([3.0]), np.inf, 1e-12).v[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("least_at", "bound", "v", "on_edge"),
    [(0.6, 1, 0.6, False), (2, 1, 0.9, True), (-2, 1, -0.1, True), (2, 0.7, 0.7, False)],
)
def test_only_the_box_has_an_edge_the_bounds_of_a_program_have_none(least_at, bound, v, on_edge):
    for way in (1, -1):
        value, slope = (lambda x, c=way * least_at, n=n: (x - c) ** n / n for n in (2, 1))
        mirrored = of_one(lambda x, value=value: value(x)[0], slope, -bound, bound)
        found = minimize(mirrored, np.array([0.4 * way]), 0.5, 1e-12)
        assert (found.v[0], found.on_edge) == (pytest.approx(way * v), on_edge)


def test_multipliers_and_violations_are_those_of_bounds_by_hand():
    """In a square 3 x - 2 y is least in the corner (0, 1); slack rows have no multipliers."""
    slopes = np.array([3.0, -2.0])
    rows = lambda x: x[:1] + x[1:], lambda x: np.ones((1, 2)), [-5], [5]
    program = Program(lambda x: slopes @ x, lambda x: slopes, *rows, 2, 0, 1)
    for off in (0.0, 0.01):
        found = stationarity(program, np.array([-off, 1.0]))
        errors = found.kkt_error, found.violation, found.complementarity
        assert errors == pytest.approx((0.0, off, 3 * off))
        assert found.on_rows == pytest.approx([0.0])
        assert found.on_bounds == pytest.approx([-3.0, 2.0])


def test_a_step_meets_its_limits_exactly():
    rng = np.random.default_rng(0)
    n, m = 40, 10
    factor, slopes, gradient = rng.normal(size=(n, n)), rng.normal(size=(m, n)), rng.normal(size=n)
    b = np.eye(n) + factor @ factor.T
    limits = (np.full(*each) for each in ((m, -np.inf), (m, -0.1), (n, -0.2), (n, 0.2)))
    step = quadratic_step(b, gradient, slopes, *limits)
    assert step is not None
    assert (slopes @ step.d).max() <= -0.1 + 1e-9
    free = np.abs(step.d) < 0.2 - 1e-9
    assert np.abs((b @ step.d + gradient + slopes.T @ step.on_rows)[free]).max() < 1e-9


def test_steps_in_several_threads_are_those_of_one():
    """Threads of a cluster's worker step at once; a solver that they shared crashed."""

    def steps(seed):
        rng, found = np.random.default_rng(seed), []
        for _ in range(300):
            q, gradient, slopes = map(rng.standard_normal, ((8, 8), 8, (6, 8)))
            limits = (np.full(6, -1.0), np.full(6, 1.0), np.full(8, -1.0), np.full(8, 1.0))
            found.append(quadratic_step(q @ q.T + np.eye(8), gradient, slopes, *limits).d)
        return np.array(found)

    with ThreadPoolExecutor(3) as pool:
        together = list(pool.map(steps, range(3)))
    for seed, found in enumerate(together):
        np.testing.assert_array_equal(found, steps(seed))


def test_a_step_meets_rows_that_agree_and_of_rows_that_contradict_each_other_a_part_is_removed():
    """Of d <= -1 and d >= 3 none, for what helps one harms the other."""

    def step_of_one(low, high):
        box = -np.full(1, 10.0), np.full(1, 10.0)
        return quadratic_step(np.eye(1), np.zeros(1), np.ones((2, 1)), *np.array([low, high]), *box)

    step = step_of_one([-np.inf, 3.0], [-1.0, np.inf])
    assert step.share == pytest.approx(0, abs=1e-9)
    assert step.d == pytest.approx([0.0], abs=1e-8)
    step = step_of_one([1.0, 3.0], [np.inf, np.inf])
    assert step.share == 1
    assert step.d == pytest.approx([3.0])
    assert step.on_rows == pytest.approx([0.0, -3.0])


ZERO = np.zeros(2)


class Pieces:
    """The largest (or the smallest, with sign -1) of linear pieces and a bowl, with x + y = total
    as a row."""

    def __init__(self, slopes, sign=1.0, total=None):
        self._slopes, self._sign = np.array(slopes, dtype=float), sign
        self.lower, self.upper = np.full(2, -1.0), np.full(2, 1.0)
        self.row_lower = self.row_upper = np.full(0 if total is None else 1, total, dtype=float)

    def _piece(self, v):
        return int(np.argmax(self._sign * self._slopes @ v))

    def objective(self, v):
        return float((self._slopes @ v)[self._piece(v)] + 0.5 * v @ v)

    def gradient(self, v):
        return self._slopes[self._piece(v)] + v

    def rows(self, v):
        return np.full(self.row_lower.size, v.sum())

    def row_slopes(self, v):
        return np.ones((self.row_lower.size, 2))


def around(program, v, radius=1e-6, **given):
    return stationarity_around(program, v, stationarity(program, v), radius, enough=1e-9, **given)


@pytest.mark.parametrize(
    "slopes", [[(1, 0), (-2, 0)], [(1, 1), (-1, 0), (0, -1)], [(3, 1), (-1, 2), (-1, -1), (1, -2)]]
)
def test_gradients_of_all_sides_cancel_at_the_bottom_of_a_valley(slopes):
    program = Pieces(slopes)
    assert stationarity(program, ZERO).kkt_error >= 1
    assert around(program, ZERO, points=16).kkt_error < 2e-6


def test_a_narrow_side_is_found_that_chance_misses():
    """The third piece has a fiftieth of the plane, below; others' gradients leave (0, 0.05)."""
    narrow = Pieces([(1, 0.05), (-1, 0.05), (0, -0.01)])
    assert around(narrow, ZERO, points=2).kkt_error < 2e-6
    wide = Pieces([(1, 0.05), (-1, 0.05)])
    assert around(wide, ZERO, points=2).kkt_error == pytest.approx(0.05, rel=1e-3)


def test_a_row_that_binds_carries_what_is_left_along_it():
    valley, slope = (Pieces(each, total=0.0) for each in ([(2, 0), (-1, 1)], [(1, 0), (2, -1)]))
    assert stationarity(valley, ZERO).kkt_error == pytest.approx(1)
    assert around(valley, ZERO, points=16).kkt_error < 2e-6
    assert around(slope, ZERO).kkt_error == pytest.approx(0.5, abs=1e-5)


def test_on_a_slope_with_a_kink_far_from_one_and_on_a_ridge_they_do_not_cancel():
    assert around(Pieces([(1, 1), (-1, 1)]), ZERO).kkt_error == pytest.approx(1, abs=1e-5)
    at = stationarity(ridge := Pieces([(1, 0), (-1, 0)], sign=-1.0), ZERO)
    assert stationarity_around(ridge, ZERO, at, 1e-6, enough=1e-9) is at
    beside = np.array([1e-3, 0.0])
    assert around(Pieces([(1, 0), (-1, 0)]), beside).kkt_error > 0.9
    assert around(Pieces([(1, 0), (-1, 0)]), beside, radius=1e-2).kkt_error < 2e-2


def test_a_kink_from_which_one_way_leads_down_is_no_minimum_either():
    """Up by twice as much as down: the gradients of the four sides cancel all the same."""

    class Saddle(Pieces):
        def objective(self, v):
            return float(abs(v[0]) - 0.5 * abs(v[1]))

        def gradient(self, v):
            return np.array([1.0, -0.5]) * np.where(v < 0, -1.0, 1.0)

    at = stationarity(saddle := Saddle([(1, 0)]), ZERO)
    assert stationarity_around(saddle, ZERO, at, 1e-6, enough=1e-9, points=16) is at


def test_no_gradient_is_asked_for_beyond_the_bounds():
    """As of a square root at 0: there is nothing on the other side."""

    class Root(Pieces):
        def objective(self, v):
            assert (v >= self.lower).all()
            return float(np.sqrt(v[0] + 1.0) + abs(v[1]))

        def gradient(self, v):
            assert (v >= self.lower).all()
            return np.array([1.0, 1.0 if v[1] >= 0 else -1.0])

    assert around(Root([(1, 0)]), np.array([-1.0, 0.0]), points=16).kkt_error < 2e-6


@pytest.mark.parametrize("seed", range(40))
def test_nonnegative_least_squares_meet_the_conditions_of_a_minimum(seed):
    """Sufficient ones, as the program is convex; up to rounding of the sums that slopes are."""
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


def linear_program(seed):
    """Gain, equations and what these equal."""
    rng = np.random.default_rng(seed)
    equations, gain = rng.standard_normal((4, 60)), rng.standard_normal(60)
    equations[-1] = np.abs(equations[-1]) + 0.1
    return gain, equations, np.array([0.0, 0.0, 0.0, 1.0])


def test_a_linear_program_meets_its_dual():
    gain, equations, right = linear_program(1)
    value, x, multipliers = linear_maximum(gain, equations, right)
    np.testing.assert_allclose(equations @ x, right, atol=1e-12)
    assert x.min() >= 0
    assert np.count_nonzero(x) <= 4
    assert gain @ x == pytest.approx(value, abs=1e-12)
    assert multipliers @ right == pytest.approx(value, abs=1e-12)
    assert (gain - multipliers @ equations).max() <= 1e-9


def test_linear_programs_on_two_threads_are_what_they_are_one_after_another():
    def solved(seed):
        value, x, multipliers = linear_maximum(*linear_program(seed))
        return np.concatenate([[value], x, multipliers])

    alone = [solved(seed) for seed in range(100)]
    with ThreadPoolExecutor(2) as threads:
        np.testing.assert_array_equal(list(threads.map(solved, range(100))), alone)


@pytest.mark.parametrize(("column", "why"), [(-1.0, "Unbounded"), (1.0, "Infeasible")])
def test_a_linear_program_without_a_solution_says_so(column, why):
    with pytest.raises(NotConvergedError, match=why):
        linear_maximum(np.ones(2), np.array([[1.0, column]]), np.array([-column]))


def test_nonnegative_least_squares_are_met_where_those_of_scipy_go_round_in_circles(monkeypatch):
    rng = np.random.default_rng(0)
    matrix, right = rng.standard_normal((9, 14)), rng.standard_normal(9)
    expected = nonnegative(matrix, right)

    def circles(*_, **__):
        raise RuntimeError("Maximum number of iterations reached.")

    monkeypatch.setattr("scipy.optimize.nnls", circles)
    found = nonnegative(matrix, right)
    assert found.min() >= 0
    np.testing.assert_allclose(matrix @ found, matrix @ expected, atol=1e-12)
