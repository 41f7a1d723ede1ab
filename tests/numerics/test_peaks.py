"""The finder of peaks, and the curvature that a moving peak adds, against functions whose answers
are known."""

import numpy as np
import pytest

from colloc.numerics.peaks import curvature_of_moving, peaks


@pytest.mark.parametrize(("power", "off"), [(1, 3e-5), (2, 1e-9)], ids=["kink", "smooth"])
def test_peaks_are_found_inside_and_at_ends(power, off):
    where = np.array([-0.2, 0.0, 0.1234567, 0.5, 0.987654, 1.0, 1.7])
    left, width = np.full(where.size, 2.0), np.full(where.size, 0.5)
    at, height = peaks(lambda t: -(np.abs((t - 2.0) / 0.5 - where[:, None]) ** power), left, width)
    inside = np.clip(where, 0, 1)
    np.testing.assert_allclose((at - left) / width, inside, rtol=0, atol=off)
    np.testing.assert_allclose(
        height, -(np.abs(inside - where) ** power), rtol=1e-4, atol=6e-5**power
    )


def value(t, v):
    return np.cos(t - 0.3 * v[0]) * np.exp(0.2 * v[1] * t) + v[0] * v[1]


def second_derivatives(of, v, step):
    unit = step * np.eye(v.size)
    each = [
        [of(v + i + j) - of(v + i - j) - of(v - i + j) + of(v - i - j) for i in unit] for j in unit
    ]
    return np.array(each) / (4 * step**2)


def test_the_curvature_of_a_largest_value_is_that_of_the_value_at_its_moving_peak():
    v, fine = np.array([0.7, -0.4]), np.linspace(-1, 2, 300_001)
    peak = fine[value(fine, v).argmax()]
    t = peak + 1e-3 * np.array([-1.0, 0.0, 1.0])
    slopes = np.stack(
        [(value(t, v + step) - value(t, v - step)) / 2e-5 for step in 1e-5 * np.eye(2)], axis=1
    )
    added = curvature_of_moving(np.ones(1), value(t, v)[:, None], slopes[:, None])
    held, moving = (
        second_derivatives(of, v, 1e-2)
        for of in (lambda v: value(peak, v), lambda v: value(fine, v).max())
    )
    np.testing.assert_allclose(held + added, moving, atol=2e-4)
    assert np.abs(added).max() > 1e-2
    # a lowest value is no peak of a row that is bounded from above
    np.testing.assert_array_equal(
        curvature_of_moving(-np.ones(1), value(t, v)[:, None], slopes[:, None]), np.zeros((2, 2))
    )
