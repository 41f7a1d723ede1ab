"""Many starts: admissible reproducible samples, gaits that are the same, archives, and runs that
nothing stops."""

import itertools
import json
import tracemalloc
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace

import h5py
import numpy as np
import pytest

from colloc.commands.families import multistart, starts_summary
from colloc.gaits.bspline import BSpline, Polygon
from colloc.gaits.gait_fields import fields
from colloc.gaits.harmonic import Fourier, Harmonic, ellipse, shifted
from colloc.gaits.polygon import Corners
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import read_problem_file
from colloc.gaits.starts import BLOCK, SAMPLERS, on_speed_floor, start_gait
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth
from colloc.mechanics.friction import Friction
from colloc.results.archive import StartName, open_archive, row_path, save_archive
from colloc.results.checks import UNCERTIFIED
from colloc.results.distinct_optima import (
    basins,
    distance,
    images,
    phase_distance,
    reversed_in_time,
)
from colloc.results.outcome import CRASHED, ERROR, TIME_LIMIT, Outcome, counts
from colloc.results.solution import SOLVED
from colloc.search import certify
from colloc.search.certify import is_trivial
from colloc.search.options import Tolerances
from colloc.search.solve import solve
from colloc.studies import calls
from colloc.studies import multistart as campaign
from colloc.system.errors import ProblemError, StoreError
from colloc.verification.replay import replay
from scripts.continue_delta import resolution_warning, value_at_zero_delta
from tests.shared.laws import coulomb
from tests.shared.stages import answer_near

REVERSIBLE, IRREVERSIBLE = Friction(mu_t=3, mu_f=1, mu_b=1), Friction(mu_t=0.5, mu_f=1, mu_b=5)
GAIT = Fourier([0.3, -0.5], [[0.9, 0.2], [0.1, -0.1]], [[0.0, 0.1], [0.8, 0.2]])


def problem(**changes):
    fields = {
        "gait": Harmonic(1, "bilateral"),
        "delta": 0.1,
        "intervals": 10,
        "mesh_tolerance": 0.0,
    }
    return Problem(**{"name": "quick", "guess": ellipse(0.2, 1.2, 0.8), **fields, **changes})


def replayed(gait, friction, instants=200):
    path = lambda t: (gait.angles(t), gait.rates(t))  # noqa: E731
    return replay(Chain(), friction, path, 1e-2, instants=instants, most_instants=instants)


@pytest.mark.parametrize(("friction", "n_image"), [(REVERSIBLE, 8), (IRREVERSIBLE, 4)])
def test_images_of_a_gait_keep_its_distance_work_and_rotation(friction, n_image):
    original = replayed(GAIT, friction)
    found = images(GAIT, Chain(), friction)
    assert len(found) == n_image
    for image in found:
        other = replayed(image, friction)
        # the replay integrates the rotation forwards in time, so its quadrature error is not the
        # same for a reversed gait
        np.testing.assert_allclose(
            [other.distance, other.work], [original.distance, original.work], rtol=1e-6
        )
        np.testing.assert_allclose(abs(other.rotation), abs(original.rotation), rtol=1e-8)


@pytest.mark.parametrize("coefficients", [(1, 1, 1), (1.7, 1, 1.3), (0.5, 1, 5)])
def test_bilateral_gaits_close_their_rotation_for_any_friction(coefficients):
    rng = np.random.default_rng(5)
    gait = Harmonic(2, "bilateral").member(0.5 * rng.normal(size=5), 2)
    motion = replayed(gait, coulomb(*coefficients))
    assert abs(motion.rotation) < 1e-10
    assert motion.distance > 1e-3


def test_a_retraced_gait_goes_nowhere_unless_friction_tells_forward_from_backward():
    retraced = Fourier([0.4, -0.9], [[0.9], [0.5]], [[0.0], [0.0]])
    assert phase_distance(retraced, reversed_in_time(retraced)) < 1e-7
    assert phase_distance(GAIT, reversed_in_time(GAIT)) > 0.1
    assert replayed(retraced, REVERSIBLE).efficiency < 1e-9
    assert replayed(retraced, IRREVERSIBLE).efficiency > 1e-2


