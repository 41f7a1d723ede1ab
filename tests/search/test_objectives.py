"""Other things than efficiency to be best at, and what must be reached; friction's size is a unit.
An objective is one expression for all who ask; nothing of a file is executed."""

import pickle
from dataclasses import replace
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import colloc
from colloc import Fourier, Friction, Harmonic, Objective, Problem, ellipse, replay
from colloc.commands.results import verify
from colloc.commands.solve import summary_dict, summary_lines
from colloc.dynamics.control_problem import control_problem
from colloc.gaits.gait_fields import statement_hash
from colloc.gaits.objective import DRIVEN, EFFICIENCY, NAMED, QUANTITIES, SPEED, TURNING
from colloc.reduced.program import ReducedProgram
from colloc.search.explore import with_reachable_distance
from colloc.search.iterate import space_near
from colloc.search.solve import solve
from tests.shared.mechanics import coulomb

SKEW = Fourier([0.5, 0.5], [[1.0], [0.2]], [[0.0], [1.0]])
SLIPPERY = {"gait": Harmonic(1, "bilateral"), "delta": 1e-2, "friction": Friction(0.3, 0.3, 0.3)}
PERIOD = dict(zip(QUANTITIES, (0.31, 1.3, 0.7, 8.0, 1.5, 3.0), strict=True))
EXPRESSIONS = [*NAMED, "distance / (work + 0.1 * length)", "2 * distance - 0.01 * work**2"]


@pytest.fixture(scope="module")
def fast():
    stated = {"gait": Harmonic(1, "bilateral"), "objective": "speed"}
    return solve(Problem("fast", ellipse(0.0, 2.8, 1.3), **stated), 1)


def test_the_fastest_gait_is_faster_and_less_efficient_and_the_replay_says_so(fast):
    usual = solve(fast.problem.with_(objective="efficiency"), 1)
    assert fast.success
    best, known = fast.certificate, usual.certificate
    at = fast.problem.body, fast.problem.friction, fast.gait, fast.delta_per_period
    measured = replay(*at, objective=SPEED)
    assert measured.value == measured.distance / measured.values["length"]
    assert measured.value == pytest.approx(best.value, abs=best.value_error)
    assert fast.value == pytest.approx(best.value, rel=1e-4)
    length = np.linalg.norm(np.diff(fast.gait.angles(np.linspace(0, 1, 200_001))), axis=0).sum()
    assert measured.values["length"] == pytest.approx(length, rel=1e-8)
    assert best.value > SPEED(known.values) + 100 * best.value_error
    assert best.efficiency < known.efficiency - 100 * known.efficiency_error


def test_a_result_says_what_it_is_best_at_and_comes_back_from_its_file(fast, tmp_path, capsys):
    again = colloc.load(colloc.save(fast, tmp_path / "fast.h5"))
    assert again.problem.objective == SPEED
    assert again.value == fast.value
    assert again.certificate == fast.certificate
    assert "d/L = 0.014" in repr(again)
    assert again.to_xarray(np.zeros(1)).attrs["value"] == fast.value
    assert verify([str(tmp_path / "fast.h5")]) == 0
    assert "speed d/L" in capsys.readouterr().out


def test_a_least_distance_is_reached_for_the_price_of_efficiency():
    usual = {"gait": Harmonic(1, "bilateral"), "friction": Friction(mu_t=3, mu_f=1, mu_b=1)}
    free = solve(Problem("free", ellipse(0.0, 1.2, 0.8), **usual), 1)
    least = 1.05 * free.distance
    far = solve(free.problem.with_(least_distance=least, guess=free.gait), 1)
    assert free.success
    assert far.success
    assert far.certificate.distance == pytest.approx(least, rel=1e-4)
    assert far.certificate.efficiency < free.certificate.efficiency
    assert "least distance" in {check.name for check in far.certificate.checks}
    assert far.problem.at_least == free.problem.with_(at_least={"distance": least}).at_least


