"""The best gait of a class: many starts, told apart, and what is said of gaits that shrink."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import colloc
from benchmarks.zoo import best_serpenoid, robot_problem
from colloc import Chain, Foot, Friction, Harmonic, Polygon, Problem, Viscous, Wheel, load, save
from colloc.gaits.starts import on_speed_floor
from colloc.mechanics.contact import crossing_depth
from colloc.reduced.program import ReducedProgram
from colloc.results.checks import UNCERTIFIED
from colloc.results.comparison import distance
from colloc.search import explore
from colloc.search import solve as stages
from colloc.search.checkpoint import Run
from colloc.search.explore import multistart, small_loops
from colloc.search.iterate import space_near
from colloc.search.optimise import optimise, regularisation_dominated
from colloc.search.options import COARSE
from colloc.search.solve import solve
from tests.shared.cases import slow

UNEQUAL = Problem(
    "unequal", None, Chain((0.3, 0.2, 0.15, 0.35)), Friction(mu_t=2, mu_f=1, mu_b=1.4), Harmonic(2)
)
GAIT = colloc.ellipse(0.0, 2.0, 1.0)
FOUR = (22 / 104, 30 / 104, 30 / 104, 22 / 104)
WITHIN = {"joint_limit": np.radians(85)}
PROBLEMS = {
    "any": Problem("any", gait=Harmonic(2)),
    "bilateral": Problem("bilateral", gait=Harmonic(3, "bilateral"), joint_limit=2.5),
    "antipodal": Problem("x", None, Chain((0.3, 0.2, 0.2, 0.3)), gait=Harmonic(1, "antipodal")),
    "limits": Problem("x", None, Chain((0.3, 0.3, 0.4)), gait=Harmonic(1), joint_limit=(0.5, 2.0)),
    "polygon": Problem("polygon", friction=Friction(mu_t=0.4, mu_f=1, mu_b=2), gait=Polygon(8)),
}


@pytest.mark.slow
def test_the_answer_is_the_best_gait_of_finite_size_beside_a_better_one_that_shrank(tmp_path):
    solution = solve(UNEQUAL)
    assert solution.status == "solved"
    assert not on_speed_floor(solution.problem, solution.gait)
    assert solution.shrunk.status == "solved"
    assert on_speed_floor(solution.problem, solution.shrunk.gait)
    assert solution.shrunk.value > solution.value
    assert f"{solution.shrunk.value:.6f}" in solution.message
    again = load(save(solution, tmp_path / "unequal.h5"))
    assert again.message == solution.message
    assert again.standing == solution.standing
    # no distinct gait is told twice, and none of finite size is better than the one that is given
    dry = (other for other in again.others if other.delta == solution.problem.delta)
    finite = [other.value for other in dry if swing(other.gait) > 9]
    assert max(finite) == pytest.approx(solution.value, rel=1e-3)


def swing(gait):
    """Of the joint that swings farthest, to either side [degrees]."""
    return np.degrees(np.ptp(gait.angles(np.linspace(0.0, 1.0, 501)), axis=1).max()) / 2


@pytest.mark.parametrize(
    ("body", "symmetry"),
    [(Chain(FOUR), "none"), slow((Chain(FOUR, feet=1), "bilateral"))],
    ids=["all gaits met shrink", "one does not, and is not the best of its size"],
)
def test_where_gaits_shrink_the_search_goes_on_among_those_that_a_person_sees_move(body, symmetry):
    gait, coarsely = Harmonic(2, symmetry), {"delta": 1e-3, "intervals": 12}
    problem = Problem("robot", body=body, gait=gait, **coarsely, **WITHIN)
    optima = explore.explore(problem, 1).optima
    assert swing(optima[0].gait) < 9
    large = [optimum for optimum in optima if swing(optimum.gait) >= 9]
    assert large
    kept_large = large[0].problem.smallest_shape_speed
    assert large[0].gait.shape_speed == pytest.approx(kept_large, rel=1e-3)
    slowest = min((other.gait.shape_speed for other in large[1:]), default=0.5)
    assert kept_large == pytest.approx(slowest, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("feet", "least"), [(1, 1.666), (0, 1.192)], ids=["feet", "lying"])
def test_four_links_whose_twitch_is_best_get_a_gait_that_one_sees_as_good_as_known(feet, least):
    """On feet the class' best bilateral gait has 1.666; lying, the fastest for its path 1.192."""
    friction = Friction(0.3, 0.3, 0.3)
    body = Chain(FOUR, feet=feet)
    solution = solve(Problem("robot", None, body, friction, Harmonic(2), **WITHIN))
    assert solution.status == "solved"
    assert solution.value > least
    assert solution.distance > 0.02
    assert swing(solution.gait) > 9 > swing(solution.shrunk.gait)
    assert solution.shrunk.value > solution.value
    met = min(solution.others, key=lambda other: abs(other.value - solution.value))
    assert f"{met.starts} converged to it" in solution.standing[0]


