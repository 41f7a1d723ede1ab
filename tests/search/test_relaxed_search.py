"""The search for relaxed gaits: what it finds, that no direction was forgotten, and that finite gaits come near it."""

import numpy as np
import pytest

import colloc
from colloc import Friction, Problem, ProblemError, Relaxed, replay, solve
from colloc.gaits.control_problem import control_problem
from colloc.gaits.relaxed import Mixture
from colloc.reduced.mixture_space import MixtureSpace
from colloc.results.relaxation import Optimality
from colloc.search import realise
from colloc.search.converge import as_it_is, converged
from colloc.search.effort import SKETCH
from colloc.search.realise import finite_certificate, kept_inside, realised_gaits, relaxed_certificate
from colloc.search.relaxed import prices, with_turned_directions
from scripts import few_corners
from scripts.few_corners import polygon_near


def problem(directions=3, delta=3e-4, pieces=14):
    return Problem(
        "small", friction=Friction(1, 1, 1), gait=Relaxed(directions, "both"), delta=delta, joint_limit=2.5, intervals=pieces
    )


@pytest.fixture(scope="module")
def solution():
    return colloc.solve(problem(), starts=1)


def test_the_isotropic_body_reaches_more_than_any_class_of_smooth_gaits(solution):
    # 0.405 is the best large gait of the classes of docs/gait_classes.md at any delta
    assert solution.status == "solved"
    assert solution.relaxed.certificate.passed, solution.message
    assert solution.relaxed.certificate.efficiency > 0.43
    assert solution.measured.distance > 0.5


def test_what_finite_gaits_lose_falls_with_the_number_of_repeats(solution):
    lost = [solution.relaxed.certificate.efficiency - r.certificate.efficiency for r in solution.relaxed.realised]
    assert all(r.certificate.passed for r in solution.relaxed.realised)
    assert lost[0] > 0
    assert lost[1] < 0.7 * lost[0]
    assert lost[2] < 0.7 * lost[1]


def test_repeats_are_doubled_where_finite_gaits_stay_far_from_what_they_tend_to(solution, monkeypatch):
    monkeypatch.setattr(realise, "_MOST_CORNERS", 600)
    near = realised_gaits(solution.problem, solution.relaxed.gait, (1,), 0.9 * solution.relaxed.certificate.efficiency)
    assert [r.repeats for r in near] == [1]
    far = realised_gaits(solution.problem, solution.relaxed.gait, (1,), 2 * solution.relaxed.certificate.efficiency)
    assert [r.repeats for r in far][:2] == [1, 2]
    assert 300 <= far[-1].corners < 600


def test_the_replay_of_a_relaxed_gait_is_the_limit_of_replays_of_finite_ones(solution):
    gait, stated = solution.relaxed.gait, solution.problem
    delta = 0.02 * gait.length
    relaxed = replay(stated.body, stated.friction, gait, delta, breaks=gait.corner_phases)
    apart = []
    for repeats in (4, 8, 16):
        finite = gait.realised(repeats)
        breaks = np.setdiff1d(np.concatenate([finite.phases, 1 - finite.phases]), [0.0, 1.0])
        replayed = replay(stated.body, stated.friction, lambda t, f=finite: (f.angles(t), f.rates(t)), delta, breaks=breaks)
        apart.append(abs(replayed.work / relaxed.work - 1))
    assert apart[2] < 1e-3
    assert apart[2] < 0.7 * apart[1] < 0.7 * 0.7 * apart[0]


def test_prices_name_a_direction_that_helps_where_one_is_missing(solution):
    assert prices_of(solution.relaxed.gait, 3).min() > -2e-3
    # the best polygon of as many pieces leaves something to be mixed in
    alone = problem(directions=1)
    space = MixtureSpace(control_problem(alone), 14)
    found = converged(space, space.parameters(alone.guess), 1e-2, SKETCH)
    better = as_it_is(MixtureSpace(control_problem(problem()), 14), _with_idle(found.gait, problem()), 1e-2)
    assert prices(better)[0].min() < -1e-2
    ready, v = with_turned_directions(better, 14)
    again = converged(ready, v, 1e-2, SKETCH)
    assert again.objective < found.objective - 1e-3


def prices_of(gait, directions):
    stated = problem(directions)
    space = MixtureSpace(control_problem(stated), len(gait.durations))
    return prices(as_it_is(space, space.parameters(gait), stated.delta))[0]


def _with_idle(gait, stated):
    from colloc.gaits.relaxed import Mixture

    idle = np.zeros((len(gait.durations), 2))
    more = np.broadcast_to([[1.0, 0.0], [0.0, 1.0]], (len(gait.durations), 2, 2))
    full = Mixture(
        np.concatenate([gait.durations, idle], axis=1),
        np.concatenate([gait.directions, more], axis=1),
        gait.start,
        gait.symmetry,
    )
    return MixtureSpace(control_problem(stated), len(gait.durations)).parameters(full)


