"""Results files: round trip, changed by hand, refused by the disk; and what is kept beside them."""

import dataclasses
import os
import shutil
import subprocess
import sys
from dataclasses import replace

import h5py
import numpy as np
import pytest

from colloc import Friction, Harmonic, Problem, StoreError, load, save, solve
from colloc.commands.main import main as colloc
from colloc.gaits.starts import latin_hypercube_gait, on_speed_floor
from colloc.results import store
from colloc.results.store import save_result
from colloc.search import checkpoint as run_module
from colloc.search.checkpoint import ROWS, Run
from colloc.search.options import OPTIONS, TOLERANCES, SearchOptions, Tolerances
from colloc.search.solve import certify_answer
from colloc.system.errors import ReadOnlyRunWarning
from colloc.system.row_file import read_rows

QUICK = Problem("quick", gait=Harmonic(1, "bilateral"), delta=1e-2, mesh_tolerance=1e-5)
FILE = """
from colloc import *
PROBLEM = Problem("mine", ellipse(0.0, 1.4, 0.8), gait=Harmonic(1, "bilateral"), delta=DELTA, delta_start=0.1, intervals=12)
"""


@pytest.mark.parametrize("place", ["/", "motion/t", "data"])
def test_a_result_to_which_somebody_added_something_is_not_lost(place, once, tmp_path):
    """A remark, or measured data; changed numbers of its own are found by `colloc verify`."""
    quick, path = once("quick of files", lambda: solve(QUICK, 1)), tmp_path / "quick.h5"
    for again in (save_result(quick, path), save_result(quick, path)):
        assert again[0].former is None
    with h5py.File(path, "a") as file:
        given = file.create_dataset("data", data=[1.0]) if place == "data" else file[place]
        given.attrs["remark"] = "measured on the robot"
    (saved,) = save_result(load(path), path)
    assert saved.why == "the former result, which holds more than colloc wrote,"
    with h5py.File(saved.former) as file:
        assert file[place].attrs["remark"] == "measured on the robot"
    with h5py.File(path) as file:
        assert place not in file or "remark" not in file[place].attrs
    (again,) = save_result(quick, path)
    assert again.former is None


def test_a_delta_that_was_lowered_for_a_small_gait_is_that_of_the_result_as_read(tmp_path):
    """Its motion, and what it is worth, are of the lower one; the problem is as it was stated."""
    law = Friction(mu_t=0.5, mu_f=1, mu_b=5)
    problem = Problem("tiny", friction=law, gait=Harmonic(1, "bilateral"), delta=0.02)
    solution = solve(problem.with_(guess=latin_hypercube_gait(problem, 0, 0)), 1)
    assert solution.answer.delta < 0.5 * solution.problem.delta
    assert solution.status == "solved"
    assert on_speed_floor(problem, solution.gait)
    for said in ("more efficient still", f"lowered from 0.02 to {solution.answer.delta:.1g}"):
        assert said in solution.message
    checks = {check.name: check.value for check in solution.certificate.checks}
    assert abs(checks["delta influence"]) < 1e-2
    again = load(save(solution, tmp_path / "tiny.h5"))
    assert again.answer.delta == again.answer.problem.delta == solution.answer.delta
    assert again.problem.delta == 0.02
    assert (again.status, again.value) == (solution.status, solution.value)
    t = np.linspace(0, 1, 7)
    np.testing.assert_array_equal(again.sample(t).z, solution.sample(t).z)


def tenfold(number):
    return 10 * number


def test_rows_that_the_disk_refused_are_written_when_it_takes_them_again(tmp_path, monkeypatch):
    def full(*_):
        raise StoreError("the disk is full.")

    path = tmp_path / "x.run.sqlite"
    run = Run(path, QUICK)
    run.result(tenfold, (1.0,))
    with monkeypatch.context() as patch:
        patch.setattr(run_module, "put_rows", full)
        with pytest.warns(ReadOnlyRunWarning, match="the disk is full"):
            run.write()
        run.result(tenfold, (2.0,))
    run.write()
    rows = read_rows(path, ROWS)
    assert sorted(value for key, value in rows.items() if key != "problem") == [10.0, 20.0]
    again = Run(path, QUICK)
    assert [again.result(tenfold, (x,)) for x in (1.0, 2.0)] == [10.0, 20.0]
    assert again.n_reused == 2


def test_what_another_process_computed_is_in_the_file_of_the_run(tmp_path):
    other = Run(problem=QUICK, stores=True)
    other.result(tenfold, (1.0,))
    run = Run(tmp_path / "x.run.sqlite", QUICK)
    run.update(other.rows)
    run.write()
    again = Run(tmp_path / "x.run.sqlite", QUICK)
    assert (again.result(tenfold, (1.0,)), again.n_reused) == (10.0, 1)


