"""A result takes its place without loss: what was there and is better, or another, is kept."""

import os
import shutil
import subprocess
import sys
from dataclasses import replace

import pytest

from colloc import StoreError, load
from colloc.commands.main import main as colloc
from colloc.results import store
from colloc.results.store import save_result

FILE = """
from colloc import *
PROBLEM = Problem("mine", ellipse(0.0, 1.4, 0.8), gait=Harmonic(1, "bilateral"), delta=DELTA, delta_start=0.1, intervals=12)
"""


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


def test_a_better_answer_to_the_same_question_is_kept_and_a_worse_or_equal_one_replaced(
    three_link, tmp_path
):
    path = tmp_path / "x.h5"
    pairs = (0.2, None), (0.3, None), (0.3 - 1e-9, None), (0.25, 1), (0.3, None), (0.1, 1)
    for value, former in pairs:
        (saved,) = save_result(valued(three_link, value, intervals=30 + int(100 * value)), path)
        assert saved.former == (former and tmp_path / "x.former-1.h5")
        assert load(path).certificate.value == value
    assert values(tmp_path) == {"x.h5": 0.1, "x.former-1.h5": 0.3}
    assert "which is better (0.3, best of 8 starts)" in saved.why


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
def test_where_the_new_result_cannot_be_written_all_stays_as_it_was(
    linked, three_link, tmp_path, monkeypatch
):
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
    count, children = 8, []
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
