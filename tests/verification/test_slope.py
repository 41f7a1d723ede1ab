"""Gaits on a slope: against points, the level, conservation of energy, and symmetry."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import root

import colloc
from colloc import Chain, Foot, Fourier, Friction, Wheel, replay, slope_motion
from colloc.gaits.regime import Regime
from colloc.verification import differential_motion as motion
from tests.shared.mechanics import coulomb, wrench

SKEW = Fourier([0.3, -0.2], [[1.2], [0.3]], [[0.2], [1.0]])  # of no symmetry
UNEQUAL = Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
LOPSIDED = Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3))
ON_FEET = Chain(
    (0.2, 0.5, 0.3), masses=(0.3, 0.3, 0.4),
    feet=(Wheel(0, 0.2, rolling=0.5, weight=0.3), Foot(1, 0.6, 0.1, 0.05), Foot(1, 0.6, 0.1,
    -0.05), Foot(2, 0.9, 0.5)),
)  # fmt: skip
"""Wheel, feet beside each other and a foot, whose weights press beside the centre of mass."""


def still(t):
    return np.tile([[0.4], [-0.7]], np.size(t)), np.zeros((2, np.size(t)))


@pytest.mark.parametrize(
    ("body", "grade"), [(LOPSIDED, 0.5), (ON_FEET, 0.25)], ids=["lying", "standing"]
)
def test_the_motion_is_that_of_a_program_of_its_own(body, grade):
    """Runge and Kutta's rule on balances of points; delta is large, so few steps do."""
    delta, steps, near = 0.3, 20, np.zeros(3)
    ours = slope_motion(body, UNEQUAL, SKEW, delta, grade, heading=1.0)

    def rates(t, state):
        nonlocal near
        (angles, rates), turn = SKEW(np.array([t])), np.exp(1j * state[0])
        pull = -grade * np.conj(turn)

        def moved(z):
            at = body, UNEQUAL, angles[:, 0], rates[:, 0], z, delta
            return wrench(*at, (pull.real, pull.imag), count=300)

        near = root(lambda z: moved(z)[0], near, tol=1e-11).x
        centre = turn * moved(near)[2]
        return np.array([near[2], centre.real, centre.imag])

    state, h = np.array([1.0 - ours.course, 0.0, 0.0]), 1 / steps
    for step in range(steps):
        t = step * h
        k1 = rates(t, state)
        k2 = rates(t + h / 2, state + h / 2 * k1)
        k3 = rates(t + h / 2, state + h / 2 * k2)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + rates(t + h, state + h * k3))
    np.testing.assert_allclose(ours.states[:3, -1], state, atol=1e-4)
    assert abs(ours.turn) > 0.05
    # joints pay for friction and for the climb
    assert abs(lifted := grade * ours.climb[0]) > 1e-3
    assert ours.joint_work[0] == pytest.approx(ours.friction_work[0] + lifted, abs=1e-9)


def test_on_the_level_it_is_the_replay():
    level = replay(LOPSIDED, UNEQUAL, SKEW, 1e-2)
    ran = slope_motion(LOPSIDED, UNEQUAL, SKEW, 1e-2, 0.0, heading=0.7)
    away = ran.climb[0] + 1j * ran.aside[0]
    assert away == pytest.approx(level.distance * np.exp(0.7j), abs=1e-5)
    assert ran.friction_work[0] == pytest.approx(level.work, abs=1e-5)
    assert ran.turn == pytest.approx(level.rotation, abs=1e-5)
    assert ran.steering[0] == 1.0
    # as the tail link lies where the gait goes nowhere
    retraced = Fourier([0.5, 0.2], [[0.8], [0.3]], np.zeros((2, 1)))
    assert slope_motion(Chain(), Friction(), retraced, 1e-2, 0.0, tolerance=1e-4).course == 0.0


def test_joints_at_rest_rest_on_any_slope_that_friction_holds():
    """But for the creep of friction that is smoothed: delta g / sqrt(mu^2 - g^2)."""
    for grade in (0.3, 0.99, 1.19):
        ran = slope_motion(Chain(), Friction(1.2, 1.2, 1.2), still, 1e-6, grade)
        assert ran.climb[0] == pytest.approx(-1e-6 * grade / np.sqrt(1.2**2 - grade**2), rel=1e-4)
        assert abs(ran.turn) < 1e-9
    wheels = Chain(feet=[Wheel(k, sideways=mu) for k, mu in enumerate((0.6, 0.8, 1.3))])
    for body, most in ((Chain(), 1.2), (wheels, 0.9)):  # the mean of the wheels
        said = f"slides down for ever: friction holds at most {most} times"
        with pytest.raises(colloc.ProblemError, match=said):
            slope_motion(body, Friction(1.2, 1.2, 1.2), still, 1e-6, most + 1e-9)


