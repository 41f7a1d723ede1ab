"""Gaits played with inertia: against Newton's law for dense points, limits, conservation."""

from dataclasses import replace

import numpy as np
import pytest

import colloc
from colloc.dynamics.dynamics import SCHEME, efficiency_at
from colloc.gaits.regime import Regime
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.verification.differential_motion import GaitWithInertia, PeriodicRun
from tests.shared.mechanics import with_inertia, wrench

GAIT = colloc.ellipse(A0=0, A1=2.859, B1=1.302)
LEANING = colloc.Fourier(mean=[0.3, -0.5], cos=[[0.4], [0.9]], sin=[[1.1], [-0.2]])
CHAIN, UNEQUAL = colloc.Chain(), colloc.Chain((0.3, 0.45, 0.25))
HEAVY_HEAD = colloc.Chain((0.3, 0.45, 0.25), masses=(0.2, 0.2, 0.6), inertias=(0.001, 0.02, 0.001))
"""Presses evenly; its head has little inertia."""
ISOTROPIC, ANISOTROPIC = colloc.Friction(), colloc.Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)


def newtons_law(body, law, gait, delta, froude, steps=400, periods=3):
    """Distance, work and rotation of the last period: dense points, Runge and Kutta's method."""
    mass, lengths = body.mass_column()[:, 0], np.array(body.lengths)
    own = np.array(body.inertias) if body.inertias else mass * lengths**2 / 12

    def changes(t, state):
        """Of orientation, place and velocity of the centre, angular momentum and work."""
        turn, velocity, angular = np.exp(1j * state[0].real), state[2], state[3].real
        angles, rates = (each[:, 0] for each in gait(np.array([t % 1.0])))
        spin, half = np.cumsum([0.0, *rates]), 0.5 * lengths * np.exp(1j * np.cumsum([0, *angles]))
        # places and velocities of the middles of links from the tail, were it at rest
        place, moving = (np.cumsum(2 * each) - each for each in (half, 1j * spin * half))
        centre, drift = mass @ place, mass @ moving
        place, moving = place - centre, moving - drift
        swing = mass @ (np.conj(place) * moving).imag + own @ spin
        omega = (angular - swing) / (mass @ np.abs(place) ** 2 + own.sum())
        tail = velocity / turn - drift - 1j * omega * centre
        z = np.array([tail.real, tail.imag, omega])
        (fx, fy, torque), power, _ = wrench(body, law, angles, rates, z, delta, count=40)
        moment = torque - (np.conj(centre) * (fx + 1j * fy)).imag
        pull = (fx + 1j * fy) * turn
        return np.array([omega, velocity, pull / froude, moment / froude, power], dtype=complex)

    state, step = np.zeros(5, dtype=complex), 1.0 / steps
    for _ in range(periods):
        before = state
        for t in np.arange(steps) * step:
            k1 = changes(t, state)
            k2 = changes(t + step / 2, state + step / 2 * k1)
            k3 = changes(t + step / 2, state + step / 2 * k2)
            k4 = changes(t + step, state + step * k3)
            state = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    change = state - before
    return abs(change[1]), change[4].real, change[0].real


def test_newtons_law_for_dense_points_says_the_same():
    """Error of 40 points a link, 1e-4; masses of its own move a body otherwise."""
    at = ANISOTROPIC, LEANING, 0.05, 0.1
    distance, work, rotation = newtons_law(HEAVY_HEAD, *at)
    played, plain = (with_inertia(body, *at) for body in (HEAVY_HEAD, UNEQUAL))
    assert (played.distance, played.work) == pytest.approx((distance, work), rel=1e-3)
    assert played.rotation == pytest.approx(rotation, abs=1e-3)
    assert abs(played.distance / plain.distance - 1) > 0.05


