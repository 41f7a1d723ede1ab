"""The reduced space: exact gradients, the same numbers as the full program, and answers that solve
the full program."""

import numpy as np
import pytest

from colloc import BSpline, Chain, Fourier, Free, Friction, Harmonic, Polygon, Problem, ellipse
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import space_near
from tests.shared.cases import cases
from tests.shared.stages import answer_near

CASES = """
harmonics: gait=Harmonic(2), friction=Friction(mu_t=0.5, mu_f=1, mu_b=5)
bilateral harmonics: gait=Harmonic(2, "bilateral")
antipodal harmonics: gait=Harmonic(1, "antipodal"), friction=ROUGH, guess=ellipse(0, 1.3, 0.8)
shared nodes: gait=Harmonic(1), scheme="hermite-simpson"
splines of three joints: gait=BSpline(6), **WAVE
bilateral splines: gait=SPLINES, friction=ROUGH
cubic splines: gait=BSpline(7, 3)
columns of one's own: gait=Basis(FUNCTIONS, "antipodal"), guess=ellipse(0, 1.6, 1.1)
columns of all joints: gait=Basis(ELLIPSES), friction=ROUGH
polygon: gait=Polygon(4), friction=Friction(mu_t=3, mu_f=1, mu_b=2)
bilateral polygon: gait=Polygon(5, "bilateral")
polygon that ends its intervals with nodes: gait=Polygon(4), scheme="radau-3"
antipodal polygon of three joints: gait=BSpline(6, 1, "antipodal"), **WAVE
polygon with an axis through sides: gait=Polygon(4, "bilateral", "side"), **FOUR
serpenoid: gait=Serpenoid(2), **FIVE
bilateral serpenoid: gait=Serpenoid(2, "bilateral"), **FIVE
antipodal serpenoid: gait=Serpenoid(3, "antipodal"), **FIVE
serpenoid with slow joints: gait=Serpenoid(2), friction=ROUGH, **FOUR, speed_limit=(5, 6, 7)
speed: gait=Harmonic(2), objective="speed"
turning: gait=Harmonic(2), objective="turning", **FREE
expression: gait=Harmonic(1, "antipodal"), objective=THRIFT, at_least={"efficiency": 0.1}
driven: gait=Harmonic(1), objective="driven efficiency"
driven bilateral polygon: gait=Polygon(4, "bilateral"), objective=DRIVEN
driven polygon: gait=Polygon(4), objective="driven efficiency", at_least={"distance / work": 0.0}
turning polygon: gait=Polygon(4), objective=TURNED, **FREE
actuators: gait=Harmonic(2), torque_limit=0.05, power_limit=(0.4, 0.9)
actuated bilateral polygon: gait=Polygon(5, "bilateral"), torque_limit=0.06, at_least=ANY
actuated polygon: gait=Polygon(4), objective=TURNED, torque_limit=(0.05, 0.06), **FREE
fast bilateral polygon: gait=Polygon(6, "bilateral", "side"), objective="speed", at_least={THRIFT: 0.1}
free pace: **PACED
fastest pace: **PACED | {"objective": "distance / period"}
pace of the efficiency: **PACED | {"objective": "efficiency"}
free pace on less friction sideways: **PACED, friction=Friction(mu_t=0.1)
motors with inertia: gait=Harmonic(2), froude=0.2, torque_limit=0.05, power_limit=0.1
motors with inertia at a free pace: **PACED, torque_limit=0.05
motors with inertia uphill: gait=BSpline(8), froude=0.2, grade=0.1, torque_limit=0.05
"""
THRIFT = "sqrt(distance) / (work + 0.1 * length)"
TURNED = "(distance + rotation**2) / (work + length)"
DRIVEN, ANY = "distance / (driven_work + length)", {"efficiency": 0.0}
FREE = {"rotation": None, "at_least": {"distance": 0.2, TURNED: 0.01}}
PACE = {"froude": Free(0.01, 1.0), "objective": "distance / (work + 0.1 * period)"}
PACED = PACE | {"gait": Harmonic(1), "rotation": None}
ROUGH = Friction(mu_t=1.7, mu_f=1, mu_b=1.3)
WAVE, FOUR = (
    {"body": Chain((0.25,) * 4), "guess": Fourier(np.zeros(3), cos, sin)}
    for cos, sin in (
        ([[0.9], [0.0], [-0.9]], [[0.2], [0.9], [-0.2]]),
        ([[1.2], [0.2], [-1.2]], [[0.7], [1.0], [0.7]]),
    )
)
SPLINES = BSpline(8, symmetry="bilateral")
FIVE = {"body": Chain((0.2,) * 5), "friction": Friction(mu_t=10), "guess": None}
T = np.arange(96) / 48 * np.pi
ELLIPSES = [np.stack([np.cos(T), -np.cos(T)]), np.stack([np.sin(T)] * 2), np.ones((2, 96))]
FUNCTIONS = tuple(
    lambda t, k=k: np.exp(2 * np.cos(2 * np.pi * t - k * np.pi / 2)) for k in range(4)
)
CASES = cases(CASES, globals())


@pytest.mark.parametrize("case", CASES)
def test_gradients_are_those_of_differences(case):
    usual = {"guess": ellipse(0.1, 1.6, 1.1), "intervals": 10}
    problem, h = Problem("p", **(usual | CASES[case])), 1e-6
    space, v = space_near(problem, problem.guess)
    v = v + 1e-2 * np.random.default_rng(0).normal(size=v.size)
    program, steps = ReducedProgram(space, 0.05), h * np.eye(v.size)
    program.place_rows(v)
    gradient = program.gradient(v)  # first: balances asked for later begin at these
    slopes = [(program.objective(v + e) - program.objective(v - e)) / (2 * h) for e in steps]
    # with inertia Newton's method leaves 1e-12 of the periodic momenta: over this step 3e-8 of
    # slopes, 4e-7 where little friction holds the body back, and 6e-7 of rows
    with_inertia = 5e-7 if "less friction" in case else 5e-8
    most, of_rows = (with_inertia, 1e-6) if problem.froude else (1e-8, 1e-7)
    np.testing.assert_allclose(gradient, slopes, rtol=0, atol=most)
    rows = np.transpose([(program.rows(v + e) - program.rows(v - e)) / (2 * h) for e in steps])
    np.testing.assert_allclose(program.row_slopes(v), rows, rtol=0, atol=of_rows)


@pytest.mark.parametrize(
    "gait", [Harmonic(1), Harmonic(2, "bilateral"), Polygon(4, "bilateral"), SPLINES]
)
def test_the_answer_solves_the_full_program_and_is_the_gait_found(gait):
    """Tail velocities and link forces among the variables, the balance among the constraints; two
    programs, one solution."""
    at = {"intervals": 24, "delta": 3e-3, "mesh_tolerance": 0.0}
    problem = Problem("p", ellipse(1.0, 0.7, 1.1), friction=ROUGH, gait=gait, **at)
    answer = answer_near(problem)
    found = answer.history[-2]
    assert (found.program, answer.program) == ("reduced", "full")
    assert max(answer.kkt_error, answer.violation, answer.complementarity) < 1e-8
    assert answer.iterations <= 15
    assert answer.value == pytest.approx(found.value, rel=1e-7)
    assert answer.layout.friction.size == 9 * answer.mesh.n_point
    assert answer.message == ""
