"""What files keep: changed by hand, refused by the disk, or read again with more than was asked."""

import h5py
import numpy as np
import pytest

from colloc import Friction, Harmonic, Problem, load, save, solve
from colloc.gaits.starts import latin_hypercube_gait, on_speed_floor
from colloc.results.kept import save_result
from colloc.search import checkpoint as run_module
from colloc.search.checkpoint import ROWS, Run
from colloc.system.errors import ReadOnlyRunWarning, StoreError
from colloc.system.row_file import read_rows

QUICK = Problem("quick", gait=Harmonic(1, "bilateral"), delta=1e-2, mesh_tolerance=1e-5)


@pytest.fixture(scope="module")
def quick(once):
    return once("quick of files", lambda: solve(QUICK, 1))


@pytest.mark.parametrize("place", ["/", "motion/t", "data"])
def test_a_result_to_which_somebody_added_something_is_not_lost_when_the_problem_is_solved_again(
    place, quick, tmp_path
):
    """A remark, or measured data; changed numbers of its own are found by `colloc verify`."""
    path = tmp_path / "quick.h5"
    for again in (save_result(quick, path), save_result(quick, path)):
        assert again[0].former is None
    with h5py.File(path, "a") as file:
        (file.create_dataset("data", data=[1.0]) if place == "data" else file[place]).attrs[
            "remark"
        ] = "measured on the robot"
    (saved,) = save_result(load(path), path)
    assert saved.why == "the former result, which holds more than colloc wrote,"
    with h5py.File(saved.former) as file:
        assert file[place].attrs["remark"] == "measured on the robot"
    with h5py.File(path) as file:
        assert place not in file or "remark" not in file[place].attrs
    (again,) = save_result(quick, path)
    assert again.former is None


def test_bounds_for_dry_friction_are_read_again_with_a_result(quick, tmp_path):
    assert quick.success
    assert quick.certificate.dry is None
    assert load(save(quick, tmp_path / "a.h5")).certificate.dry is None
    again = load(save(quick, tmp_path / "b.h5"))
    again.certify_dry()
    least, most = again.certificate.dry
    assert least < most < quick.efficiency + 0.1
    assert load(save(again, tmp_path / "c.h5")).certificate.dry == (least, most)


def test_a_delta_that_was_lowered_for_a_small_gait_is_that_of_the_result_as_read(tmp_path):
    """Its motion, and what it is worth, are of the lower one; the problem is as it was stated."""
    problem = Problem(
        "tiny",
        friction=Friction(mu_t=0.5, mu_f=1, mu_b=5),
        gait=Harmonic(1, "bilateral"),
        delta=0.02,
    )
    solution = solve(problem.with_(guess=latin_hypercube_gait(problem, 0, 0)), 1)
    assert solution.answer.delta < 0.5 * solution.problem.delta
    assert solution.status == "solved"
    assert on_speed_floor(problem, solution.gait)
    assert f"lowered from 0.02 to {solution.answer.delta:.1g}" in solution.message
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
    path = tmp_path / "x.run.sqlite"
    run = Run(path, QUICK)
    run.result(tenfold, (1.0,))
    with monkeypatch.context() as patch:
        patch.setattr(
            run_module,
            "put_rows",
            lambda *_: (_ for _ in ()).throw(StoreError("the disk is full.")),
        )
        with pytest.warns(ReadOnlyRunWarning, match="the disk is full"):
            run.write()
        run.result(tenfold, (2.0,))
    run.write()
    assert sorted(value for key, value in read_rows(path, ROWS).items() if key != "problem") == [
        10.0,
        20.0,
    ]
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
