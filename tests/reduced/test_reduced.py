"""The reduced space: exact gradients, the full program's numbers, and answers that solve it."""

import numpy as np
import pytest

import colloc
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
antipodal polygon of three joints: gait=Polygon(6, "antipodal"), **WAVE
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
half a period with inertia: gait=Harmonic(1, "antipodal"), guess=ellipse(0, 1.6, 1.1), froude=0.1
inertia on feet: gait=Harmonic(1), body=Chain(UNEVEN, feet=1), friction=ROUGH, froude=0.1, rotation=None
turning with inertia: gait=Harmonic(1), objective="turning", rotation=None, froude=0.1
turning by an angle with inertia: gait=Harmonic(1), rotation=0.3, froude=0.1
driven with inertia: **HEAVY, gait=Harmonic(2), objective="driven efficiency"
driven with inertia at a free pace: **HEAVY | PACE | {"objective": DRIVEN_AND_IDLE}, gait=Harmonic(1)
heat with inertia: **HEAVY, gait=Harmonic(2), objective=WARM
inertia uphill: gait=Harmonic(1), body=Chain(UNEVEN), friction=ROUGH, grade=0.2, towards=0.4, froude=0.1
inertia uphill at a free pace: gait=Harmonic(1), friction=ROUGH, grade=0.2, towards=0.4, **PACE
turning by an angle: gait=Harmonic(1), rotation=0.3
polygon that turns by an angle: gait=Polygon(4), friction=ROUGH, rotation=0.3
uphill: gait=Harmonic(1, "bilateral"), grade=0.4, torque_limit=0.06
uphill, across: gait=Harmonic(1, "bilateral"), **ACROSS
feet uphill: body=FEET, friction=ROUGH, gait=Harmonic(2), **STEEP
feet uphill, across: body=FEET, friction=ROUGH, gait=Harmonic(2), **ACROSS
spline uphill: body=ODD, friction=ROUGH, gait=BSpline(8), **STEEP
spline uphill, across: body=ODD, friction=ROUGH, gait=BSpline(8), **ACROSS
snake uphill: body=ODD, friction=ROUGH, gait=Serpenoid(2), guess=None, **STEEP
polygon uphill: body=ODD, friction=ROUGH, gait=Polygon(5), **STEEP
polygon uphill, across: body=ODD, friction=ROUGH, gait=Polygon(5), **STEEP, towards=2.0
"""
UNEVEN, ODD = (0.3, 0.45, 0.25), Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3))
PARTS = (colloc.Foot(0), colloc.Pad(1, 0.1, 0.6), colloc.Wheel(2, rolling=0.5))
FEET = Chain(ODD.lengths, feet=PARTS, masses=(0.4, 0.3, 0.3))
HEAVY = {"body": Chain(UNEVEN, masses=(0.2, 0.2, 0.6), inertias=(0.002, 0.01, 0.004))}
HEAVY |= {"friction": Friction(mu_t=1.3, mu_f=0.7, mu_b=1.1), "froude": 0.3, "rotation": None}
DRIVEN_AND_IDLE = "distance / (driven_work + 0.05 * period)"
HEAT = colloc.Quantity("heat", "sum(moment**2)")
WARM = colloc.Objective("distance / (work + 5 * heat)", quantities=[HEAT])
STEEP = {"grade": 0.2, "objective": "driven efficiency", "torque_limit": 0.06}
ACROSS = {"grade": 0.2, "towards": 2.0, "objective": "distance / (work + 0.01 * length)"}
ACROSS |= {"torque_limit": 0.06, "power_limit": 0.3}
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
FUNCTIONS = [lambda t, k=k: np.exp(2 * np.cos(2 * np.pi * (t - k / 4))) for k in range(4)]
CASES = cases(CASES, globals())


@pytest.mark.parametrize("case", CASES)
def test_gradients_are_those_of_differences(case):
    usual = {"guess": ellipse(0.1, 1.6, 1.1), "intervals": 10}
    problem = Problem("p", **(usual | CASES[case]))
    h = 1e-5 if problem.grade else 1e-6
    space, v = space_near(problem, problem.guess)
    v = v + 1e-2 * np.random.default_rng(0).normal(size=v.size)
    program, steps = ReducedProgram(space, 0.05), h * np.eye(v.size)
    program.place_rows(v)
    gradient = program.gradient(v)  # first: balances asked for later begin at these
    slopes, row_slopes = program.motion.gradients(v, 0.05), program.row_slopes(v)

    def numbers(v):
        totals = program.motion.values(v, 0.05)
        sums = [totals[name] for name in slopes]
        return np.concatenate([[program.objective(v)], sums, program.rows(v)])

    known = np.transpose([(numbers(v + e) - numbers(v - e)) / (2 * h) for e in steps])
    n = len(slopes) + 1
    # with inertia Newton's method leaves 1e-12 of the periodic momenta: over this step 3e-8 of
    # slopes, 4e-7 where little friction holds the body back, and 6e-7 of rows; on a slope 5e-12 of
    # the balance: 8e-7 of rows
    with_states = 5e-7 if "less friction" in case else 5e-8
    most, of_rows = (with_states, 2e-6) if problem.froude or problem.grade else (1e-8, 1e-7)
    np.testing.assert_allclose([gradient, *slopes.values()], known[:n], rtol=0, atol=most)
    np.testing.assert_allclose(row_slopes, known[n:], rtol=0, atol=of_rows)


@pytest.mark.parametrize(
    "gait", [Harmonic(1), Harmonic(2, "bilateral"), Polygon(4, "bilateral"), SPLINES]
)
def test_the_answer_solves_the_full_program_and_is_the_gait_found(gait):
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
