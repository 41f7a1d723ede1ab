"""A study on a Dask cluster of which a process is killed, stopped or cannot write: nothing finished
is lost, nothing hangs."""

import json
import signal
import subprocess
import sys
import threading
import time

import pytest
from shared.dask_cluster import DaskProcesses

from colloc.studies.cell import read_journal
from colloc.system.dask_pool import connect
from colloc.system.task_pool import EngineGone, Task, run_tasks

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and limits"),
]
pytest.importorskip("distributed")
STUDY = """
from colloc import *
from colloc.studies.study import Axis, Study
def problem(mu_t):
    return Problem("tiny", ellipse(0, 2.8, 1.3), gait=Harmonic(1, "bilateral"), friction=Friction(mu_t=mu_t, mu_f=1, mu_b=1),
                   delta=1e-2, delta_start=1e-2, intervals=12, mesh_tolerance=1e-4)
STUDY = Study("tiny", (Axis("mu_t", tuple(1 + k / 50 for k in range(CELLS)), travels=False),), problem, cold_starts=0)
"""


def naps(dask, times, workers=2):
    """Tasks that sleep, by number, on a cluster; and a list that grows as they end."""
    executor, _ = connect(dask.address, workers, patience=20.0)
    waiting = iter([Task(k, (seconds,)) for k, seconds in enumerate(times)])
    return run_tasks(time.sleep, lambda: next(waiting, None), workers=workers, executor=executor)


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGSTOP])
def test_the_task_of_a_worker_that_is_killed_or_does_not_answer_goes_to_another(sent):
    with DaskProcesses(SCHEDULER__WORKER_TTL="3s") as dask:
        victim = dask.worker()
        dask.worker()
        run = naps(dask, [0.1, 0.1, 2.0, 2.0, 0.1, 0.1])
        done = [next(run)[0].key]
        threading.Timer(0.5, lambda: victim.send_signal(sent)).start()
        begin = time.monotonic()
        done += [task.key for task, result in run if result is None]
        assert sorted(done) == [0, 1, 2, 3, 4, 5]
        assert time.monotonic() - begin < 60
        if sent == signal.SIGSTOP:  # and back again
            victim.send_signal(signal.SIGCONT)
            assert [task.key for task, result in naps(dask, [0.1, 0.1]) if result is None] == [0, 1]


def test_a_local_cluster_listens_to_this_machine_alone():
    psutil = pytest.importorskip("psutil")
    executor, _ = connect("local", 1)
    try:
        processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
        open_to = [each for process in processes for each in process.net_connections("inet")]
        assert {x.laddr.ip for x in open_to if x.status == "LISTEN"} == {"127.0.0.1"}
    finally:
        executor(1)._client.shutdown()


def test_a_scheduler_that_is_stopped_ends_the_run():
    with DaskProcesses() as dask:
        dask.worker()
        executor, _ = connect(dask.address, 1, patience=3.0)
        waiting = iter([Task(0, (0.0,)), Task(1, (1.0,))])
        run = run_tasks(time.sleep, lambda: next(waiting, None), workers=1, executor=executor)
        next(run)
        dask.scheduler.send_signal(signal.SIGSTOP)
        begin = time.monotonic()
        with pytest.raises(EngineGone, match="gave no answer for 3 s"):
            list(run)
        assert time.monotonic() - begin < 30


def study_file(folder, cells):
    (folder / "s.py").write_text(f"CELLS = {cells}\n{STUDY}")
    words = ["sweep", str(folder / "s.py"), "--output", str(folder / "out")]
    return [sys.executable, "-m", "colloc", *words]


def test_a_killed_scheduler_and_a_killed_run_cost_what_was_under_way(tmp_path):
    command, cells = study_file(tmp_path, 14), 14
    journal = tmp_path / "out" / "tiny.study"

    def finished():
        return len(read_journal(journal)) if journal.exists() else 0

    def until(number):
        for _ in range(1200):
            if finished() >= number:
                return
            time.sleep(0.05)
        pytest.fail(f"{finished()} cells in a minute")

    for victim, most in (("scheduler", 3), ("run", 7)):
        with DaskProcesses() as dask:
            dask.worker()
            piped = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
            run = subprocess.Popen([*command, "--dask", dask.address], text=True, **piped)
            until(most)
            (dask.scheduler if victim == "scheduler" else run).kill()
            said, errors = run.communicate(timeout=90)
            assert run.returncode == (2 if victim == "scheduler" else -signal.SIGKILL)
            if victim == "scheduler":
                assert errors.count("\n") == 1
                assert "is gone; what is done is kept" in errors
            assert finished() >= said.count("round 0:")
    kept = finished()
    assert 7 <= kept < cells
    done = subprocess.run([*command, "--json"], capture_output=True, text=True)
    assert json.loads(done.stdout)["counts"] == {"solved": cells}
    keys = [(each.problem_hash, a.key) for each in read_journal(journal) for a in each.attempts]
    assert len(keys) == len(set(keys))  # nothing was solved twice
