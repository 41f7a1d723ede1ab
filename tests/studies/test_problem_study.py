"""Studies: where starts travel, no effect of workers, what is kept, one file that xarray opens."""

import dataclasses
import json
import random
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partialmethod

import numpy as np
import pytest
from shared.store_samples import load_study, outcome

import colloc
from colloc import Axis, Chain, Fourier, Friction, Harmonic, ModalBody, Problem, Study, ellipse
from colloc.commands.families import sweep as sweep_study
from colloc.commands.families import sweep_summary
from colloc.gaits.gait_fields import fields
from colloc.gaits.harmonic import shift_phase
from colloc.gaits.linear import Combination
from colloc.results.archive import CRASHED, PASSED_OVER
from colloc.results.comparison import reversed_in_time, swap_ends
from colloc.results.solution import NOT_CONVERGED, SOLVED
from colloc.studies import sweep as study_run
from colloc.studies.study import read_study_file
from colloc.studies.sweep import (
    StudyRun,
    read_journal,
    run_chunk,
    save_study,
    start_key,
    study_table,
)
from colloc.system.task_pool import LostTask
from colloc.verification.replay import replay

FILE = """
from colloc import *
from colloc.studies.study import Axis, Study

def problem(mu_t, mu_b):
    return Problem("tiny", ellipse(0.0, 2.85, 1.3), friction=Friction(mu_t=mu_t, mu_b=mu_b), gait=Harmonic(1, "bilateral"),
                   delta=1e-2, delta_start=1e-2, intervals=12, mesh_tolerance=1e-4)

STUDY = Study("tiny", (Axis("mu_t", (1.0, 1.1)), Axis("mu_b", (1.0,))), problem, cold_starts=0)
"""
START = ellipse(0.0, 1.2, 0.4)
CLASSES = {
    "ellipse": Harmonic(1, "bilateral"),
    "triangle": colloc.Polygon(3, "bilateral"),
    "spline": colloc.BSpline(8, symmetry="bilateral"),
}
STUDY = """
from colloc import Axis, Friction, Harmonic, ModalBody, Problem, Study

def problem(mu_t):
    body, gait = ModalBody(2, panels=4), Harmonic(1, "antipodal")
    return Problem("modes", body=body, friction=Friction(mu_t=mu_t, mu_f=1, mu_b=1), gait=gait, delta=0.02, intervals=8)

STUDY = Study("modes", (Axis("mu_t", (100.0, 50.0)),), problem, cold_starts=0, warm_starts=1)
"""


PRESCRIBED = """
from colloc import Axis, Friction, Problem, Study, Wave

def problem(mu_t):
    return Problem("waves", body=Wave("sine"), friction=Friction(mu_t=mu_t, mu_f=1, mu_b=1), delta=1e-2, mesh_tolerance=1e-3)

PROBLEM = problem(100.0)
STUDY = Study("waves", (Axis("mu_t", (100.0, 50.0)),), problem)
"""


def problem(x=1.0, y=1.0, kind="a"):
    law, guess = Friction(mu_t=x, mu_f=1, mu_b=y), ellipse(0.0, 1.0 + 0.01 * len(kind), 0.5)
    return Problem("p", guess, friction=law, gait=Harmonic(1, "bilateral"), intervals=10)


def grid(**changes):
    axes = (Axis("x", (1.0, 2.0, 3.0, 4.0)), Axis("y", (1.0, 2.0, 3.0)))
    return Study(**{"name": "grid", "axes": axes, "problem": problem, **changes})


def landscape(stated, start_from, start, time_limit, **_):
    """In place of a solve: two basins, by the amplitude of joint 1; 0.9 of the way is kept."""
    guess = start_from()
    good, law = guess.cos[0, 0] > 1.5, stated.friction
    if law.mu_t == 3.0 and law.mu_b == 2.0:
        return outcome(start, np.nan, guess, status=NOT_CONVERGED)
    way = 0.9 * ((2.0 if good else 1.0) - guess.cos[0, 0]) * np.array([[1], [-1]])
    gait = Fourier(guess.mean, guess.cos + way, guess.sin)
    return outcome(start, (0.3 if good else 0.2) + 0.01 * law.mu_t, gait, guess)