def test_skates_hold_across_the_slope_and_not_along():
    def straight(t):
        return np.zeros((2, np.size(t))), np.zeros((2, np.size(t)))

    skates = Friction(mu_t=10, mu_f=0.1, mu_b=0.1)
    across = slope_motion(Chain(), skates, straight, 1e-6, 0.5, heading=np.pi / 2)
    assert across.climb[0] == pytest.approx(-1e-6 * 0.5 / np.sqrt(10**2 - 0.5**2), rel=1e-4)
    with pytest.raises(colloc.NotConvergedError, match="friction may be too weak"):
        slope_motion(Chain(), skates, straight, 1e-6, 0.5, heading=0.0)


@pytest.mark.parametrize(
    "mu", [(1, 1, 1), pytest.param((2, 1, 3), marks=pytest.mark.slow)], ids=str
)
def test_a_gait_that_is_its_own_reverse_keeps_every_heading(mu):
    """With the slope turned over: a monotone map of headings that is its own inverse is none."""
    at = Chain(), coulomb(*mu), colloc.ellipse(A0=0.4, A1=1.5, B1=1.0), 1e-2

    def ran(heading, grade=0.3):
        return slope_motion(*at, grade, heading=heading, tolerance=1e-5)

    for heading in (-np.pi, -0.5 * np.pi, 0.5 * np.pi):
        assert abs(ran(heading).turn) < 1e-4
    there, level = ran(1.0), ran(1.0, grade=0.0)
    assert there.steering[0] == pytest.approx(1.0, abs=1e-4)
    # which is no matter of course: in between it does turn, otherwise than on the level
    half = [np.interp(0.5, ran.phases, ran.states[0]) for ran in (there, level)]
    assert abs(half[0] - half[1]) > 1e-2


def test_the_steering_is_the_slope_of_the_map():
    ends = [
        slope_motion(Chain(), Friction(), SKEW, 0.1, 0.4, heading=0.5 + s, tolerance=1e-7)
        for s in (-1e-3, 0.0, 1e-3)
    ]
    slope = (ends[2].headings[1] - ends[0].headings[1]) / 2e-3
    assert ends[1].steering[0] == pytest.approx(slope, abs=1e-4)
    assert abs(slope - 1.0) > 1e-2


def test_joints_work_by_their_moments_and_what_balances_leave_over_is_told(monkeypatch):
    balance, solve = motion.balance_on_slope, motion.solve_balance

    def harder(*at, **how):
        solved, now, *more = balance(*at, **how)
        return solved, now._replace(actuator_power=1.01 * now.actuator_power), *more

    def roughly(*at, **how):
        solved = solve(*at, **how)
        return replace(solved, residual=solved.residual + 1e-3 * np.arange(solved.residual.size))

    monkeypatch.setattr(motion, "balance_on_slope", harder)
    monkeypatch.setattr(motion, "solve_balance", roughly)
    gait, how = replace(SKEW, theta=0.3), {"regime": Regime(grade=0.1), "tolerance": 1e-2}
    played = replay(Chain(), Friction(), gait, 0.1, **how)
    assert played.actuator_work / played.work == pytest.approx(1.01, abs=1e-3)
    assert played.residual == pytest.approx(1e-3 * (played.instants - 1), rel=1e-3)


@pytest.mark.parametrize("rough", [1.0, 100.0])  # works of 100 are off by most
def test_the_stated_error_covers_the_true_one(rough):
    at = LOPSIDED, UNEQUAL.in_units_of(1 / rough), SKEW, 1e-3, 0.3 * rough
    exact = slope_motion(*at, tolerance=1e-7).states[:5, -1]
    for tolerance in (1e-3, 1e-4):
        ran, loose = (slope_motion(*at, tolerance=by * tolerance) for by in (1, 30))
        off, seen = (np.abs(ran.states[:5, -1] - x).max() for x in (exact, loose.states[:5, -1]))
        assert off < ran.error < 30 * tolerance
        assert ran.error == pytest.approx(seen)


def test_a_replay_on_a_slope_says_for_which_part_of_the_time_its_motion_is_open():
    rng, law = np.random.default_rng(5), Friction(mu_t=100, mu_f=1, mu_b=1)
    waves = rng.uniform(-0.8, 0.8, 2), rng.normal(0, 0.8, (2, 2)), rng.normal(0, 0.8, (2, 2))
    at = Chain(), law, Fourier(*waves, theta=0.3), 1e-2
    replayed = replay(*at, regime=Regime(grade=0.02), tolerance=1e-3, instants=400)
    both = slope_motion(*at, grade=0.02, tolerance=1e-3, periods=2)
    first, then = (slope_motion(*at, 0.02, heading=h, tolerance=1e-3) for h in both.headings[:2])
    assert 1e-3 < first.several < 1e-2
    assert replayed.several == pytest.approx(first.several, rel=0.3)
    assert both.several == pytest.approx(0.5 * (first.several + then.several), rel=0.2)
    for name in ("climb", "aside", "friction_work", "joint_work", "steering"):
        parts = np.append(getattr(first, name), getattr(then, name))
        np.testing.assert_allclose(getattr(both, name), parts, atol=1e-3)
    assert both.turn == pytest.approx(first.turn + then.turn, abs=1e-3)
    for last in (1.9, 2.1):  # half of that is left of both
        assert replace(both, steering=np.array([0.5, last])).stable == (last < 2)
