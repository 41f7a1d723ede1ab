"""Second-order conditions: optima have positive curvature on what is free, and a known saddle has
not."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from colloc import Chain, Friction, Harmonic, Problem, ellipse
from colloc.mechanics.densities import Instants
from colloc.reduced.program import ReducedProgram
from colloc.reduced.second_order import curvature
from colloc.search.iterate import space_near
from tests.shared.stages import answer_near

PROBLEM = Problem("bilateral", gait=Harmonic(1, "bilateral"), intervals=100)
SADDLE = ellipse(0.0, 0.30734, 0.76781)


def program_at(problem, gait):
    """The reduced program, with its checks placed, and the parameters of a gait."""
    space, v = space_near(problem, gait)
    return ReducedProgram(space, problem.delta), v


class Quadratic:
    """x'Hx/2 on a plane or not, with its exact answer known."""

    def __init__(self, hessian, normal=None, upper=np.inf):
        n = len(hessian)
        self.hessian, self.lower, self.upper = (
            np.array(hessian, dtype=float),
            np.full(n, -9.0),
            np.full(n, 9.0),
        )
        self.normal = (
            np.zeros((0, n)) if normal is None else np.atleast_2d(np.array(normal, dtype=float))
        )
        self.row_lower = self.row_upper = np.zeros(len(self.normal))

    def objective(self, v):
        return 0.5 * v @ self.hessian @ v

    def gradient(self, v):
        return self.hessian @ v

    def rows(self, v):
        return self.normal @ v

    def row_slopes(self, v):
        return self.normal

    @property
    def row_names(self):
        return [("plane", k) for k in range(len(self.normal))]

    def move_checks(self, v, later=0.0):
        pass

    def of_moving_peaks(self, v, on_rows):
        return np.zeros((v.size, v.size))


class Touching(Quadratic):
    """Minimise x^2 + b y^2 - p x with x cos t + y sin t <= 1 at all t: rows at the worst t, which
    turns with y.

    On the circle x = 1 - y^2/2, so the objective has the curvature 2 b + p - 2 along it; the row
    held at its instant, x <= 1, gives 2 b.
    """

    def __init__(self, b, p):
        super().__init__(np.diag([2.0, 2.0 * b]), [1.0, 0.0])
        self.pull, self.row_lower, self.row_upper = p, np.array([-np.inf]), np.ones(1)

    def objective(self, v):
        return super().objective(v) - self.pull * v[0]

    def gradient(self, v):
        return super().gradient(v) - np.array([self.pull, 0.0])

    def move_checks(self, v, later=0.0):
        t = np.arctan2(v[1], v[0]) + later
        self.normal = np.array([[np.cos(t), np.sin(t)]])


def test_curvature_is_that_on_the_free_directions_alone():
    hessian = np.diag([3.0, -2.0, 0.5])
    free, fixed = (
        curvature(Quadratic(hessian, normal), np.zeros(3)) for normal in (None, [0, 1, 0])
    )
    assert free.smallest == pytest.approx(-2.0)
    assert np.abs(free.direction) == pytest.approx([0, 1, 0])
    assert fixed.smallest == pytest.approx(0.5)
    assert (free.n_free, fixed.n_free) == (3, 2)


@pytest.mark.parametrize("b", [-0.5, 0.25])
def test_the_worst_instant_moves_with_the_gait(b):
    found = curvature(Touching(b, 3.0), np.array([1.0, 0.0]))
    assert found.n_free == 1
    assert found.smallest == pytest.approx(2 * b + 1, abs=1e-4)


def test_the_peak_of_a_moment_moves_with_the_gait():
    """The second derivative of the largest moment over time is that at its instant and what the
    move of the instant adds."""
    problem = Problem(
        "weak",
        body=Chain((0.25,) * 4),
        gait=Harmonic(1, "bilateral"),
        torque_limit=0.06,
        delta=1e-2,
    )
    space, v = space_near(problem, problem.guess)
    program = ReducedProgram(space, problem.delta)
    program.place_rows(v)
    (shares, points), names = program.actuators.placed, problem.path_limits.names
    row = int(
        np.argmax(
            np.where(
                shares == names.index("torque of joint 2"),
                program.actuators.values(v, problem.delta),
                -1,
            )
        )
    )
    cell = points[row] // space.mesh.scheme.s
    left, right = space.mesh.edges[cell : cell + 2]

    def moment(at, t):
        gait, body, t = space.member(at), problem.body, np.atleast_1d(t)
        angles, rates = gait(t)
        z = body.solve(problem.friction, angles, rates, problem.delta).z
        return problem.path_limits.at(
            Instants(body, problem.friction, angles, rates, problem.delta, z=z)
        )[1, 0]

    def peak(at):
        reach = {
            "bounds": (2 * left - right, 2 * right - left),
            "method": "bounded",
            "options": {"xatol": 1e-12},
        }
        return minimize_scalar(lambda t: -moment(at, t), **reach).x

    here, on_rows = peak(v), np.zeros(program.row_lower.size)
    assert left < here < right
    on_rows[row] = 1.0
    added, rng = program.of_moving_peaks(v, on_rows), np.random.default_rng(0)
    for z in rng.normal(size=(3, v.size)):
        step = 1e-3 * z / np.linalg.norm(z)
        largest = [moment(at, peak(at)) for at in (v - step, v, v + step)]
        there = [moment(at, here) for at in (v - step, v, v + step)]
        moved = (
            largest[0] - 2 * largest[1] + largest[2] - there[0] + 2 * there[1] - there[2]
        ) / 1e-6
        assert moved > 1e-3
        assert step @ added @ step / 1e-6 == pytest.approx(moved, rel=1e-2)


def test_the_gait_between_two_ways_of_bending_is_a_saddle():
    """Its curvature is the second difference of the efficiency along its direction."""
    program, v = program_at(PROBLEM, SADDLE)
    found = curvature(program, v)
    assert found.kkt_error < 1e-3
    assert found.n_free == 3
    assert found.smallest == pytest.approx(-0.81, abs=0.02)
    assert found.error < 1e-4
    step = 1e-3 * found.direction
    objective = [program.objective(v + k * step) for k in (-1, 0, 1)]
    assert objective[0] < objective[1] > objective[2]
    assert (objective[0] - 2 * objective[1] + objective[2]) / 1e-6 == pytest.approx(
        found.smallest, rel=1e-2
    )


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