def test_a_solution_survives_its_file(solution, tmp_path):
    again = colloc.load(colloc.save(solution, tmp_path / "small.h5"))
    assert again.measured == solution.measured == solution.relaxed.best.certificate
    assert again.relaxed.certificate == solution.relaxed.certificate
    assert (again.relaxed.gait.directions == solution.relaxed.gait.directions).all()
    assert [r.corners for r in again.relaxed.realised] == [r.corners for r in solution.relaxed.realised]
    assert (again.others[0].gait.durations == solution.others[0].gait.durations).all()
    assert (again.status, again.starts) == ("solved", 1)


def test_a_certificate_fails_where_the_claim_is_wrong(solution):
    wrong = Optimality(solution.relaxed.optimality.efficiency * 1.01, 0.0, 0.0, 0.0, 1)
    failures = relaxed_certificate(solution.problem, solution.relaxed.gait, wrong).failures
    assert [check.name for check in failures] == ["replay gap"]
    narrow = solution.problem.with_(joint_limit=2.0)
    assert "joint limits" in [c.name for c in finite_certificate(narrow, solution.gait).failures]


def test_the_motion_that_is_drawn_goes_as_far_as_the_replay_says(solution):
    motion = solution.sample(np.array([0.0, 1.0]))
    assert motion.centre[0, 1] - motion.centre[0, 0] == pytest.approx(solution.measured.distance, rel=2e-3)
    assert abs(motion.centre[1, 1]) < 1e-3


def test_sides_of_a_polygon_may_be_long():
    """A side that is all there is on its piece; of several directions each takes a short time, lest loops go on for ever."""
    stated = problem(1)
    square = Mixture([[1.7], [1.7]], [[[1.0, 0.0]], [[0.0, 1.0]]], [-0.85, 0.85], "both")
    space = MixtureSpace(control_problem(stated), 2)
    v = space.parameters(square)
    assert np.all((space.lower <= v) & (v <= space.upper))
    assert MixtureSpace(control_problem(problem(3)), 2).upper[2] < 1.7


def test_loops_that_reach_beyond_what_is_admissible_are_drawn_in(solution):
    """The mean shape of a relaxed gait may lie on a bound; of a finite gait the corners may not lie beyond."""
    gait = solution.relaxed.realised[0].gait
    assert kept_inside(solution.problem, gait) is gait
    narrow = solution.problem.with_(joint_limit=0.99 * np.abs(gait.corners).max())
    assert "joint limits" in [c.name for c in finite_certificate(narrow, gait).failures]
    drawn_in = kept_inside(narrow, gait)
    assert finite_certificate(narrow, drawn_in).passed
    assert 0.99 * narrow.joint_limit < np.abs(drawn_in.corners).max() <= narrow.joint_limit


def test_what_is_collocated_of_the_finite_gait_is_what_its_replay_says(solution):
    """So its figure, its report and its export show the gait that the certificate is about."""
    assert solution.success
    assert len(solution.plot().axes) == 5
    assert dict(solution.to_xarray().sizes) == {"t": 401, "joint": 2, "velocity": 3, "axis": 2}
    assert solution.gait.corners == pytest.approx(solution.relaxed.best.gait.corners, abs=1e-12)
    assert solution.answer.efficiency == pytest.approx(solution.measured.efficiency, rel=1e-3)
    assert solution.answer.distance == pytest.approx(solution.measured.distance, rel=1e-3)


def test_a_polygon_of_few_corners_is_nearly_as_good_as_one_of_many(solution, monkeypatch):
    monkeypatch.setattr(few_corners, "_TRIED", 1)
    heard: list[str] = []
    simple = polygon_near(solution.problem, solution.relaxed.gait, 52, heard.append)
    assert simple.relaxed.best.corners <= 52 < 0.5 * solution.relaxed.realised[0].corners
    assert simple.success
    # what is left without loops is far from it: joined to larger ones they were kept
    mean = finite_certificate(solution.problem, solution.relaxed.gait.mean.realised())
    assert simple.efficiency > solution.relaxed.certificate.efficiency - 0.3 * (
        solution.relaxed.certificate.efficiency - mean.efficiency
    )
    assert len(heard) > 1


@pytest.mark.parametrize(
    "asked", [{"objective": "speed"}, {"gait": Relaxed(3, "none"), "rotation": None}, {"at_least": {"distance": 0.1}}]
)
def test_whatever_is_asked_for_besides_the_efficiency_is_refused(asked):
    with pytest.raises(ProblemError, match="efficiency alone"):
        solve(problem().with_(**asked), starts=1)


def test_other_searches_say_that_relaxed_gaits_are_not_for_them():
    with pytest.raises(ProblemError, match="no full program"):
        solve(problem(), search="full")