GIVEN = {"starts": (4, 8, 16, 32), "intervals": (20, 150), "delta_start": (0.03, 1.0)}
GIVEN |= {"scheme": ["gauss-5"], "formulation": ["implicit velocity"], "mesh_tolerance": [1e-6]}


@pytest.mark.slow
@pytest.mark.parametrize(
    "given", [{name: value} for name, values in GIVEN.items() for value in values], ids=str
)
def test_the_answer_does_not_depend_on_what_the_search_is_given(given):
    """Before, options decided: 0.234, 0.493 and 0.647 were each called solved."""
    starts, changed = given.get("starts", 32), {k: v for k, v in given.items() if k != "starts"}
    solution = solve(UNEQUAL.with_(shrinking=True, **changed), starts)
    assert solution.status == "solved"
    assert solution.efficiency == pytest.approx(0.64685, rel=2e-4)


def test_a_gait_that_breaks_the_rows_of_its_class_in_the_end_is_no_answer(monkeypatch):
    """Links that pass through each other as delta falls went on to ten thousand intervals."""
    follow = explore.follow
    monkeypatch.setattr(explore, "follow", lambda *at: replace(follow(*at), violation=0.5))
    with pytest.raises(colloc.NotConvergedError, match="no gait could be followed"):
        explore.explore(Problem("broken", gait=Harmonic(1, "bilateral")), 2)


@pytest.mark.parametrize(
    ("asked", "meeting", "froude", "tried", "slow"),
    [
        (None, range(32), 0.0, 32, 0),  # all where a start takes a moment
        (None, range(3), 0.1, 96, 0),  # with inertia there are more gaits; three are too few
        (None, [0, *range(16, 32)], 0.1, 96, 0),  # hops do not count
        (None, [0, 4, 8, 34], 0.1, 35, 0),
        (None, range(4), 0.1, 24, 0),  # a quarter of the starts at least
        (None, [0, 1, 2, 70], 0.1, 96, 0),  # an eighth is too few
        (None, [], 0.1, 32, 5),  # a third of them where optima of slow motion are known
        (32, range(32), 0.0, 32, 0),  # as many as were asked for
    ],
)
def test_the_search_ends_once_starts_met_the_best_often(
    monkeypatch, asked, meeting, froude, tried, slow
):
    numbers = itertools.count()

    def sketch(problem, gait, is_new, deltas, known):
        if not known[-1]:
            # the other one is better where friction is not yet dry, and nobody meets it again
            for value, dry, path in ((-1.0, -1.0, GAIT), (-2.0, -0.5, GAIT.scaled(0.1))):
                found = SimpleNamespace(objective=value, gait=path, delta=1.0, v=None)
                found.problem, found.space = problem, SimpleNamespace(objective=lambda v, x=dry: x)
                known[-1].append(explore.Candidate(found))
        number = next(numbers)
        known[-1][0].n_new += is_new * (number in meeting)
        # the smallest hops end near the gait that is best where friction is dry
        assert is_new or number % 3 or gait.shape_speed > 0.5 * GAIT.shape_speed

    monkeypatch.setattr(explore, "sketch", sketch)
    monkeypatch.setattr(explore, "small_loops", lambda problem: [])
    monkeypatch.setattr(explore, "slow_optima", lambda problem: [GAIT] * slow)
    monkeypatch.setattr(explore, "ReducedProgram", lambda space, delta: space)
    problem = Problem("same", gait=Harmonic(1, "antipodal"), froude=froude)
    candidates, count = multistart(problem, asked)
    assert count == tried
    assert [each.iterate.objective for each in candidates] == [-1.0, -2.0]


def test_a_search_for_a_least_distance_begins_at_the_gaits_that_go_farthest(monkeypatch):
    begun = []
    monkeypatch.setattr(explore, "sketch", lambda coarse, *at: begun.append(at[:2]))
    monkeypatch.setattr(explore, "small_loops", lambda problem: [])
    monkeypatch.setattr(explore, "farthest", lambda far: [SimpleNamespace(value=0.2, gait=GAIT)])
    stated = Problem("far", gait=Harmonic(1, "bilateral"), delta=1e-2, least_distance=0.3)
    said = "known at first goes 0.2 body lengths per cycle, less than the 0.3 required, so half of that was required: 0.1."
    assert said in solve(stated, 2).message
    assert begun[0] == (GAIT, False)
    assert begun[1][1]