@pytest.fixture
def fake(monkeypatch):
    def known(p, g, *_):
        return (0.29 if g.cos[0, 0] > 1.5 else 0.19) + 0.01 * p.friction.mu_t

    monkeypatch.setattr(study_run, "run_guess", landscape)
    monkeypatch.setattr(study_run, "value_of", known)
    monkeypatch.setattr(study_run, "start_gait", lambda p, sampler, seed, k: START)


def finished(run, **options):
    return list(run.run(**{"executor": ThreadPoolExecutor, **options}))


def missing(run):
    return [cell for cell in run.study.cells() if run.state(cell).missing]


def study_file(folder, text=FILE):
    path = folder / "tiny.py"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_sweep_runs_on_the_executor_that_is_passed_and_goes_on_from_its_folder(fake, tmp_path):
    asked, seen = [], []

    def cluster(workers):
        asked.append(workers)
        return ThreadPoolExecutor(workers)

    how = {"workers": 2, "executor": cluster, "progress": seen.append}
    first = colloc.sweep(grid(), tmp_path, **how)
    visits = len(seen)
    assert visits >= 12
    assert "3 of 12, 18 s left" in str(dataclasses.replace(seen[2], seconds=6.0))
    assert set(asked) == {2}
    again = colloc.sweep(grid(), tmp_path, **how)
    assert len(seen) == visits
    assert np.array_equal(again.variables["value"], first.variables["value"], equal_nan=True)
    assert np.array_equal(first.variables["value"], colloc.sweep(grid()).variables["value"], True)


def test_a_grid_of_a_million_cells_makes_its_problems_as_it_reaches_them(fake, tmp_path):
    made = []

    def counted(x, y):
        made.append((x, y))
        return problem(x, y)

    axes = tuple(Axis(name, tuple(1.0 + k / 1000 for k in range(1000))) for name in "xy")
    run = StudyRun(grid(axes=axes, problem=counted, cold_starts=0), tmp_path)
    cells = run.run(executor=ThreadPoolExecutor)
    assert [next(cells).cell for _ in range(3)] == [(0, 0), (1, 0), (0, 1)]
    cells.close()
    assert len(made) < 30


def test_starts_travel_from_the_value_before_and_between_all_texts():
    kinds = Axis("kind", ("a", "b", "c"))
    study = grid(axes=(Axis("x", (1.0, 2.0, 3.0)), kinds, Axis("y", (1.0, 2.0), travels=False)))
    assert study.around((0, 0, 0), before=True) == []
    assert set(study.around((2, 2, 1), before=True)) == {(1, 2, 1), (2, 0, 1), (2, 1, 1)}
    assert set(study.around((1, 0, 0))) == {(0, 0, 0), (2, 0, 0), (1, 1, 0), (1, 2, 0)}
    assert len(list(study.cells())) == 18
    assert study.problem_at((1, 1, 0)).friction.mu_t == 2.0


def test_a_study_file_is_code_and_its_mistakes_are_named_with_their_line(tmp_path):
    wrong = {"x = 1": "no STUDY", "\n1/0": "line 2: ZeroDivisionError", "STUDY = 3": "be a Study"}
    for text, message in wrong.items():
        with pytest.raises(colloc.ProblemError, match=message):
            read_study_file(study_file(tmp_path, text))
    study, source = read_study_file(study_file(tmp_path))
    assert (study.shape, source) == ((2, 1), FILE)
    laws = {"Frction(mu_t=mu_t": "NameError: ", "Friction(mu_t=-mu_t": "friction.mu_t"}
    for law, what in laws.items():
        path = study_file(tmp_path, FILE.replace("Friction(mu_t=mu_t", law))
        said = rf"no problem at mu_t = 1.0, mu_b = 1.0: .*tiny\.py, line 6: {what}"
        with pytest.raises(colloc.ProblemError, match=said):
            read_study_file(path)[0].problem_at((0, 0))


