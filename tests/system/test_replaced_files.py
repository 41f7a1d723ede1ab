"""Full disks, closed folders, two writers: a clear error or both results, never a broken file."""

import contextlib
import errno
import glob
import io
import multiprocessing
import os
import resource
import sys
import tempfile
import time
from pathlib import Path

import pytest
from shared.store_samples import KINDS, ROW_KINDS, Samples, outcome, problem, record

from colloc import CollocError, StoreError
from colloc.commands.families import multistart as show_archive
from colloc.results.archive import StartName, archive_at, open_archive
from colloc.studies.sweep import append_visits, read_journal
from colloc.system.files import alone_in, lock_file, replaced_file
from colloc.system.row_file import CACHE, put_rows, read_rows

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX limits and processes")


@contextlib.contextmanager
def no_file_larger_than(size):
    """What a write beyond `size` meets is an error of the system, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def samples(three_link, tmp_path):
    return Samples(tmp_path / "ö results", three_link)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.05, 0.6, 0.98])
def test_a_full_disk_is_a_clear_error_and_keeps_the_old_file(samples, kind, share):
    path = samples.write(kind)
    before, names = samples.read(kind), sorted(p.name for p in path.parent.iterdir())
    size = path.stat().st_size
    refused = pytest.raises(CollocError, match="cannot write")
    with no_file_larger_than(int(share * size)), refused as caught:
        samples.write(kind, 1)
    assert str(path.parent) in str(caught.value)
    assert samples.read(kind) == before
    assert sorted(p.name for p in path.parent.iterdir()) == names
    samples.write(kind, 1)
    assert samples.read(kind) != before


def in_child(function, *arguments):
    """Exit code of a forked process that runs a function; 77 for an exception."""
    pid = os.fork()
    if pid == 0:
        code = 77
        try:
            code = function(*arguments) or 0
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def in_child_that_cannot_write(folder, root, function):
    """The same of one who may not write into the folder, but pass through those above it."""
    temporary = Path(tempfile.gettempdir())
    top = temporary if root.is_relative_to(temporary) else root.parent
    inside = [p for p in folder.parents if p.is_relative_to(top) and p != top]
    before = {p: p.stat().st_mode for p in inside}

    def powerless():
        if os.geteuid() == 0:
            os.setuid(65534)  # nobody: permissions do not stop the superuser
        else:
            os.chmod(folder, 0o555)
        return function()

    try:
        for p, mode in before.items():
            p.chmod(mode | 0o011)
        return in_child(powerless)
    finally:
        for p, mode in before.items():
            p.chmod(mode)


def test_a_folder_that_cannot_be_written_is_refused_at_once(samples, tmp_path, tmp_path_factory):
    temporary = Path(tempfile.gettempdir()).stat().st_mode
    folder = tmp_path / "locked away"
    folder.mkdir(mode=0o755)

    def attempt():
        refused = 0
        for kind in KINDS:
            samples.folder = folder
            with contextlib.suppress(PermissionError):
                os.makedirs(folder, exist_ok=True)
            try:
                samples.write(kind)
            except CollocError as error:
                refused += "cannot write" in str(error) and str(folder) in str(error)
        return 10 * (refused == len(KINDS))

    assert in_child_that_cannot_write(folder, tmp_path_factory.getbasetemp(), attempt) == 10
    assert list(folder.iterdir()) == []
    assert Path(tempfile.gettempdir()).stat().st_mode == temporary


def test_an_archive_is_read_where_nothing_can_be_written(tmp_path, tmp_path_factory):
    folder = tmp_path / "published"
    kept = open_archive(problem(), folder / "a.h5")
    kept.add({StartName("sobol", 3, k): outcome(k, (4 + k) / 8) for k in range(4)})
    folder.chmod(0o755)
    before = sorted(p.name for p in folder.iterdir())

    def shown():
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            code = show_archive([str(folder / "a.h5")])
        return 10 * (code == 0) + ("4 starts: 4 solved" in said.getvalue())

    assert in_child_that_cannot_write(folder, tmp_path_factory.getbasetemp(), shown) == 11
    assert sorted(p.name for p in folder.iterdir()) == before
    assert len(archive_at(folder / "a.h5").outcomes) == 4


def test_a_lock_keeps_other_processes_out_until_its_holder_lets_go(tmp_path):
    def attempt():
        try:
            with lock_file(tmp_path / "lock"):
                return 20
        except StoreError as refused:
            return 10 if f"in use by process {os.getppid()} on" in str(refused) else 0

    with lock_file(tmp_path / "lock"):
        assert in_child(attempt) == 10
    assert in_child(attempt) == 20
    assert [path.name for path in tmp_path.iterdir()] == ["lock"]


@pytest.mark.parametrize("failure", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
@pytest.mark.filterwarnings("ignore:flock not supported")
def test_a_file_system_without_locks_stops_nobody(tmp_path, monkeypatch, failure):
    def refuse(*_):
        raise OSError(failure, os.strerror(failure))

    monkeypatch.setattr("fcntl.flock", refuse)
    ran = []
    for hold in (lock_file(tmp_path / "lock"), alone_in(tmp_path)):
        with hold:
            ran.append(failure)
    assert ran == [failure] * 2


def _write_many(kind, folder, who, count):
    folder = Path(folder)
    for k in range(count):
        if kind == "cache":
            put_rows(folder / "c.sqlite", CACHE, {f"{who}-{k}": {"value": k}})
        elif kind == "archive":
            made = {StartName("sobol", who, k): outcome(k, 0.1 + 0.001 * k)}
            open_archive(problem(), folder / "a.h5").add(made)
        else:
            append_visits(folder, [record(1000 * who + k)])


@pytest.mark.parametrize("kind", ROW_KINDS)
def test_two_writers_at_once_end_with_both_results(kind, tmp_path):
    count = 12
    context = multiprocessing.get_context("fork")
    arguments = [(kind, tmp_path, who, count) for who in (1, 2)]
    writers = [context.Process(target=_write_many, args=each) for each in arguments]
    for step in ("start", "join"):
        for writer in writers:
            getattr(writer, step)()
    if kind == "cache":
        found = set(read_rows(tmp_path / "c.sqlite", CACHE))
        assert found == {f"{who}-{k}" for who in (1, 2) for k in range(count)}
    elif kind == "archive":
        outcomes = open_archive(problem(), tmp_path / "a.h5").outcomes
        assert sorted(outcomes) == [("sobol", who, k) for who in (1, 2) for k in range(count)]
        assert outcomes["sobol", 2, 3].efficiency == 0.1 + 0.001 * 3
    else:
        keys = {f"key{1000 * w + k}" for w in (1, 2) for k in range(count)}
        assert {r.attempts[0].key for r in read_journal(tmp_path)} == keys


def test_readers_see_the_old_file_or_the_new_one_while_it_is_replaced(samples):
    path = samples.write("arrays")
    pid = os.fork()
    if pid == 0:
        for k in range(40):
            samples.write("arrays", k)
        os._exit(0)
    seen = set()
    while os.waitpid(pid, os.WNOHANG)[0] == 0:
        seen.add(samples.read("arrays", path)["a/b"][0])
    assert seen <= set(map(float, range(40)))
    assert len(seen) > 1


def die_while_writing(path):
    with replaced_file(path):
        os._exit(9)


def test_what_a_killed_process_left_is_swept_after_an_hour_and_what_others_write_is_not(tmp_path):
    killed, foreign = tmp_path / "x[1].h5", tmp_path / ".movie.mp4.part"
    assert in_child(die_while_writing, killed) == 9
    (left,) = tmp_path.glob(f".{glob.escape(killed.name)}.*.part")
    foreign.write_bytes(b"not ours")
    os.utime(foreign, (0, 0))
    for age, there in ((3590, [".movie.mp4.part", left.name]), (3605, [".movie.mp4.part"])):
        os.utime(left, (time.time() - age,) * 2)
        with replaced_file(tmp_path / "y.h5") as name:
            Path(name).write_bytes(b"whole")
        assert sorted(p.name for p in tmp_path.iterdir()) == [*there, "y.h5"]


@pytest.mark.parametrize("moment", ["close", "fsync", "replace"])
def test_ctrl_c_at_any_moment_leaves_no_temporary_file(moment, tmp_path, monkeypatch):
    def pressed(*_):
        raise KeyboardInterrupt

    (tmp_path / "x").write_text("old")
    monkeypatch.setattr(f"colloc.system.files.os.{moment}", pressed)
    with pytest.raises(KeyboardInterrupt), replaced_file(tmp_path / "x") as name:
        Path(name).write_text("new")
    monkeypatch.undo()
    assert [p.name for p in tmp_path.iterdir()] == ["x"]
    assert (tmp_path / "x").read_text() == "old"
