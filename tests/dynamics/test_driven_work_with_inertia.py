"""Work of single joints with inertia: against Newton's law for links in the plane, the balance of
power, the slow limit and differences; and searches for what takes least of it."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import colloc
from colloc.gaits.regime import Regime
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import space_near
from tests.shared.cases import slow_but
from tests.shared.inertia import played as with_inertia

GAIT = colloc.Fourier([0.3, -0.2], cos=[[0.6, 0.1], [0.3, 0.2]], sin=[[0.2, 0.3], [0.7, -0.1]])
CHAIN = colloc.Chain((0.3, 0.25, 0.45), masses=(0.2, 0.2, 0.6), inertias=(0.002, 0.01, 0.004))
FLOOR, DELTA, FROUDE = colloc.Friction(mu_t=1.3, mu_f=0.7, mu_b=1.1), 0.05, 0.3
DRIVEN = colloc.Objective("driven efficiency")
ALL = colloc.Quantity("all_power", "sum(power)")
PACED = "distance / (driven_work + 0.05 * period)"


def problem(**fields):
    usual = {"body": CHAIN, "friction": FLOOR, "gait": colloc.Harmonic(2), "guess": GAIT}
    usual |= {"froude": FROUDE, "objective": "driven efficiency", "delta": DELTA, "rotation": None}
    return colloc.Problem("driven", **usual | fields)


def newtons_joint_powers(froude, points=60, n=4000):
    """Power of each joint in a period, from the followed place and orientation of the body by
    Newton's law for each link in the plane: a program that shares no line with the torques."""
    ran = with_inertia(CHAIN, FLOOR, GAIT, DELTA, froude, tolerance=1e-8)
    spline = CubicSpline(ran.tail[0], ran.states[3:6].T)
    t, h, lengths = (np.arange(n) + 0.5) / n, 1e-4, np.array(CHAIN.lengths)
    masses = np.array(CHAIN.masses)

    def links(t):
        """Directions (angles) and midpoints of the links."""
        theta, x, y = spline(t).T
        turned = theta + np.vstack([0 * t, np.cumsum(GAIT.angles(t), axis=0)])
        along = lengths[:, None] * np.exp(1j * turned)
        middle = np.cumsum(along, axis=0) - 0.5 * along
        return turned, middle - masses @ middle + x + 1j * y

    before, now, after = links(t - h), links(t), links(t + h)
    spin, velocity = ((b - a) / (2 * h) for a, b in zip(before, after, strict=True))
    turning, growth = ((b - 2 * c + a) / h**2 for a, c, b in zip(before, now, after, strict=True))
    direction, arm = np.exp(1j * now[0]), (np.arange(points) + 0.5) / points - 0.5
    force, moment = 0.0, 0.0
    for share in arm:
        at = share * lengths[:, None] * direction
        moving = np.conj(direction) * (velocity + 1j * spin * at)
        mu = np.where(moving.real > 0, FLOOR.mu_f, FLOOR.mu_b)
        size = np.sqrt(np.abs(moving) ** 2 + DELTA**2)
        push = -(mu * moving.real + 1j * FLOOR.mu_t * moving.imag) / size
        push = lengths[:, None] / points * direction * push
        force, moment = force + push, moment + (np.conj(at) * push).imag
    # what the links behind a joint lack of force and moment goes through it
    lacks = froude * masses[:, None] * growth - force
    spun = froude * np.array(CHAIN.inertias)[:, None] * turning - moment
    powers, (_, rates) = [], GAIT(t)
    for joint in range(2):
        hinge = now[1][joint] + 0.5 * lengths[joint] * direction[joint]
        behind = slice(0, joint + 1)
        about = (np.conj(now[1][behind] - hinge) * lacks[behind]).imag + spun[behind]
        powers.append(-about.sum(axis=0) * rates[joint])
    return np.array(powers)


def test_newtons_law_for_every_link_says_the_same():
    """Up to its 60 points on a link."""
    powers, idle = newtons_joint_powers(FROUDE), 1.3 * DELTA
    positive = 0.5 * (powers + np.sqrt(powers**2 + idle**2)).sum(axis=0).mean()
    played = with_inertia(CHAIN, FLOOR, GAIT, DELTA, FROUDE, quantities=["driven_work"])
    assert played.values["driven_work"] == pytest.approx(positive, rel=1e-3)
    assert played.values["driven_work"] > 1.1 * played.work, "joints brake links, too"


@pytest.mark.parametrize("grade", [0.0, 0.2])
def test_joints_do_the_work_of_friction_and_climb(grade):
    """What kinetic energy takes it gives back in a period."""
    gait = colloc.Fourier(GAIT.mean, GAIT.cos, GAIT.sin, theta=0.7)
    how = {"regime": Regime(grade=grade), "quantities": [ALL]} if grade else {"quantities": [ALL]}
    played = with_inertia(CHAIN, FLOOR, gait, DELTA, FROUDE, tolerance=1e-7, **how)
    assert played.values["all_power"] == pytest.approx(played.work, rel=3e-7)