def test_what_is_found_does_not_depend_on_workers_or_on_who_is_faster(fake, tmp_path, monkeypatch):
    def slow(*arguments):
        time.sleep(random.Random(arguments[2]).random() * 0.01)
        return landscape(*arguments)

    monkeypatch.setattr(study_run, "run_guess", slow)
    found = []
    for k, (workers, chunk) in enumerate([(1, 1), (4, 1), (4, 1), (1, 3)]):
        run = StudyRun(grid(chunk=chunk), tmp_path / str(k))
        finished(run, workers=workers)
        best = {cell: state.best for cell, state in run.cells.items()}
        found.append({c: b and (b.outcome.efficiency, b.gait_key) for c, b in best.items()})
    assert found[1:] == found[:1] * 3


def test_a_good_basin_found_anywhere_spreads_everywhere(fake, tmp_path, monkeypatch):
    """Cells have starts of their own, and their guess; one start of the last finds the basin."""
    numbers, rounds = [], {}

    def start(p, sampler, seed, k):
        numbers.append((seed, k))
        return ellipse(0.0, 1.9 if k == 23 else 1.2, 0.4)

    monkeypatch.setattr(study_run, "start_gait", start)
    run = StudyRun(grid(cold_starts=2, seed=5), tmp_path)
    for progress in run.run(executor=ThreadPoolExecutor):
        best = [state.best for state in run.cells.values() if state.best is not None]
        rounds[progress.round] = sum(each.outcome.efficiency > 0.3 for each in best)
    assert rounds[0] == 1
    assert sorted(set(numbers)) == [(5, k) for k in range(2 * 12)]
    for state in run.cells.values():
        guesses = {a.key for a in state.attempts if a.origin == study_run.GUESS}
        assert start_key(state.problem.guess) in guesses
    table = study_table(run).variables
    # the cell that never converges is walked around
    assert np.isnan(table["efficiency"][2, 1])
    assert np.sum(table["efficiency"] > 0.3) == 11
    for cell, state in run.cells.items():
        assert table["seconds"][cell] == sum(a.outcome.seconds for a in state.attempts)
    tried, certified = table["starts"], table["starts_certified"]
    assert certified[2, 1] == 0 < tried[2, 1]
    assert (np.delete(certified.ravel(), 7) == np.delete(tried.ravel(), 7)).all()
    assert not table["below_neighbour"].any()
    assert missing(StudyRun(run.study, tmp_path, retry=True)) == []  # that cell had no error


def test_a_cell_below_what_a_neighbours_gait_achieves_is_marked(fake, tmp_path, monkeypatch):
    def stubborn(stated, start_from, start, time_limit, **_):
        # in the cell (1, 1) every search ends in the poor basin; elsewhere the guess is good
        guess, law = start_from(), stated.friction
        if (law.mu_t, law.mu_b) == (2.0, 2.0):
            return outcome(start, 0.22, guess)
        return outcome(start, 0.3 + 0.01 * law.mu_t, ellipse(0.0, 2.0, 0.25 * law.mu_t), guess)

    def known(p, g, *_):  # of two gaits of neighbours one is the better here
        return 0.31 - 0.2 * abs(g.sin[0, 0] - 0.5)

    monkeypatch.setattr(study_run, "value_of", known)
    monkeypatch.setattr(study_run, "run_guess", stubborn)
    run = StudyRun(grid(cold_starts=0), tmp_path)
    finished(run)
    assert {a.origin for a in run.cells[1, 1].attempts} == {
        study_run.GUESS,
        study_run.WARM,
        study_run.RESCUE,
    }
    whole = study_table(run)
    table = whole.variables
    assert np.argwhere(table["below_neighbour"]).tolist() == [[1, 1]]
    assert table["neighbour_value"][1, 1] == pytest.approx(0.31)
    lines = sweep_summary(run.study, whole, tmp_path)[1]
    assert "1 of them below what a neighbour's gait achieves there" in lines[1]
    assert "x 2, y 2: 0.220000, where a neighbour's gait achieves 0.310000" in lines[2]
    # what was seen is in the journal
    again = StudyRun(grid(cold_starts=0), tmp_path)
    assert again.state((1, 1)).attempts
    # best is who has the largest value, whatever its efficiency
    other = dataclasses.replace(again.state((0, 0)).best.outcome, efficiency=9.0, value=0.1)
    again.state((0, 0)).attempts.append(study_run.Attempt("", "", other))
    assert again.state((0, 0)).best.outcome.efficiency < 9
    assert study_table(again).variables["below_neighbour"][1, 1]


