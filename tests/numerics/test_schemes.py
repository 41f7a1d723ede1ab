"""Tableau identities and convergence orders of the time schemes."""

import numpy as np
import pytest

from colloc.numerics.mesh import Mesh
from colloc.numerics.peaks import curvature_of_moving, peaks
from colloc.numerics.schemes import scheme

ORDERS = {"trapezoid": 2, "hermite-simpson": 4}
ORDERS |= {f"gauss-{s}": 2 * s for s in range(1, 7)} | {
    f"radau-{s}": 2 * s - 1 for s in range(1, 7)
}


@pytest.mark.parametrize(("name", "order"), ORDERS.items())
def test_tableau_identities(name, order):
    s = scheme(name)
    np.testing.assert_allclose(s.A.sum(axis=1), s.c, atol=1e-14)
    for k in range(1, s.s + 1):  # simplifying assumptions C(s)
        np.testing.assert_allclose(s.A @ s.c ** (k - 1), s.c**k / k, atol=1e-13)
    for k in range(1, order + 1):  # order conditions B(p), and not one more
        assert abs(s.b @ s.c ** (k - 1) - 1 / k) < 1e-13
    assert abs(s.b @ s.c**order - 1 / (order + 1)) > 1e-12


@pytest.mark.parametrize("name", ["gauss-12", "radau-12"])
def test_high_orders_stay_accurate(name):
    s = scheme(name)
    assert abs(s.b @ np.cos(s.c) - np.sin(1)) < 1e-14
    assert s.b.min() > 0


@pytest.mark.parametrize(("name", "order"), ORDERS.items())
def test_mesh_integrates_at_the_order_of_its_scheme(name, order):
    s = scheme(name)
    errors = []
    for n in (4, 8):
        mesh = Mesh(s, np.linspace(0.0, 2.0, n + 1))
        _, rate = mesh.quadrature()
        errors.append(abs((rate @ np.exp(mesh.times)).sum() - (np.exp(2.0) - 1)))
    if errors[1] > 1e-13:
        assert abs(np.log2(errors[0] / errors[1]) - order) < 0.3
    assert errors[1] < 8.0 * 0.25**order


@pytest.mark.parametrize("name", ORDERS)
def test_site_equations_have_one_row_per_unknown_and_integrate_polynomials_exactly(name):
    s = scheme(name)
    mesh = Mesh(s, np.array([0.0, 0.3, 0.4, 1.1]))
    state, rate = mesh.integration()
    assert state.shape == (mesh.n_site - 1, mesh.n_site)
    sites = np.empty(mesh.n_site)
    sites[mesh.edge_sites] = mesh.edges
    sites[mesh.sites] = mesh.times[mesh.points]
    degree = s.s
    np.testing.assert_allclose(
        state @ sites**degree - rate @ (degree * mesh.times ** (degree - 1)), 0, atol=1e-13
    )


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