@pytest.mark.slow
def test_a_turning_gait_turns_by_the_prescribed_angle():
    turns = {"objective": "turning", "rotation": 0.3, "delta": 1e-2}
    solution = solve(Problem("turn", SKEW, gait=Harmonic(1), **turns), 1)
    assert solution.success
    gait, problem = solution.gait, solution.problem
    at = problem.body, problem.friction, gait, solution.delta_per_period
    assert replay(*at, instants=3000).rotation == pytest.approx(0.3, abs=1e-5)
    # of free gaits, one turns by more and for less work per angle
    free = solve(problem.with_(rotation=None, guess=gait), 1)
    assert free.success
    assert free.certificate.rotation > 0.5
    assert free.value > solution.value


def test_an_objective_may_be_negative_and_of_any_sign():
    """Work costs more than the distance is worth: the best gait is the smallest."""
    asked = {"objective": Objective("distance - work", "net"), "delta": 1e-3}
    stated = Problem("idle", ellipse(0.0, 0.6, 0.4), gait=Harmonic(1, "bilateral"), **asked)
    solution = solve(stated, 1)
    assert solution.success
    assert solution.value < 0
    assert solution.gait.shape_speed == pytest.approx(0.1, rel=1e-3)
    assert "better still" in solution.message


def test_no_energy_comes_back_from_a_joint_that_is_driven_backwards():
    """Such joints' driven work is more than the work, so it pays to look for another gait."""
    problem = Problem("brake", SKEW, gait=Harmonic(1), objective="driven efficiency", delta=1e-3)
    before = replay(problem.body, problem.friction, SKEW, 1e-3, quantities=["driven_work"])
    assert before.values["driven_work"] > (1 + 1e-3) * before.work
    solution = solve(problem, 1)
    assert solution.success
    found = solution.certificate
    assert found.value == pytest.approx(found.distance / found.values["driven_work"], rel=1e-12)
    assert found.value <= found.efficiency
    usual = solve(problem.with_(objective="efficiency", guess=solution.gait), 1)
    at = problem.body, problem.friction, usual.gait, 1e-3
    assert solution.value >= replay(*at, objective=problem.objective).value * (1 - 1e-6)


def test_every_joint_has_a_limit_of_its_own():
    stated = {"friction": Friction(mu_t=3, mu_f=1, mu_b=1), "joint_limit": (1.0, 2.0)}
    problem = Problem("stiff", gait=Harmonic(1), delta=1e-2, **stated)
    solution = solve(problem, 1)
    assert solution.success
    first, second = np.abs(solution.gait.angles(np.linspace(0, 1, 20_001))).max(axis=1)
    assert first == pytest.approx(1.0, abs=1e-6)
    assert 1.0 < second < 2.0
    assert Problem.from_dict(problem.to_dict()).joint_limit == (1.0, 2.0)
    same = [{"gait": Harmonic(1, "bilateral"), "joint_limit": limit} for limit in (1.0, (1.0, 1.0))]
    values = [solve(problem.with_(guess=None, **changes), 1).value for changes in same]
    assert values[0] == values[1]


@pytest.mark.slow
def test_where_the_farthest_gait_goes_less_half_of_its_distance_is_asked_for():
    problem = Problem("stiff", body=colloc.Chain((0.2, 0.6, 0.2)), least_distance=0.1, **SLIPPERY)
    farthest = solve(problem.with_(objective="distance", least_distance=None), 4)
    solution = solve(problem, 4)
    assert farthest.success
    assert solution.success
    ((aim, least),) = solution.problem.at_least
    assert aim.name == "distance"
    # how far the farthest goes is known on a coarse mesh
    assert least == pytest.approx(0.5 * farthest.distance, rel=0.1)
    assert solution.distance >= least * (1 - 1e-6)
    assert f"The farthest gait known at first goes {2 * least:.3g} body lengths" in solution.message
    assert f"so half of that was required: {least:.3g}" in solution.message


def test_the_full_program_by_itself_keeps_it_too():
    coarsely = {"delta": 0.1, "delta_start": 0.1, "intervals": 12, "mesh_tolerance": 1e-2}
    problem = Problem("far", least_distance=0.1, **SLIPPERY | coarsely)
    solution = solve(problem, search="full")
    assert [least for _, least in solution.problem.at_least] == [0.1]
    assert solution.distance > 0.1 * (1 - 1e-3)


