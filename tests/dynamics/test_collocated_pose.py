"""Orientation and place along a mesh: a circle, orders, derivatives, and headings."""

import numpy as np
import pytest

from colloc.dynamics.collocated import CollocatedPose, heading
from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, NONE
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme

SCHEMES = ("gauss-3", "radau-2", "trapezoid", "hermite-simpson")
EDGES = np.array([0.0, 0.1, 0.35, 0.4, 0.8, 1.0])


def pose(name, edges, omega, centre, theta_0=0.0):
    mesh = Mesh(scheme(name), edges)
    c = centre(mesh.times)
    return CollocatedPose.on_mesh(mesh, omega(mesh.times), np.array([c.real, c.imag]), theta_0)


@pytest.mark.parametrize("name", SCHEMES)
def test_a_body_that_turns_and_moves_steadily_goes_round_a_circle(name):
    """theta = w t, and the centre of mass lies at v (e^(i w t) - 1) / (i w)."""
    w, v = 0.8, 0.3 + 0.1j
    fine = np.linspace(0, 1, 400)
    found = pose(name, fine, lambda t: w + 0 * t, lambda t: v + 0 * t)
    np.testing.assert_allclose(found.theta, w * fine, atol=1e-12)
    np.testing.assert_allclose(found.place, v * (np.exp(1j * w * fine) - 1) / (1j * w), atol=1e-6)


def rate(t):
    return 1.5 * np.cos(2 * t) - 0.4


def forward(t):
    return (0.5 + t) * np.exp(0.7j * t)


@pytest.mark.parametrize(("name", "order"), [("gauss-2", 4), ("radau-2", 3), ("trapezoid", 2)])
def test_the_place_converges_with_the_order_of_the_scheme(name, order):
    exact = pose("gauss-5", np.linspace(0, 1, 200), rate, forward).place[-1]
    coarse, fine = (
        abs(pose(name, np.linspace(0, 1, n + 1), rate, forward).place[-1] - exact) for n in (8, 16)
    )
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("name", SCHEMES)
def test_the_displacement_has_the_slopes_of_differences(name):
    mesh, rng, axis = Mesh(scheme(name), EDGES), np.random.default_rng(0), np.exp(0.4j)
    shape = (mesh.n, mesh.scheme.s)
    omega, x, y = (rng.normal(size=shape) for _ in range(3))

    def ahead(*rates):
        turn, forwards, left = rates
        end = CollocatedPose(mesh.scheme, mesh.h, turn, forwards + 1j * left).place[-1]
        return (end * np.conj(axis)).real

    found = CollocatedPose(mesh.scheme, mesh.h, omega, x + 1j * y)
    on_theta, (on_centre,) = found.on_pose(np.array([axis]))
    slopes = np.concatenate([found.on_rates(on_theta), on_centre])
    for which in range(3):
        step = np.zeros((3, *shape))
        step[which] = 1e-6 * rng.normal(size=shape)
        there, back = (ahead(*(np.array([omega, x, y]) + sign * step)) for sign in (1, -1))
        assert (slopes * step).sum() == pytest.approx(0.5 * (there - back), rel=1e-6)


def test_a_gait_goes_where_its_whole_period_leads():
    """The second half of an antipodal gait mirrors the first, from where that ended."""
    displacement, rotation = 0.3 * np.exp(0.9j), 0.5
    whole = displacement + np.exp(1j * rotation) * np.conj(displacement)
    for end in (displacement, -displacement):
        ahead = (1 if end == displacement else -1) * whole / abs(whole)
        assert np.exp(1j * heading(ANTIPODAL, end, rotation)) == pytest.approx(ahead)
    for symmetry in (NONE, BILATERAL):
        assert heading(symmetry, displacement, rotation) == pytest.approx(0.9)