def test_distance_does_not_see_start_phase_or_symmetry_but_sees_everything_else():
    for phase in (0.1, 0.37, 0.9):
        assert phase_distance(GAIT, shifted(GAIT, phase)) < 1e-7
    for image in images(GAIT, Chain(), REVERSIBLE):
        assert distance(shifted(image, 0.21), GAIT, Chain(), REVERSIBLE) < 1e-7
    moved = Fourier(GAIT.mean + np.array([0.1, 0.0]), GAIT.cos, GAIT.sin)
    assert phase_distance(GAIT, moved) == pytest.approx(0.1, rel=1e-6)
    assert distance(GAIT, reversed_in_time(GAIT), Chain(), IRREVERSIBLE) > 0.1
    assert (
        distance(
            GAIT, images(GAIT, Chain((0.2, 0.3, 0.5)), IRREVERSIBLE)[-1], Chain(), IRREVERSIBLE
        )
        < 1e-7
    )


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize(
    ("symmetry", "harmonics"), [("none", 1), ("bilateral", 2), ("antipodal", 1)]
)
def test_starts_are_admissible_members_of_their_class_and_reproducible(
    sampler, symmetry, harmonics
):
    stated = problem(gait=Harmonic(harmonics, symmetry), joint_limit=2.8)
    t = np.arange(500) / 500
    seen = []
    for k in (0, 1, BLOCK - 1, BLOCK, 3 * BLOCK + 7):
        gait = start_gait(stated, sampler, 3, k)
        angles = gait.angles(t)
        assert np.abs(angles).max() <= 2.8
        assert not crossing_depth(stated.body, angles).any()
        assert gait.shape_speed >= stated.smallest_shape_speed
        again = stated.gait.member(stated.gait.parameters(gait), 2)
        assert phase_distance(gait, again) < 1e-7
        np.testing.assert_array_equal(angles, start_gait(stated, sampler, 3, k).angles(t))
        assert np.abs(angles - start_gait(stated, sampler, 4, k).angles(t)).max() > 1e-2
        seen.append(angles)
    assert min(np.abs(a - b).max() for i, a in enumerate(seen) for b in seen[:i]) > 1e-2
    with pytest.raises(ProblemError, match="sampler"):
        start_gait(stated, "dice", 0, 0)


def test_a_start_that_turns_the_body_does_not_collapse_onto_a_retraced_gait():
    stated = problem(gait=Harmonic(1, "none"), intervals=20)
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


def test_an_optimum_on_the_speed_floor_says_so(tmp_path, capsys):
    # without the bound the best gait has a shape speed of 1.86
    bounds = {"smallest_shape_speed": 2.0, "delta": 1e-3, "mesh_tolerance": 1e-4}
    stated = problem(
        friction=Friction(mu_t=0.5, mu_f=1, mu_b=5), guess=ellipse(0, 1.8, 1.2), **bounds
    )
    solution = solve(stated, 1)
    assert solution.status == SOLVED
    assert on_speed_floor(stated, solution.gait)
    assert "smallest_shape_speed = 2" in solution.message
    assert not on_speed_floor(stated, ellipse(0.0, 2.0, 1.2))
    found = [outcome(0, solution.gait), outcome(1, ellipse(0.0, 2.0, 1.2))]
    lines = starts_summary(stated, found, None)[2]
    assert sum("on the bound smallest_shape_speed" in line for line in lines) == 1


def outcome(start, gait=GAIT, efficiency=0.2, status=SOLVED):
    return Outcome(start, status, "", gait, gait, efficiency, 1e-7, 0.1, 0.5, 1e-4, 12, 1.5, 1.25)


