"""What is stated of a corner, every operation that states it, and what a potential may do over a cell
hold the exact value: in fractions, to 60 digits, or written out term by term."""

import ctypes
import itertools
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from scipy.interpolate import BSpline

from colloc import Chain, Elliptic, Friction
from colloc.bounds.sampled import DEGREE, PotentialSpace, TensorSpline
from research.guarantee import kernel
from research.guarantee.c_compiler import compiled_library
from research.guarantee.enclosure import CORNERS, DELTA, Cells, states
from research.guarantee.loaded_balance import Loaded
from research.guarantee.potential_range import _HEADINGS, PotentialRange, gain_bound

OPERATIONS = """
#include "interval.hpp"
extern "C" void operations(int n, const double *given, Interval *found)
{
    for (int i = 0; i < n; ++i, given += 4, found += 9) {
        const Interval a(given[0], given[1]), b(given[2], given[3]);
        found[0] = a + b, found[1] = a - b, found[2] = a * b, found[3] = a / b, found[4] = square(a);
        found[5] = root(size_of(a)), found[6] = arc_of(a, size_of(b)), found[7] = log_of(size_of(b)), found[8] = sine_of(a.lo);
    }
}
"""


@pytest.mark.slow
def test_operations_hold_the_exact_results_of_all_that_their_operands_hold(tmp_path):
    (tmp_path / "operations.cpp").write_text(OPERATIONS)
    headers = {"interval.hpp": (kernel.SOURCES / "interval.hpp").read_text("ascii")}
    library = compiled_library(tmp_path / "operations.cpp", kernel.proof_flags(), headers)
    rng, n = np.random.default_rng(71), 2000
    a, b = np.sort(rng.normal(size=(2, n, 2)) * 10.0 ** rng.integers(-9, 3, (2, n, 1)), axis=-1)
    a[::2], b[::3] = a[::2, :1], b[::3, :1]  # exact ones
    b = np.where(
        (b > 0).any(axis=1) & (b < 0).any(axis=1), np.abs(b).max(axis=1), b.T
    ).T  # division by 0 is not defined
    given, found = np.ascontiguousarray(np.concatenate([a, b], axis=1)), np.empty((n, 9, 2))
    library.operations(n, *(ctypes.c_void_p(each.ctypes.data) for each in (given, found)))
    with mpmath.workdps(60):
        for row, held in zip(given, found, strict=True):
            for x, y in ((x, y) for x in map(Fraction, row[:2]) for y in map(Fraction, row[2:])):
                p, q = (mpmath.mpf(z.numerator) / z.denominator for z in (x, abs(y)))
                exact = [x + y, x - y, x * y, x / y, x * x]
                far = [mpmath.sqrt(abs(p)), mpmath.asinh(p / q), mpmath.log(q)]
                far += [mpmath.sin(p)] * (x == row[0])
                bounds = ((Fraction(lo), Fraction(hi)) for lo, hi in held)
                assert all(lo <= z <= hi for z, (lo, hi) in zip(exact, bounds, strict=False))
                assert all(lo <= z <= hi for z, (lo, hi) in zip(far, held[5:], strict=False))
    low, high = np.moveaxis(found[::6, [0, 2, 3, 4, 5, 8]], -1, 0)
    assert (high - low <= 1e-14 * np.abs(high) + 1e-14).all()


def exact_state(lengths, sigma, point, z, load):
    """Dissipation, forces of links (along, across, about the hinge), sum phi . B r, imbalance."""
    mp, total, forces, left = mpmath.mpf, mpmath.mpf(0), [], [mpmath.mpf(float(x)) for x in load]
    *q, s = (mp(float(x)) for x in point)
    z, side = [mp(float(x)) for x in z], mp(float(lengths[1])) / 2
    places, spins = (-side, -side, side), (1 - z[2], z[2], z[2] + s)
    links = zip((q[0], 0, -q[1]), places, spins, (-1, 1, 1), lengths, strict=True)
    for angle, at, spin, sense, l in links:
        hinge = mpmath.expj(angle) * mpmath.mpc(z[0], z[1] + at * z[2])
        by, l, y0 = mp(float(sigma[0 if hinge.real > 0 else 1])), mp(float(l)), hinge.imag
        x, y1 = by * hinge.real, y0 + l * spin
        a, r0, r1 = (mpmath.sqrt(x**2 + y**2 + mp(DELTA) ** 2) for y in (0, y0, y1))
        arc = (mpmath.asinh(y1 / a) - mpmath.asinh(y0 / a)) / spin
        whole, first = ((y1 * r1 - y0 * r0) / spin + a**2 * arc) / 2, (r1 - r0) / spin
        force = by * x * arc, first, (whole - a**2 * arc - y0 * first) / spin
        total += whole
        forces.append(force)
        push = mpmath.expj(-angle) * mpmath.mpc(*force[:2])
        moment = at * push.imag + sense * force[2]
        left = [a - b for a, b in zip(left, (push.real, push.imag, moment), strict=True)]
    flat = [each for force in forces for each in force]
    return [total, *flat, forces[0][2] + s * forces[2][2], mpmath.hypot(*left[:2]), abs(left[2])]


