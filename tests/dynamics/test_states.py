"""One to three states on a mesh whose rates depend on them: order, adjoints, symmetry."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from colloc import Chain, Fourier, Friction
from colloc.dynamics.dynamics import OnSlope, Shapes
from colloc.dynamics.states import CollocatedStates, Rates
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
