"""Many starts: admissible reproducible samples, equal gaits, archives, runs that nothing stops."""

import itertools
import json
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from shared.store_samples import GAIT, outcome

import colloc
from colloc import BSpline, Chain, Fourier, Friction, Harmonic, Problem, StoreError, ellipse
from colloc.commands.families import multistart, starts_summary
from colloc.gaits.harmonic import shift_phase
from colloc.gaits.problem_file import read_problem_file
from colloc.gaits.starts import BLOCK, SAMPLERS, largest_amplitude, on_speed_floor, start_gait
from colloc.mechanics.contact import crossing_depth
from colloc.results import archive as archives
from colloc.results.archive import ERROR, TIME_LIMIT, Archive, open_archive, save_archive
from colloc.results.checks import UNCERTIFIED
from colloc.results.comparison import images, phase_distance, reversed_in_time
from colloc.results.solution import SOLVED
from colloc.search import certify
from colloc.search.certify import is_trivial
from colloc.search.options import Tolerances
from colloc.search.solve import solve
from colloc.studies import solve as campaign
from colloc.system.task_pool import LostTask
from colloc.verification.replay import replay
from tests.shared.stages import answer_near

REVERSIBLE, IRREVERSIBLE = Friction(mu_t=3, mu_f=1, mu_b=1), Friction(mu_t=0.5, mu_f=1, mu_b=5)
ROUND = ellipse(0.2, 1.2, 0.8)
USUAL = {"gait": Harmonic(1, "bilateral"), "delta": 0.1, "intervals": 10, "mesh_tolerance": 0.0}
FILE = """
from colloc import *
PROBLEM = Problem(name="quick", gait=Harmonic(1, "bilateral"), guess=ellipse(0.2, 1.2, 0.8),
                  friction=Friction(mu_t=10, mu_f=1, mu_b=1), delta=0.1, intervals=10, mesh_tolerance=1e-3)
"""
SPLINE = BSpline(6).member(np.linspace(0.1, 1.3, 12) ** 2, 2)
CORNERS = colloc.Corners([[0.1, 1.3, 1 / 3], [0.0, 0.2, 0.9]])


def problem(**changes):
    return Problem("quick", **{"guess": ROUND, **USUAL, **changes})


def name(start, seed=0):
    return archives.StartName(SAMPLERS[0], seed, start)


def replayed(gait, friction, instants=200):
    return replay(Chain(), friction, gait, 1e-2, instants=instants, most_instants=instants)


@pytest.mark.parametrize(("friction", "n_image"), [(REVERSIBLE, 8), (IRREVERSIBLE, 4)])
def test_images_of_a_gait_keep_its_distance_work_and_rotation(friction, n_image):
    original, found = replayed(GAIT, friction), images(GAIT, Chain(), friction)
    assert len(found) == n_image
    for image in found:
        other = replayed(image, friction)
        # the rotation is integrated forwards in time: a reversed gait has another quadrature error
        assert other.distance == pytest.approx(original.distance, rel=1e-6)
        assert other.work == pytest.approx(original.work, rel=1e-6)
        assert abs(other.rotation) == pytest.approx(abs(original.rotation), rel=1e-8)


def test_gaits_are_as_far_apart_as_their_angles_at_the_phase_where_they_are_nearest():
    other = Fourier([0.1, 0.6], [[0.7, 0.2], [-0.3, 0.0]], [[0.1, 0.0], [0.9, 0.4]])
    t = np.arange(512) / 512
    squares = [((GAIT.angles(t) - other.angles(t + by)) ** 2).sum(axis=0).mean() for by in t]
    assert phase_distance(GAIT, other) == pytest.approx(min(squares) ** 0.5, rel=1e-4)


