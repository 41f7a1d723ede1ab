"""Tableau identities and convergence orders of the time schemes."""

import numpy as np
import pytest

from colloc.numerics.mesh import Mesh, uniform_mesh
from colloc.numerics.schemes import scheme
from colloc.system.errors import ProblemError

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


@pytest.mark.parametrize("name", ["spline", "gauss-0", "gauss-13", "radau", 3, ""])
def test_unknown_schemes_are_refused(name):
    with pytest.raises(ProblemError, match="unknown scheme"):
        scheme(name)


@pytest.mark.parametrize(("name", "order"), ORDERS.items())
def test_mesh_integrates_at_the_order_of_its_scheme(name, order):
    s = scheme(name)
    errors = []
    for n in (4, 8):
        mesh = uniform_mesh(s, n, 2.0)
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
