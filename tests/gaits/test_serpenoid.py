"""Serpenoid gaits: a few numbers for any number of links, solved and certified like all gaits."""

import numpy as np
import pytest

from colloc import Chain, Fourier, Friction, Harmonic, Problem, ProblemError, Serpenoid
from colloc.reduced.program import ReducedProgram
from colloc.results.store import load, save
from colloc.search.iterate import space_near
from colloc.search.solve import solve
from colloc.transcription.layout import RADIANS
from tests.shared.stages import program_of

FIVE = Chain((0.2,) * 5)
SNAKE = Friction(mu_t=10, mu_f=1, mu_b=1)
CLASSES = [Serpenoid(2, "none"), Serpenoid(2, "bilateral"), Serpenoid(3, "antipodal")]


def moved(gait_class, seed=1):
    """A space of the class, and parameters that are no wave of the usual guess."""
    problem = Problem("s", body=FIVE, friction=SNAKE, gait=gait_class)
    space, v = space_near(problem, Problem("g", body=FIVE).guess)
    return space, v + 0.05 * np.random.default_rng(seed).standard_normal(v.size)


@pytest.mark.parametrize("gait_class", CLASSES, ids=str)
def test_joints_follow_one_another_by_a_lag_and_a_member_has_its_parameters(gait_class):
    space, v = moved(gait_class)
    gait, t = space.member(v), np.linspace(0, 1, 7)
    angles, earlier = gait.angles(t), gait.angles(t - gait.lag / (2 * np.pi))
    np.testing.assert_allclose(angles[1:], earlier[:-1], atol=1e-13)
    np.testing.assert_allclose(gait_class.parameters(gait), v, atol=1e-14)
    told = Fourier(gait.mean, gait.cos, gait.sin)  # which does not know its lag
    np.testing.assert_allclose(gait_class.parameters(told), v, atol=1e-6)


@pytest.mark.parametrize("gait_class", CLASSES, ids=str)
def test_gradients_are_those_of_finite_differences(gait_class):
    space, v = moved(gait_class)
    program, h = ReducedProgram(space, 1e-2), 1e-6
    gradient = program.gradient(v)  # first: balances asked for later begin at these
    program.place_rows(v)
    for j, step in enumerate(h * np.eye(v.size)):
        numeric = (program.objective(v + step) - program.objective(v - step)) / (2 * h)
        rows = (program.rows(v + step) - program.rows(v - step)) / (2 * h)
        assert gradient[j] == pytest.approx(numeric, abs=1e-8)
        np.testing.assert_allclose(program.row_slopes(v)[:, j], rows, atol=1e-7)


@pytest.mark.parametrize("gait_class", CLASSES, ids=str)
def test_the_full_program_says_what_the_search_does(gait_class):
    """The objectives agree; with another lag a gait is no member."""
    space, v = moved(gait_class)
    reduced, full = ReducedProgram(space, 1e-2), program_of(space.control.problem)
    x, functions, delta = full.feasible(space.full_parameters(v), 1e-2), full.nlp.functions, 1e-2
    value = float(functions["grad_f"](x, delta / RADIANS)[0])
    assert value == pytest.approx(reduced.objective(v), rel=1e-8)

    def beyond():
        rows = np.array(functions["jac_g"](x, delta / RADIANS)[0]).ravel()
        return np.abs(rows[full.groups["members"]]).max()

    assert beyond() < 1e-14
    x[full.layout.parameters[0, 0]] += 0.1
    assert beyond() > 1e-2


def test_a_solved_one_is_certified_kept_and_no_better_than_all_harmonics(tmp_path):
    problem = Problem("snake", body=FIVE, friction=SNAKE, gait=Serpenoid(symmetry="antipodal"))
    found = solve(problem, starts=1)
    assert found.success
    whole = solve(problem.with_(gait=Harmonic(1, "antipodal"), guess=found.gait), starts=1)
    assert found.efficiency < whole.efficiency
    read = load(save(found, tmp_path / "snake.h5"))
    assert read.problem.gait == problem.gait
    assert read.gait.lag == found.gait.lag
    assert "waves along the body" in str(read.gait)


def test_one_joint_has_no_serpenoid_gaits():
    with pytest.raises(ProblemError, match="at least three links"):
        Problem("none", body=Chain((0.5, 0.5)), friction=SNAKE, gait=Serpenoid())