@pytest.mark.parametrize("mu", [0.02, pytest.param(0.01, marks=pytest.mark.slow)])
def test_errors_that_are_stated_are_no_smaller_where_friction_hardly_brakes(mu):
    """A period leaves nearly all of a change of momenta: a small gap is a motion far off."""
    at = CHAIN, colloc.Friction(mu, mu, mu), LEANING, 1e-3, 1.0
    rough, fine = (with_inertia(*at, tolerance=tolerance) for tolerance in (1e-4, 1e-6))
    assert np.abs(rough.multipliers).max() > 0.96
    assert abs(rough.distance - fine.distance) < rough.errors["distance"] < 1e-4 * rough.distance


def test_a_period_that_does_not_close_is_off_by_no_more_than_is_stated():
    """However small its steps are: a gap leads away from the motion of equal periods."""
    gait = GaitWithInertia(CHAIN, colloc.Friction(0.1, 0.1, 0.1), LEANING, 1e-2, froude=1.0)
    closed = gait.find_period()
    exact = gait.periodic_run(closed.momenta, 1e-6, closed.slopes)
    start = exact.momenta + np.array([3e-4, -2e-4, 1e-4])
    left_open = PeriodicRun(gait.run(start, 1e-6), start, 1e-6)
    stated, true = gait.errors(left_open, left_open, closed.slopes), gait.totals(exact.ends)
    off = {name: abs(value - true[name]) for name, value in gait.totals(left_open.ends).items()}
    assert off["distance"] > 2e-5
    assert all(off[name] <= stated[name] for name in off)
    # but where another run begins is no error of this one
    assert gait.errors(exact, left_open, closed.slopes)["distance"] < 0.5 * off["distance"]


def test_a_motion_is_stable_where_no_small_change_grows():
    played = with_inertia(CHAIN, ISOTROPIC, GAIT, 1e-2, 0.1, tolerance=1e-3)
    assert played.stable
    assert played.residual == np.abs(played.states[:3, -1] - played.states[:3, 0]).max() > 0
    for grows in (1.1, -1.1, 0.8 + 0.8j):
        assert not replace(played, multipliers=(0.2, grows, 0.5)).stable


def test_what_another_motion_whose_periods_are_alike_would_change_is_stated(monkeypatch):
    at, rough = (CHAIN, ANISOTROPIC, LEANING, 0.05), GaitWithInertia.rough_period
    gait = GaitWithInertia(*at, froude=0.1)
    one = rough(gait, gait.momenta())
    rest = one._replace(momenta=one.momenta + np.array([0.1, 0.0, 0.0]))

    def found(self, near):
        return rough(self, near) if near.any() else rest

    monkeypatch.setattr(GaitWithInertia, "rough_period", found)
    played, other = with_inertia(*at, 0.1), gait.totals(gait.run(rest.momenta, 1e-5).states)
    changes = {name: abs(value - played.values[name]) for name, value in other.items()}
    assert played.several == 1.0
    assert played.others == pytest.approx(changes, abs=1e-5)


