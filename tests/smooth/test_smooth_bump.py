"""Bump crawlers by collocation: physics against the general solver, derivatives, and that optimising helps."""

import casadi as ca
import numpy as np
import pytest

from colloc.collocation.bump_transcription import piece_lengths, transcribe_bump
from colloc.collocation.layout import RADIANS
from colloc.mechanics.friction import Friction
from colloc.numerics.blocks import oracles
from colloc.search.bump_optimum import best_start, feasible_bump, optimise_bump, prescribed_vertices
from colloc.smooth.balance import solve_smooth
from colloc.smooth.bump_balance import balance_and_power, bump_instant, solve_bump
from colloc.smooth.bump_body import BumpBody
from colloc.smooth.concertina import Concertina
from colloc.system.errors import NotConvergedError, ProblemError
from scripts.models.epsilon_study import Crawler, delta_for

BODY, DELTA = BumpBody(0.05, modes=4), 1e-4


def test_modes_and_slopes():
    x, h = np.linspace(-0.99, 0.99, 41), 1e-6
    value, slope = BODY.modes_at(x)
    np.testing.assert_allclose(slope, (BODY.modes_at(x + h)[0] - BODY.modes_at(x - h)[0]) / (2 * h), atol=1e-7)
    assert np.abs(BODY.modes_at(np.array([-1.0, 1.0, 1.2]))[0]).max() == 0.0
    assert value.shape == (41, 4)


def test_the_second_half_of_a_motion_is_the_mirror_image_of_the_first():
    vertices = np.random.default_rng(3).normal(size=(BODY.n, 4)) * 0.2
    motion, t = BODY.motion(vertices), np.linspace(0.01, 0.49, 17)
    s = np.linspace(0.4, 0.6, 31)[:, None] * np.ones((1, 17))
    for of in (motion.angle, motion.rate):
        assert np.abs(of(s, t)).max() > 0.1
        np.testing.assert_allclose(of(s, t + 0.5), -of(s, t), atol=1e-12)


@pytest.mark.parametrize("friction", [Friction(), Friction(1.7, 1.0, 1.3)])
def test_balance_and_power_agree_with_the_general_solver(friction):
    """The same motion by links plus one bump, and by adaptive panels along the whole body."""
    body, delta = BumpBody(0.05, modes=4, panels=8), 1e-2
    vertices = np.zeros((body.n, 2))
    vertices[:, 0], vertices[:, 1] = (0.1, 0.2, 0.7, -0.1, 0.05), (0.2, 0.1, 1.0, 0.1, -0.05)
    t = np.array([0.1, 0.3])
    general = solve_smooth(body.motion(vertices), friction, t, delta).require()
    q = vertices[:, :1] + 2 * t * (vertices[:, 1:] - vertices[:, :1])
    rates = 2 * (vertices[:, 1:] - vertices[:, :1]) * np.ones((1, 2))
    state = solve_bump(body, friction, q, rates, delta)
    assert state.residual.max() < 1e-9
    u, v, omega = state.velocity * body.width
    rear = body.link_lengths(q)[0]
    np.testing.assert_allclose(np.stack([u, v - rear * omega, omega]), general.z, atol=1e-8)
    slow = delta / body.width
    _, power = balance_and_power(body, friction, bump_instant(body, friction, q, rates, state.velocity, slow), slow)
    np.testing.assert_allclose(power[0] * body.width, general.power, atol=1e-8)


def test_the_prescribed_crawler_is_a_member_of_the_class():
    n = 12
    vertices = prescribed_vertices(BODY, 1.3, n)
    crawler, t = Concertina(epsilon=0.05, amplitude=1.3), np.array([0.05, 0.21, 0.28, 0.4])
    s = np.linspace(0.4, 0.6, 301)[:, None] * np.ones((1, 4))
    np.testing.assert_allclose(BODY.motion(vertices).angle(s, t), crawler.prescribed().angle(s, t), atol=1e-12)
    assert piece_lengths(vertices).max() / piece_lengths(vertices).min() < 1.001