def test_what_a_net_rotation_could_add_to_the_distance_does_not_count():
    gait = Fourier([0.2, -0.4], [[0.8], [-0.5]], [[0.1], [0.6]])  # no symmetry: it turns
    stated = problem().with_(gait=Harmonic(1, "none"), delta=1e-2, intervals=40)
    at = stated.body, stated.friction
    exact = replay(*at, gait, stated.delta)
    assert abs(exact.rotation) > 0.01
    sure = max((exact.distance - 0.5 * abs(exact.rotation)) / exact.work, 0.0)
    assert study_run.value_of(stated, gait) == pytest.approx(sure, abs=1e-3 * exact.efficiency)
    # where it could add all of it nothing counts, nor does the square of less than nothing
    turning = Fourier([0.6, 0.6], [[0.5], [-0.3]], [[0.1], [0.5]])
    turned = replay(*at, turning, stated.delta, instants=200, tolerance=1e-3)
    assert 0.5 * abs(turned.rotation) > turned.distance > 0.01
    assert study_run.value_of(stated.with_(objective="towing"), turning) == 0.0
    assert abs(replay(*at, study_run.member(stated, gait), stated.delta).rotation) < 1e-4


def test_a_start_that_turns_as_it_should_is_worth_the_same_whatever_phase_it_begins_at():
    turning = Fourier([1.2, 0.6], [[0.9], [0.1]], [[0.1], [0.9]])
    turned = replay(Chain(), Friction(), turning, 1e-2).rotation
    stated = Problem("turning", gait=Harmonic(1), delta=1e-2, rotation=turned)
    values = [study_run.value_of(stated, shift_phase(turning, phase)) for phase in (0.0, 0.3, 0.6)]
    np.testing.assert_allclose(values, values[0], rtol=2e-3)


def test_a_run_that_is_left_goes_on_where_it_stopped_and_solves_nothing_twice(fake, tmp_path):
    seen = []
    for progress in StudyRun(grid(), tmp_path).run(executor=ThreadPoolExecutor, ahead=0):
        seen.append(progress.cell)
        if len(seen) == 5:
            break
    again = StudyRun(grid(), tmp_path)
    assert set(missing(again)) == set(again.cells) - set(seen)
    rest = [p.cell for p in finished(again) if p.round == 0]
    assert set(rest) | set(seen) == set(again.cells)
    assert not set(rest) & set(seen)
    assert finished(StudyRun(grid(), tmp_path)) == []
    keys = [(r.problem_hash, a.key) for r in read_journal(tmp_path) for a in r.attempts]
    assert len(keys) == len(set(keys))


def test_failures_are_recorded_skipped_and_tried_again_only_on_request(tmp_path, monkeypatch):
    def stated(x, y):
        if x == 2.0:
            raise ZeroDivisionError("not here")
        return problem(x, y)

    monkeypatch.setattr(study_run, "run_guess", lambda *a, **_: 1 / 0)
    run = StudyRun(grid(problem=stated), tmp_path)
    finished(run)
    table = study_table(run).variables
    assert set(table["status"][1]) == {study_run.NO_PROBLEM}
    said = r"x = 2.0, y = 1.0: .*study.py, line \d+: ZeroDivisionError: not here"
    assert re.search(said, table["message"][1, 0])
    assert set(table["status"][0]) == {"error"}
    assert "division by zero" in table["message"][0, 0]
    assert missing(StudyRun(grid(problem=stated), tmp_path)) == []
    assert len(missing(StudyRun(grid(problem=stated), tmp_path, retry=True))) == 9
    with pytest.raises(colloc.ProblemError, match="no problem in any cell"):
        StudyRun(grid(problem=lambda x, y: 3), tmp_path)