@pytest.mark.slow
def test_corners_are_passed_where_they_are():
    gait = colloc.Corners(np.array([[0.0, 1.5, 0.4], [0.0, 0.2, 1.4]]))
    exact = with_inertia(CHAIN, ISOTROPIC, gait, 1e-2, 0.1, breaks=gait.corner_phases)
    blind = with_inertia(CHAIN, ISOTROPIC, gait, 1e-2, 0.1)
    assert exact.distance == pytest.approx(blind.distance, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("loss", [0.01, pytest.param(0.2, marks=pytest.mark.slow)])
def test_on_a_rougher_floor_slow_enough_is_as_much_faster_and_there_the_part_is_lost(loss):
    froude = [
        colloc.slow_enough(CHAIN, colloc.Friction(mu, mu, mu), GAIT, 1e-2, loss)
        for mu in (1.0, 30.0)
    ]
    assert froude[1] == pytest.approx(30 * froude[0], rel=1e-6)
    slow = colloc.replay(CHAIN, ISOTROPIC, GAIT, 1e-2)
    played = with_inertia(CHAIN, ISOTROPIC, GAIT, 1e-2, froude[0])
    assert abs(1 - played.efficiency / slow.efficiency) == pytest.approx(loss, rel=0.05)


def test_a_gait_whose_efficiency_no_pace_changes_much_is_slow_enough_at_none():
    gait, floor = colloc.ellipse(A0=0.3, A1=0.6, B1=0.5), colloc.Friction(3.0, 3.0, 3.0)
    said = r"by less than 0.3 up to a Froude number of 30\."
    with pytest.raises(colloc.NotConvergedError, match=said):
        colloc.slow_enough(CHAIN, floor, gait, 1e-2, 0.3)
    slow, fast = (with_inertia(CHAIN, floor, gait, 1e-2, froude) for froude in (1e-3, 30.0))
    assert abs(1 - fast.efficiency / slow.efficiency) < 0.3


def test_what_inertia_takes_from_a_gait_that_turns_does_not_depend_on_where_its_period_begins():
    """Its way does: the body wriggles about the circle that it follows."""
    turning = colloc.Fourier([1.0, 1.1], [[-1.0], [0.7]], [[1.0], [0.9]])
    begun = [lambda t, s=shift: turning((t + s) % 1.0) for shift in (0.0, 0.3, 0.6)]
    at, mesh = (CHAIN, ISOTROPIC, turning), Mesh(scheme(SCHEME), np.linspace(0, 1, 321))
    turn = colloc.replay(*at, 1e-2).rotation
    chord = colloc.replay(*at, 1e-2, turn=turn)
    slowly = with_inertia(*at, 1e-2, 1e-4, turn=turn)
    assert (slowly.distance, slowly.rotation) == pytest.approx((chord.distance, turn), rel=1e-3)
    assert efficiency_at(*at, mesh, 1e-2)[0] == pytest.approx(chord.efficiency, rel=1e-4)
    paces = [colloc.slow_enough(CHAIN, ISOTROPIC, gait, 1e-2) for gait in begun]
    np.testing.assert_allclose(paces, paces[0], rtol=0.03)


@pytest.mark.slow
def test_a_body_from_rest_moves_as_newtons_law_says():
    at = UNEQUAL, ANISOTROPIC, LEANING, 0.05, 0.1
    begun = colloc.motion_from_rest(*at, periods=2)
    expected = [newtons_law(*at, periods=n) for n in (1, 2)]
    np.testing.assert_allclose(begun.periods, expected, rtol=1e-3, atol=1e-3)
    assert abs(begun.periods[0, 0] / begun.periods[1, 0] - 1) > 0.02


def test_periods_from_rest_become_alike_and_are_joined_without_a_gap():
    at = UNEQUAL, ANISOTROPIC, LEANING, 0.05, 0.1
    begun, played = colloc.motion_from_rest(*at, periods=4), with_inertia(*at)
    settled = played.distance, played.work, played.rotation
    assert begun.periods[-1] == pytest.approx(settled, abs=1e-4)
    assert not begun.states[:, 0].any()
    assert np.abs(np.diff(begun.states, axis=1)).max() < 0.1
    assert begun.states[3, -1] == pytest.approx(begun.periods[:, 2].sum(), abs=1e-12)
    assert begun.states[6, -1] == pytest.approx(begun.periods[:, 1].sum(), abs=1e-12)
    vx, vy, _, theta, x, y, _ = begun.states
    moved = np.trapezoid(np.exp(1j * theta) * (vx + 1j * vy), begun.phases)
    # the way is that of the velocities, whatever the body has turned before
    assert abs(x[-1] + 1j * y[-1] - moved) < 1e-4


def test_a_stiff_body_glides_down_a_slope_that_is_steeper_than_friction():
    """At g (sin - mu cos); what its weight does goes into friction and kinetic energy."""
    stiff, mu, grade, froude = colloc.ellipse(A0=0, A1=0, B1=0), 0.3, 0.5, 0.2
    ran = colloc.motion_from_rest(
        CHAIN, colloc.Friction(mu, mu, mu), stiff, 1e-4, froude, periods=2, grade=grade, theta=np.pi
    )
    speed, _, _, theta, x, y, work = ran.states[:, -1]
    assert speed == pytest.approx(2 * (grade - mu) / froude, rel=1e-3)
    assert x == pytest.approx(-speed, rel=1e-3)
    assert (theta, y) == (pytest.approx(np.pi), pytest.approx(0.0, abs=1e-12))
    assert -grade * x == pytest.approx(work + 0.5 * froude * speed**2, rel=1e-4)


def test_on_a_slope_slow_motion_is_approached_as_the_froude_number():
    at = CHAIN, ANISOTROPIC, LEANING, 3e-2
    how = {"grade": 0.2, "theta": 0.4}
    slow = colloc.slope_motion(*at, **how).states[:3, -1]
    ends = (colloc.motion_from_rest(*at, f, periods=1, **how).states[:, -1] for f in (4e-3, 1e-3))
    off = [np.abs(end[3:6] - slow).max() for end in ends]
    assert off[1] < 2e-3
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.25)


