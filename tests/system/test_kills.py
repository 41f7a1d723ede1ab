"""kill -9 at 120 random moments of a solve, a multi-start and a study: nothing finished is lost.

A fork is killed after a random time or, every other cycle, within milliseconds of a write. What it
said through a pipe that it had finished must be found, and the next cycle goes on in its folder.
"""

import contextlib
import json
import os
import select
import signal
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import h5py
import numpy as np
import pytest
from shared.store_samples import load_study

from colloc.commands.families import multistart
from colloc.commands.families import sweep as sweep_study
from colloc.commands.solve import solve
from colloc.gaits.problem_file import read_problem_file
from colloc.results import store
from colloc.results.archive import Archive, open_archive
from colloc.search.checkpoint import ROWS
from colloc.studies import solve as campaign
from colloc.studies import sweep as study_run
from colloc.studies.sweep import read_journal
from colloc.system import task_pool
from colloc.system.row_file import read_rows

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="forks and kills"),
]
CYCLES = 120
RAISED = 99
PROBLEM = """
from colloc import *
PROBLEM = Problem("tiny", ellipse(0, 2.8, 1.3), gait=Harmonic(1, "bilateral"), delta=1e-2, delta_start=1e-2, intervals=8,
                  mesh_tolerance=0.0)
"""
STUDY = """
from colloc import *
from colloc.studies.study import Axis, Study
def problem(mu_t):
    return Problem("tiny", ellipse(0, 2.8, 1.3), gait=Harmonic(1, "bilateral"), friction=Friction(mu_t=mu_t, mu_f=1, mu_b=1),
                   delta=1e-2, delta_start=1e-2, intervals=8, mesh_tolerance=0.0)
STUDY = Study("tiny", (Axis("mu_t", (1.0, 1.05, 1.1, 1.15)),), problem, cold_starts=0, warm_starts=1)
"""


def told(say, name, function, facts):
    """The function, saying when it begins to write and, once it has returned, what is finished."""

    def wrapped(*arguments, **options):
        say({"begins": name})
        result = function(*arguments, **options)
        say({"finished": facts(*arguments)})
        return result

    return wrapped


def child(kind, folder, pipe):
    """Run a command to its end, in a forked process."""

    def say(message):
        os.write(pipe, json.dumps(message).encode() + b"\n")

    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    if kind == "solve":
        campaign.save_result = told(say, kind, campaign.save_result, solve_facts)
        return solve([str(folder / "p.py"), "--output", str(folder), "--no-figure", "--quiet"])
    if kind == "multistart":
        campaign.run_starts = partial(campaign.run_starts, executor=ThreadPoolExecutor)
        Archive.add = told(say, kind, Archive.add, lambda archive, _: start_facts(archive.outcomes))
        words = ["--output", str(folder), "--starts", "4", "--quiet"]
        return multistart([str(folder / "p.py"), *words])
    task_pool.process_pool = ThreadPoolExecutor
    appended = study_run.append_visits
    study_run.append_visits = told(say, kind, appended, lambda _, visits: attempt_facts(visits))
    return sweep_study([str(folder / "s.py"), "--output", str(folder), "--quiet"])


def solve_facts(solution, path):
    return {"result": solution.answer.x.sum()}


def start_facts(outcomes):
    return {str(name): outcome.gait.cos.sum() for name, outcome in outcomes.items()}


def attempt_facts(visits):
    return {
        f"{r.problem_hash} {a.key}": a.outcome.gait.cos.sum() for r in visits for a in r.attempts
    }


def kept(kind, folder):
    """What the files of a folder hold; every file that is there must be whole."""
    if kind == "solve":
        facts = {}
        read_rows(folder / "tiny.run.sqlite", ROWS)
        for name in ("tiny.failed.h5", "tiny.h5"):
            if (folder / name).exists():
                facts |= solve_facts(store.load(folder / name), folder / name)
        return facts
    if kind == "multistart":
        found = open_archive(read_problem_file(folder / "p.py").problem, folder / "tiny.starts.h5")
        if (folder / "tiny.starts.h5").exists():
            with h5py.File(folder / "tiny.starts.h5") as file:
                assert file["start"].size <= len(found.outcomes)
        return start_facts(found.outcomes)
    if (folder / "tiny.nc").exists():
        load_study(folder / "tiny.nc")
    return attempt_facts(read_journal(folder / "tiny.study"))


def cycle(kind, folder, rng, longest, at_a_write):
    """Run and kill; what the run said it had finished, and whether it was killed before its end."""
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        code = RAISED
        with contextlib.suppress(BaseException):
            os.close(read)
            code = child(kind, folder, write)
        os._exit(code)
    os.close(write)
    os.set_blocking(read, False)
    begin, said = time.perf_counter(), b""
    wait = rng.uniform(0, longest)
    writes = int(rng.integers(1, 4)) if at_a_write else 10**9
    while time.perf_counter() - begin < (20 * longest if at_a_write else wait):
        if select.select([read], [], [], 0.001)[0]:
            got = os.read(read, 2**16)
            if not got:
                break
            said += got
        if said.count(b'"begins"') >= writes:
            time.sleep(rng.uniform(0, 0.02))
            break
    os.kill(pid, signal.SIGKILL)
    status = os.waitpid(pid, 0)[1]
    assert os.waitstatus_to_exitcode(status) != RAISED, f"{kind} ended by itself, in an exception"
    os.set_blocking(read, True)
    with os.fdopen(read, "rb") as rest:
        said += rest.read()
    finished = {}
    for line in said.decode().splitlines(keepends=True):
        if line.endswith("\n"):
            finished |= json.loads(line).get("finished", {})
    return finished, os.WIFSIGNALED(status)


def test_nothing_finished_is_lost_in_120_kills(tmp_path):
    rng = np.random.default_rng(7)
    seen = Counter()
    for kind, whole in (("solve", 1), ("multistart", 4), ("sweep", 4)):
        longest, number, before = 3.0, 0, {}
        folder = tmp_path / f"{kind} 0"
        folder.mkdir()
        kills = 0
        while kills < CYCLES // 3:
            (folder / "p.py").write_text(PROBLEM)
            (folder / "s.py").write_text(STUDY)
            begin = time.perf_counter()
            finished, killed = cycle(kind, folder, rng, longest, at_a_write=bool(kills % 2))
            found = kept(kind, folder)
            for key, value in (before | finished).items():
                assert found[key] == value, f"{kind}: {key} was finished, and is lost or changed"
            kills += killed
            seen[f"{kind}: killed"] += killed
            seen[f"{kind}: results checked"] += len(before | finished)
            before = found
            if not killed:
                longest = time.perf_counter() - begin
            if len(found) >= whole:
                number, before = number + 1, {}
                folder = tmp_path / f"{kind} {number}"
                folder.mkdir()
        left = list(tmp_path.rglob(".*.part"))
        seen[f"{kind}: temporary files left"] = len(left)
    print(dict(seen))
    assert sum(n for name, n in seen.items() if name.endswith("killed")) >= 100
    assert all(seen[f"{kind}: results checked"] > 10 for kind in ("solve", "multistart", "sweep"))
