"""The pool: no loss with a worker, order may depend on results, one BLAS thread a process."""

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import ClassVar

import numpy as np
import pytest

from colloc.system.task_pool import LostTask, Task, pool_for, process_pool, run_tasks

UNGUARDED = {
    "colloc's": "import colloc\nfrom operator import neg as task",
    "its own": "def task(x):\n    return -x",
}
PROGRAM = "from colloc.system.environment import one_thread_each; one_thread_each(); import os; print(os.environ['OPENBLAS_NUM_THREADS'])"


def listed(tasks):
    waiting = iter(tasks)
    return lambda: next(waiting, None)


def doubled(x):
    return 2 * x


def dying_once(x, folder):
    """Kills its own process the first time it is called with 3, and every time with 5."""
    flag = os.path.join(folder, f"died-{x}")
    if x == 5 or (x == 3 and not os.path.exists(flag)):
        open(flag, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    return 2 * x


def threads_in_use(n):
    a = np.random.default_rng(0).normal(size=(n, n))
    for _ in range(3):
        a = a @ a / np.linalg.norm(a)
    return len(os.listdir("/proc/self/task")), os.environ["OPENBLAS_NUM_THREADS"]


def test_a_worker_killed_mid_run_loses_nothing_and_one_that_always_dies_is_named(tmp_path):
    tasks = [Task(x, (x, str(tmp_path))) for x in range(9)]
    ran = run_tasks(dying_once, listed(tasks), workers=2, ahead=2)
    found = {task.key: result for task, result in ran}
    assert {x: r for x, r in found.items() if x != 5} == {x: 2 * x for x in range(9) if x != 5}
    assert isinstance(found[5], LostTask)
    assert "died twice" in found[5].message


def test_results_that_are_there_at_once_come_in_the_order_in_which_their_tasks_were_begun():
    tasks = [Task(x, (x,)) for x in range(50)]
    ran = run_tasks(doubled, listed(tasks), workers=1, executor=pool_for, ahead=49)
    assert [task.key for task, _ in ran] == list(range(50))


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="counts threads in /proc")
def test_blas_threads_do_not_multiply_with_processes(monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    ((_, (count, setting)),) = run_tasks(threads_in_use, listed([Task(0, (600,))]), workers=1)
    assert setting == "1"
    # the main thread, the one that watches the parent, and the queue's feeder if it has started
    assert count <= 3
    assert os.environ["OPENBLAS_NUM_THREADS"] == "4"


@pytest.mark.parametrize("whose", UNGUARDED)
def test_a_script_without_a_main_guard_runs_tasks_on_processes_without_a_word(tmp_path, whose):
    (tmp_path / "script.py").write_text(
        f"""{UNGUARDED[whose]}
from colloc.system.task_pool import Task, run_tasks, pool_for
waiting = iter([Task(x, (x,)) for x in range(3)])
print(sorted(result for _, result in run_tasks(task, lambda: next(waiting, None), workers=2, executor=pool_for)))
""",
        encoding="utf-8",
    )
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "pickle.py").write_text("open('ran', 'w').close()", encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, "../script.py"], cwd=tmp_path / "elsewhere", capture_output=True, text=True
    )
    assert (ran.stdout, ran.stderr) == ("[-2, -1, 0]\n", "")
    assert not (tmp_path / "elsewhere" / "ran").exists()


class Unreliable(Executor):
    """A cluster that gives up: an exception that is no result, every time for 4, once for 2."""

    failed: ClassVar[set] = set()

    def __init__(self, _):
        pass

    def submit(self, function, x):
        future = Future()
        if x == 4 or (x == 2 and 2 not in self.failed):
            self.failed.add(x)
            future.set_exception(ConnectionError("worker gone"))
        else:
            future.set_result(function(x))
        return future

    def shutdown(self, wait=True):
        pass


def test_what_a_cluster_gives_up_on_is_tried_again_alone_and_then_named():
    Unreliable.failed.clear()
    tasks = listed(Task(x, (x,)) for x in range(6))
    ran = run_tasks(doubled, tasks, workers=2, executor=Unreliable)
    found = {task.key: result for task, result in ran}
    assert found[2] == 4
    assert found[4] == LostTask("its worker failed twice (ConnectionError: worker gone).")
    assert sorted(found) == list(range(6))


class Broken(Executor):
    def submit(self, *_):
        raise BrokenProcessPool("cannot start")


def test_a_pool_that_never_starts_is_an_error_and_not_an_endless_loop():
    with pytest.raises(BrokenProcessPool):
        list(run_tasks(doubled, listed([Task(0, (0,))]), workers=2, executor=lambda n: Broken()))


def test_workers_do_not_outlive_a_parent_that_is_killed():
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        with process_pool(1) as pool:
            os.write(write, str(pool.submit(os.getpid).result()).encode())
            time.sleep(60)
        os._exit(0)
    os.close(write)
    worker = int(os.read(read, 100))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    for _ in range(100):
        try:
            with open(f"/proc/{worker}/stat") as file:
                gone = file.read().rpartition(")")[2].split()[0] == "Z"
        except OSError:
            gone = True
        if gone:
            break
        time.sleep(0.05)
    assert gone


def test_ctrl_c_while_a_task_is_handed_over_leaves_the_executors_locks_open():
    """It falls where a lock is taken and no block reopens it: `with lock` of CPython 3.13."""

    class Locked(ThreadPoolExecutor):
        lock = threading.Lock()

        def submit(self, *arguments):
            self.lock.acquire()
            signal.raise_signal(signal.SIGINT)
            self.lock.release()
            return super().submit(*arguments)

    with pytest.raises(KeyboardInterrupt):
        list(run_tasks(doubled, listed([Task(1, (1,))]), workers=1, executor=Locked))
    assert not Locked.lock.locked()


def said(environment):
    return subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
    ).stdout.strip()


def test_linear_algebra_uses_one_thread_unless_the_environment_says_otherwise():
    bare = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    assert said(bare) == "1"
    assert said({**bare, "OPENBLAS_NUM_THREADS": "3"}) == "3"