@pytest.mark.slow
def test_slow_motion_is_the_limit():
    """The difference falls like the Froude number."""
    slow = colloc.replay(CHAIN, FLOOR, GAIT, DELTA, objective=DRIVEN)
    off = []
    for froude in (8e-3, 2e-3):
        played = with_inertia(CHAIN, FLOOR, GAIT, DELTA, froude, tolerance=1e-5, objective=DRIVEN)
        off.append(played.values["driven_work"] / slow.values["driven_work"] - 1)
    assert 1e-2 > off[0] > 3 * off[1] > 0


@pytest.mark.parametrize("seed", slow_but([0], range(4)))
def test_stated_errors_cover_the_true_ones(seed):
    rng = np.random.default_rng(seed)
    mean, series = 0.4 * rng.normal(size=2), rng.normal(size=(2, 2, 2)) * [0.9, 0.3]
    mu_t, mu_f, mu_b = rng.uniform(0.3, 2, 3)
    law = colloc.Friction(mu_t=mu_t, mu_f=mu_f, mu_b=mu_b)
    delta, froude = 10 ** rng.uniform([-4, -2.5], [-1.5, 0])
    at = CHAIN, law, colloc.Fourier(mean, *series), delta, froude
    true = with_inertia(*at, tolerance=1e-7, objective=DRIVEN)
    for tolerance in (1e-3, 1e-5):
        played = with_inertia(*at, tolerance=tolerance, objective=DRIVEN)
        off = abs(played.values["driven_work"] - true.values["driven_work"])
        assert off <= played.errors["driven_work"]
        assert abs(DRIVEN(played.values) / DRIVEN(true.values) - 1) <= played.error_of(DRIVEN)
        assert played.error_of(DRIVEN) <= tolerance


def test_shooting_and_collocation_find_the_same_work():
    stated = problem(intervals=200)
    space, v = space_near(stated, GAIT)
    found = ReducedProgram(space, DELTA).period(v)
    replayed = colloc.replay(CHAIN, FLOOR, GAIT, DELTA, froude=FROUDE, objective=DRIVEN)
    assert found["driven_work"] == pytest.approx(replayed.values["driven_work"], rel=2e-5)
    assert replayed.actuator_work == pytest.approx(replayed.work, rel=1e-6)


@pytest.mark.slow
def test_a_gait_of_least_driven_work_is_certified_and_beats_that_of_least_work():
    stated = {"body": colloc.Chain(), "friction": colloc.Friction(), "guess": None}
    stated |= {"gait": colloc.Harmonic(1, "antipodal"), "rotation": 0.0, "delta": 1e-2}
    stated = problem(froude=0.2, mesh_tolerance=1e-4, **stated)
    found = colloc.solve(stated, starts=1)
    assert found.status == "solved", found.message
    assert found.answer.program == "full"
    other = colloc.solve(stated.with_(objective="efficiency"), starts=1)
    again = colloc.evaluate(stated, other.gait)
    assert again.status == "solved", again.message
    assert found.value > 1.001 * again.value


@pytest.mark.slow
def test_a_pace_is_best_where_time_and_energy_are_worth_the_same():
    """A period more or less of a free pace costs as much, and the range does not bind."""
    stated = {"body": colloc.Chain(), "friction": colloc.Friction(), "guess": None}
    stated |= {"gait": colloc.Harmonic(1, "antipodal"), "rotation": 0.0, "delta": 1e-2}
    stated |= {"objective": PACED, "mesh_tolerance": 1e-4}
    found = colloc.solve(problem(froude=colloc.Free(0.01, 1.0), **stated), starts=1)
    assert found.status == "solved", found.message
    assert 0.02 < found.froude < 0.5
    beside = [
        with_inertia(
            colloc.Chain(), colloc.Friction(), found.gait, 1e-2, by * found.froude,
            objective=colloc.Objective(PACED),
        )
        for by in (0.7, 1.0, 1.4)
    ]  # fmt: skip
    values = [colloc.Objective(PACED)(each.values) for each in beside]
    assert values[1] > max(values[0], values[2])
    assert values[1] == pytest.approx(found.value, rel=1e-4)


def test_where_torques_are_infinite_they_are_refused():
    corners = colloc.Corners(np.array([[0.0, 1.5, 0.4], [0.0, 0.2, 1.4]]))
    with pytest.raises(colloc.ProblemError, match="joint rates jump: leave driven_work out"):
        colloc.replay(
            CHAIN, FLOOR, corners, DELTA, froude=FROUDE, quantities=["driven_work"],
            breaks=corners.corner_phases,
        )  # fmt: skip
