"""What a run keeps: an interrupted solve, or one with helpers, ends as if nothing had happened."""

import functools
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import colloc
from benchmarks.kills import command as solve_command
from benchmarks.kills import contents
from colloc import BSpline, Chain, Friction, Harmonic, ModalBody, Polygon, Problem, ellipse, load
from colloc.commands.solve import summary_lines
from colloc.gaits.problem_file import read_problem_file
from colloc.gaits.starts import is_visible, on_speed_floor
from colloc.results.checks import UNCERTIFIED
from colloc.search import checkpoint as ahead
from colloc.search.checkpoint import ROWS, STAGES, Ahead, Run, active_run
from colloc.search.explore import explore, first_optimum, sketch
from colloc.search.optimise import descend
from colloc.search.options import SearchOptions
from colloc.search.solve import certify_answer, choose, solve
from colloc.system.files import run_file
from colloc.system.row_file import put_rows, read_rows
from tests.shared.cases import slow_but

AT = {"delta": 1e-2, "delta_start": 0.1, "intervals": 12, "mesh_tolerance": 1e-3}
QUICK = Problem("quick", gait=Harmonic(1, "bilateral"), **AT)
FILE = """
from colloc import *
PROBLEM = Problem("quick", gait=Harmonic(1, "bilateral"), friction=Friction(mu_t=2, mu_f=1, mu_b=1.4), delta=1e-3)
"""
SERIES = colloc.Fourier([0.2, 0.0, -0.1], [[1.0], [0.2], [-0.8]], [[0.3], [1.1], [0.5]])
WIDE = ellipse(1.0, 0.7, 1.1)
PROBLEMS = [
    QUICK,
    Problem("series", SERIES, Chain((0.3, 0.2, 0.2, 0.3)), gait=Harmonic(1), **AT),
    Problem("spline", WIDE, gait=BSpline(8, symmetry="bilateral"), **AT),
    Problem("sides", WIDE, gait=Polygon(4, "bilateral"), **AT | {"intervals": 24}),
    QUICK.with_(name="uphill", guess=ellipse(0, 2.8, 1.3), grade=0.1, delta_start=None),
    Problem(
        "modes", None, ModalBody(2, panels=4), gait=Harmonic(1, "antipodal"), **AT | {"delta": 0.1}
    ),
]
PROBLEM = Problem("quick", gait=Harmonic(1, "none"), **AT)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The problem, and the contents of the file that an undisturbed solve of it leaves."""
    folder = tmp_path_factory.mktemp("undisturbed")
    (folder / "quick.py").write_text(FILE, encoding="utf-8")
    found = colloc.solve(folder / "quick.py", starts=4, output=folder / "quick.h5")
    assert found.status == "solved", found.message
    assert [path.name for path in folder.glob("quick.*") if path.suffix != ".py"] == ["quick.h5"]
    return folder / "quick.py", contents(folder / "quick.h5")


class Stop:
    """Raises KeyboardInterrupt, once, as the kept value of a number appears."""

    def __init__(self, number, monkeypatch):
        self.left = number
        result = Run.result

        def stopping(run, stage, arguments):
            value = result(run, stage, arguments)
            self.left -= 1
            if self.left == 0:
                raise KeyboardInterrupt
            return value

        monkeypatch.setattr(Run, "result", stopping)


@pytest.mark.parametrize("number", slow_but([8], [1, 3, 5, 8, 12, 14]))
def test_an_interrupted_solve_goes_on_to_the_same_file(undisturbed, tmp_path, monkeypatch, number):
    file, wanted = undisturbed
    path = tmp_path / "quick.h5"
    with monkeypatch.context() as patch:
        stop = Stop(number, patch)
        first = colloc.solve(file, starts=4, output=path)
    assert stop.left <= 0
    assert first.status == "interrupted"
    assert "best gait so far" in first.message
    assert load(path.with_suffix(".interrupted.h5")).status == "interrupted"
    assert not path.exists()
    assert len(read_rows(run_file(path), ROWS)) >= number
    assert colloc.solve(file, starts=4, output=path).status == "solved"
    assert contents(path) == wanted
    assert [each.name for each in tmp_path.iterdir()] == ["quick.h5"]


@pytest.mark.slow
@pytest.mark.parametrize("asked", [signal.SIGINT, signal.SIGKILL])
def test_so_does_the_command_after_a_signal(undisturbed, tmp_path, asked):
    file, wanted = undisturbed
    command = [word for word in solve_command(file, tmp_path) if word != "--quiet"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    time.sleep(1.0)
    process.send_signal(asked)
    said = process.communicate(timeout=60)[1]
    if process.returncode == 130 and (tmp_path / "quick.interrupted.h5").exists():
        assert "the same command goes on from there" in said
    assert "solved" in subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert contents(tmp_path / "quick.h5") == wanted
    assert [each.name for each in tmp_path.iterdir()] == ["quick.h5"]


@pytest.mark.slow
def test_nothing_is_computed_twice_however_often_a_solve_is_interrupted(tmp_path, monkeypatch):
    path, result, computed = tmp_path / "x.run.sqlite", Run.result, []

    def counted(run, stage, arguments):
        @functools.wraps(stage)
        def compute(*arguments):
            computed.append(stage.__name__)
            return stage(*arguments)

        value = result(run, compute, arguments)
        if len(computed) - stops[-1] == 5:
            stops.append(len(computed))
            raise KeyboardInterrupt
        return value

    wanted, stops = solve(QUICK, 2), [0]
    monkeypatch.setattr(Run, "result", counted)
    while (found := solve(QUICK, 2, keep=path)).status == "interrupted":
        pass
    assert len(stops) > 3
    np.testing.assert_array_equal(found.answer.x, wanted.answer.x)
    rows = [key.split(" ")[0] for key in read_rows(path, ROWS)]
    for stage in ("optimise", "confirm", "_certificate"):
        assert computed.count(stage) == rows.count(stage) > 0


@pytest.mark.parametrize("shrinking", [False, True])
def test_the_best_gait_of_finite_size_is_the_answer_unless_one_that_shrank_may_be(
    shrinking, monkeypatch
):
    found = solve(QUICK.with_(delta=1e-3, mesh_tolerance=1e-5), 1)
    assert found.success
    tiny = {"gait": found.gait.scaled(0.01), "value": 1.1 * found.answer.value}
    small = replace(found, answer=replace(found.answer, **tiny))
    assert is_visible(found.gait)
    assert not is_visible(small.gait)
    chosen = choose(found.problem.with_(shrinking=shrinking), [small, found])
    if shrinking:
        assert chosen.answer is small.answer
        assert chosen.shrunk is None
    else:
        assert chosen.answer is found.answer
        assert chosen.shrunk.answer is small.answer
        assert "A tiny gait is better still" in chosen.message
    assert choose(found.problem, [small]).answer is small.answer
    failed = replace(found, answer=replace(found.answer, value=9.0, optimal=False), message="why")
    assert choose(found.problem, [failed, found]).message == found.message  # as good in the replay
    failed = replace(failed, certificate=UNCERTIFIED)
    assert "A gait of 9.000000 is not verified: why" in choose(QUICK, [failed, found]).message
    strict = replace(found.answer, problem=QUICK.with_(mesh_tolerance=1e-9))
    text = "Try more starts or a larger mesh_tolerance. The gait is so slow or small that delta"
    assert text in certify_answer(QUICK.with_(delta=0.1), strict).message

    def stopped(*at):
        active_run().solutions += [failed, found]
        raise KeyboardInterrupt

    monkeypatch.setattr("colloc.search.solve._solve", stopped)
    assert solve(QUICK, 1).answer is found.answer  # the best that holds


def stage(number):
    return np.arange(3.0), QUICK


def test_a_kept_value_that_was_damaged_is_found_anew(tmp_path):
    path = tmp_path / "x.run.sqlite"
    first = Run(path, QUICK)
    first.result(stage, (1,))
    first.write()
    (key,) = (key for key in read_rows(path, ROWS) if key != "problem")
    for wrong in ({"kind": "Stranger", "of": {}}, {"array": "AAAA", "type": "<f8", "shape": [3]}):
        put_rows(path, ROWS, {key: wrong})
        again = Run(path, QUICK)
        assert again.result(stage, (1,))[1] == QUICK
        assert again.n_reused == 0


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.name)
def test_what_is_kept_is_read_back_to_the_bit_and_goes_on_alike(problem, tmp_path, monkeypatch):
    # what is found is written as it appears
    monkeypatch.setattr("colloc.search.checkpoint.OPTIONS", SearchOptions(checkpoint_interval=0.0))
    path = tmp_path / "x.run.sqlite"
    first = Run(path, problem)
    with first.active(np.inf):
        found = descend(first_optimum(problem, problem.guess))
    second = Run(path, problem)
    with second.active(np.inf):
        again = descend(first_optimum(problem, problem.guess))
    assert second.n_reused == len(read_rows(path, ROWS)) - 1 > 0
    np.testing.assert_array_equal(again.v, found.v)
    for name in ("objective", "kkt_error", "history"):
        assert getattr(again, name) == getattr(found, name)
    # its space is made anew, and its program says the same
    assert again.program().objective(again.v) == found.program().objective(found.v)
    np.testing.assert_array_equal(again.program().rows(again.v), found.program().rows(found.v))


@pytest.mark.slow
def test_solves_on_two_threads_end_as_one_after_another():
    kinds = [Problem("a", gait=Harmonic(2), friction=Friction(mu_t=mu), **AT) for mu in (1.0, 2.0)]
    with ThreadPoolExecutor(2) as threads:
        together = list(threads.map(colloc.solve, kinds))
    for problem, found in zip(kinds, together, strict=True):
        alone = colloc.solve(problem)
        np.testing.assert_array_equal(found.answer.x, alone.answer.x)
        assert found.certificate == alone.certificate


def test_a_run_of_another_problem_or_a_damaged_one_is_named_fresh_begins_again(tmp_path, capsys):
    from colloc.commands.solve import solve as main

    (tmp_path / "quick.py").write_text(FILE.replace("delta=1e-3", "delta=0.1"), encoding="utf-8")
    run = run_file(tmp_path / "quick.h5")
    put_rows(run, ROWS, {"problem": "another"})
    words = f"--output {tmp_path}/ --no-figure --starts 1 --quiet"
    command = [str(tmp_path / "quick.py"), *words.split()]
    assert main(command) == 2
    assert "--fresh begins again" in capsys.readouterr().err
    run.write_bytes(b"not SQLite" * 100)
    assert main(command) == 2
    assert "begin again (solve --fresh)" in capsys.readouterr().err
    assert main([*command, "--fresh"]) in (0, 4)
    assert not run.exists()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="POSIX limits")
def test_a_solve_on_a_full_disk_prints_its_answer_and_keeps_what_was_there(undisturbed, tmp_path):
    """No file may grow, which a write meets as it meets a full disk."""
    import resource

    file, wanted = undisturbed
    run, rows = run_file(tmp_path / "quick.h5"), {f"stage {k}": [k] for k in range(3)}
    put_rows(run, ROWS, {"problem": read_problem_file(file).problem.hash, **rows})
    before = run.read_bytes()
    command = [word for word in solve_command(file, tmp_path) if word != "--quiet"]

    def full():
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(before),) * 2)

    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=full)
    assert done.returncode == 2
    assert done.stdout.startswith("quick: solved in ")
    for said in (f"cannot write {run}: ", "The solve goes on", "result is not saved: cannot write"):
        assert done.stderr.count(said) == 1
    assert "Traceback" not in done.stderr
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {run.name: before}
    subprocess.run(command, capture_output=True, check=True)  # with room
    assert contents(tmp_path / "quick.h5") == wanted


@pytest.mark.parametrize("thread", ["main", "worker"])
def test_time_that_is_over_gives_the_best_gait_so_far(thread):
    """Twenty links spend half a minute before SQP first asks; no signal reaches a worker."""
    links = 20
    problem = Problem("long", body=Chain((1 / links,) * links), gait=Harmonic(1, "antipodal"))
    begin, found = time.process_time(), []
    if thread == "main":
        found.append(solve(problem, seconds=2.0))
    else:
        target = lambda: found.append(solve(problem, seconds=2))  # noqa: E731
        worker = threading.Thread(target=target, daemon=True)
        worker.start()
        worker.join(60)
    assert time.process_time() - begin < 6.0
    (solution,) = found
    assert solution.status == "interrupted"
    assert "2 s allowed have passed" in solution.message
    assert solution.value > 0
    assert solution.sample(0.3).angles.shape == (links - 1, 1)


def test_the_best_gait_told_of_is_one_of_finite_size_and_stages_come_in_their_order():
    """Small loops are better from the first start on; a leading sketch shrinks on its way."""
    body, friction = Chain((0.4, 0.2, 0.4)), Friction(mu_t=2, mu_f=1, mu_b=1.4)
    problem = Problem("three", None, body, friction, Harmonic(1), delta=1e-3)
    seen = []
    solution = solve(problem, 2, progress=seen.append)
    assert solution.shrunk.value > 1.1 * solution.value
    assert not any(on_speed_floor(problem, news.best.gait) for news in seen)
    dry = [news.best.value for news in seen if news.best.delta == problem.delta]
    assert max(dry) == pytest.approx(solution.value, rel=1e-3)
    assert len(dry) > len(seen) / 3
    came = [(news.round, STAGES.index(news.stage), news.done) for news in seen]
    assert came == sorted(came)
    assert str(seen[-1]).startswith("round 3, certify, 0 of 1; best d/W = 0.25")


def test_an_interrupted_solve_ends_with_the_best_gait_told_of_or_with_the_guess():
    seen = []

    def stopping(news):
        seen.append(news.best)
        if len(seen) == 2:
            signal.raise_signal(signal.SIGINT)

    first, best = solve(QUICK, seconds=1e-9), solve(QUICK, 2, progress=stopping)
    assert (first.status, best.status) == ("interrupted",) * 2
    np.testing.assert_allclose(
        first.gait.angles(np.arange(9) / 9), QUICK.guess.angles(np.arange(9) / 9), atol=1e-12
    )
    assert best.value == seen[-1].value > 1.5 * first.value
    assert f"{best.value:.6f} on its mesh, not verified" in "\n".join(summary_lines(best, None))
    assert best.message.startswith("interrupted; this is the best gait so far.")
    assert solve(QUICK, 1).status != "interrupted"  # it is over then


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


@pytest.mark.slow
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


@pytest.mark.slow
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