def test_the_first_line_of_a_gait_that_nobody_sees_says_so(three_link):
    problem = Problem("twitch", ellipse(0, 0.06, 0.05), smallest_shape_speed=0.02, **SLIPPERY)
    solution = colloc.evaluate(problem, problem.guess)
    assert solution.is_tiny
    assert summary_dict(solution, None, None, None)["tiny"]
    assert "tiny gait" in summary_lines(solution, None)[0]
    one_moves = colloc.Fourier([0.0, 0.0], [[1.0], [0.01]], [[0.0], [0.01]])
    assert not replace(three_link, answer=replace(three_link.answer, gait=one_moves)).is_tiny


def stated(*mu, **changes):
    coarsely = {"intervals": 24, "delta": 1e-2, "mesh_tolerance": 1e-4}
    usual = {"gait": Harmonic(1, "bilateral"), "friction": coulomb(*mu), **coarsely}
    return Problem("unit", ellipse(0.3, 1.0, 0.5), **usual | changes)


def test_every_limit_follows_friction_by_its_own_power():
    def limits(mu):
        heat = colloc.PathLimit("heat", "sum(moment**2)", 0.04 * mu**2)
        problem = stated(mu, mu, mu, torque_limit=0.2 * mu, power_limit=0.9 * mu, limits=[heat])
        return control_problem(problem).actuators

    for light, unit in zip(limits(1e-3).each, limits(1.0).each, strict=True):
        assert light.name == unit.name
        np.testing.assert_allclose(light.most, unit.most, rtol=1e-12)


@pytest.fixture(scope="module")
def unit():
    return solve(stated(1.0, 1.0, 1.0), 1)


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_coefficients_of_any_size_are_solved_and_certified(unit, size):
    """Work is proportional to the coefficients, efficiency inversely; the gait is the same."""
    seen = []
    solution = solve(stated(size, size, size), 1, progress=seen.append)
    assert solution.status == "solved"
    assert solution.efficiency * size == pytest.approx(unit.efficiency, rel=1e-9)
    known = unit.certificate.efficiency
    assert solution.certificate.efficiency * size == pytest.approx(known, rel=1e-6)
    assert solution.work / size == pytest.approx(unit.work, rel=1e-9)
    np.testing.assert_allclose(solution.gait.cos, unit.gait.cos, rtol=1e-6)
    assert seen[-1].best.value == pytest.approx(solution.value, rel=1e-4)
    assert all(step.work / size < 10 for step in solution.history)
    assert solution.answer.kkt_error < 1e-6


def test_what_must_be_reached_is_stated_in_units_of_friction_too():
    least = {"efficiency": 150.0, "distance": 0.2}
    light = Problem("light", friction=Friction(1e-3, 1e-3, 1e-3), at_least=least)
    scaled = control_problem(light)
    assert (scaled.unit, scaled.dynamics.law.mu_t) == (1e-3, 1.0)
    assert [value for _, value in scaled.aims.at_least] == pytest.approx([0.15, 0.2])
    # what is proportional to no power of friction is left as it is
    assert control_problem(light.with_(objective="distance / (work + length)")).unit == 1.0


@pytest.mark.parametrize("grade", [0.0, 0.1])
def test_a_pace_and_a_slope_count_by_their_ratio_to_friction(grade):
    """With a tenth of it, of the grade and of the Froude number a gait moves as before."""
    periods, asked = [], {"gait": Harmonic(1), "objective": "driven efficiency"}
    for size in (1.0, 0.1):
        problem = stated(size, size, size, froude=0.05 * size, grade=grade * size, **asked)
        space, v = space_near(problem, ellipse(0.3, 1.0, 0.5))
        periods.append(ReducedProgram(space, 1e-2).period(v))
    unit, light = periods
    assert abs(unit["distance"]) > 1e-4
    assert light["distance"] == pytest.approx(unit["distance"], rel=1e-9)
    for name in ("work", "driven_work"):
        assert light[name] == pytest.approx(0.1 * unit[name], rel=1e-9)


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_values_gradients_and_symbols_agree(text):
    objective = Objective(text)
    symbols = {name: ca.SX.sym(name) for name in QUANTITIES}
    expression = objective(symbols)
    inputs = ca.vertcat(*symbols.values())
    function = ca.Function("f", [inputs], [expression, ca.gradient(expression, inputs)])
    value, gradient = (np.array(a).ravel() for a in function([PERIOD[name] for name in symbols]))
    assert objective(PERIOD) == pytest.approx(value[0], rel=1e-14)
    partials = objective.partials(PERIOD)
    assert tuple(partials) == objective.uses
    np.testing.assert_allclose([partials.get(name, 0.0) for name in symbols], gradient, rtol=1e-13)


