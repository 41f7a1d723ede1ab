"""What is stated of a corner, and every operation that states it, holds the exact value: in
fractions, or to 60 digits."""

import ctypes
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from colloc import Chain, Elliptic, Friction
from colloc.mechanics.native_kernel import native_kernel
from research.guarantee import kernel
from research.guarantee.c_compiler import compiled_library
from research.guarantee.enclosure import DELTA, states

pytestmark = pytest.mark.skipif(native_kernel() is None, reason="no C compiler")
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
    """Dissipation, forces (along, across, moment about the hinge) of each link, sum phi . B r,
    force and torque left over."""
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
    """Of motions of any speed; of links that hardly turn, and of ones that turn about a point of
    their own."""
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
    """The integral of (a.n)^2/|V| by quadrature, of changes that turn about a point of the piece
    too."""
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
