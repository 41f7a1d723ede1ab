"""The reduced space: exact gradients, the same numbers as the full program, and answers that solve
the full program."""

import numpy as np
import pytest

from colloc import BSpline, Chain, Fourier, Friction, Harmonic, Polygon, Problem, ellipse
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import space_near
from tests.shared.cases import cases
from tests.shared.stages import answer_near

FOUR = {
    "body": Chain((0.25,) * 4),
    "guess": Fourier(np.zeros(3), [[1.2], [0.2], [-1.2]], [[0.7], [1.0], [0.7]]),
}
WAVE = {**FOUR, "guess": Fourier(np.zeros(3), [[0.9], [0.0], [-0.9]], [[0.2], [0.9], [-0.2]])}
CASES = """
harmonics: gait=Harmonic(2), friction=Friction(mu_t=0.5, mu_f=1, mu_b=5)
bilateral harmonics: gait=Harmonic(2, "bilateral")
antipodal harmonics: gait=Harmonic(1, "antipodal"), friction=ROUGH, guess=ellipse(0, 1.3, 0.8)
shared nodes: gait=Harmonic(1), scheme="hermite-simpson"
splines of three joints: gait=BSpline(6), **WAVE
polygon: gait=Polygon(4), friction=Friction(mu_t=3, mu_f=1, mu_b=2)
bilateral polygon: gait=Polygon(5, "bilateral")
polygon that ends its intervals with nodes: gait=Polygon(4), scheme="radau-3"
antipodal polygon of three joints: gait=BSpline(6, 1, "antipodal"), **WAVE
polygon with an axis through sides: gait=Polygon(4, "bilateral", "side"), **FOUR
"""
ROUGH = Friction(mu_t=1.7, mu_f=1, mu_b=1.3)
CASES = cases(CASES, globals())
DELTA = 0.05


def near_start(case, shake=1e-2):
    stated = {"guess": ellipse(0.1, 1.6, 1.1), "intervals": 10} | CASES[case]
    problem = Problem("p", **stated)
    space, v = space_near(problem, problem.guess)
    v = v + shake * np.random.default_rng(0).normal(size=v.size)
    program = ReducedProgram(space, DELTA)
    program.place_rows(v)
    return space, v, program


@pytest.mark.parametrize("case", CASES)
def test_gradients_are_those_of_differences(case):
    space, v, program = near_start(case)
    h = 1e-6
    steps = h * np.eye(space.n)
    slopes = [(program.objective(v + e) - program.objective(v - e)) / (2 * h) for e in steps]
    np.testing.assert_allclose(program.gradient(v), slopes, atol=2e-7)
    rows = np.transpose([(program.rows(v + e) - program.rows(v - e)) / (2 * h) for e in steps])
    np.testing.assert_allclose(program.row_slopes(v), rows, atol=2e-6)


@pytest.mark.parametrize(
    "gait",
    [
        Harmonic(1, "none"),
        Harmonic(2, "bilateral"),
        Polygon(4, "bilateral"),
        BSpline(8, symmetry="bilateral"),
    ],
)
def test_the_answer_solves_the_full_program_and_is_the_gait_found(gait):
    """Tail velocities and link forces among the variables, the balance among the constraints; two
    programs, one solution."""
    problem = Problem(
        "p",
        ellipse(1.0, 0.7, 1.1),
        friction=Friction(mu_t=1.7, mu_f=1, mu_b=1.3),
        gait=gait,
        intervals=24,
        delta=3e-3,
    )
    answer = answer_near(problem.with_(mesh_tolerance=0.0))
    found = answer.history[-2]
    assert (found.program, answer.program) == ("reduced", "full")
    assert max(answer.kkt_error, answer.violation, answer.complementarity) < 1e-8
    assert answer.iterations <= 15
    assert answer.value == pytest.approx(found.value, rel=1e-7)
    assert answer.layout.friction.size == 9 * answer.mesh.n_point
    assert answer.message == ""