@pytest.mark.parametrize(
    "friction", [Friction(), Elliptic(mu_t=1.0, mu_f=0.6, mu_b=1.4)], ids=["equal", "directed"]
)
def test_what_is_stated_of_a_corner_holds_what_it_is_to_sixty_digits(friction):
    """At any speed; with links that hardly turn, or turn about a point of their own."""
    rng, body, n = np.random.default_rng(72), Chain((0.3, 0.45, 0.25)), 60
    points = rng.uniform(-2.5, 2.5, (3, n)) * [[1], [1], [0.4]]
    z = rng.normal(size=(3, n)) * 10.0 ** rng.integers(-9, 1, n)
    z[0, ::4] *= 1e-9
    z[2, 1::4] = 1.0 - 1e-13
    load = 0.01 * rng.normal(size=(3, n))
    found = states(body, friction, points, z, load).reshape(n, 13, 2)
    with mpmath.workdps(60):
        for i in range(n):
            at = (friction.mu_f, friction.mu_b), points[:, i], z[:, i], load[:, i]
            exact = exact_state(body.lengths, *at)
            assert all(lo <= each <= hi for each, (lo, hi) in zip(exact, found[i], strict=True))
    assert np.median(found[:, :, 1] - found[:, :, 0]) < 1e-13


PIECE = """
#include "growth.hpp"
extern "C" void piece(const double *mean, double begin, double end, Interval *found)
{
    CellLink k;
    Arcs arcs;
    Matrix3 H;
    k.sign = 1.0, k.mean_hinge[0] = mean[0], k.mean_hinge[1] = mean[1], k.mean_spin = mean[2];
    k.hinge_row[0][0] = k.hinge_row[1][1] = 1.0;
    add_piece(&k, H, &arcs, 1.0, begin, end);
    for (int i = 0; i < 9; ++i)
        found[i] = H[i / 3][i % 3];
}
"""


def test_growth_of_a_short_arc_is_never_more_than_it_is_and_nearly_as_much(tmp_path):
    """The integral of (a.n)^2/|V| by quadrature, also for turns about a point of the piece."""
    (tmp_path / "piece.cpp").write_text(PIECE)
    headers = {each.name: each.read_text("ascii") for each in kernel.SOURCES.glob("*.hpp")}
    library = compiled_library(tmp_path / "piece.cpp", kernel.proof_flags(), headers)
    rng, (nodes, weights) = np.random.default_rng(73), np.polynomial.legendre.leggauss(8)
    library.piece.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_void_p]
    for turn in 10.0 ** rng.uniform(-6, -2.6, 40):
        vs, y = rng.normal(size=2)
        begin, length = 0.1, 0.05
        w = turn * np.hypot(vs, y) / length
        mean, found = np.array([vs, y - w * begin, w]), np.empty((3, 3, 2))
        library.piece(mean.ctypes.data, begin, begin + length, found.ctypes.data)
        lower = np.tril(found[:, :, 1])
        form = lower + lower.T - np.diag(np.diag(lower))
        s, weight = begin + length * (0.5 + 0.5 * nodes), 0.5 * length * weights
        V = np.stack([0 * s + vs, mean[1] + w * s])
        for about in (*rng.uniform(0, 0.3, 3), begin, begin + 0.5 * length):
            spin = rng.normal()
            d = np.array([0.01 * spin * rng.normal(), -spin * about, spin])
            across = (V[0] * (d[1] + d[2] * s) - V[1] * d[0]) / np.hypot(*V)
            exact = (weight * across**2 / np.hypot(*V)).sum()
            assert exact * (1 - 4 * turn**2) - 1e-15 <= d @ form @ d <= exact * (1 + 1e-12)


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


def test_what_is_stated_of_a_harmonic_and_its_gain_holds_them_in_fractions(potential, cells):
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
    """h^2/8 of second derivatives; h/4 of a change times the other's slope."""
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
        slopes = {k: [potential.largest[k, d][i, j] for d in ((1, 0), (0, 1))] for k in (1, 3)}
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
    """A cubic that is the same everywhere meets the bound."""
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