def test_round_trip_keeps_everything(three_link, tmp_path):
    again = load(save(three_link, tmp_path / "a b" / "ü.h5"))
    assert again.problem.hash == three_link.problem.hash
    assert again.status == "solved"
    assert again.certificate == three_link.certificate
    assert again.source == three_link.source
    assert Tolerances(**again.settings["tolerances"]) == TOLERANCES
    assert SearchOptions(**again.settings["options"]) == OPTIONS
    assert len(again.history) == len(three_link.history)
    assert again.starts == three_link.starts > 1
    assert [other.value for other in again.others] == [other.value for other in three_link.others]
    assert again.others[0].value == pytest.approx(again.value, rel=1e-2)  # on a coarse mesh
    np.testing.assert_array_equal(again.answer.x, three_link.answer.x)
    t = np.linspace(0, 2, 11)
    np.testing.assert_array_equal(again.sample(t).tail, three_link.sample(t).tail)


def test_an_answer_among_gaits_larger_than_the_guess_is_read_back(three_link, tmp_path):
    """The search may go on among gaits that are faster than the usual first guess."""
    gait = three_link.gait
    larger = three_link.answer.problem.with_(smallest_shape_speed=gait.shape_speed, guess=gait)
    answer = dataclasses.replace(three_link.answer, problem=larger)
    small = three_link.problem.with_(guess=gait.scaled(0.5))
    found = dataclasses.replace(three_link, problem=small, answer=answer)
    again = load(save(found, tmp_path / "x.h5"))
    assert again.answer.problem.hash == larger.hash
    assert again.problem.hash == small.hash
    said = certify_answer(small, answer).message
    assert f"no better gait with a shape speed of {gait.shape_speed:.2g} or more" in said


@pytest.mark.parametrize("name", ["distance", "work_error", "value_at_zero_delta", "value"])
def test_a_certificate_that_lacks_a_number_or_has_several_is_refused(name, three_link, tmp_path):
    path, said = save(three_link, tmp_path / "x.h5"), f"attribute {name} of /certificate is missing"
    with h5py.File(path, "a") as file:
        del file["certificate"].attrs[name]
        if name == "value":
            file["certificate"].attrs[name], said = [0.26, 0.27], "TypeError"
    with pytest.raises(StoreError, match=f"not a readable colloc solution: {said}"):
        load(path)


