"""Second-order conditions: optima have positive curvature on what is free, a known saddle has not, and
a search leaves it; rows follow the worst instants of whatever gait they are asked for, and a search
on one mesh ends when they rest."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar, root

from colloc import Chain, Friction, Harmonic, Problem, ellipse
from colloc.gaits.starts import latin_hypercube_gait
from colloc.mechanics.densities import Instants
from colloc.reduced.program import ReducedProgram
from colloc.reduced.second_order import curvature
from colloc.search import optimise as converge
from colloc.search.confirm import confirm
from colloc.search.iterate import evaluate_at, space_near
from colloc.search.optimise import leave_saddle, solve_subproblems
from colloc.search.options import FINE, OPTIONS
from colloc.search.solve import finish, solve
from tests.shared.stages import answer_near, optimum_near

PROBLEM = Problem("bilateral", gait=Harmonic(1, "bilateral"), intervals=100)
SADDLE = ellipse(0.0, 0.30734, 0.76781)


class Touching:
    """Minimise x^2 + b y^2 - p x with x cos t + y sin t <= 1 at all t: rows at the worst t, which
    turns with y.

    On the circle x = 1 - y^2/2, so the objective has the curvature 2 b + p - 2 along it; the row
    held at its instant, x <= 1, gives 2 b.
    """

    lower, upper = np.full(2, -9.0), np.full(2, 9.0)
    row_lower, row_upper, row_names = np.array([-np.inf]), np.ones(1), [("circle", 0)]

    def __init__(self, b, p):
        self.weights, self.pull = np.array([1.0, b]), np.array([p, 0.0])

    def objective(self, v):
        return (self.weights * v - self.pull) @ v

    def gradient(self, v):
        return 2 * self.weights * v - self.pull

    def rows(self, v):
        return self.normal @ v

    def row_slopes(self, v):
        return self.normal

    def move_checks(self, v, later=0.0, reach=0.0):
        t = np.arctan2(v[1], v[0]) + later
        self.normal = np.array([[np.cos(t), np.sin(t)]])

    def of_moving_peaks(self, v, on_rows):
        return np.zeros((2, 2))


@pytest.mark.parametrize("b", [-0.5, 0.25])
def test_the_worst_instant_moves_with_the_gait(b):
    found = curvature(Touching(b, 3.0), np.array([1.0, 0.0]))
    assert found.n_free == 1
    assert found.smallest == pytest.approx(2 * b + 1, abs=1e-4)


class Rough(Touching):
    """Bent down within 1e-5 of y = 0 alone; with a gradient that is off, as where kinks pass a
    point of the mesh: the Hessian has an antisymmetric part."""

    def objective(self, v):
        y, w = abs(v[1]), 1e-5
        return super().objective(v) - (y * y if y < w else w * (2 * y - w))

    def gradient(self, v):
        off = 0.1 * np.array([v[1], 0.5 - v[0]])
        return super().gradient(v) + off - [0.0, 2 * np.clip(v[1], -1e-5, 1e-5)]


def test_a_bend_that_a_longer_step_does_not_see_is_no_saddle_and_an_error_is_what_it_couples():
    found = curvature(Rough(0.25, 1.0), np.array([0.5, 0.0]))
    assert found.smallest == pytest.approx(0.5 - 0.08, abs=0.01)
    # of -1.5 and 2, by as much as a coupling of 0.1 moves them
    assert found.error == pytest.approx(0.1**2 / 3.5, rel=1e-2)


def test_the_peak_of_a_moment_moves_with_the_gait():
    """Its second derivative is that at its instant and what the instant's move adds."""
    gait, asked = Harmonic(1, "bilateral"), {"torque_limit": 0.06, "delta": 1e-2}
    problem = Problem("weak", body=Chain((0.25,) * 4), gait=gait, **asked)
    space, v = space_near(problem, problem.guess)
    program = ReducedProgram(space, problem.delta)
    program.place_rows(v)
    (shares, points), names = program.actuators.placed, problem.path_limits.names
    second = shares == names.index("torque of joint 2")
    row = int(np.argmax(np.where(second, program.actuators.values(v, problem.delta), -1)))
    cell = points[row] // space.mesh.scheme.s
    left, right = space.mesh.edges[cell : cell + 2]

    def moment(at, t):
        gait, body, t = space.member(at), problem.body, np.atleast_1d(t)
        angles, rates = gait(t)
        at = body, problem.friction, angles, rates, problem.delta
        return problem.path_limits.at(Instants(*at, z=body.solve(*at[1:]).z))[1, 0]

    def peak(at):
        reach, finely = (2 * left - right, 2 * right - left), {"xatol": 1e-12}
        how = {"bounds": reach, "method": "bounded", "options": finely}
        return minimize_scalar(lambda t: -moment(at, t), **how).x

    here, on_rows = peak(v), np.zeros(program.row_lower.size)
    assert left < here < right
    on_rows[row] = 1.0
    added, rng = program.of_moving_peaks(v, on_rows), np.random.default_rng(0)
    for z in rng.normal(size=(3, v.size)):
        step = 1e-3 * z / np.linalg.norm(z)
        largest = [moment(at, peak(at)) for at in (v - step, v, v + step)]
        there = [moment(at, here) for at in (v - step, v, v + step)]
        moved = (np.diff(largest, 2) - np.diff(there, 2))[0] / 1e-6
        assert moved > 1e-3
        assert step @ added @ step / 1e-6 == pytest.approx(moved, rel=1e-2)


