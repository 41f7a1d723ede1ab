"""Tableau identities and convergence orders of the time schemes."""

import numpy as np
import pytest

from colloc.numerics.mesh import Mesh
from colloc.numerics.peaks import curvature_of_moving, peaks
from colloc.numerics.schemes import scheme

ORDERS = {"trapezoid": 2, "hermite-simpson": 4}
ORDERS |= {f"gauss-{s}": 2 * s for s in range(1, 7)}
ORDERS |= {f"radau-{s}": 2 * s - 1 for s in range(1, 7)}


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
    known = -(np.abs(inside - where) ** power)
    np.testing.assert_allclose(height, known, rtol=1e-4, atol=6e-5**power)


@pytest.mark.parametrize(("at", "multiplier", "added"), [(0, 1, 1), (np.pi, 1, 0), (np.pi, -1, 1)])
def test_a_row_gains_curvature_from_a_peak_that_moves_not_from_a_valley(at, multiplier, added):
    """cos(t - v) is 1 at its peak, whatever v is; held at t = v its curvature is -1."""
    t = at + 1e-3 * np.array([[-1.0], [0.0], [1.0]])
    found = curvature_of_moving(np.full(1, multiplier), np.cos(t), np.sin(t)[..., None])
    np.testing.assert_allclose(found, [[added]], atol=1e-5)
