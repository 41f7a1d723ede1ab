"""Other processes compute ahead what a search asks for: its answer does not depend on them, nor on
what becomes of them."""

import os
import signal
import time
from types import SimpleNamespace

import pytest

import colloc
from benchmarks.kills import contents
from colloc import Harmonic, Problem
from colloc.search import checkpoint as ahead
from colloc.search.checkpoint import Ahead, Run
from colloc.search.explore import explore, sketch
from colloc.search.options import SearchOptions

PROBLEM = Problem(
    "quick",
    gait=Harmonic(1, "none"),
    delta=1e-2,
    delta_start=0.1,
    intervals=12,
    mesh_tolerance=1e-3,
)


@pytest.fixture
def received(monkeypatch):
    """Processes begin at once; of each task of theirs, the number of rows and the run."""
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.setattr(ahead, "OPTIONS", SearchOptions(worth_a_process=0.0))
    update, numbers = Run.update, []

    def counted(run, rows):
        numbers.append((len(rows), run))
        update(run, rows)

    monkeypatch.setattr(Run, "update", counted)
    return numbers


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    path = tmp_path_factory.mktemp("alone") / "quick.h5"
    assert colloc.solve(PROBLEM, starts=8, output=path).status == "solved"
    return contents(path)


def test_the_file_is_the_same_to_the_last_bit(alone, received, tmp_path, monkeypatch):
    wait_for = Ahead.wait_for

    def patient(self, *task):
        until = time.monotonic() + 60.0
        while not all(f.done() for f in self._futures.values()) and time.monotonic() < until:
            time.sleep(0.01)
        wait_for(self, *task)

    monkeypatch.setattr(Ahead, "wait_for", patient)
    colloc.solve(PROBLEM, starts=8, output=tmp_path / "quick.h5")
    assert sum(n_rows > 0 for n_rows, _ in received) > 1
    assert received[0][1].n_reused > 0.5 * sum(n_rows for n_rows, _ in received)
    assert contents(tmp_path / "quick.h5") == alone


def _die(problem, task):
    os.kill(os.getpid(), signal.SIGKILL)


def test_so_it_is_if_they_die(alone, received, tmp_path, monkeypatch):
    monkeypatch.setattr(ahead, "_rows_of", _die)
    colloc.solve(PROBLEM, starts=8, output=tmp_path / "quick.h5")
    assert not received
    assert contents(tmp_path / "quick.h5") == alone


def test_none_is_begun_for_what_this_process_alone_knows_nor_for_little(received, monkeypatch):
    run = Run(problem=PROBLEM)
    run.problem = SimpleNamespace(law=lambda: 0)
    run.ahead.begin(1e3)
    assert run.ahead.count == 0
    monkeypatch.setattr(ahead, "OPTIONS", SearchOptions(worth_a_process=2.0))
    some = Run(problem=PROBLEM).ahead
    some.begin(1.9)
    assert some.count == 0
    some.begin(2.1)
    assert some.count == 2
    some.end()


def test_none_is_begun_where_a_stage_is_called_by_itself(received):
    assert explore(PROBLEM, starts=4).starts >= 4
    assert not received


def test_files_of_the_folder_are_not_run(received, tmp_path, monkeypatch):
    (tmp_path / "random.py").write_text("open('ran', 'w').close()", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    some = Run(problem=PROBLEM).ahead
    some.begin(1e3)
    for _ in range(2):  # what is asked for twice is computed once
        some.submit(1, sketch, PROBLEM, PROBLEM.guess, True, [0.1, 0.01])
    (future,) = some._futures.values()
    future.result(timeout=60)
    for _ in range(2):
        some.wait_for(sketch, PROBLEM, PROBLEM.guess, True, [0.1, 0.01])
    some.end()
    assert len(received) == 1
    assert received[0][0] > 0
    assert not (tmp_path / "ran").exists()
