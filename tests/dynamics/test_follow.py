"""States followed through a period: a closed form, jumps, and what tolerances promise."""

import threading
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy.integrate

from colloc import NotConvergedError
from colloc.verification.differential_motion import integrate_period

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