def test_a_retraced_gait_goes_nowhere_unless_friction_tells_forward_from_backward():
    retraced = Fourier([0.4, -0.9], [[0.9], [0.5]], [[0.0], [0.0]])
    assert phase_distance(retraced, reversed_in_time(retraced)) < 1e-7
    assert phase_distance(GAIT, reversed_in_time(GAIT)) > 0.1
    assert replayed(retraced, REVERSIBLE).efficiency < 1e-9
    assert replayed(retraced, IRREVERSIBLE).efficiency > 1e-2


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("gait", [Harmonic(1), Harmonic(2, "bilateral"), Harmonic(1, "antipodal")])
def test_starts_are_admissible_members_of_their_class_and_reproducible(sampler, gait):
    stated, t, seen = problem(gait=gait, joint_limit=2.8), np.arange(500) / 500, []
    for k in (0, 1, BLOCK - 1, BLOCK, 3 * BLOCK + 7):
        start = start_gait(stated, sampler, 3, k)
        angles = start.angles(t)
        assert np.abs(angles).max() <= 2.8
        assert not crossing_depth(stated.body, angles).any()
        assert start.shape_speed >= stated.smallest_shape_speed
        if sampler == SAMPLERS[0]:  # from 0.2 to 0.95 of the largest
            assert 1.05 < largest_amplitude(stated, start) < 5.01
        assert phase_distance(start, gait.member(stated.gait.parameters(start), 2)) < 1e-7
        np.testing.assert_array_equal(angles, start_gait(stated, sampler, 3, k).angles(t))
        assert np.abs(angles - start_gait(stated, sampler, 4, k).angles(t)).max() > 1e-2
        seen.append(angles)
    assert min(np.abs(a - b).max() for a, b in itertools.combinations(seen, 2)) > 1e-2


def test_a_start_that_turns_the_body_does_not_collapse_onto_a_retraced_gait():
    stated = problem(gait=Harmonic(1), intervals=20)
    answer = answer_near(stated.with_(guess=start_gait(stated, SAMPLERS[0], 0, 0)))
    assert answer.optimal
    assert not is_trivial(answer)
    assert phase_distance(answer.gait, reversed_in_time(answer.gait)) > 0.1


def test_a_level_that_goes_nowhere_is_no_success(monkeypatch):
    # with a threshold above every efficiency each level counts as going nowhere
    monkeypatch.setattr(certify, "TOLERANCES", Tolerances(zero_value=2.0))
    solution = solve(problem(), 1)
    assert is_trivial(solution.answer)
    assert solution.status != SOLVED
    assert "goes nowhere" in solution.message


def test_an_optimum_on_the_speed_floor_says_so():
    # without the bound the best gait has a shape speed of 1.86
    bounds = {"smallest_shape_speed": 2.0, "delta": 1e-3, "mesh_tolerance": 1e-4}
    stated = problem(friction=IRREVERSIBLE, guess=ellipse(0, 1.8, 1.2), **bounds)
    solution, large = solve(stated, 1), ellipse(0.0, 2.0, 1.2)
    assert solution.status == SOLVED
    assert on_speed_floor(stated, solution.gait)
    assert "smallest_shape_speed = 2" in solution.message
    assert not on_speed_floor(stated, large)
    found = [outcome(k, gait=gait) for k, gait in enumerate((solution.gait, large))]
    lines = starts_summary(stated, found, None)[2]
    assert sum("on the bound smallest_shape_speed" in line for line in lines) == 1


def test_basins_join_images_of_one_gait_and_nothing_else():
    stated = problem(friction=REVERSIBLE, gait=Harmonic(2))
    found = images(GAIT, Chain(), REVERSIBLE)
    same = [outcome(k, gait=shift_phase(image, 0.1 * k)) for k, image in enumerate(found)]
    other = outcome(20, gait=Fourier(GAIT.mean + 0.3, GAIT.cos, GAIT.sin))
    better, failed = outcome(21, 0.21), outcome(22, status=ERROR)
    found = archives.basins(stated, [*same, other, better, failed])
    assert [b.best.efficiency for b in found] == [0.21, 0.2, 0.2]
    assert sorted(len(b.starts) for b in found) == [1, 1, 8]
    assert sum(b.frequency for b in found) == pytest.approx(10 / 11)
    assert archives.counts([*same, failed]) == {SOLVED: 8, ERROR: 1}