def test_basins_join_images_of_one_gait_and_nothing_else():
    stated = problem(friction=REVERSIBLE, gait=Harmonic(2, "none"))
    same = [
        outcome(k, shifted(g, 0.1 * k)) for k, g in enumerate(images(GAIT, Chain(), REVERSIBLE))
    ]
    other = outcome(20, Fourier(GAIT.mean + 0.3, GAIT.cos, GAIT.sin))
    better = outcome(21, GAIT, 0.21)
    failed = outcome(22, status=ERROR)
    found = basins(stated, [*same, other, better, failed])
    assert [b.best.efficiency for b in found] == [0.21, 0.2, 0.2]
    assert sorted(len(b.starts) for b in found) == [1, 1, 8]
    assert sum(b.frequency for b in found) == pytest.approx(10 / 11)
    assert counts([*same, failed]) == {SOLVED: 8, ERROR: 1}


def test_an_archive_comes_back_as_it_was_written(tmp_path):
    path = tmp_path / "sub" / "a.h5"
    names = {k: StartName(SAMPLERS[0], 7, k) for k in (4, 1)}
    assert open_archive(problem(), path).outcomes == {}
    archive = open_archive(problem(), path)
    archive.add(
        {
            names[4]: outcome(4, efficiency=1 / 3),
            names[1]: outcome(1, efficiency=np.nan, status=ERROR),
        }
    )
    back = open_archive(problem(), path)
    assert sorted(back.outcomes) == sorted(names.values())
    for name in ("status", "efficiency", "iterations", "cpu_seconds", "delta"):
        assert getattr(back.outcomes[names[4]], name) == getattr(archive.outcomes[names[4]], name)
    assert np.isnan(back.outcomes[names[1]].efficiency)
    np.testing.assert_array_equal(back.outcomes[names[1]].gait.sin, GAIT.sin)
    save_archive(back)
    assert sorted(p.name for p in path.parent.glob("[!.]*")) == ["a.h5", "a.sqlite"]


@pytest.mark.parametrize(
    "gait",
    [
        BSpline(6).member(np.linspace(0.1, 1.3, 12) ** 2, 2),
        Corners([[0.1, 1.3, 1 / 3], [0.0, 0.2, 0.9]]),
    ],
    ids=["spline", "polygon"],
)
def test_gaits_of_every_class_are_kept_to_the_bit(gait, tmp_path):
    stated = problem(gait=Polygon(3) if isinstance(gait, Corners) else BSpline(6), guess=gait)
    name = StartName(SAMPLERS[0], 0, 0)
    open_archive(stated, tmp_path / "a.h5").add({name: outcome(0, gait)})
    back = open_archive(stated, tmp_path / "a.h5").outcomes[name].gait
    assert type(back) is type(gait)
    assert fields(back) == fields(gait)


def test_an_archive_that_cannot_be_gone_on_from_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "a.h5"
    path.write_bytes(b"results of an older colloc")
    with pytest.raises(StoreError, match="choose another --output"):
        open_archive(problem(), path)
    assert path.read_bytes() == b"results of an older colloc"
    path.unlink()
    row_path(path).write_bytes(b"not SQLite" * 100)
    with pytest.raises(StoreError, match="cannot be read as a colloc starts"):
        open_archive(problem(), path)
    assert row_path(path).read_bytes() == b"not SQLite" * 100