def test_on_feet_that_hold_the_map_of_a_period_is_found_soon_however_dry_friction_is():
    """Steps that err by more than delta would shake a body that should rest, without end."""
    asked, standing = [], colloc.Chain((0.3, 0.45, 0.25), feet=1)

    def path(t):
        asked.append(t)
        return LEANING(t)

    law = standing.law(colloc.Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3))
    played = GaitWithInertia(standing, law, path, 1e-7, froude=0.02)
    slopes = played.rough_period(played.momenta()).slopes
    # friction leaves nothing of the momenta of the period before
    assert np.abs(slopes[:3]).max() < 1e-6
    # some 12,000, by rounding, where more would let the first method give up
    assert len(asked) < 50_000


def test_a_gait_that_inertia_makes_better_is_slow_enough_up_to_where_it_is_by_that_part():
    gait = colloc.ellipse(A0=1.5, A1=1.1, B1=0.9)
    froude = colloc.slow_enough(CHAIN, ISOTROPIC, gait, 1e-2, 0.05)
    slow = colloc.replay(CHAIN, ISOTROPIC, gait, 1e-2).efficiency
    played = with_inertia(CHAIN, ISOTROPIC, gait, 1e-2, froude, tolerance=1e-4)
    assert played.efficiency / slow - 1 == pytest.approx(0.05, rel=0.05)


@pytest.mark.parametrize("grade", [0.0, 0.2])
def test_jacobian_of_the_states_is_the_derivative_of_their_rates(grade):
    # two motions side by side, which know nothing of each other
    moving = GaitWithInertia(
        colloc.Chain((0.2, 0.5, 0.3)), colloc.Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5),
        colloc.ellipse(A0=0.3, A1=1.0, B1=0.7), 1e-2, froude=0.1, regime=Regime(grade=grade),
    )  # fmt: skip
    states, h = np.random.default_rng(0).normal(size=14), 1e-6
    step = [moving.rates(0.3, states + s) - moving.rates(0.3, states - s) for s in h * np.eye(14)]
    found = moving.jacobian(0.3, states)
    np.testing.assert_allclose(found, np.transpose(step) / (2 * h), atol=1e-7)


@pytest.mark.parametrize("method", ["LSODA", "Radau"])
def test_between_the_steps_of_a_run_states_follow_their_equation(monkeypatch, method):
    monkeypatch.setattr("colloc.verification.differential_motion._METHODS", ((method, np.inf),))
    gait, floor = colloc.ellipse(A0=0.3, A1=1.0, B1=0.5), colloc.Friction(mu_t=2)
    moving = GaitWithInertia(colloc.Chain(), floor, gait, 0.1, froude=0.1)
    ran = moving.run(np.zeros(3), 1e-3)
    middle = 0.5 * (ran.phases[1:] + ran.phases[:-1])
    rates = (ran.at(middle + 1e-6) - ran.at(middle - 1e-6)) / 2e-6
    exact = [moving.rates(*at) for at in zip(middle, ran.at(middle).T, strict=True)]
    np.testing.assert_allclose(rates.T, exact, atol=1e-2)
    np.testing.assert_allclose(ran.at(ran.phases), ran.states, atol=1e-9)
