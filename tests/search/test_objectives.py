"""Other things than efficiency to be best at: exact derivatives, optima that the replay confirms,
and what must be reached."""

import numpy as np
import pytest

from colloc import (
    Fourier,
    Friction,
    Harmonic,
    Objective,
    Problem,
    ellipse,
    load,
    replay,
    save,
)
from colloc.commands.results import verify
from colloc.gaits.objective import SPEED
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import space_near
from colloc.search.solve import solve
from tests.shared.cases import cases

THRIFT = "sqrt(distance) / (work + 0.1 * length)"
TURNED = "(distance + rotation**2) / (work + length)"
DRIVEN, ANY = "distance / (driven_work + length)", {"efficiency": 0.0}
FREE = {"rotation": None, "at_least": {"distance": 0.2, TURNED: 0.01}}
CASES = """
speed: gait=Harmonic(2), objective="speed"
turning: gait=Harmonic(2), objective="turning", **FREE
expression: gait=Harmonic(1, "antipodal"), objective=THRIFT, at_least={"efficiency": 0.1}
driven: gait=Harmonic(1), objective="driven efficiency"
driven bilateral polygon: gait=Polygon(4, "bilateral"), objective=DRIVEN
driven polygon: gait=Polygon(4), objective="driven efficiency", at_least={"distance / work": 0.0}
polygon: gait=Polygon(4), objective=TURNED, **FREE
actuators: gait=Harmonic(2), torque_limit=0.05, power_limit=(0.4, 0.9)
actuated bilateral polygon: gait=Polygon(5, "bilateral"), torque_limit=0.06, at_least=ANY
actuated polygon: gait=Polygon(4), objective=TURNED, torque_limit=(0.05, 0.06), **FREE
bilateral polygon: gait=Polygon(6, "bilateral", "side"), objective="speed", at_least={THRIFT: 0.1}
"""
CASES = cases(CASES, globals())
SKEW = Fourier([0.5, 0.5], [[1.0], [0.2]], [[0.0], [1.0]])
DELTA = 0.1


def stated(case):
    usual = {
        "guess": ellipse(0.1, 1.6, 1.1),
        "intervals": 10,
        "friction": Friction(mu_t=1.7, mu_f=1, mu_b=1.3),
    }
    return Problem("p", **(usual | CASES[case]))


@pytest.mark.parametrize("case", CASES)
def test_gradients_of_the_reduced_program_are_those_of_differences(case):
    problem, h = stated(case), 1e-6
    space, v = space_near(problem, problem.guess)
    v = v + 1e-2 * np.random.default_rng(0).normal(size=v.size)
    program = ReducedProgram(space, DELTA)
    program.place_rows(v)
    steps = h * np.eye(space.n)
    slopes = [(program.objective(v + e) - program.objective(v - e)) / (2 * h) for e in steps]
    # balances are solved to 1e-12, so that differences over 2 h know the slope of a value of order
    # 1 to 1e-6
    np.testing.assert_allclose(program.gradient(v), slopes, atol=1e-6)
    rows = np.transpose([(program.rows(v + e) - program.rows(v - e)) / (2 * h) for e in steps])
    np.testing.assert_allclose(program.row_slopes(v), rows, atol=2e-6)


@pytest.fixture(scope="module")
def usual():
    return solve(Problem("usual", ellipse(0.0, 2.8, 1.3), gait=Harmonic(1, "bilateral")), 1)


@pytest.fixture(scope="module")
def fast():
    return solve(
        Problem("fast", ellipse(0.0, 2.8, 1.3), gait=Harmonic(1, "bilateral"), objective="speed"), 1
    )


def test_the_fastest_gait_is_faster_and_less_efficient_and_the_replay_says_so(usual, fast):
    assert fast.success
    best, known = fast.certificate, usual.certificate
    measured = replay(
        fast.problem.body, fast.problem.friction, fast.gait, fast.delta_per_period, objective=SPEED
    )
    assert (
        measured.value
        == measured.distance / measured.length
        == pytest.approx(best.value, abs=best.value_error)
    )
    assert fast.value == pytest.approx(best.value, rel=1e-4)
    t = np.linspace(0, 1, 200_001)
    length = np.linalg.norm(np.diff(fast.gait.angles(t)), axis=0).sum()
    assert measured.length == pytest.approx(length, rel=1e-8)
    assert best.value > SPEED(known.values) + 100 * best.value_error
    assert best.efficiency < known.efficiency - 100 * known.efficiency_error


