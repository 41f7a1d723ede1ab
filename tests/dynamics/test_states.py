"""One to three states on a mesh whose rates depend on them: order, adjoints, symmetry; orientation and
place along a mesh: a circle, orders, derivatives, and headings."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from colloc import Chain, Fourier, Friction
from colloc.dynamics.collocated import CollocatedPose, heading
from colloc.dynamics.dynamics import OnSlope, Shapes
from colloc.dynamics.states import CollocatedStates, Rates
from colloc.gaits.gait import ANTIPODAL, BILATERAL, NONE
from colloc.gaits.regime import Regime
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme

EDGES = np.array([0.0, 0.1, 0.35, 0.4, 0.8, 1.0])
SIZES = (1, 2, 3)


def spring(k, push=1.0):
    """States pulled to 0 unevenly and by each other, and pushed to and fro."""
    rng = np.random.default_rng(k)
    matrix = 2.0 * np.eye(k) + 0.5 * rng.normal(size=(k, k))

    def rates(t, s):
        force = push * np.sin(2 * np.pi * t + np.arange(k)[:, None])
        return force - matrix @ s - 0.5 * s**3

    def on_states(t, s):
        return np.moveaxis(-matrix - 1.5 * np.eye(k) * (s**2).T[:, None], 0, -1)

    return rates, on_states


def on_mesh(mesh, ode):
    rates, on_states = ode
    return lambda s: Rates(rates(mesh.times, s), on_states(mesh.times, s))


def followed(rates, start, t):
    at = lambda t, s: rates(np.array([t]), s[:, None])[:, 0]  # noqa: E731
    return solve_ivp(at, (0, t), start, rtol=1e-11, atol=1e-12).y[:, -1]


@pytest.mark.parametrize("k", SIZES)
@pytest.mark.parametrize("free", [False, True])
def test_they_converge_to_the_differential_equation_with_the_order_of_the_scheme(k, free):
    ode, errors = spring(k), []
    # a free start is the state at phase 0 after many periods
    start = followed(ode[0], np.zeros(k), 30.0) if free else np.linspace(0.5, 1, k)
    exact = followed(ode[0], start, 1.0)
    for n in (10, 20):
        mesh = Mesh(scheme("gauss-2"), np.linspace(0.0, 1.0, n + 1))
        equations = CollocatedStates(mesh, np.full(k, free))
        states, found, held = equations.solve(on_mesh(mesh, ode), 0 * start if free else start)
        assert held
        end = found + equations.integrals(ode[0](mesh.times, states))[1][:, -1]
        errors.append(np.abs(end - exact).max())
        if free:
            np.testing.assert_allclose(end, found, atol=1e-11)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.3)


@pytest.mark.parametrize("k", SIZES)
@pytest.mark.parametrize("free", [False, True])
def test_the_adjoint_has_the_slopes_of_differences(k, free):
    mesh, rng = Mesh(scheme("radau-2"), EDGES), np.random.default_rng(1)
    mask = np.full(k, free)
    mask[:1] = free and k != 2  # one told, the other free
    image = -np.eye(k) if k == 3 else None
    equations, (rates, on_states) = CollocatedStates(mesh, mask, image), spring(k)
    (weight, more), start = rng.normal(size=(2, k, mesh.n_point)), np.full(k, 0.2)
    moved = np.where(mask, 0.0, rng.normal(size=k))

    def number(size):
        def at(s):
            return Rates(rates(mesh.times, s) + size * more, on_states(mesh.times, s))

        states, _, held = equations.solve(at, start + size * moved)
        assert held
        return (weight * states).sum(), states

    _, states = number(0.0)
    on_start, on_rates, _ = equations.vjp(on_states(mesh.times, states), weight[None])
    difference = (number(1e-5)[0] - number(-1e-5)[0]) / 2e-5
    assert (on_rates[0] * more).sum() + on_start[0] @ moved == pytest.approx(difference, rel=1e-7)
    np.testing.assert_allclose(on_start[0, mask], 0.0, atol=1e-12)


def test_half_a_period_and_its_image_are_the_whole():
    """Pushed the other way half a period later, odd springs do the opposite."""
    ode, image = spring(2), -np.eye(2)
    half, whole = (
        Mesh(scheme("gauss-4"), np.linspace(0.0, end, n + 1)) for end, n in ((0.5, 20), (1.0, 40))
    )
    equations = CollocatedStates(half, np.full(2, True), image)
    first, start, held = equations.solve(on_mesh(half, ode), np.zeros(2))
    equations = CollocatedStates(whole, np.full(2, True))
    both, again, _ = equations.solve(on_mesh(whole, ode), np.zeros(2))
    assert held
    np.testing.assert_allclose(start, again, atol=1e-11)
    np.testing.assert_allclose(np.concatenate([first, -first], axis=1), both, atol=1e-11)


def test_a_periodic_motion_is_found_where_others_grow_beyond_all_numbers():
    """Fourteenfold in each of 300 intervals: none but the constant one repeats itself."""
    mesh = Mesh(scheme("gauss-2"), np.linspace(0.0, 1.0, 301))
    growth, equations = 3.46 * mesh.n, CollocatedStates(mesh, free=np.ones(1, dtype=bool))
    slope = np.full((1, 1, mesh.n_point), growth)
    states, _, held = equations.solve(lambda s: Rates(growth * s + 1.0, slope), np.zeros(1))
    assert held
    np.testing.assert_allclose(states, -1.0 / growth, rtol=0, atol=1e-12)


def test_where_rates_have_no_slope_there_is_no_motion_and_no_derivative():
    mesh, slope = Mesh(scheme("gauss-2"), EDGES), np.zeros((2, 2, 10))
    slope[0, 1, 4], equations = np.nan, CollocatedStates(mesh, np.array([True, False]))
    assert not equations.solve(lambda s: Rates(s + 1.0, slope), np.zeros(2))[2]
    assert all(np.isnan(part).any() for part in equations.vjp(slope, np.ones((1, 2, 10))))


def test_a_slow_motion_down_a_steep_slope_is_found_where_steps_run_out_of_what_balances():
    """Links that hardly slip sideways: from such a begin of theta, judging a step by the next one
    ends without a motion, as no rate is known there."""
    mesh, body = Mesh(scheme("gauss-3"), np.linspace(0.0, 1.0, 21)), Chain()
    cos, sin = [[0.5, 1.3], [1.3, 1.4]], [[0.4, -0.3], [0.6, 0.6]]
    shapes = Shapes(*Fourier([-0.9, -1.1], cos, sin)(mesh.times), 0.03)
    slow = OnSlope(body, body.law(Friction(mu_t=8.0)), Regime(grade=0.6))
    along = slow.simulate(mesh, shapes, np.array([3.0]))
    assert along.held.all()
    turned = slow.equations(mesh).integrals(along.now.z[2:])[0]
    np.testing.assert_allclose(along.states, 3.0 + turned, atol=1e-9)


SCHEMES = ("gauss-3", "radau-2", "trapezoid", "hermite-simpson")


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
