"""Low-mode gaits of smooth bodies: modes, balance against the general solver, derivatives, optima and what they beat."""

import casadi as ca
import numpy as np
import pytest

from colloc.collocation.layout import RADIANS
from colloc.collocation.modal_transcription import transcribe_modal
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.mechanics.friction import Friction
from colloc.numerics.blocks import oracles
from colloc.search.modal_optimum import optimise_modal
from colloc.smooth.balance import solve_smooth
from colloc.smooth.modal_balance import modal_balance, solve_modal
from colloc.smooth.modal_body import ModalBody
from colloc.smooth.modal_problem import ModalProblem
from colloc.smooth.motion import sine_wave
from colloc.smooth.period import measured_period
from colloc.system.errors import NotConvergedError, ProblemError

SIDEWAYS = Friction(100.0, 1.0, 1.0)
FOURIER = ModalBody(4, "fourier")


@pytest.mark.parametrize("basis", ["legendre", "fourier"])
def test_modes_have_zero_mean_and_are_orthogonal(basis):
    body = ModalBody(6, basis)
    grid = body.grid
    values, weights = body.modes_at(grid.nodes[:, 0]), grid.weights
    products = values.T @ (weights * values)
    np.testing.assert_allclose(weights[:, 0] @ values, 0.0, atol=1e-12)
    np.testing.assert_allclose(products, np.diag(np.diag(products)), atol=1e-9)


def test_fourier_modes_hold_the_paper_s_wave_exactly():
    wave, t = FOURIER.motion(FOURIER.wave(0.7), True), np.array([0.03, 0.31])
    s = np.linspace(0.0, 1.0, 50)[:, None] * np.ones((1, 2))
    np.testing.assert_allclose(wave.angle(s, t), sine_wave(0.7).angle(s, t), atol=1e-12)
    np.testing.assert_allclose(wave.rate(s, t), sine_wave(0.7).rate(s, t), atol=1e-11)


def test_a_straight_staircase_prolongs_to_the_line_through_it():
    """A chain on a circle has headings in arithmetic progression; its nearest degree-one mode has the circle's curvature."""
    n = 40
    amplitudes = ModalBody(3).from_links(np.full(n, 1.0 / n)) @ np.full(n - 1, 1.0 / n)
    np.testing.assert_allclose(amplitudes, [0.5, 0.0, 0.0], atol=2.0 / n**2)


@pytest.mark.parametrize("friction", [SIDEWAYS, Friction(0.5, 1.0, 5.0)])
def test_balance_and_power_agree_with_adaptive_panels(friction):
    body = ModalBody(4, panels=24, order=8)
    gait, t, delta = body.wave(1.0), np.array([0.05, 0.2, 0.4]), 0.05
    general = solve_smooth(body.motion(gait, True), friction, t, delta).require()
    solved = solve_modal(body, friction, gait.angles(t), gait.rates(t), delta)
    power = modal_balance(body, friction, gait.angles(t), gait.rates(t), solved.velocity, np.array([[delta]])).power
    # where parts slide backward, mu jumps within a panel
    tolerance = 1e-6 if friction.mu_f == friction.mu_b else 1e-4
    np.testing.assert_allclose(solved.velocity, general.z, atol=tolerance)
    np.testing.assert_allclose(power[0], general.power, rtol=tolerance)


def test_the_statement_vanishes_at_the_solver_s_velocity():
    gait, t = FOURIER.wave(1.0), np.linspace(0.0, 0.5, 7)
    solved = solve_modal(FOURIER, SIDEWAYS, gait.angles(t), gait.rates(t), 0.1)
    force = modal_balance(FOURIER, SIDEWAYS, gait.angles(t), gait.rates(t), solved.velocity, np.array([[0.1]])).force
    assert np.abs(force).max() < 1e-9 * SIDEWAYS.largest


def problem(**changes) -> ModalProblem:
    fields = {"name": "wave", "guess": FOURIER.wave(1.0), "body": FOURIER, "friction": SIDEWAYS, "intervals": 8}
    return ModalProblem(**(fields | changes))