@pytest.mark.parametrize(
    ("kind", "gait"), [(Harmonic(2), GAIT), (BSpline(6), SPLINE), (colloc.Polygon(3), CORNERS)]
)
def test_an_archive_comes_back_to_the_bit_with_gaits_of_every_class(kind, gait, tmp_path):
    path, stated = tmp_path / "sub" / "a.h5", problem(gait=kind, guess=gait)
    archive = open_archive(stated, path)
    assert archive.outcomes == {}
    failed = outcome(1, np.nan, gait, status=ERROR)
    archive.add({name(4, 7): outcome(4, 1 / 3, gait), name(1, 7): failed})
    back = open_archive(stated, path)
    assert back.outcomes.keys() == archive.outcomes.keys()
    done = (back.done(SAMPLERS[0], 7, 4 + 1, retry=again) for again in (False, True))
    assert [*done] == [{1, 4}, {4}]
    for key, one in back.outcomes.items():
        assert type(one.gait) is type(gait)
        assert repr(archives.outcome_fields(one)) == repr(
            archives.outcome_fields(archive.outcomes[key])
        )
    save_archive(back)
    assert sorted(p.name for p in path.parent.glob("[!.]*")) == ["a.h5", "a.sqlite"]


def test_an_archive_that_cannot_be_gone_on_from_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "a.h5"
    for file, content, words in (
        (path, b"results of an older colloc", "choose another --output"),
        (archives.row_path(path), b"not SQLite" * 100, "cannot be read as a colloc starts"),
    ):
        file.write_bytes(content)
        with pytest.raises(StoreError, match=words):
            open_archive(problem(), path)
        assert file.read_bytes() == content
        file.unlink()