def test_the_gait_between_two_ways_of_bending_is_a_saddle():
    space, v = space_near(PROBLEM, SADDLE)
    program = ReducedProgram(space, PROBLEM.delta)
    found = curvature(program, v)
    assert found.kkt_error < 1e-3
    assert found.n_free == 3
    assert found.smallest == pytest.approx(-0.81, abs=0.02)
    assert found.error < 1e-4
    step = 1e-3 * found.direction
    objective = [program.objective(v + k * step) for k in (-1, 0, 1)]
    assert objective[0] < objective[1] > objective[2]
    assert np.diff(objective, 2)[0] / 1e-6 == pytest.approx(found.smallest, rel=1e-2)


def test_an_optimum_is_better_than_its_neighbours():
    answer = answer_near(PROBLEM.with_(friction=Friction(mu_t=10, mu_f=1, mu_b=1), intervals=20))
    space, v = space_near(answer.problem, answer.gait, answer.edges, answer.scheme)
    program = ReducedProgram(space, answer.delta)
    found = curvature(program, v)
    assert found.n_free == v.size
    assert found.smallest > 100 * found.error
    here, rng = program.objective(v), np.random.default_rng(1)
    for direction in rng.normal(size=(10, v.size)):
        rise = program.objective(v + 0.01 * direction / np.linalg.norm(direction)) - here
        assert rise > 0.9 * 0.5e-4 * found.smallest


@pytest.mark.parametrize("follows", [True, False])
def test_a_gait_comes_to_rest_at_limits_that_it_touches_for_an_instant(follows, monkeypatch):
    """With fixed instants it swings: every round is optimal for those of the one before."""
    if not follows:
        monkeypatch.setattr(ReducedProgram, "follow_worst", lambda held: None)
    monkeypatch.setattr(converge, "OPTIONS", replace(OPTIONS, radius=0.5))
    body, friction = Chain((0.25, 0.25, 0.25, 0.25)), Friction(mu_t=0.4, mu_f=1, mu_b=1)
    problem = Problem(
        "touch", body=body, friction=friction, gait=Harmonic(4), joint_limit=2.5, intervals=20
    )
    space, v = space_near(problem, latin_hypercube_gait(problem, 0, 0))
    _, conditions, *_ = solve_subproblems(ReducedProgram(space, 0.02), v, FINE)
    assert (max(conditions.kkt_error, conditions.violation) < 1e-6) == follows


USUAL = {"gait": Harmonic(1, "bilateral"), "guess": ellipse(0.0, 2.0, 1.0)}
PLAIN = Problem("plain", intervals=60, mesh_tolerance=0, **USUAL)


@pytest.fixture(scope="module")
def found():
    return optimum_near(PLAIN.with_(intervals=40))


@pytest.mark.parametrize(("beyond", "kept"), [(0.0, False), (1e-7, False), (1e-4, True)])
def test_what_ipopt_finds_is_the_answer_where_its_checks_rest(found, monkeypatch, beyond, kept):
    """Up to what certificates let pass; else the search's gait, if first-order optimal, is."""
    place = ReducedProgram.place_rows
    monkeypatch.setattr(ReducedProgram, "place_rows", lambda at, v: (place(at, v), beyond)[1])
    answer = confirm(found)
    assert answer.optimal
    assert ("beyond its limits" in answer.message) == kept
    assert (answer.status == "stationary") == kept
    assert abs(answer.value + found.objective) < OPTIONS.confirm_radius


@pytest.mark.parametrize("changed", [{}, {"mu_b": 2.0}], ids=["symmetric", "unequal"])
def test_a_solve_that_begins_at_its_answer_stays_there_at_one_delta(changed):
    problem = Problem("again", friction=Friction(**changed), delta=1e-3, **USUAL)
    found = solve(problem, 1)
    again = solve(problem.with_(guess=found.gait), 1)
    assert found.history[0].delta == problem.delta_start
    assert {step.delta for step in again.history} == {problem.delta}
    assert again.value == pytest.approx(found.value, rel=problem.mesh_tolerance)
    assert again.success


@pytest.fixture(scope="module")
def saddle():
    """Without an offset the gait is its own mirror image, and no gradient would give it one."""
    space, v = space_near(PLAIN, SADDLE)
    v = root(ReducedProgram(space, PLAIN.delta).gradient, v, tol=1e-9).x
    return evaluate_at(space, v, PLAIN.delta)


def test_below_a_saddle_lies_an_optimum_and_nothing_below_that(saddle, found):
    assert leave_saddle(found) is None
    assert saddle.optimal
    assert saddle.objective == pytest.approx(-0.04614, abs=2e-5)
    below = leave_saddle(saddle)
    assert curvature(ReducedProgram(below.space, below.delta), below.v).smallest > 0
    assert below.objective < 2 * saddle.objective


def test_a_search_that_comes_to_a_saddle_goes_on_from_there(saddle):
    assert confirm(saddle).second_order.smallest < 0
    found = finish(PLAIN, saddle)
    assert found.success
    assert found.answer.second_order.smallest > 0
    assert found.answer.value > -4 * saddle.objective
    assert found.answer.history[0].value == pytest.approx(0.04614, abs=2e-5)