def test_with_a_little_inertia_one_start_leads_to_what_many_lead_to_in_slow_motion():
    gaits = Problem("same", body=Chain((0.4, 0.2, 0.25, 0.15)), gait=Harmonic(2, "none"))
    inertial, shown = gaits.with_(froude=1e-4), []
    with Run(problem=inertial, progress=shown.append).active(np.inf):
        slow, fast = (
            min(each.dry_objective for each in multistart(problem, starts)[0] if not each.is_loop)
            for problem, starts in ((gaits, 32), (inertial, 1))
        )
    assert fast < 0.99 * slow
    assert {each.best.problem.froude for each in shown if each.best} == {1e-4}


@pytest.mark.parametrize(("drier", "is_lost"), [(-0.4, True), (-0.6, False), (np.nan, True)])
def test_a_gait_that_loses_half_of_its_value_as_delta_falls_owed_it_to_delta(
    monkeypatch, drier, is_lost
):
    program = SimpleNamespace(motion=None, objective=lambda v: drier)
    monkeypatch.setattr("colloc.search.optimise.ReducedProgram", lambda space, delta: program)
    gait = SimpleNamespace(space=program, delta=0.1, objective=-1.0, v=None)
    assert regularisation_dominated(gait) == is_lost


def test_in_slow_motion_the_work_is_that_against_friction_and_motors_have_no_limits():
    asked = {"objective": "driven efficiency", "torque_limit": 0.1, "gait": Harmonic(1)}
    fast = Problem("fast", froude=0.1, **asked)
    slow = explore.in_slow_motion(fast)
    assert (slow.froude, slow.objective.name, slow.path_limits.names) == (0.0, "efficiency", ())
    assert explore.in_slow_motion(fast.with_(grade=0.1)) is None


@pytest.mark.parametrize(
    ("ends", "solved_for", "first"),
    [
        ([(1.0, True), (0.9, True)], 1, 0),
        ([(1.0, False), (0.9, True), (0.8, True)], 2, 0),  # the best that is certified
        ([(0.7, True), (0.9, True), (0.8, True)], 2, 0),  # the best once refined
        ([(0.7, True), (0.9, False), (0.8, True)], 3, 0),
        ([(1.0, False), (0.9, False), (0.8, False), (0.7, True)], 3, 0),
        ([(0.8, True), (0.7, True), (1.0, True), (0.9, True)], 1, 2),  # the best that a body does
    ],
)
def test_gaits_are_solved_for_until_one_holds_and_none_promises_more(
    monkeypatch, ends, solved_for, first
):
    """They promise 1, 0.9, 0.8, 0.7; before the first tried, the body does not move as promised."""
    asked = []

    def finish(problem, optimum):
        value, holds = ends[len(asked)]
        asked.append(optimum)
        answer = SimpleNamespace(value=value, problem=UNEQUAL, gait=GAIT, optimal=True)
        return SimpleNamespace(answer=answer, certificate=SimpleNamespace(passed=holds))

    monkeypatch.setattr(stages, "finish", finish)
    optima = [SimpleNamespace(value=1.0 - 0.1 * k, strays=k < first) for k in range(len(ends))]
    found = stages._finish_best(UNEQUAL.with_(shrinking=True), optima)
    assert (len(found), len(asked), asked[0]) == (solved_for, solved_for, optima[first])


def test_ends_off_the_motion_in_time_are_no_reason_to_follow_no_more_and_give_way_to_twins(
    monkeypatch,
):
    mesh, problem = SimpleNamespace(n=9, edges=np.linspace(0, 1, 10)), Problem("ends")
    space = SimpleNamespace(mesh=mesh)
    usual = {"violation": 0.0, "gait": GAIT, "delta": 1.0, "space": space, "value": 1.0}
    ends = [
        SimpleNamespace(basin=basin, strays=k < 4, objective=0.001 * k - 1.0, **usual)
        for k, basin in enumerate((0, 1, 2, 3, 3, 5, 6, 7))
    ]
    monkeypatch.setattr(explore, "follow", lambda problem, candidate: candidate)
    monkeypatch.setattr(explore, "same_gait", lambda problem, a, b: a.basin == b.basin)
    monkeypatch.setattr(explore, "space_near", lambda problem, gait: (space, None))
    monkeypatch.setattr(explore, "_best", lambda iterates: None)
    candidates = [explore.Candidate(end, 1, dry_objective=-1.0) for end in ends]
    explored = explore._follow_promising(problem, candidates, 8)
    assert [end.basin for end in explored.optima] == [0, 1, 2, 3, 5, 6, 7]
    assert [end.strays for end in explored.optima[:4]] == [True, True, True, False]


