"""Low-mode gaits of smooth bodies: modes, balance against the general solver, derivatives, optima and
what they beat; as many panels in a search as a gait needs."""

import numpy as np
import pytest

import colloc
from colloc import Fourier, Friction, Harmonic, ModalBody, Problem, Wave, load, replay, save
from colloc.dynamics.control_problem import control_problem
from colloc.reduced.linear_space import LinearSpace
from colloc.reduced.program import ReducedProgram
from colloc.results.comparison import distance, reversed_in_time, swap_ends
from colloc.search.iterate import evaluate_at, space_near
from colloc.search.optimise import on_more_panels
from colloc.search.solve import solve
from colloc.smooth.balance import Motion, PanelBatch
from colloc.transcription.shape_constraints import shape_checks
from scripts.models.period import measured_period
from tests.shared.stages import answer_near, program_of

SIDEWAYS = Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0)
FOURIER = ModalBody(4, "fourier")


def wave(body, amplitude):
    """``amplitude sin(2 pi (s + t))``, the paper's, but for half a period."""
    cos, sin = body.wave(-1.0)
    return Fourier(np.zeros(body.n_joint), amplitude * cos[:, None], amplitude * sin[:, None])


def gait_motion(body, gait):
    """Theta(s, t) of an antipodal gait of the modes' amplitudes."""

    def wide(s, t):
        return np.broadcast_to(s, (len(s), t.size))

    parts = gait.angles, gait.rates
    angle, rate = (lambda s, t, part=part: body.tangent(wide(s, t), part(t)) for part in parts)
    return Motion(angle, rate, stages=(0.0, 0.5), antipodal=True)


@pytest.mark.parametrize("basis", ["legendre", "fourier"])
def test_modes_have_zero_mean_and_are_orthogonal(basis):
    body = ModalBody(6, basis)
    grid = body.grid
    values, weights = body.modes_at(grid.nodes[:, 0]), grid.weights
    products = values.T @ (weights * values)
    np.testing.assert_allclose(weights[:, 0] @ values, 0.0, atol=1e-12)
    np.testing.assert_allclose(products, np.diag(np.diag(products)), atol=1e-9)


def test_fourier_modes_hold_the_paper_s_wave_exactly():
    motion, t = gait_motion(FOURIER, wave(FOURIER, 0.7)), np.array([0.03, 0.31])
    s = np.linspace(0.0, 1.0, 50)[:, None] * np.ones((1, 2))
    paper = Wave("sine", 0.7).prescribed()
    np.testing.assert_allclose(motion.angle(s, t), paper.angle(s, t + 0.5), atol=1e-12)
    np.testing.assert_allclose(motion.rate(s, t), paper.rate(s, t + 0.5), atol=1e-11)


def test_a_straight_staircase_is_laid_into_the_line_through_it():
    """A chain on a circle has evenly stepped headings; its degree-one mode has its curvature."""
    n = 40
    amplitudes = ModalBody(3).from_chain(np.full(n, 1.0 / n)) @ np.full(n - 1, 1.0 / n)
    np.testing.assert_allclose(amplitudes, [0.5, 0.0, 0.0], atol=2.0 / n**2)


@pytest.mark.parametrize("modes", [2, 4, 6, 12])
@pytest.mark.parametrize("basis", ["legendre", "fourier"])
def test_the_tangent_is_bounded_wherever_it_is_largest(basis, modes):
    body = ModalBody(modes, basis)
    shapes, checks = np.random.default_rng(modes).normal(size=(modes, 500)), shape_checks(body)
    everywhere = np.abs(body.modes_at(np.linspace(0.0, 1.0, 20001)) @ shapes).max(axis=0)
    which, every = np.repeat(np.arange(len(checks.names)), 500), np.tile(shapes, len(checks.names))
    values = checks.values(which, every)
    largest = np.abs(values).reshape(-1, 500).max(axis=0)
    np.testing.assert_allclose(largest, everywhere, rtol=2e-5)
    places = checks.shares(which, every)
    np.testing.assert_allclose(checks.values(which, every, places), values, atol=1e-10)
    slopes = checks.slopes(which, every, places)
    np.testing.assert_allclose(slopes, body.modes_at(places).T, atol=1e-10)


def test_amplitudes_of_modes_may_exceed_the_limit_of_the_tangent_and_both_programs_let_them():
    body, gait = ModalBody(4), Harmonic(1)
    shapes = np.random.default_rng(1).normal(size=(4, 5000))
    shapes /= body.bounded_angles.largest(shapes)
    largest = np.abs(shapes).max(axis=1)
    assert largest.max() > 4 / np.pi
    assert (largest <= gait.bounds(body, 1.0)[1].max() * np.pi / 4).all()
    problem = Problem("modes", body=body, gait=gait, joint_limit=1.0)
    program = program_of(problem)
    np.testing.assert_allclose(
        program.upper[program.layout.parameters[:, 0]], LinearSpace(control_problem(problem)).upper
    )


