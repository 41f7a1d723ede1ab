"""Where smooth pieces meet, stationarity is a matter of the gradients of all of them."""

import numpy as np
import pytest

from colloc.numerics.sqp import stationarity, stationarity_around

ZERO = np.zeros(2)


class Pieces:
    """The largest (or the smallest, with sign -1) of linear pieces and a bowl, with x + y = total
    as a row."""

    def __init__(self, slopes, sign=1.0, total=None):
        self._slopes, self._sign, rows = (
            np.array(slopes, dtype=float),
            sign,
            0 if total is None else 1,
        )
        self.lower, self.upper = np.full(2, -1.0), np.full(2, 1.0)
        self.row_lower = self.row_upper = np.full(rows, total, dtype=float)

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
    """Of the plane the third piece has a fiftieth, right below; the others' gradients leave (0,
    0.05)."""
    narrow = Pieces([(1, 0.05), (-1, 0.05), (0, -0.01)])
    assert around(narrow, ZERO, points=2).kkt_error < 2e-6
    assert around(Pieces([(1, 0.05), (-1, 0.05)]), ZERO, points=2).kkt_error == pytest.approx(
        0.05, rel=1e-3
    )


def test_they_do_not_cancel_on_a_slope_with_a_kink():
    assert around(Pieces([(1, 1), (-1, 1)]), ZERO).kkt_error == pytest.approx(1, abs=1e-5)


def test_a_row_that_binds_carries_what_is_left_along_it():
    assert stationarity(
        valley := Pieces([(2, 0), (-1, 1)], total=0.0), ZERO
    ).kkt_error == pytest.approx(1)
    assert around(valley, ZERO, points=16).kkt_error < 2e-6
    assert around(Pieces([(1, 0), (2, -1)], total=0.0), ZERO).kkt_error == pytest.approx(
        0.5, abs=1e-5
    )


def test_a_ridge_has_the_same_gradients_and_is_no_minimum():
    at = stationarity(ridge := Pieces([(1, 0), (-1, 0)], sign=-1.0), ZERO)
    assert stationarity_around(ridge, ZERO, at, 1e-6, enough=1e-9) is at


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


def test_a_kink_farther_away_than_the_radius_does_not_count():
    beside = np.array([1e-3, 0.0])
    assert around(Pieces([(1, 0), (-1, 0)]), beside).kkt_error > 0.9
    assert around(Pieces([(1, 0), (-1, 0)]), beside, radius=1e-2).kkt_error < 2e-2
