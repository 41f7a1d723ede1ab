"""The best gait of a class: many starts, told apart, and what is said of gaits that shrink."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from colloc import Chain, Friction, Harmonic, Problem, ellipse
from colloc.gaits.starts import on_speed_floor
from colloc.results.store import load, save
from colloc.search import explore, solve
from colloc.search.explore import candidates
from colloc.search.solve import solve

UNEQUAL = Problem("unequal", body=Chain((0.3, 0.2, 0.15, 0.35)), friction=Friction(2, 1, 1.4), gait=Harmonic(2, "none"))


@pytest.mark.slow
def test_a_gait_that_shrinks_to_the_bound_has_the_best_one_of_finite_size_beside_it(tmp_path):
    solution = solve(UNEQUAL)
    assert on_speed_floor(solution.problem, solution.gait)
    assert solution.finite is not None
    assert solution.finite.status == "solved"
    assert not on_speed_floor(solution.problem, solution.finite.gait)
    assert f"{solution.finite.certificate.efficiency:.6f}" in solution.message
    again = load(save(solution, tmp_path / "unequal.h5"))
    assert again.message == solution.message
    assert again.standing == solution.standing
    assert "best of 32 starts" in again.standing[0]
    # no distinct gait is told twice, and none of finite size is better than the one that is given
    finite = [other.value for other in again.others if not other.on_speed_floor and other.delta == solution.problem.delta]
    assert max(finite) == pytest.approx(solution.finite.efficiency, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "starts"),
    [
        ({}, 4),
        ({}, 8),
        ({}, 16),
        ({}, 32),
        ({"intervals": 20}, 32),
        ({"intervals": 150}, 32),
        ({"scheme": "gauss-5"}, 32),
        ({"formulation": "implicit velocity"}, 32),
        ({"delta_start": 0.03}, 32),
        ({"delta_start": 1.0}, 32),
        ({"mesh_tolerance": 1e-6}, 32),
    ],
    ids=str,
)
def test_the_answer_does_not_depend_on_what_the_search_is_given(changed, starts):
    """Before, options decided: 0.234, 0.493 and 0.647 were each called solved."""
    solution = solve(UNEQUAL.with_(**changed), starts)
    assert solution.status == "solved"
    assert solution.efficiency == pytest.approx(0.64685, rel=2e-4)


@pytest.mark.parametrize(("violation", "kept"), [(1e-3, True), (0.5, False)])
def test_starts_that_are_no_members_yet_are_not_compared_with_others(monkeypatch, violation, kept):
    """What breaks the rows of its class may have any value."""
    settled = explore.settled_apart

    def off(*arguments):
        found = settled(*arguments)
        return replace(found, conditions=replace(found.conditions, violation=violation))

    monkeypatch.setattr(explore, "settled_apart", off)
    problem = Problem("one_start", gait=Harmonic(1, "bilateral"))
    known, tried = candidates(problem, 1, lambda: True, lambda step: None)
    assert tried == 1
    assert bool(known) == kept


@pytest.mark.parametrize(
    ("count", "better", "tried"),
    [
        (1, {0: 1}, 1),
        (8, {0: 1}, 8),
        (8, {0: 1, 6: 2}, 15),
        (8, {0: 1, 6: 2, 14: 3}, 23),
        (4, {0: 1, 3: 2, 9: 3}, 12),
    ],
    ids=["one", "none leads on", "one leads on", "two do", "three times what was asked for"],
)
def test_the_search_goes_on_while_one_of_the_last_eight_led_on(monkeypatch, count, better, tried):
    def follow(space, v, number, deltas, known):
        if number in better:
            found = SimpleNamespace(objective=-better[number], gait=ellipse(0, 1.0, 0.5), delta=1.0)
            known[-1].append(explore.Candidate(found))

    monkeypatch.setattr(explore, "_follow", follow)
    monkeypatch.setattr(explore, "objective_at", lambda delta, found: found.objective)
    found, number = candidates(Problem("hops", gait=Harmonic(1, "bilateral")), count, lambda: True, lambda step: None)
    assert number == tried
    assert found[0].found.objective == -max(better.values())


def test_more_starts_go_wherever_fewer_do(monkeypatch):
    """New starts and hops take turns, and what a hop begins from depends on what came before alone."""
    begun = {}

    def follow(space, v, number, deltas, known):
        begun[number] = (v, len(deltas))
        found = SimpleNamespace(objective=-1.0 if number == 0 else -2.0, gait=ellipse(0, 1.0, 0.1 * number), delta=1.0)
        known[-1].append(explore.Candidate(found))

    monkeypatch.setattr(explore, "_follow", follow)
    monkeypatch.setattr(explore, "objective_at", lambda delta, found: found.objective)
    problem = Problem("turns", gait=Harmonic(1, "bilateral"))
    candidates(problem, 18, lambda: True, lambda step: None)
    fewer, begun = begun, {}
    candidates(problem, 40, lambda: True, lambda step: None)
    del begun[-1], fewer[-1]  # small loops
    assert [deltas for _, deltas in begun.values()] == [2] * 16 + [1] * 16 + [2] * 8
    assert len(fewer) == 18
    for number, (v, deltas) in fewer.items():
        assert deltas == begun[number][1]
        np.testing.assert_array_equal(v, begun[number][0])


@pytest.mark.parametrize(
    ("ends", "answer", "solved_for"),
    [
        ([("solved", 1.0), ("solved", 0.9)], 0, 1),
        ([("certificate failed", 1.0), ("solved", 0.9), ("solved", 0.8)], 1, 2),
        ([("solved", 0.7), ("solved", 0.9), ("solved", 0.8)], 1, 2),
        ([("solved", 0.7), ("certificate failed", 0.9), ("solved", 0.8)], 2, 3),
        ([("certificate failed", 1.0), ("not converged", 0.9), ("certificate failed", 0.8), ("solved", 0.7)], 0, 3),
    ],
    ids=["the best", "the best certified", "the best once refined", "both", "none of the first three"],
)
def test_the_answer_is_the_best_gait_whose_certificate_holds(monkeypatch, ends, answer, solved_for):
    """Gaits promise 1, 0.9, 0.8, 0.7 before their meshes are refined."""
    asked = []

    def solution(problem, on_level, levels):
        asked.append(levels)
        status, value = ends[len(asked) - 1]
        return SimpleNamespace(status=status, value=value, message="", number=len(asked) - 1)

    monkeypatch.setattr(solve, "solve", solution)
    contenders = [[SimpleNamespace(value=1.0 - 0.1 * k)] for k in range(len(ends))]
    found = solve._best_certified(UNEQUAL, contenders, None, lambda: True)
    assert (found.number, len(asked)) == (answer, solved_for)
    assert bool(found.message) == (answer > 0 and ends[0][0] != "solved")


@pytest.mark.parametrize(
    ("speed", "failed", "small"),
    [
        (0.1, ["delta influence"], True),
        (0.15, ["delta influence"], True),
        (0.25, ["delta influence"], False),
        (0.1, ["mesh error"], False),
    ],
)
def test_delta_is_lowered_for_gaits_near_the_bound_where_nothing_else_fails(speed, failed, small):
    checks = [SimpleNamespace(name=name) for name in failed]
    solution = SimpleNamespace(
        problem=UNEQUAL, gait=SimpleNamespace(shape_speed=speed), certificate=SimpleNamespace(failures=checks)
    )
    assert solve._is_small_and_viscous(solution) == small


def test_where_a_gait_of_finite_size_shrinks_after_all_the_next_one_stands_beside_the_best(monkeypatch):
    def solved(gait, value):
        certificate = SimpleNamespace(value=value, value_error=1e-7)
        return SimpleNamespace(problem=None, gait=gait, status="solved", value=value, certificate=certificate)

    ends = {"first": solved("small", 0.5), "second": solved("large", 0.4)}
    monkeypatch.setattr(solve, "solve", lambda problem, on_level, levels: ends[levels])
    monkeypatch.setattr(solve, "on_speed_floor", lambda problem, gait: gait == "small")
    solution = SimpleNamespace(problem=None, message="", starts=32, others=(), finite=None)
    solve._add_finite(solution, ["first", "second"])
    assert solution.finite is ends["second"]
    assert "0.400000" in solution.message