def test_xarray_opens_an_archive_with_named_dimensions(tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    archive = open_archive(problem(), tmp_path / "a.h5")
    with xarray.open_dataset(save_archive(archive), engine="h5netcdf") as data:
        assert dict(data.sizes) == {"start": 0, "basin": 0}
    archive.add({name(k, seed): outcome(k) for seed in (0, 1) for k in range(2)})
    with xarray.open_dataset(save_archive(archive, "command"), engine="h5netcdf") as data:
        assert dict(data.sizes) == {"start": 4, "joint": 2, "harmonic": 2, "basin": 1}
        assert data.gait_cos.dims == ("start", "joint", "harmonic")
        assert data.start.values.tolist() == [0, 1, 0, 1]
        assert data.seed.values.tolist() == [0, 0, 1, 1]
        assert set(data.status.values) == {SOLVED}
        assert (data.basin_count.item(), data.basin_frequency.item()) == (4, 1)
        assert data.attrs["command"] == "command"


def test_a_bad_start_or_a_slow_one_does_not_end_the_run(monkeypatch):
    calls = itertools.count(1)

    def watched(stated, starts, *, seconds, **how):
        number = next(calls)
        if number == 2:
            raise ZeroDivisionError("one bad start")
        found = solve(stated, starts, **how if number < 4 else {})  # the last one tells nothing
        return replace(found, interrupted=True, certificate=UNCERTIFIED) if number > 2 else found

    monkeypatch.setattr(campaign, "search_solve", watched)
    monkeypatch.setattr(campaign.time, "perf_counter", itertools.count(0, 1000).__next__)
    how = {"time_limit": 500, "executor": ThreadPoolExecutor}
    good, bad, slow, late = campaign.run_starts(Archive(problem()), range(4), **how)
    assert (good.start, bad.start, slow.start) == (0, 1, 2)
    assert (late.status, late.message) == (TIME_LIMIT, "gave up after 500 s; no optimum yet.")
    assert good.iterations > 0
    assert (bad.status, bad.message) == (ERROR, "ZeroDivisionError: one bad start")
    assert slow.status == TIME_LIMIT
    assert "the last optimum was at delta = 4.0e-03" in slow.message


def test_a_worker_that_dies_costs_one_start(monkeypatch):
    def run_tasks(function, ready, **_):
        while (task := ready()) is not None:
            yield task, LostTask("its worker died") if task.key == 2 else outcome(task.key)

    monkeypatch.setattr(campaign, "run_tasks", run_tasks)
    found = list(campaign.run_starts(Archive(problem()), range(6)))
    assert [o.start for o in found] == [0, 1, 2, 3, 4, 5]
    assert [o.start for o in found if o.status == archives.CRASHED] == [2]


def test_the_command_line_solves_in_processes_resumes_and_reports(tmp_path, capsys, monkeypatch):
    path, out, asked = tmp_path / "quick.py", tmp_path / "out", []
    path.write_text(FILE, encoding="utf-8")

    def run(*options):
        how = "--output", str(out), "--workers", "3", "--time-limit", "7"
        code = multistart([str(path), *how, *map(str, options)])
        return code, *capsys.readouterr()

    def kept():
        return open_archive(read_problem_file(path).problem, out / "quick.starts.h5")

    def starts(archive, numbers, *, seed, **settings):
        assert settings == {"sampler": SAMPLERS[0], "workers": 3, "time_limit": 7.0}
        for k in numbers:
            asked.append(k)
            ended = outcome(k, 0.2 + 0.01 * k, gait=ROUND)
            archive.add({name(k, seed): ended})
            yield ended

    assert "0 starts done already, 2 to go" in run("--starts", 2)[1]
    assert sorted(kept().of_search(SAMPLERS[0], 0)) == [0, 1]
    monkeypatch.setattr(campaign, "run_starts", starts)
    code, said, _ = run("--starts", 4, "--json")
    summary = json.loads(said)
    assert (code, asked) == (0, [2, 3])
    assert summary["starts"] == sum(summary["counts"].values()) == 4
    assert summary["optima"][0]["efficiency"] >= 0.2 - 1e-12
    # of fewer starts than are there so many count as were asked for
    assert "3 starts done already, 0 to go" in run("--starts", 3)[1]
    # another seed joins the same archive, and says what else is there
    code, said, _ = run("--starts", 2, "--seed", 1)
    assert (code, asked) == (0, [2, 3, 0, 1])
    assert "--start 1 --seed 1   makes a result of the best" in said
    assert "other starts in the file: 4; the best of all, 0.230000, is start 3 of seed 0" in said
    assert sorted(kept().of_search(SAMPLERS[0], 0)) == [0, 1, 2, 3]
    assert sorted(kept().of_search(SAMPLERS[0], 1)) == [0, 1]
    # another problem of the same name does not
    path.write_text(FILE.replace("delta=0.1", "delta=0.2"), encoding="utf-8")
    code, _, complaint = run()
    assert (code, asked) == (2, [2, 3, 0, 1])
    assert "holds starts of another problem" in complaint
    path.write_text(FILE, encoding="utf-8")
    assert len(kept().outcomes) == 6
    kept().add({name(1, 1): outcome(1, gait=ROUND, status=ERROR)})
    assert "1 starts done already, 1 to go" in run("--starts", 2, "--seed", 1, "--retry")[1]


class _Enough(Exception):
    pass


def test_more_starts_than_memory_holds_begin_at_once_one_by_one(tmp_path, capsys, monkeypatch):
    """In a pipe too: a line for every start as it ends."""
    path, many = tmp_path / "quick.py", 10**6  # a list of them takes 40 MB
    path.write_text(FILE, encoding="utf-8")

    def solved(function, ready, **settings):
        for _ in range(3):
            task = ready()
            yield task, outcome(task.key, gait=ROUND)
        raise _Enough

    def run(begun):
        with pytest.raises(_Enough):
            begun()
        return capsys.readouterr().out

    monkeypatch.setattr(campaign, "run_tasks", solved)
    words = [str(path), "--starts", str(many), "--output", f"{tmp_path}/"]
    said = run(lambda: multistart(words))
    assert f"0 starts done already, {many} to go" in said
    assert said.count("  solved\n") == 3
    said = run(lambda: multistart(words))
    assert f"3 starts done already, {many - 3} to go" in said
    ended = [line.split()[0] for line in said.splitlines() if line.endswith("solved")]
    assert ended == ["3", "4", "5"]
    tracemalloc.start()
    run(lambda: multistart([*words, "--quiet"]))
    run(lambda: campaign.multistart(problem(), many))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 5e6


def test_a_start_that_fails_on_its_way_is_told_with_the_last_optimum_it_came_through(monkeypatch):
    problem = Problem("quick", gait=Harmonic(1, "bilateral"), delta=1e-2, intervals=10)

    begun = []

    def stopped(*asked, **how):
        begun.append(asked[0].guess)
        solution = solve(*asked, **how)
        assert len([step for step in solution.history if step.optimal]) > 1
        answer = replace(solution.answer, optimal=False)
        return replace(solution, answer=answer, certificate=UNCERTIFIED)

    monkeypatch.setattr(campaign, "search_solve", stopped)
    found = campaign.run_guess(problem, lambda: problem.guess, 3, np.inf)
    assert found.status not in (ERROR, SOLVED)
    assert found.delta == problem.delta
    assert found.efficiency > 0.2
    campaign.reopen(problem, found)  # from where it had begun
    assert begun[1] == found.guess != found.gait
