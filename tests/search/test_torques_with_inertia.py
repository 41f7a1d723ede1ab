"""Limits on torque and power of bodies with inertia: the torques' own identities, derivatives, and
searches in which they bind."""

import numpy as np
import pytest

import colloc
from colloc.dynamics.chain import joint_torques, torque_function
from colloc.dynamics.control_problem import control_problem
from colloc.mechanics.balance import joint_moments
from colloc.mechanics.friction import LinkVelocity
from colloc.mechanics.inertia import (
    inertial_moments,
    kinetic_energy,
    momentum_rates,
    tail_velocity,
)
from colloc.reduced.program import ReducedProgram
from colloc.results.limit_use import lines
from colloc.results.robot import joint_torques as sheet_torques
from colloc.search.iterate import space_near
from tests.shared.stages import program_of

CHAIN = colloc.Chain((0.3, 0.25, 0.45))
FLOOR = colloc.Friction(mu_t=1.3, mu_f=0.7, mu_b=1.1)
GAIT = colloc.Fourier([0.3, -0.2], cos=[[0.6, 0.1], [0.3, 0.2]], sin=[[0.2, 0.3], [0.7, -0.1]])
DELTA, FROUDE = 0.05, 0.3


def states(n):
    return np.random.default_rng(0).normal(size=(3, n))


def test_torques_by_derivatives_agree_with_those_by_differences_in_time():
    t, h = np.linspace(0.03, 0.9, 7), 1e-4
    (angles, rates), accelerations = GAIT(t), (GAIT(t + h)[1] - GAIT(t - h)[1]) / (2 * h)
    momenta = states(t.size)
    function = torque_function(CHAIN, FLOOR)
    found = function(angles, rates, accelerations, momenta, DELTA, FROUDE).full()
    wanted = joint_torques(CHAIN, FLOOR, GAIT, t, momenta, delta=DELTA, froude=FROUDE)
    np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_a_uniform_pull_takes_no_torque():
    """What it does to the joints of a body at rest, less what its acceleration of all links does."""
    angles, pull = GAIT(np.linspace(0.03, 0.9, 7))[0], np.random.default_rng(1).normal(size=(2, 7))
    none = np.zeros((len(CHAIN.contact.force_names), 7))
    falls = (pull[0] * c + pull[1] * s for c, s in zip(*directions(angles), strict=True))
    aside = (pull[1] * c - pull[0] * s for c, s in zip(*directions(angles), strict=True))
    growth = LinkVelocity(np.array([*falls]), np.array([*aside]), np.zeros((3, 7)))
    still = LinkVelocity(*np.zeros((3, 3, 7)))
    against = joint_moments(CHAIN, angles, none, pull)
    np.testing.assert_allclose(
        against + inertial_moments(CHAIN, angles, still, growth), 0.0, atol=1e-14
    )


def directions(angles):
    """Cosines and sines of the links' directions from that of the tail link."""
    turns = np.cumsum(np.vstack([np.zeros(angles.shape[1]), angles]), axis=0)
    return np.cos(turns), np.sin(turns)


def test_joints_do_the_work_of_friction_and_what_the_kinetic_energy_grows_by():
    """Power balance, whatever the momenta: M . r = dissipation + Fr dT/dt."""
    t, momenta, h = np.linspace(0.03, 0.9, 7), states(7), 1e-5
    angles, rates = GAIT(t)
    at = {"delta": DELTA, "froude": FROUDE}
    now = momentum_rates(CHAIN, FLOOR, angles, rates, momenta, **at)

    def energy(by):
        (q, r), then = GAIT(t + by), momenta + by * now.rates
        return kinetic_energy(CHAIN, q, r, tail_velocity(CHAIN, q, r, then))[0]

    growth = (energy(h) - energy(-h)) / (2 * h)
    torques = joint_torques(CHAIN, FLOOR, GAIT, t, momenta, **at)
    np.testing.assert_allclose(
        (torques * rates).sum(axis=0), now.power[0] + FROUDE * growth, atol=1e-6
    )


def limited(**changes):
    stated = {"body": CHAIN, "gait": colloc.Harmonic(2), "delta": 1e-2, "intervals": 20}
    return colloc.Problem(
        "limited", friction=FLOOR, **({"torque_limit": 0.05, "froude": 0.2} | stated | changes)
    )


@pytest.mark.parametrize(
    "problem",
    [
        limited(power_limit=0.1),
        limited(froude=colloc.Free(0.05, 0.5), objective="distance / (work + 0.1 * period)"),
        limited(grade=0.1, gait=colloc.BSpline(8)),
    ],
    ids=["power", "free pace", "slope"],
)
def test_rows_have_the_derivatives_of_their_values_and_are_those_of_the_full_program(problem):
    space, v = space_near(problem, GAIT)
    program = ReducedProgram(space, 1e-2)
    program.place_rows(v)
    program.actuators.placed = np.array([[0, 1, 1, 0], [3, 7, 20, 31]])
    h = 1e-6
    differences = [
        (program.actuators.values(v + e, 1e-2) - program.actuators.values(v - e, 1e-2)) / (2 * h)
        for e in h * np.eye(v.size)
    ]
    slopes = program.actuators.slopes(v, 1e-2)
    np.testing.assert_allclose(slopes, np.transpose(differences), atol=1e-5 * np.abs(slopes).max())
    limits = control_problem(problem).actuators
    shares = program.motion.shares(limits, v, 1e-2)
    np.testing.assert_allclose(
        program.motion.shares(limits, v, 1e-2, space.mesh.times), shares, atol=1e-10
    )
    full = program_of(problem, GAIT)
    x = full.feasible(space.full_parameters(v), 1e-2)
    rows = full.nlp.functions["jac_g"](x, 1e-2 / full.delta_unit)[0].full().ravel()
    np.testing.assert_allclose(rows[full.groups["actuators"]], shares.T.ravel(), atol=1e-8)
    np.testing.assert_allclose(rows[full.groups["accelerations"]], 0.0, atol=1e-10)


def test_a_gait_whose_motors_limit_it_is_certified_and_uses_all_that_it_may():
    problem = colloc.Problem(
        "weak",
        friction=colloc.Friction(mu_t=2, mu_f=1, mu_b=1),
        gait=colloc.Harmonic(1, "antipodal"),
        delta=1e-2,
        froude=0.2,
        torque_limit=0.2,
    )
    strong = colloc.solve(problem.with_(torque_limit=None), starts=1)
    weak = colloc.solve(problem, starts=1)
    assert weak.status == "solved", weak.message
    assert weak.answer.program == "full"
    assert weak.value < strong.value - 1e-4
    (check,) = (check for check in weak.certificate.checks if check.name == "actuators")
    assert check.passed
    most = [np.abs(sheet_torques(each, np.arange(2000) / 2000)).max() for each in (strong, weak)]
    assert most[0] > 0.21
    assert most[1] == pytest.approx(0.2, rel=1e-3)
    (used,) = lines(weak)  # statics say nothing of what accelerates links
    assert "torque 100 % of 0.2" in used
    again = colloc.evaluate(problem, weak.gait)
    assert again.status == "solved", again.message
    assert again.value == pytest.approx(weak.value, rel=1e-5)
    beyond = colloc.evaluate(problem, strong.gait)
    assert [check.name for check in beyond.certificate.failures] == ["actuators"]


def test_where_torques_are_infinite_limits_are_refused():
    with pytest.raises(colloc.ProblemError, match="infinite where joint rates jump"):
        limited(gait=colloc.Polygon(8))