@pytest.mark.slow
def test_what_leads_to_nothing_better_is_passed_over_and_the_cell_has_the_best_gait_of_all_its_starts():
    start, elsewhere = ellipse(0.0, 2.0, 1.0), ellipse(0.0, 2.85, 1.3)
    stated = Problem("two", start, gait=Harmonic(1, "bilateral"), delta=1e-2, intervals=12)
    at = (0,), stated, True, (), (elsewhere,), (0, 3), 0.0, frozenset(), 1, 300.0, 1
    work = study_run.Work(*at)
    done = study_run.visit(work)
    assert [a.outcome.status for a in done.attempts if a.origin == study_run.WARM] == [SOLVED]
    passed = [a for a in done.attempts if a.outcome.status == PASSED_OVER]
    assert study_run.GUESS in {a.origin for a in passed}
    best = study_run.best_attempt(done.attempts).outcome.value
    alone = [study_run.run_guess(stated, lambda a=a: a.outcome.guess, 0, 300.0) for a in passed]
    assert {end.status for end in alone} == {SOLVED}
    assert max(end.value for end in alone) <= best * (1 + study_run.BETTER)
    # a cell that was solved before is solved again for what does better, and for nothing else
    for incumbent, status in ((0.9 * best, SOLVED), (1.1 * best, PASSED_OVER)):
        again = dataclasses.replace(work, incumbent=incumbent, cold=())
        attempts = {a.origin: a.outcome.status for a in study_run.visit(again).attempts}
        assert attempts[study_run.WARM] == status
    # and what was tried is not tried again
    told = dataclasses.replace(work, tried=frozenset(a.key for a in done.attempts))
    assert not study_run.visit(told).attempts


def test_what_nobody_knows_of_a_gait_is_not_kept_and_asked_again(tmp_path):
    scores = {"known": 0.2, "unknown": np.nan, "endless": np.inf}
    study_run.append_visits(tmp_path, [study_run.Visit("a", (), scores)])
    (kept,) = read_journal(tmp_path)
    assert kept.scores == {"known": 0.2}


def test_a_task_whose_worker_dies_is_recorded_as_crashed(fake, tmp_path, monkeypatch):
    def run_tasks(function, ready, **_):
        while (task := ready()) is not None:
            first = task.arguments[0][0].cell == (0, 1) and not task.arguments[0][0].tried
            yield task, LostTask("its worker died") if first else function(*task.arguments)

    monkeypatch.setattr(study_run, "run_tasks", run_tasks)
    run = StudyRun(grid(), tmp_path)
    finished(run)
    assert study_table(run).variables["starts"].min() >= 1
    assert CRASHED in {a.outcome.status for a in run.cells[0, 1].attempts}
    assert run.cells[0, 1].best is not None  # in the next round, from its neighbours