def test_a_result_says_what_it_is_best_at_and_comes_back_from_its_file(fast, tmp_path, capsys):
    again = load(save(fast, tmp_path / "fast.h5"))
    assert again.problem.objective == SPEED
    assert again.value == fast.value
    assert again.certificate == fast.certificate
    assert "d/L = 0.014" in repr(again)
    assert verify([str(tmp_path / "fast.h5")]) == 0
    assert "speed d/L" in capsys.readouterr().out


def test_a_least_distance_is_reached_for_the_price_of_efficiency():
    friction = Friction(mu_t=3, mu_f=1, mu_b=1)
    free = solve(
        Problem("free", ellipse(0.0, 1.2, 0.8), gait=Harmonic(1, "bilateral"), friction=friction), 1
    )
    least = 1.05 * free.distance
    far = solve(free.problem.with_(at_least={"distance": least}, guess=free.gait), 1)
    assert free.success
    assert far.success
    assert far.certificate.distance == pytest.approx(least, rel=1e-4)
    assert far.certificate.efficiency < free.certificate.efficiency
    assert "least distance" in {check.name for check in far.certificate.checks}


def test_a_turning_gait_turns_by_the_prescribed_angle():
    solution = solve(Problem("turn", SKEW, gait=Harmonic(1), objective="turning", rotation=0.3), 1)
    assert solution.success
    gait, problem = solution.gait, solution.problem
    measured = replay(
        problem.body, problem.friction, gait, solution.delta_per_period, instants=3000
    )
    assert measured.rotation == pytest.approx(0.3, abs=1e-5)
    # of free gaits, one turns by more and for less work per angle
    free = solve(problem.with_(rotation=None, guess=gait), 1)
    assert free.success
    assert free.certificate.rotation > 0.5
    assert free.value > solution.value


def test_an_objective_may_be_negative_and_of_any_sign():
    """Work costs more than the distance is worth: the best gait is the smallest."""
    solution = solve(
        Problem(
            "idle",
            ellipse(0.0, 0.6, 0.4),
            gait=Harmonic(1, "bilateral"),
            objective=Objective("distance - work", "net"),
            delta=1e-3,
        ),
        1,
    )
    assert solution.success
    assert solution.value < 0
    assert solution.gait.shape_speed == pytest.approx(0.1, rel=1e-3)
    assert "better still" in solution.message


def test_no_energy_comes_back_from_a_joint_that_is_driven_backwards():
    """A gait with such joints: its driven work is more than its work, and so it pays to look for
    another."""
    problem = Problem("brake", SKEW, gait=Harmonic(1), objective="driven efficiency", delta=1e-3)
    before = replay(problem.body, problem.friction, SKEW, 1e-3, quantities=["driven_work"])
    assert before.values["driven_work"] > (1 + 1e-3) * before.work
    solution = solve(problem, 1)
    assert solution.success
    found = solution.certificate
    assert found.value == pytest.approx(found.distance / found.values["driven_work"], rel=1e-12)
    assert found.value <= found.efficiency
    usual = solve(problem.with_(objective="efficiency", guess=solution.gait), 1)
    assert solution.value >= replay(
        problem.body, problem.friction, usual.gait, 1e-3, objective=problem.objective
    ).value * (1 - 1e-6)


def test_every_joint_has_a_limit_of_its_own():
    problem = Problem(
        "stiff",
        gait=Harmonic(1),
        joint_limit=(1.0, 2.0),
        friction=Friction(mu_t=3, mu_f=1, mu_b=1),
        delta=1e-3,
    )
    solution = solve(problem, 1)
    assert solution.success
    first, second = np.abs(solution.gait.angles(np.linspace(0, 1, 20_001))).max(axis=1)
    assert first == pytest.approx(1.0, abs=1e-6)
    assert 1.0 < second < 2.0
    assert Problem.from_dict(problem.to_dict()).joint_limit == (1.0, 2.0)
    same = [{"gait": Harmonic(1, "bilateral"), "joint_limit": limit} for limit in (1.0, (1.0, 1.0))]
    values = [solve(problem.with_(guess=None, **changes), 1).value for changes in same]
    assert values[0] == values[1]