@pytest.mark.parametrize("symmetry", ["antipodal", "none"])
def test_derivatives_through_the_balance_by_finite_differences(symmetry):
    transcription = transcribe_modal(problem(gait=Harmonic(2, symmetry), body=ModalBody(4, "fourier", panels=4)))
    functions = oracles(transcription.assembly)
    rng = np.random.default_rng(7)
    parameters = transcription.problem.gait.parameters(FOURIER.wave(0.8))
    x = transcription.feasible_point(parameters + 0.05 * rng.normal(size=parameters.size), 0.3)
    p = functions.parameter_vector(0.3 / RADIANS, transcription.block_parameters(parameters))
    direction, weight, h = rng.normal(size=x.size), rng.normal(size=transcription.assembly.m), 1e-5

    def evaluated(step):
        g, jacobian = functions.options["jac_g"](x + step * direction, p)
        return np.array(g).ravel(), ca.DM(jacobian)

    (plus, after), (minus, before), (_, here) = evaluated(h), evaluated(-h), evaluated(0.0)
    np.testing.assert_allclose(np.array(here @ direction).ravel(), (plus - minus) / (2 * h), atol=1e-5)
    upper = ca.DM(functions.options["hess_lag"](x, p, 0.0, weight)).full()
    hessian = upper + upper.T - np.diag(np.diag(upper))
    numeric = np.array((after - before).T @ weight).ravel() / (2 * h)
    np.testing.assert_allclose(hessian @ direction, numeric, atol=1e-4 * np.abs(numeric).max())


def test_feasible_points_satisfy_every_equation():
    transcription = transcribe_modal(problem())
    parameters = transcription.problem.gait.parameters(FOURIER.wave(1.0))
    x = transcription.feasible_point(parameters, 0.1)
    functions = oracles(transcription.assembly)
    p = functions.parameter_vector(0.1 / RADIANS, transcription.block_parameters(parameters))
    g = np.array(functions.options["jac_g"](x, p)[0]).ravel()
    assert np.maximum(transcription.constraint_lower - g, g - transcription.constraint_upper).max() < 1e-9


def test_the_optimum_beats_the_paper_s_wave_and_is_certified():
    found = optimise_modal(problem())
    wave = measured_period(sine_wave(), SIDEWAYS, found.problem.delta)
    assert found.certified, [c for c in found.checks if not c.passed]
    assert found.iterations < 60
    assert wave.efficiency + 0.09 < found.efficiency < 1.0
    # a maximum: the same class of gaits, replayed by the other solver, is worse to either side
    for scale in (0.97, 1.03):
        g = found.gait
        moved = Fourier(g.mean, scale * g.cos, scale * g.sin)
        period = measured_period(FOURIER.motion(moved, True), SIDEWAYS, found.problem.delta)
        assert period.efficiency < found.efficiency - 1e-6


@pytest.mark.slow
def test_more_modes_never_do_worse_and_isotropic_friction_needs_finer_panels():
    few = optimise_modal(problem(body=ModalBody(4), guess=ModalBody(4).wave(1.0)))
    many = optimise_modal(problem(body=ModalBody(6), guess=ModalBody(6).wave(1.0)))
    assert few.certified
    assert many.certified
    assert few.efficiency + 0.02 < many.efficiency < 1.0


def test_a_budget_that_runs_out_is_said():
    with pytest.raises(NotConvergedError, match=r"no optimum at delta .* start from another guess"):
        optimise_modal(problem(body=ModalBody(4, "fourier", panels=2, order=4)), iterations=1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"guess": FOURIER.wave(2.0)}, "tangent angle reaches"),
        ({"guess": ModalBody(3).wave(1.0)}, "3 modes but the body has 4"),
        ({"gait": Harmonic(1, "bilateral")}, "'none' or 'antipodal'"),
        ({"largest_angle": 2.0}, "below pi/2"),
        ({"delta": 1.0}, "must not lie below delta"),
        ({"intervals": 1}, "mesh is too small"),
        ({"delta": float("nan")}, "positive finite"),
    ],
)
def test_unusable_problems_are_refused(changes, message):
    with pytest.raises(ProblemError, match=message):
        problem(**changes)


@pytest.mark.parametrize(
    ("changes", "message"), [({"modes": 0}, "modes"), ({"basis": "sine"}, "basis"), ({"panels": 2.5}, "panels")]
)
def test_unusable_bodies_are_refused(changes, message):
    with pytest.raises(ProblemError, match=message):
        ModalBody(**changes)


def test_fourier_modes_come_in_pairs():
    with pytest.raises(ProblemError, match="pairs"):
        ModalBody(3, "fourier")