def test_xarray_opens_the_result_with_dimensions_units_and_texts(fake, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    axes = (Axis("x", (1.0, 2.0, 3.0), "mu_t / mu_f"), Axis("kind", ("ä", "bb")))
    run = StudyRun(grid(axes=axes, problem=lambda x, kind: problem(x, 1.0, kind)), tmp_path)
    finished(run)
    table, command = study_table(run, lambda p: 0.5 / p.friction.mu_t), "ä" * 70_000
    path = save_study(table, tmp_path / "a b" / "ü.nc", source="text", command=command)
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert dict(data.sizes) == {"x": 3, "kind": 2, "joint": 2, "harmonic": 1}
        assert data.efficiency.sel(x=2.0, kind="bb").item() == table.variables["efficiency"][1, 1]
        xarray.testing.assert_equal(table.to_xarray().efficiency, data.efficiency)
        assert data.x.attrs["long_name"] == "mu_t / mu_f"
        assert data.efficiency.attrs["units"] == "1/weight"
        assert list(data.kind.values) == ["ä", "bb"]
        assert data.cos.dims == ("x", "kind", "joint", "harmonic")
        assert data.status.values[0, 0] == SOLVED
        np.testing.assert_allclose(data.upper_bound[:, 0], [0.5, 0.25, 0.5 / 3])
        # work is at least the smallest coefficient times the way: 1 forwards, x sideways
        np.testing.assert_allclose(data.trivial_bound, 1.0)
        assert not data.at_slowest.values.any()
        assert data.attrs["source"] == "text"
        assert data.attrs["command"] == command  # more than one block of HDF5 holds
        assert json.loads(data.attrs["versions"])["numpy"] == np.__version__
        assert data.message.values[0, 0] == ""
        texts = {data[name].dtype.kind for name in ("kind", "status", "message", "gait_class")}
        assert len(texts) == 1
        attributes = [each.attrs.values() for each in data.variables.values()]
        assert all(isinstance(text, str) for values in attributes for text in values)
    back = load_study(path)
    np.testing.assert_array_equal(back.variables["efficiency"], table.variables["efficiency"])
    assert back.dimensions["mean"] == ("x", "kind", "joint")


def in_class(kind, guess=ellipse(0.1, 2.0, 1.0), intervals=20):  # noqa: B008
    return Problem("p", guess, gait=CLASSES[kind], delta=1e-3, intervals=intervals)


def test_classes_of_gaits_are_an_axis_and_kept_exactly(tmp_path, monkeypatch):
    def next_to(stated, start_from, start, time_limit, **_):
        guess = start_from()
        gait = study_run.member(stated, guess)
        return outcome(start, study_run.value_of(stated, gait), gait, guess)

    monkeypatch.setattr(study_run, "run_guess", next_to)
    study = Study("kinds", (Axis("kind", tuple(CLASSES)),), in_class, cold_starts=0)
    run = StudyRun(study, tmp_path)
    finished(run)
    ellipses, triangles, splines = (run.cells[k,] for k in range(3))
    kinds = [type(cell.best.outcome.gait) for cell in (ellipses, triangles, splines)]
    assert kinds == [Fourier, colloc.Corners, Combination]
    # the ellipse was looked at in both other classes, as it is
    for cell in (triangles, splines):
        score = cell.scores[ellipses.best.gait_key]
        assert score == pytest.approx(ellipses.best.outcome.efficiency, rel=0.02)
    again = StudyRun(study, tmp_path)
    for k in range(3):
        assert again.state((k,)).best.gait_key == run.cells[k,].best.gait_key
    table = load_study(save_study(study_table(run), tmp_path / "kinds.nc")).variables
    assert set(table["status"]) == {SOLVED}
    triangle = triangles.best.outcome.gait
    assert table["delta"][1] == pytest.approx(1e-4 * triangle.length)
    t = np.linspace(0, 1, 100)
    series = Fourier(*(table[name][1] for name in ("mean", "cos", "sin")))
    np.testing.assert_allclose(series.angles(t), triangle.angles(t), atol=0.2)
    assert np.isnan(table["cos"][0, :, 1:]).all()


def test_a_class_says_how_a_path_turns_and_where_its_wave_runs():
    # joint 2 repeats joint 1 a quarter period later
    quarter = Fourier([0, 0], [[1.0], [0.0]], [[0.0], [1.0]])
    back = Fourier([0, 0], [[1.0], [0.0]], [[0.0], [-1.0]])
    # a small wave of twice the pace runs twice about the mean, and back
    both = Fourier([0.8, -0.5], [[1.0, 0.5], [0.0, 0.0]], [[0.0, 0.0], [1.0, -0.5]])
    twice = Fourier([0.8, -0.5], [[0.0, 0.5], [0.0, 0.0]], [[0.0, 0.0], [0.0, -0.5]])
    for gait, turns, wave in ((quarter, 1, 1), (back, -1, -1), (both, 1, 1 / 3), (twice, -2, -1)):
        assert (study_run.winding(gait), study_run.wave_direction(gait)) == (
            turns,
            pytest.approx(wave),
        )
    together = Fourier([0, 0], [[1.0], [1.0]], [[0.0], [0.0]])
    assert study_run.wave_direction(together) == pytest.approx(0.0)


@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal"])
def test_a_class_names_a_symmetry_and_backwards_all_runs_the_other_way(symmetry):
    kind = Harmonic(3, symmetry)
    gait = kind.member(0.4 * np.random.default_rng(3).normal(size=kind.size(2)), 2)
    body, friction = Chain(), Friction(mu_t=3.0, mu_f=1.0, mu_b=1.0)
    found = study_run.gait_class(gait, body, friction)
    assert found["gait_class"].endswith(f" {symmetry}")
    assert not found["retraced"]
    for other in (reversed_in_time(gait), swap_ends(gait, body)):
        image = study_run.gait_class(other, body, friction)
        assert image["gait_class"] == found["gait_class"]
        assert image["winding"] == -found["winding"]
        for name in ("wave", "forward"):
            assert image[name] == pytest.approx(-found[name], abs=1e-4)


@pytest.mark.parametrize("size", [0.05, 1.0])
def test_what_is_off_by_a_hundredth_of_a_gait_still_counts_as_symmetric(size):
    for off, symmetry in ((0.01, "both"), (0.03, "none")):
        gait = Fourier([0, 0], [[size, off * size], [0.0, 0.0]], [[0.0, 0.0], [size, 0.0]])
        found = study_run.gait_class(gait, Chain(), Friction(mu_t=3, mu_f=1, mu_b=1))
        assert found["gait_class"].endswith(f" {symmetry}")


def test_a_gait_is_standing_if_it_goes_back_its_way_or_hardly_has_a_wave_or_hardly_moves_along_itself():
    assert study_run.class_name(False, False, True, 1, 1) == "standing (retraced), none"
    named = (0.04, 1, "standing"), (0.5, 0.04, "standing"), (-0.5, -0.3, "direct")
    for wave, forward, kind in named:
        assert study_run.class_name(False, False, False, wave, forward) == f"{kind}, none"


@pytest.mark.parametrize(("mu_t", "kind"), [(20.0, "retrograde, both"), (0.1, "direct, both")])
def test_snakes_move_against_their_wave_and_bristle_worms_with_it(mu_t, kind):
    # the paper, section I: retrograde waves at large transverse friction, direct ones at small
    for sign in (1, -1):
        gait = Fourier([0, 0], [[0.4], [0.0]], [[0.0], [sign * 0.4]])
        # modes bend the body everywhere, which makes less of a step from place to place
        for body, steps in ((Chain(), 1.0), (ModalBody(2, panels=4), 0.5)):
            found = study_run.gait_class(gait, body, Friction(mu_t=mu_t, mu_f=1, mu_b=1))
            assert found["gait_class"] == kind
            assert abs(found["forward"]) == pytest.approx(1.0, abs=1e-6)
            assert 0.25 < found["wave"] * sign <= steps


def test_the_name_of_a_gait_is_the_same_in_every_process():
    gait, other = (Fourier([0.1, 0.2], [[0.4], [0.3]], [[0.0], [end]]) for end in (0.4, 0.5))
    made = f"from colloc.gaits.gait_fields import gait_from; gait = gait_from({fields(gait)})"
    code = f"{made}; from colloc.studies.sweep import start_key; print(start_key(gait))"
    words = [sys.executable, "-c", code]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    assert said == start_key(gait) != start_key(other)


def test_the_command_says_what_it_found_and_goes_on_from_its_journal(
    fake, tmp_path, monkeypatch, capsys
):
    pools, chunks, solve = [], [], run_chunk
    pool = lambda workers: pools.append(workers) or ThreadPoolExecutor(workers)  # noqa: E731
    monkeypatch.setattr(StudyRun, "run", partialmethod(StudyRun.run, executor=pool))
    made = lambda *at, retry: pools.append(retry) or StudyRun(*at)  # noqa: E731
    monkeypatch.setattr(study_run, "StudyRun", made)
    monkeypatch.setattr(study_run, "run_chunk", lambda x: chunks.append(len(x)) or solve(x))
    words = ["--output", f"{tmp_path}/", "--chunk", "2", "--workers", "3"]
    for journal in (0, 2):
        assert sweep_study([str(study_file(tmp_path)), *words]) == 0
        said = capsys.readouterr().out
        assert f"2 cells, {journal} of them in the journal\n" in said
        assert ("round 0: 2 of 2, 0 s left)" in said) == (journal == 0)
        assert f"tiny: 2 cells: 2 solved; saved {tmp_path}/tiny.nc" in said
    assert load_study(tmp_path / "tiny.nc").attributes["source"] == FILE
    one = FILE.replace("(1.0, 1.1)", "(3.0,)").replace("(1.0,)", "(2.0, 2.1)")
    assert sweep_study([str(study_file(tmp_path, one)), *words, "--quiet", "--retry"]) == 3
    assert capsys.readouterr().out.startswith("tiny: 2 cells: 1 no verified gait, 1 solved; saved")
    assert (max(chunks), {*pools}) == (2, {3, False, True})


@pytest.mark.slow
def test_the_command_line_solves_resumes_and_certifies(tmp_path, capsys):
    out = tmp_path / "out put"
    words = [str(study_file(tmp_path)), "--output", str(out)]
    assert sweep_study(words) == 0
    assert "2 cells, 0 of them in the journal" in capsys.readouterr().out
    table = load_study(out / "tiny.nc").variables
    # the isotropic optimum of problems/three_link.py at a delta a hundred times larger
    assert table["efficiency"][0, 0] == pytest.approx(0.2600, abs=2e-3)
    assert table["gait_class"][0, 0].endswith("both")
    assert sweep_study([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["counts"] == {"solved": 2}
    again = load_study(out / "tiny.nc").variables["efficiency"]
    np.testing.assert_array_equal(again, table["efficiency"])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_ctrl_c_keeps_what_is_done_and_says_so(tmp_path):
    many = FILE.replace("(1.0, 1.1)", "tuple(1 + 0.01 * k for k in range(40))")
    words = ["-m", "colloc", "sweep", str(study_file(tmp_path, many)), "--output", str(tmp_path)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen([sys.executable, *words], **pipes)
    lines = [process.stdout.readline() for _ in range(3)]
    process.send_signal(signal.SIGINT)
    rest, errors = process.communicate(timeout=240)
    assert process.returncode == 130
    said = "interrupted; what is done is kept, and the same command goes on from there."
    assert errors == f"colloc: {said}\n"
    assert " not tried yet" in rest
    assert "no verified gait" not in rest
    reported = sum("round 0" in line for line in [*lines, *rest.splitlines()])
    assert reported >= 2
    assert np.sum(load_study(tmp_path / "tiny.nc").variables["efficiency"] > 0) >= reported


@pytest.mark.slow
@pytest.mark.parametrize(("text", "least"), [(STUDY, 0.3), (PRESCRIBED, 0.5)])
def test_gaits_of_modes_travel_and_prescribed_motions_do_not(text, least, tmp_path, capsys):
    (tmp_path / "study.py").write_text(text)
    assert sweep_study([str(tmp_path / "study.py"), "--output", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["counts"] == {"solved": 2}
    (file,) = tmp_path.glob("*.nc")
    study = load_study(file).variables
    assert study["efficiency"][0] > study["efficiency"][1] > least  # friction sideways helps
    if text == PRESCRIBED:
        assert study["starts"].tolist() == [1, 1]