def test_gradients_of_every_operation_are_those_of_differences():
    text = "sqrt(distance) * abs(rotation - 1) / length**-1 + 3 - (2 - work) / +work**0 * work"
    text += " + tanh(distance) * log(work) - exp(-rotation) + where(distance < 1, work**2, work)"
    objective, h = Objective(text), 1e-6
    for name, slope in objective.partials(PERIOD).items():
        up, down = (objective(PERIOD | {name: PERIOD[name] + side * h}) for side in (1, -1))
        assert slope == pytest.approx((up - down) / (2 * h), rel=1e-8)


def test_an_expression_that_is_known_has_its_name():
    assert Objective("distance/work") == EFFICIENCY == Objective("efficiency")
    assert Objective("distance / length") == SPEED
    assert Objective("1 / (work / distance)").name == "1 / (work / distance)"


def test_the_power_of_friction_that_an_objective_is_proportional_to():
    assert (EFFICIENCY.degree, SPEED.degree, TURNING.degree, DRIVEN.degree) == (-1, 0, -1, -1)
    assert Objective("distance / work**0.5").degree == -0.5
    assert Objective("distance / (work + length)").degree is None


def test_what_is_usual_is_not_stated_so_a_problem_has_one_hash():
    problem = Problem("h1", gait=Harmonic(1, "bilateral"))
    same = problem.with_(objective="distance / work", rotation=0.0, at_least={})
    assert same.hash == problem.hash
    assert "objective" not in problem.to_dict()


def test_a_problem_with_an_objective_comes_back_from_its_statement():
    asked = {"objective": Objective("rotation / work", "turn"), "at_least": {"speed": 0.01}}
    problem = Problem("turning", gait=Harmonic(2), rotation=None, **asked)
    again = Problem.from_dict(problem.to_dict())
    assert again.objective == problem.objective
    assert again.rotation is None
    assert again.at_least == ((SPEED, 0.01),)
    assert pickle.loads(pickle.dumps(problem)).hash == problem.hash  # as it goes to other processes
    assert again.hash == problem.hash == statement_hash(problem.to_dict())
    assert again.hash != problem.with_(at_least={}).hash


@pytest.mark.parametrize("expression", ["work", "-work", "1 / work", "rotation / work"])
def test_the_error_of_a_value_is_relative_to_its_magnitude_whatever_its_sign(expression):
    period = {"distance": 0.4, "work": 2.0, "rotation": -0.3, "length": 7.0, "driven_work": 2.0}
    assert Objective(expression).relative_error(period, {"work": 0.1}) == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("asked", "least", "begun"),
    [(0.3, 0.1, ["far", "other"]), (0.15, 0.15, ["far", "other"]), (0.1, 0.1, [])],
)
def test_of_a_distance_that_no_gait_goes_half_of_the_farthest_is_asked(
    asked, least, begun, monkeypatch
):
    """None is looked for where the guess, which goes 0.268, goes twice as far."""
    farthest = [SimpleNamespace(value=0.2, gait="far"), SimpleNamespace(value=0.1, gait="other")]
    monkeypatch.setattr("colloc.search.explore.farthest", lambda problem: farthest)
    stated = Problem("far", guess=ellipse(0, 2.86, 1.3), least_distance=asked)
    problem, known = with_reachable_distance(stated)
    assert known == begun
    assert [(aim.name, level) for aim, level in problem.at_least] == [("distance", least)]