@pytest.mark.parametrize("basis", ["legendre", "fourier"])
def test_a_gait_seen_from_the_other_end_backwards_in_time_is_the_same_gait(basis):
    """The reversed swap keeps distance and work (`colloc.results.comparison`), smooth or not."""
    body, friction, t = ModalBody(4, basis), Friction(mu_t=2, mu_f=1, mu_b=3), np.arange(40) / 40
    gait, powers = wave(body, 0.8), []
    image = reversed_in_time(swap_ends(gait, body))
    for g in (gait, image):
        at = friction, g.angles(t), g.rates(t), 0.05
        powers.append(body.motion(*at, body.solve(*at)).power.sum())
    assert powers[1] == pytest.approx(powers[0], rel=1e-9)
    assert distance(gait, image, body, friction) < 1e-12


def problem(**changes) -> Problem:
    fields = {"body": FOURIER, "friction": SIDEWAYS, "gait": Harmonic(1, "antipodal")}
    return Problem("wave", **(fields | {"intervals": 8} | changes))


@pytest.mark.slow
def test_the_optimum_beats_the_paper_s_wave_and_is_certified(tmp_path):
    found = solve(problem(body=ModalBody(4, "fourier", panels=4)), 1)
    reference = measured_period(Wave().prescribed(), SIDEWAYS, found.problem.delta)
    assert found.status == "solved", found.message
    assert found.answer.program == "implicit velocity"
    assert reference.efficiency + 0.09 < found.efficiency < 1.0
    # a maximum: the same class of gaits, replayed by the general solver, is worse to either side
    for scale in (1.0, 0.97, 1.03):
        motion = gait_motion(FOURIER, found.gait.scaled(scale))
        period = measured_period(motion, SIDEWAYS, found.problem.delta)
        if scale == 1.0:
            assert period.efficiency == pytest.approx(found.efficiency, rel=1e-6)
        else:
            assert period.efficiency < found.efficiency - 1e-6
    read = load(save(found, tmp_path / "wave.h5"))
    assert (read.problem.hash, read.problem.body) == (found.problem.hash, found.problem.body)
    np.testing.assert_array_equal(read.sample(0.3).tail, found.sample(0.3).tail)


@pytest.mark.slow
def test_more_modes_never_do_worse():
    few, many = (solve(problem(body=ModalBody(modes)), 1) for modes in (4, 6))
    assert (few.status, many.status) == ("solved", "solved")
    assert few.efficiency == pytest.approx(0.794192, abs=2e-6)
    assert many.efficiency == pytest.approx(0.855543, abs=2e-6)


GAIT = Fourier([0.0, 0.0], [[0.4562], [0.0]], [[0.0], [-1.429]])
USUAL = {"gait": Harmonic(1, "antipodal"), "intervals": 8}


def found(panels, delta=1e-2, **changes):
    stated = Problem("two-modes", GAIT, ModalBody(2, panels=panels), **USUAL, **changes)
    return evaluate_at(*space_near(stated, GAIT), delta)


def test_panels_are_added_where_a_point_at_rest_moves_over_them_alone():
    coarse = found(8)
    finer, v = on_more_panels(coarse)
    exact = -found(96).objective
    assert 8 < finer.control.dynamics.body.panels <= 32  # at most fourfold at a time
    after = -ReducedProgram(finer, 1e-2).objective(v)
    assert abs(after - exact) < 0.2 * abs(-coarse.objective - exact)
    np.testing.assert_array_equal(finer.mesh.edges, coarse.space.mesh.edges)
    # and stay where they do not matter
    assert on_more_panels(found(16, delta=0.5)) is None
    sideways = Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0)
    assert on_more_panels(found(8, friction=sideways, mesh_tolerance=1e-2)) is None
    stated = Problem("chain", gait=Harmonic(1, "antipodal"))  # and a chain has none to add
    assert on_more_panels(evaluate_at(*space_near(stated, stated.guess), 0.1)) is None


def test_joints_work_by_their_bending_moment_and_not_by_what_friction_takes(monkeypatch):
    of_moments = PanelBatch.bending_power
    monkeypatch.setattr(PanelBatch, "bending_power", lambda *at: 1.01 * of_moments(*at))
    at = ModalBody(2, panels=4), Friction(), GAIT, 0.1
    again = replay(*at, instants=80, tolerance=1e-3)
    assert again.actuator_work / again.work == pytest.approx(1.01, abs=1e-3)


@pytest.mark.slow
def test_a_gait_on_more_panels_is_replayed_and_kept(tmp_path):
    at = {"delta": 0.1, "delta_start": 0.1}
    stated = Problem("two-modes", GAIT, ModalBody(2, panels=4), **USUAL, **at)
    solution = colloc.Solution(stated, answer_near(stated))
    how = {"instants": 80, "tolerance": 1e-5}
    again = replay(stated.body, stated.friction, solution.gait, 0.1, **how)
    assert solution.answer.problem.body.panels > 4
    assert abs(solution.efficiency / again.efficiency - 1) < 1e-4
    read = load(save(solution, tmp_path / "two.h5"))
    assert read.answer.problem.body == solution.answer.problem.body != read.problem.body
    assert np.abs(read.answer.at_points.force).max() < 1e-6