def test_where_no_certificate_holds_the_best_of_gaits_that_were_left_is_the_answer(monkeypatch):
    """The first three followed fail; what comes of others is another gait, at the final delta."""
    problem, asked = Problem("quick", gait=Harmonic(1, "bilateral"), delta=1e-2), []
    finish = stages.finish
    explored = explore.explore(problem, 6)

    def failing(problem, optimum):
        found = finish(problem, optimum)
        asked.append(optimum)
        if len(asked) <= len(explored.optima):
            found.certificate = UNCERTIFIED
        return found

    monkeypatch.setattr(stages, "finish", failing)
    solution = solve(problem, 6)
    assert len(asked) > len(explored.optima) > 0
    others = [other.value for other in asked[len(explored.optima) :]]
    assert solution.value == pytest.approx(max(others), rel=1e-2)
    assert not any(explore.same_gait(problem, *two) for two in itertools.combinations(asked, 2))
    monkeypatch.setattr(Run, "has_time", lambda run: False)
    assert explore.follow_rest(problem, explored) == []


@pytest.mark.slow
def test_a_gait_that_jumps_between_balanced_motions_gives_way_to_one_that_certifies():
    """A foot between wheels: most that promises well turns in jumps whose phase no mesh decides."""
    rolls = {"rolling": 0.056, "weight": 0.2872234}
    foot = Foot(1, 0.5, weight=1 - 2 * 0.2872234)
    feet = Wheel(0, 0.24857, **rolls), foot, Wheel(2, 0.75143, **rolls)
    floor, gait = Friction(mu_t=0.5488), Harmonic(1, "antipodal")
    solution = solve(Problem("rolls", None, Chain(feet=feet), floor, gait))
    assert solution.status == "solved"
    assert solution.value > 0.69


@pytest.mark.parametrize("problem", PROBLEMS.values(), ids=PROBLEMS)
def test_loops_are_admissible_members_of_the_class_hardly_longer_than_they_must_be(problem):
    loops, own = small_loops(problem), problem.gait.start_class
    assert 2 <= len(loops) <= 4
    for loop in loops:
        n_joint = problem.body.n_joint
        again = own.member(own.parameters(loop), n_joint)
        assert distance(again, loop, problem.body, problem.friction) < 1e-9
        angles = loop.angles(np.linspace(0, 1, 200))
        assert (np.abs(angles).max(axis=1) <= np.broadcast_to(problem.joint_limit, n_joint)).all()
        assert not crossing_depth(problem.body, angles).any()
        # pressed against its limits, a loop is a little smaller
        assert 0.9 < loop.shape_speed / problem.smallest_shape_speed < 2


def test_viscous_drag_has_none():
    """In first order what a small loop goes forth it goes back."""
    drag = {"friction": Viscous(normal=2.0, tangential=1.0), "objective": "towing"}
    assert small_loops(Problem("drag", gait=Harmonic(1), **drag)) == []


def test_a_small_gait_at_the_fold_is_found_where_it_is_the_best():
    """Two harmonics, joints up to pi: 0.37 at the fold, 0.35 for gaits of any size."""
    problem = Problem("fold", gait=Harmonic(2))
    known, _ = multistart(problem, 8)
    best = known[0].iterate.gait
    assert -known[0].dry_objective > 0.36
    assert best.shape_speed < 2 * problem.smallest_shape_speed
    assert np.sort(np.abs(best.mean)) == pytest.approx([0, np.pi], abs=0.2)


def test_rounds_that_go_to_and_fro_between_joint_limits_come_to_an_end():
    """Each end broke what had a row in the other alone: this robot got no answer."""
    tenths = "1 7 1 -5 -4 -1 11 4 7 -6 0 1 5 2 5 0 -4 12 -7 4 -1 -10 6 -5 -8"
    table = 0.1 * np.fromstring(tenths, sep=" ").reshape(5, 5)
    stated, begun = robot_problem(21), colloc.Fourier.from_table(table)
    end = optimise(*space_near(stated, begun), stated.delta, 1e-3)
    assert end.violation < 1e-3 < 0.1 < 1.5 * end.value


@pytest.mark.slow
def test_rounds_whose_worst_instants_move_a_little_each_time_go_on():
    """Each kept its own rows; after four of them these counted as a contradiction."""
    robot = robot_problem(5)
    assert solve(robot.with_(guess=best_serpenoid(robot).gait), 1).status == "solved"


def test_where_no_motion_repeats_on_a_mesh_every_interval_is_halved(monkeypatch):
    """A body that coasts may have none at points that see little of how it slips."""
    gait, value = colloc.ellipse(A0=0, A1=2.8, B1=1.3), ReducedProgram.objective
    problem = Problem("coarse", gait, gait=Harmonic(1, "bilateral"), intervals=8)
    finer = lambda at, v: value(at, v) if at.space.mesh.n > 8 else np.nan  # noqa: E731
    monkeypatch.setattr(ReducedProgram, "objective", finer)
    assert optimise(*space_near(problem, gait), 1e-2, COARSE).space.mesh.n == 16
