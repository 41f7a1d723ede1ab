"""What a potential may do over a cell: written out term by term, and met where nothing is lost."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from scipy.interpolate import BSpline

from colloc.bounds.potential import DEGREE, PotentialSpace, TensorSpline
from research.guarantee.enclosure import CORNERS, Cells
from research.guarantee.loaded_balance import Loaded
from research.guarantee.potential_range import _HEADINGS, PotentialRange, gain_bound

N = 6


@pytest.fixture(scope="module")
def potential():
    space = PotentialSpace(TensorSpline(2, np.pi, 4), (1, 3), True)
    return PotentialRange(space, np.random.default_rng(3).normal(size=space.size))


@pytest.fixture(scope="module")
def cells():
    """Oblong ones, none of which a knot cuts, with s of both signs."""
    rng = np.random.default_rng(4)
    size = np.array([[0.05], [0.02], [0.3]]) * rng.uniform(0.5, 1, (3, N))
    places = rng.integers(-2, 2, (2, N)) * np.pi / 2 + rng.uniform(0.1, 1.4, (2, N))
    low = np.stack([*places, rng.uniform(-1, 0.7, N)])
    points = (low[:, :, None] + size[:, :, None] * CORNERS.T[:, None, :]).reshape(3, -1)
    return Cells(low, size, points, np.arange(8 * N).reshape(N, 8))


def motions_at(points, seed=5):
    rng = np.random.default_rng(seed)
    n = points.shape[1]
    blank = [np.zeros((3, 3, n)), np.zeros((2, n)), np.zeros(n)]
    return Loaded(rng.normal(size=(3, n)), rng.uniform(1, 2, n), rng.uniform(1, 2, n), *blank)


def value(potential, k, q, order=(0, 0)):
    """c_k or a derivative of it at one shape."""
    t, every = potential.spline.extend, np.eye(potential.spline.per_joint)
    return (
        np.kron(*(BSpline(t, every, DEGREE)(*each) for each in zip(q, order, strict=True)))
        @ potential.c[k]
    )


def cubic(t, i, x, degree=DEGREE):
    """The i-th B-spline on some knots and its slope, by its recursion; in fractions."""
    if degree == 0:
        return Fraction(t[i] <= x < t[i + 1]), Fraction(0)
    one, other = cubic(t, i, x, degree - 1)[0], cubic(t, i + 1, x, degree - 1)[0]
    up, down = 1 / (t[i + degree] - t[i]), 1 / (t[i + degree + 1] - t[i + 1])
    return (x - t[i]) * up * one + (t[i + degree + 1] - x) * down * other, degree * (
        up * one - down * other
    )


def test_what_is_stated_of_a_harmonic_and_of_its_gain_holds_what_they_are_in_fractions(
    potential, cells
):
    points, z = cells.points[:, ::5], motions_at(cells.points[:, ::5]).velocity
    knots = [Fraction(x) for x in potential.spline.extend]
    for k, c in potential.c.items():
        table = c.reshape(potential.spline.per_joint, -1)
        stated = potential._harmonic(k, points, z)
        for n, (q1, q2, s) in enumerate(points.T):
            first, second = (
                [cubic(knots, i, Fraction(q)) for i in range(len(table))] for q in (q1, q2)
            )
            x, y, spin = (Fraction(v) for v in z[:, n])
            for part in (0, 1):
                real, value, rate = (np.real, np.imag)[part], [0, 0], 0
                pairs = itertools.product(enumerate(first), enumerate(second))
                for (i, (a, da)), (j, (b, db)) in pairs:
                    if a * b:
                        both = Fraction(table[i, j].real), Fraction(table[i, j].imag)
                        value = [v + a * b * each for v, each in zip(value, both, strict=True)]
                        rate += (da * b + Fraction(s) * a * db) * both[part]
                turned = k * spin * value[0] if part else -k * spin * value[1]
                gain = rate + turned + ((x, y)[part] if k == 1 else 0)
                for exact, (near, off) in zip((value[part], gain), stated, strict=True):
                    assert abs(exact - Fraction(float(real(near[n])))) <= Fraction(off[n])
        assert max(off.max() for _, off in stated) < 1e-13


def test_the_gain_over_all_headings_is_bounded_from_above_and_closely():
    rng = np.random.default_rng(41)
    amplitudes = {k: rng.normal(size=40) + 1j * rng.normal(size=40) for k in (1, 3, 5)}
    theta = np.linspace(0, 2 * np.pi, 20001)
    waves = (np.real(a[:, None] * np.exp(1j * k * theta)) for k, a in amplitudes.items())
    fine = sum(waves).max(axis=1)
    assert np.all(gain_bound(amplitudes) >= fine)
    assert np.all(gain_bound(amplitudes) <= fine * 1.005)


@pytest.mark.parametrize("harmonic", [1, 2, 3])
def test_half_way_between_headings_the_bound_of_the_gain_is_met_to_fourth_order(harmonic):
    step = np.pi / _HEADINGS
    for amplitude in (1.0, 2.5):
        found = gain_bound({harmonic: np.array([amplitude * np.exp(1j * harmonic * step)])})[0]
        assert amplitude <= found <= amplitude * (1 + (harmonic * step) ** 4 / 20 + 2e-9)


def test_the_error_of_a_trial_motion_is_that_of_interpolating_slopes_and_products(potential, cells):
    """h^2/8 of second derivatives of the rate, and of spin times potential; (h/4) of the change of
    one times the slope of the other."""
    motions = motions_at(cells.points)
    found = potential.trial_error(cells, motions)
    for n in range(N):
        spin, place = motions.velocity[2, cells.at[n]].reshape(2, 2, 2), cells.low[:2, n]
        s = max(abs(cells.low[2, n]), abs(cells.low[2, n] + cells.size[2, n]))
        i, j = (int(np.searchsorted(potential.spline.knots, q, side="right")) - 1 for q in place)
        total = 0.0
        for k in (1, 3):
            tables = potential.largest.items()
            largest = {order: table[i, j] for (own, order), table in tables if own == k}
            for axis in (0, 1):
                h, change = cells.size[axis, n], np.abs(np.diff(spin, axis=axis)).max()
                twice, once = ((2, 0), (1, 0)) if axis == 0 else ((0, 2), (0, 1))
                rate = largest[twice[0] + 1, twice[1]] + s * largest[twice[0], twice[1] + 1]
                product = h**2 / 8 * np.abs(spin).max() * largest[twice]
                total += h**2 / 8 * rate + k * (product + h / 4 * change * largest[once])
        assert found[n] == pytest.approx(total, rel=1e-8)


def test_a_reference_point_is_the_first_harmonic_and_all_else_is_beside_it(potential, cells):
    found = potential.reference(cells)
    for n in range(N):
        centre = cells.low[:2, n] + 0.5 * cells.size[:2, n]
        i, j = (int(np.searchsorted(potential.spline.knots, q, side="right")) - 1 for q in centre)
        slopes = {
            k: [potential.largest[k, order][i, j] for order in ((1, 0), (0, 1))] for k in (1, 3)
        }
        across = {k: cells.size[0, n] * a + cells.size[1, n] * b for k, (a, b) in slopes.items()}
        bent = [potential.largest[1, order][i, j] for order in ((2, 0), (0, 2))]
        assert found.centre[n] == pytest.approx(value(potential, 1, centre), rel=1e-8)
        for corner in cells.at[n]:
            known = value(potential, 1, cells.points[:2, corner])
            assert found.at[corner] == pytest.approx(known, rel=1e-8)
        beside = 0.5 * across[1] + 3 * (0.5 * across[3] + abs(value(potential, 3, centre)))
        assert found.beside[n] == pytest.approx(beside, rel=1e-8)
        assert found.change[n] == pytest.approx(across[1], rel=1e-8)
        curvature = (cells.size[:2, n] ** 2 / 8 * bent).sum()
        assert found.curvature[n] == pytest.approx(curvature, rel=1e-8)


@pytest.mark.parametrize("order", [(1, 0), (0, 1), (2, 0), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)])
def test_bounds_of_derivatives_are_the_hull_of_their_coefficients(potential, order):
    """A cubic that is the same everywhere has the same derivatives everywhere: the bound is met by
    a polynomial."""
    a, b = order
    spline, space = potential.spline, potential.space
    whole = PotentialRange(space, np.zeros(space.size))
    at = np.stack([axis.ravel() for axis in np.meshgrid(*[np.linspace(-np.pi, np.pi, 29)] * 2)])
    monomial = at[0] ** a * at[1] ** b
    whole.c = {
        1: np.linalg.lstsq(
            spline.matrices(at, at)[0].toarray(), monomial.astype(complex), rcond=None
        )[0]
    }
    factorial = np.prod(np.arange(1, a + 1)) * np.prod(np.arange(1, b + 1))
    np.testing.assert_allclose(whole.largest[1, order], factorial, rtol=1e-7)