def test_derivatives_through_the_balance_by_finite_differences():
    vertices = prescribed_vertices(BODY, 1.3, 6) + 0.02 * np.random.default_rng(3).normal(size=(BODY.n, 7))
    transcription = transcribe_bump(BODY, Friction(), vertices)
    functions = oracles(transcription.assembly)
    x = feasible_bump(transcription, vertices, 1e-2)
    p = functions.parameter_vector(1e-2 / RADIANS, transcription.block_parameters(x))
    rng = np.random.default_rng(4)
    direction = np.zeros(x.size)
    direction[transcription.layout.q.ravel()] = rng.normal(size=transcription.layout.q.size)
    h = 1e-6

    def jacobian(at):
        return functions.options["jac_g"](at, p)

    plus, minus = (np.array(jacobian(x + k * h * direction)[0]).ravel() for k in (1, -1))
    exact = np.array(ca.DM(jacobian(x)[1]) @ direction).ravel()
    np.testing.assert_allclose(exact, (plus - minus) / (2 * h), atol=2e-5)

    weight = rng.normal(size=transcription.assembly.m)
    upper = ca.DM(functions.options["hess_lag"](x, p, 0.0, weight)).full()
    hessian = upper + upper.T - np.diag(np.diag(upper))
    gradients = [ca.DM(jacobian(x + k * h * direction)[1]).full().T @ weight for k in (1, -1)]
    numeric = (gradients[0] - gradients[1]) / (2 * h)
    np.testing.assert_allclose(hessian @ direction, numeric, atol=2e-3 * np.abs(numeric).max())


def test_feasible_start_satisfies_every_equation():
    vertices = prescribed_vertices(BODY, 1.3, 12)
    transcription = transcribe_bump(BODY, Friction(), vertices)
    x = feasible_bump(transcription, vertices, DELTA)
    functions = oracles(transcription.assembly)
    p = functions.parameter_vector(DELTA / RADIANS, transcription.block_parameters(x))
    g = np.array(functions.options["jac_g"](x, p)[0]).ravel()
    assert np.maximum(transcription.constraint_lower - g, g - transcription.constraint_upper).max() < 1e-9


def test_the_optimum_satisfies_first_order_conditions_and_beats_the_prescribed_crawler():
    """At strongly regularised friction the optimum is soon found; the slow test goes on to smaller delta."""
    body = BumpBody(0.1, modes=2)
    found = optimise_bump(body, Friction(), prescribed_vertices(body, 1.5 - 1e-6, 4), 8e-3, delta_start=8e-3, nodes=2)
    checks = {c.name: c for c in found.checks(1.5)}
    assert all(checks[name].passed for name in ("KKT error", "constraint violation", "region"))
    assert abs(checks["replay gap"].value) < 1e-2
    assert checks["tangent angle"].value < 1e-2
    before = Crawler(Concertina(epsilon=0.1, amplitude=1.5), delta=8e-3).measured_period(intervals=2)
    assert before.efficiency + 0.01 < found.replay().efficiency < 1.0


@pytest.mark.slow
def test_the_optimum_is_certified_at_small_delta():
    body = BumpBody(0.05, modes=4, panels=6)
    delta = 32 * delta_for(0.05)
    found = optimise_bump(body, Friction(), prescribed_vertices(body, 1.5 - 1e-6, 12), delta)
    assert found.delta == delta
    assert all(c.passed for c in found.checks(1.5)), found.checks(1.5)
    prescribed = Crawler(Concertina(epsilon=0.05, amplitude=1.5), delta=delta_for(0.05)).measured_period(intervals=2)
    assert found.replay(delta=delta_for(0.05)).efficiency > prescribed.efficiency + 0.005


def test_a_first_level_that_fails_is_said():
    with pytest.raises(NotConvergedError, match="larger delta_start"):
        optimise_bump(BODY, Friction(), prescribed_vertices(BODY, 1.5 - 1e-6, 6), 1e-6, delta_start=1e-6, iterations=2)


def test_the_best_start_is_chosen_by_loss():
    weak, strong = (prescribed_vertices(BODY, a, 6) for a in (0.6, 1.4))
    assert best_start(BODY, Friction(), [weak, strong], DELTA) is strong


@pytest.mark.parametrize("changes", [{"epsilon": 0.7}, {"share": 0.0}, {"modes": 1}])
def test_unusable_bodies_are_refused(changes):
    with pytest.raises(ProblemError, match="must lie between"):
        BumpBody(**({"epsilon": 0.1} | changes))
