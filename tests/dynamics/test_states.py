"""One to three states on a mesh whose rates depend on them: order, adjoints, symmetry; orientation and
place along a mesh; and states followed through a period: a closed form, jumps, tolerances."""

import threading
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy.integrate
from scipy.integrate import solve_ivp

from colloc import Chain, Fourier, Friction, NotConvergedError
from colloc.dynamics.collocated import heading
from colloc.dynamics.dynamics import OnSlope, Shapes
from colloc.dynamics.states import CollocatedStates, Rates
from colloc.gaits.gait import ANTIPODAL, BILATERAL, NONE
from colloc.gaits.regime import Regime
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.verification.differential_motion import integrate_period

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
        states, found, exist = equations.solve(on_mesh(mesh, ode), 0 * start if free else start)
        assert exist
        end = found + equations.integrals(ode[0](mesh.times, states))[1][:, -1]
        errors.append(np.abs(end - exact).max())
        if free:
            np.testing.assert_allclose(end, found, atol=1e-11)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.3)


def test_half_a_period_and_its_image_are_the_whole():
    """Pushed the other way half a period later, odd springs do the opposite."""
    ode, image = spring(2), -np.eye(2)
    half, whole = (
        Mesh(scheme("gauss-4"), np.linspace(0.0, end, n + 1)) for end, n in ((0.5, 20), (1.0, 40))
    )
    equations = CollocatedStates(half, np.full(2, True), image)
    first, start, exist = equations.solve(on_mesh(half, ode), np.zeros(2))
    equations = CollocatedStates(whole, np.full(2, True))
    both, again, _ = equations.solve(on_mesh(whole, ode), np.zeros(2))
    assert exist
    np.testing.assert_allclose(start, again, atol=1e-11)
    np.testing.assert_allclose(np.concatenate([first, -first], axis=1), both, atol=1e-11)


def test_a_periodic_motion_is_found_where_others_grow_beyond_all_numbers():
    """Fourteenfold in each of 300 intervals: none but the constant one repeats itself."""
    mesh = Mesh(scheme("gauss-2"), np.linspace(0.0, 1.0, 301))
    growth, equations = 3.46 * mesh.n, CollocatedStates(mesh, free=np.ones(1, dtype=bool))
    slope = np.full((1, 1, mesh.n_point), growth)
    states, _, exist = equations.solve(lambda s: Rates(growth * s + 1.0, slope), np.zeros(1))
    assert exist
    np.testing.assert_allclose(states, -1.0 / growth, rtol=0, atol=1e-12)


def test_where_rates_have_no_slope_there_is_no_motion_and_no_derivative():
    mesh, slope = Mesh(scheme("gauss-2"), EDGES), np.zeros((2, 2, 10))
    slope[0, 1, 4], equations = np.nan, CollocatedStates(mesh, np.array([True, False]))
    assert not equations.solve(lambda s: Rates(s + 1.0, slope), np.zeros(2))[2]
    assert all(np.isnan(part).any() for part in equations.vjp(slope, np.ones((1, 2, 10))))


def test_a_slow_motion_down_a_steep_slope_is_found_where_steps_run_out_of_what_balances():
    """Judged by the next one, steps end without a motion, as no rate is known there."""
    mesh, body = Mesh(scheme("gauss-3"), np.linspace(0.0, 1.0, 21)), Chain()
    cos, sin = [[0.5, 1.3], [1.3, 1.4]], [[0.4, -0.3], [0.6, 0.6]]
    shapes = Shapes(*Fourier([-0.9, -1.1], cos, sin)(mesh.times), 0.03)
    slow = OnSlope(body, body.law(Friction(mu_t=8.0)), Regime(grade=0.6))
    along = slow.simulate(mesh, shapes, np.array([3.0]))
    assert along.exist.all()
    turned = slow.equations(mesh).integrals(along.now.z[2:])[0]
    np.testing.assert_allclose(along.states, 3.0 + turned, atol=1e-9)


def test_a_gait_goes_where_its_whole_period_leads():
    """The second half of an antipodal gait mirrors the first, from where that ended."""
    displacement, rotation = 0.3 * np.exp(0.9j), 0.5
    whole = displacement + np.exp(1j * rotation) * np.conj(displacement)
    for end in (displacement, -displacement):
        ahead = (1 if end == displacement else -1) * whole / abs(whole)
        assert np.exp(1j * heading(ANTIPODAL, end, rotation)) == pytest.approx(ahead)
    for symmetry in (NONE, BILATERAL):
        assert heading(symmetry, displacement, rotation) == pytest.approx(0.9)


TURN = np.array([[0.0, 2.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
BEGIN = np.array([1.0, 0.0, 2.0])


def exact(t):
    return np.array([np.cos(2 * t), -np.sin(2 * t), 2 * np.exp(-t)])


def turning(t, state, asked):
    return TURN @ state, (asked or 0) + 1


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7])
def test_three_states_are_those_of_the_closed_form_within_the_tolerance(tolerance):
    ran = integrate_period(turning, BEGIN, tolerance)
    assert np.abs(ran.states - exact(ran.phases)).max() < tolerance
    t = np.linspace(0, 1, 33)
    assert np.abs(ran.at(t) - exact(t)).max() < tolerance


def test_a_jump_of_the_rates_is_met_from_both_sides():
    """s' = -1, then 3: the later rate never counts for the earlier piece."""
    seen = []

    def rates(t, state, _):
        seen.append(t)
        return np.array([-1.0 if t < 0.3 else 3.0]), None

    ran = integrate_period(rates, np.zeros(1), 1e-6, breaks=(0.3,))
    assert 0.3 not in seen
    states = ran.at(np.array([0.15, 0.3, 0.65]))
    np.testing.assert_allclose(states, [[-0.15, -0.3, 0.75]], atol=1e-9)
    assert ran.states[0, -1] == pytest.approx(1.8, abs=1e-9)


@pytest.mark.parametrize(("others", "asks"), [(True, False), (True, True), (False, False)])
def test_where_one_method_gives_up_or_asks_without_end_another_goes_on(monkeypatch, others, asks):
    """As where friction is stiff; where none goes on, a sentence says how far."""

    def gives_up(*given, method, **how):
        while asks and method == "LSODA":
            given[0](0.1, given[2])
        ran = solve_ivp(*given, method=method, **how)
        ran.success = others and method != "LSODA"
        return ran

    solve_ivp = scipy.integrate.solve_ivp
    monkeypatch.setattr(scipy.integrate, "solve_ivp", gives_up)
    if others:
        ran = integrate_period(turning, BEGIN, 1e-7)
        assert np.abs(ran.states - exact(ran.phases)).max() < 1e-7
    else:
        with pytest.raises(NotConvergedError, match="could not be followed beyond phase 1"):
            integrate_period(turning, BEGIN, 1e-7)


def test_two_threads_follow_what_one_follows_and_leave_warnings_as_they_were():
    begun, ended = (threading.Event(), threading.Event()), threading.Event()

    def thread(k):
        def rates(t, state, asked):
            begun[k].set()
            # for the other one, to begin or to end
            (ended if k else begun[1]).wait(0 if asked else 0.3)
            return turning(t, state, asked)

        if k:
            begun[0].wait()
        states = integrate_period(rates, BEGIN, 1e-7).states
        ended.set()
        return states

    alone, before = integrate_period(turning, BEGIN, 1e-7).states, list(warnings.filters)
    with ThreadPoolExecutor(2) as threads:
        for states in threads.map(thread, (0, 1)):
            np.testing.assert_array_equal(states, alone)
    assert warnings.filters == before
