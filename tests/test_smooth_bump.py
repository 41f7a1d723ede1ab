"""Bump crawlers by collocation: physics against the general solver, derivatives, and that optimising helps."""

import casadi as ca
import numpy as np
import pytest

from colloc.blocks import oracles
from colloc.bump_balance import balance_and_power, bump_instant, solve_bump
from colloc.bump_body import BumpBody
from colloc.bump_optimum import best_start, feasible_bump, optimise_bump, prescribed_vertices
from colloc.bump_transcription import piece_lengths, transcribe_bump
from colloc.concertina import Concertina
from colloc.errors import ProblemError
from colloc.friction import Friction
from colloc.layout import RADIANS
from colloc.smooth_balance import solve_smooth

BODY, DELTA = BumpBody(0.05, modes=4), 1e-4


def test_modes_and_slopes():
    x, h = np.linspace(-0.99, 0.99, 41), 1e-6
    value, slope = BODY.modes_at(x)
    np.testing.assert_allclose(slope, (BODY.modes_at(x + h)[0] - BODY.modes_at(x - h)[0]) / (2 * h), atol=1e-7)
    assert np.abs(BODY.modes_at(np.array([-1.0, 1.0, 1.2]))[0]).max() == 0.0
    assert value.shape == (41, 4)


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
    np.testing.assert_allclose(BODY.motion(vertices).angle(s, t), crawler.motion().angle(s, t), atol=1e-12)
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


def test_optimised_is_better_than_prescribed_and_replay_confirms_it():
    vertices = prescribed_vertices(BODY, 1.5 - 1e-6, 9)
    found = optimise_bump(BODY, Friction(), vertices, DELTA, rounds=3, iterations=10)
    assert all(b < a for a, b in zip(found.losses, found.losses[1:], strict=False))
    assert found.losses[-1] < 0.99 * found.losses[0]
    assert np.abs(BODY.angles(found.vertices[1:])).max() < 1.5 + 1e-5
    replay = found.replay()
    assert replay.efficiency == pytest.approx(found.efficiency, rel=5e-3)
    assert replay.efficiency < 1.0


def test_the_best_start_is_chosen_by_loss():
    weak, strong = (prescribed_vertices(BODY, a, 6) for a in (0.6, 1.4))
    assert best_start(BODY, Friction(), [weak, strong], DELTA) is strong


@pytest.mark.parametrize("changes", [{"epsilon": 0.7}, {"share": 0.0}, {"modes": 1}])
def test_unusable_bodies_are_refused(changes):
    with pytest.raises(ProblemError, match="must lie between"):
        BumpBody(**({"epsilon": 0.1} | changes))