def test_xarray_opens_an_archive_with_named_dimensions(tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    archive = open_archive(problem(), tmp_path / "a.h5")
    with xarray.open_dataset(save_archive(archive), engine="h5netcdf") as data:
        assert dict(data.sizes) == {"start": 0, "basin": 0}
    archive.add({StartName(SAMPLERS[0], seed, k): outcome(k) for seed in (0, 1) for k in range(2)})
    with xarray.open_dataset(save_archive(archive, "command"), engine="h5netcdf") as data:
        assert dict(data.sizes) == {"start": 4, "joint": 2, "harmonic": 2, "basin": 1}
        assert data.gait_cos.dims == ("start", "joint", "harmonic")
        assert data.start.values.tolist() == [0, 1, 0, 1]
        assert data.seed.values.tolist() == [0, 0, 1, 1]
        assert set(data.status.values) == {SOLVED}
        assert data.basin_count.item() == 4
        assert data.attrs["command"] == "command"


def test_a_bad_start_or_a_slow_one_does_not_end_the_run(monkeypatch):
    def watched(stated, starts, *, seconds, **how):
        watched.calls += 1
        if watched.calls == 2:
            raise ZeroDivisionError("one bad start")
        found = solve(stated, starts, **how)
        return (
            replace(found, interrupted=True, certificate=UNCERTIFIED)
            if watched.calls == 3
            else found
        )

    watched.calls = 0
    monkeypatch.setattr(campaign, "solve", watched)
    monkeypatch.setattr(campaign.time, "perf_counter", itertools.count(0, 1000).__next__)
    found = list(
        campaign.run_starts(problem(), range(3), time_limit=500, executor=ThreadPoolExecutor)
    )
    assert [o.start for o in found] == [0, 1, 2]
    assert found[0].iterations > 0
    assert (found[1].status, found[1].message) == (ERROR, "ZeroDivisionError: one bad start")
    assert found[2].status == TIME_LIMIT
    assert "the last optimum was at delta = 1.0e-01" in found[2].message


class _Dying(Executor):
    """Breaks, like a pool whose worker was killed, whenever start 2 is submitted."""

    def __init__(self, workers):
        self.broken = False

    def submit(self, function, *arguments):
        if self.broken:
            raise BrokenProcessPool("died")
        future = Future()
        if arguments[3] == 2:
            self.broken = True
            future.set_exception(BrokenProcessPool("died"))
        else:
            future.set_result(outcome(arguments[3]))
        return future


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_a_worker_that_dies_costs_one_start(workers):
    found = list(campaign.run_starts(problem(), range(6), workers=workers, executor=_Dying))
    assert sorted(o.start for o in found) == [0, 1, 2, 3, 4, 5]
    assert [o.start for o in found if o.status == CRASHED] == [2]


FILE = """
from colloc import *
PROBLEM = Problem(name="quick", gait=Harmonic(1, "bilateral"), guess=ellipse(0.2, 1.2, 0.8),
                  friction=Friction(mu_t=10, mu_f=1, mu_b=1), delta=0.1, intervals=10, mesh_tolerance=1e-3)
"""


def test_the_command_line_solves_in_processes_resumes_and_reports(tmp_path, capsys, monkeypatch):
    path, out = tmp_path / "quick.py", tmp_path / "out"
    path.write_text(FILE, encoding="utf-8")
    multistart([str(path), "--starts", "2", "--output", str(out)])
    printed = capsys.readouterr().out
    assert "0 starts done already, 2 to go" in printed
    kept = lambda: open_archive(read_problem_file(path).problem, out / "quick.starts.h5")  # noqa: E731
    assert sorted(kept().of_search(SAMPLERS[0], 0)) == [0, 1]
    asked = []

    def run(stated, starts, **settings):
        for k in starts:
            asked.append(k)
            yield outcome(k, ellipse(0.2, 1.2, 0.8))

    monkeypatch.setattr(campaign, "run_starts", run)
    assert multistart([str(path), "--starts", "4", "--output", str(out), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert asked == [2, 3]
    assert summary["starts"] == 4
    assert sum(summary["counts"].values()) == 4
    assert summary["optima"][0]["efficiency"] >= 0.2 - 1e-12
    # of fewer starts than are there so many count as were asked for
    assert multistart([str(path), "--starts", "3", "--output", str(out)]) == 0
    assert "3 starts done already, 0 to go" in capsys.readouterr().out
    # another seed joins the same archive, and says what else is there
    assert (
        multistart(
            [str(path), "--starts", "2", "--seed", "1", "--output", str(out / "quick.starts.h5")]
        )
        == 0
    )
    assert asked == [2, 3, 0, 1]
    assert "starts in the file besides: 4; the best of all, 0.200000" in capsys.readouterr().out
    archive = kept()
    assert sorted(archive.of_search(SAMPLERS[0], 0)) == [0, 1, 2, 3]
    assert sorted(archive.of_search(SAMPLERS[0], 1)) == [0, 1]
    # another problem of the same name does not
    path.write_text(FILE.replace("delta=0.1", "delta=0.2"), encoding="utf-8")
    assert multistart([str(path), "--output", str(out)]) == 2
    assert "holds starts of another problem" in capsys.readouterr().err
    assert asked == [2, 3, 0, 1]
    path.write_text(FILE, encoding="utf-8")
    assert len(kept().outcomes) == 6


def test_of_two_runs_at_once_with_other_seeds_or_problems_neither_overwrites_the_other(tmp_path):
    runs = [open_archive(problem(), tmp_path / "a.h5") for _ in (0, 1)]
    for k in range(3):
        for seed, archive in enumerate(runs):
            archive.add({StartName(SAMPLERS[0], seed, k): outcome(k, efficiency=0.1 * (seed + 1))})
    assert len(runs[0].outcomes) == 3
    save_archive(runs[0])
    expected = {(SAMPLERS[0], seed, k): 0.1 * (seed + 1) for seed in (0, 1) for k in range(3)}
    assert {name: o.efficiency for name, o in runs[0].outcomes.items()} == expected
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["start"].size == 6
    with pytest.raises(StoreError, match="another problem"):
        open_archive(problem(delta=0.2), tmp_path / "a.h5")
    assert len(open_archive(problem(), tmp_path / "a.h5").outcomes) == 6


def test_the_limit_of_small_delta_agrees_with_a_smaller_delta(three_link):
    limit = value_at_zero_delta(three_link)
    assert limit.error < 1e-3 * limit.value
    assert abs(limit.value - three_link.certificate.efficiency_at_zero_delta) < 3 * limit.error
    assert resolution_warning(three_link) is None


class _Enough(Exception):
    pass


def test_more_starts_than_memory_holds_begin_at_once_and_are_told_one_by_one(
    tmp_path, capsys, monkeypatch
):
    """In a pipe too: a line for every start as it ends."""
    path = tmp_path / "quick.py"
    path.write_text(FILE, encoding="utf-8")
    many = 10**6  # a list of them takes 40 MB

    def solved(function, ready, **settings):
        for _ in range(3):
            task = ready()
            yield task, outcome(task.key, ellipse(0.2, 1.2, 0.8))
        raise _Enough

    monkeypatch.setattr(campaign, "run_tasks", solved)
    words = [str(path), "--starts", str(many), "--output", f"{tmp_path}/"]
    with pytest.raises(_Enough):
        multistart(words)
    told = capsys.readouterr().out
    assert f"0 starts done already, {many} to go" in told
    assert told.count("  solved\n") == 3
    with pytest.raises(_Enough):
        multistart(words)
    told = capsys.readouterr().out
    assert f"3 starts done already, {many - 3} to go" in told
    assert [line.split()[0] for line in told.splitlines() if line.endswith("solved")] == [
        "3",
        "4",
        "5",
    ]
    tracemalloc.start()
    for begun in (
        lambda: multistart([*words, "--quiet"]),
        lambda: calls.multistart(problem(), many),
    ):
        with pytest.raises(_Enough):
            begun()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 5e6


def test_a_start_that_fails_on_its_way_is_told_with_the_last_optimum_it_came_through(monkeypatch):
    problem = Problem("quick", gait=Harmonic(1, "bilateral"), delta=1e-2, intervals=10)

    def stopped(*asked, **how):
        solution = solve(*asked, **how)
        assert len([step for step in solution.history if step.optimal]) > 1
        answer = replace(solution.answer, optimal=False)
        return replace(solution, answer=answer, certificate=UNCERTIFIED)

    monkeypatch.setattr(campaign, "solve", stopped)
    outcome = campaign.run_guess(problem, lambda: problem.guess, 3, np.inf)
    assert outcome.status not in (ERROR, SOLVED)
    assert outcome.delta == problem.delta
    assert outcome.efficiency > 0.2