def test_xarray_opens_every_group_of_a_solution_with_named_dimensions(three_link, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    path = save(three_link, tmp_path / "x.h5")
    sizes = {}
    for group in ("/", "gait", "motion", "certificate", "answer", "history"):
        with xarray.open_dataset(path, group=group, engine="h5netcdf") as data:
            assert not any(name.startswith("phony_dim") for name in data.sizes)
            known = "joint harmonic t velocity axis check edge variable constraint step"
            assert set(data.dims) <= set(known.split())
            sizes |= data.sizes
            if group == "motion":
                assert data.joint_angles.dims == ("joint", "t")
                assert data.t.values[-1] == 1.0
                np.testing.assert_array_equal(data.centre, three_link.sample(data.t.values).centre)
    assert (sizes["joint"], sizes["axis"], sizes["velocity"]) == (2, 2, 3)
    assert sizes["check"] == len(three_link.certificate.checks)


def valued(solution, value, **changes):
    """The solution with another certified value, of the same problem with some fields changed."""
    problem = solution.problem.with_(**changes) if changes else solution.problem
    quantities = solution.certificate.values | {"distance": value * solution.certificate.work}
    certificate = replace(solution.certificate, value=value, values=quantities)
    return replace(solution, problem=problem, certificate=certificate)


def values(folder):
    """Certified values of all results of a folder, by the names of their files."""
    return {path.name: load(path).certificate.value for path in folder.glob("*.h5")}


@pytest.mark.parametrize(
    "changes",
    [{"delta": 2e-4}, {"name": "other"}, {"joint_limit": 3.0}, {"at_least": {"distance": 0.1}}],
)
def test_the_result_of_another_problem_is_kept_under_another_name(changes, three_link, tmp_path):
    path = tmp_path / "x.h5"
    save_result(valued(three_link, 0.2), path)
    (saved,) = save_result(valued(three_link, 0.9, **changes), path)
    assert (saved.path, saved.former) == (path, tmp_path / "x.former-1.h5")
    assert "of another problem called three_link" in saved.why
    assert values(tmp_path) == {"x.h5": 0.9, "x.former-1.h5": 0.2}


def test_a_better_answer_to_the_same_question_is_kept_no_worse_or_equal_one(three_link, tmp_path):
    path = tmp_path / "x.h5"
    pairs = (0.2, None), (0.3, None), (0.3 - 1e-9, None), (0.25, 1), (0.3, None), (0.1, 1)
    for value, former in pairs:
        (saved,) = save_result(valued(three_link, value, intervals=30 + int(100 * value)), path)
        assert saved.former == (former and tmp_path / "x.former-1.h5")
        assert load(path).certificate.value == value
    assert values(tmp_path) == {"x.h5": 0.1, "x.former-1.h5": 0.3}
    assert "which is better (0.3, best of 32 starts)" in saved.why


@pytest.mark.skipif(
    sys.platform != "linux" or shutil.which("cc") is None,
    reason="a library that is preloaded stands for the system",
)
def test_on_a_file_system_without_locks_a_result_is_read_and_replaced(three_link, tmp_path):
    """As the system says it there: to HDF5, which locks what it opens, as to Python."""
    path, source, library = (tmp_path / name for name in ("x.h5", "flock.c", "flock.so"))
    source.write_text(
        "#include <errno.h>\nint flock(int file, int how) { errno = ENOLCK; return -1; }\n"
    )
    subprocess.run(["cc", "-shared", "-fPIC", source, "-o", library], check=True)
    save_result(three_link, path)
    code = f"""if True:
        from pathlib import Path
        from colloc.results.store import save_result
        from colloc.results.store import load
        path = Path({str(path)!r})
        print(save_result(load(path), path)[0].former)"""
    how = {"env": {**os.environ, "LD_PRELOAD": str(library)}, "capture_output": True, "text": True}
    ran = subprocess.run([sys.executable, "-c", code], **how)
    assert (ran.stdout, ran.stderr) == ("None\n", "")


def test_what_belongs_to_a_result_goes_with_it(three_link, tmp_path):
    path = tmp_path / "x.h5"
    small = replace(valued(three_link, 0.3), shrunk=valued(three_link, 0.2))
    assert [saved.path.name for saved in save_result(small, path)] == ["x.h5", "x.shrunk.h5"]
    (tmp_path / "x.png").write_bytes(b"its figure")
    save_result(valued(three_link, 0.3, delta=2e-4), path)
    assert values(tmp_path) == {"x.h5": 0.3, "x.former-1.h5": 0.3, "x.former-1.shrunk.h5": 0.2}
    assert (tmp_path / "x.former-1.png").read_bytes() == b"its figure"
    assert not (tmp_path / "x.png").exists()


def test_what_cannot_be_read_is_kept(three_link, tmp_path):
    (tmp_path / "x.h5").write_bytes(b"somebody's data")
    (saved,) = save_result(three_link, tmp_path / "x.h5")
    assert saved.former.read_bytes() == b"somebody's data"
    assert load(tmp_path / "x.h5").certificate == three_link.certificate


@pytest.mark.parametrize("linked", [True, False])
def test_where_no_result_can_be_written_all_stays(linked, three_link, tmp_path, monkeypatch):
    path = tmp_path / "x.h5"
    save_result(replace(valued(three_link, 0.2), shrunk=valued(three_link, 0.1)), path)
    (tmp_path / "x.png").write_bytes(b"its figure")
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}

    def full(*_):
        raise StoreError("cannot write: No space left on device.")

    def without_links(*_):
        raise OSError("not supported")

    monkeypatch.setattr(store, "save", full)
    if not linked:
        monkeypatch.setattr(os, "link", without_links)
    with pytest.raises(StoreError, match="No space left"):
        save_result(valued(three_link, 0.2, delta=2e-4), path)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


@pytest.mark.skipif(not hasattr(os, "fork"), reason="POSIX processes")
def test_of_many_problems_that_are_saved_at_once_none_is_lost(three_link, tmp_path):
    count, children = 4, []
    for k in range(count):
        solution = valued(three_link, 0.1 + 0.01 * k, delta=1e-4 * (1 + k))
        if (child := os.fork()) == 0:
            code = 1
            try:
                save_result(solution, tmp_path / "x.h5")
                code = 0
            finally:
                os._exit(code)
        children.append(child)
    assert [os.waitpid(child, 0)[1] for child in children] == [0] * count
    assert sorted(values(tmp_path).values()) == [0.1 + 0.01 * k for k in range(count)]


def test_solve_says_where_the_result_of_another_problem_of_this_name_went(tmp_path, capsys):
    for delta in ("2e-2", "1e-2"):
        (tmp_path / "p.py").write_text(FILE.replace("DELTA", delta))
        words = ["solve", f"{tmp_path}/p.py", "--starts", "1", "--output", f"{tmp_path}/"]
        assert colloc(words) in (0, 4)
    said = capsys.readouterr().out
    former = next(tmp_path.glob("mine*.former-1.h5"))
    assert f"the former result, of another problem called mine, is kept as {former}\n" in said
    assert load(former).problem.delta == 2e-2
    assert former.with_suffix(".png").exists()
