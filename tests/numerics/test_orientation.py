"""The orientation on a mesh where its rate depends on it: against matrices, and against the differential equation."""

import numpy as np
import pytest

from colloc.numerics.mesh import Mesh
from colloc.numerics.orientation import Orientation
from colloc.numerics.schemes import scheme

EDGES = np.array([0.0, 0.1, 0.35, 0.4, 0.8, 1.0])


@pytest.mark.parametrize("name", ["gauss-3", "radau-2"])
def test_interval_by_interval_it_is_the_one_large_system(name):
    mesh, rng = Mesh(scheme(name), EDGES), np.random.default_rng(0)
    orientation, n = Orientation(mesh, unit=2.0), mesh.n_point
    integral = np.stack([orientation.turned(column) for column in np.eye(n)], axis=1)
    slope, right, on_theta = rng.normal(size=n), rng.normal(size=n), rng.normal(size=(3, n))
    matrix = np.eye(n) - integral * slope
    np.testing.assert_allclose(orientation.solved(slope, right), np.linalg.solve(matrix, right), atol=1e-12)
    mu = np.linalg.solve(matrix.T, on_theta.T).T
    begun, on_rates = orientation.pulled_back(slope, on_theta)
    np.testing.assert_allclose(begun, mu.sum(axis=1), atol=1e-12)
    np.testing.assert_allclose(on_rates, mu @ integral, atol=1e-12)


def test_its_solution_converges_to_that_of_the_differential_equation():
    """theta' = -2 theta from 1; Newton's method needs one step, for the equation is linear."""
    errors = []
    for n in (8, 16):
        mesh = Mesh(scheme("gauss-3"), np.linspace(0.0, 1.0, n + 1))
        theta = Orientation(mesh).solved(np.full(mesh.n_point, -2.0), np.ones(mesh.n_point))
        errors.append(np.abs(theta - np.exp(-2 * mesh.times)).max())
    assert errors[0] < 3e-6
    assert errors[1] == pytest.approx(errors[0] / 16, rel=0.1)  # of order 4 between the edges
