"""Other processes compute ahead what a search asks for: its answer does not depend on them, nor on
what becomes of them."""

import time

import pytest

import colloc
from benchmarks.kills import contents
from colloc import Harmonic, Problem
from colloc.search import helpers
from colloc.search.explore import sketched
from colloc.search.run import Run

PROBLEM = Problem(
    "quick",
    gait=Harmonic(1, "none"),
    delta=1e-2,
    delta_start=0.1,
    intervals=12,
    mesh_tolerance=1e-3,
)
DIES = (
    "import sys; print('{}', flush=True); next(line for line in sys.stdin.buffer if "
    "b'colloc.search.explore' in line)"
)
TORN = f"{DIES}; print('{{', end='', flush=True)"


@pytest.fixture
def learnt(monkeypatch):
    """Processes are begun at once; of each task of theirs how much it has found, and the run that
    learnt it."""
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.setattr(helpers, "_WORTH", 0.0)
    learn, numbers = Run.learn, []

    def counted(run, rows):
        numbers.append((len(rows), run))
        learn(run, rows)

    monkeypatch.setattr(Run, "learn", counted)
    return numbers


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    path = tmp_path_factory.mktemp("alone") / "quick.h5"
    assert colloc.solve(PROBLEM, starts=8, output=path).status == "solved"
    return contents(path)


def test_the_file_is_the_same_to_the_last_bit(alone, learnt, tmp_path, monkeypatch):
    await_for, until = helpers.Helpers.await_for, time.monotonic() + 60.0

    def patient(some, *task):
        while some.waiting and time.monotonic() < until:
            time.sleep(0.01)
        await_for(some, *task)

    monkeypatch.setattr(helpers.Helpers, "await_for", patient)
    colloc.solve(PROBLEM, starts=8, output=tmp_path / "quick.h5")
    assert sum(found > 0 for found, _ in learnt) > 1
    assert learnt[0][1].found_again > 0.5 * sum(found for found, _ in learnt)
    assert contents(tmp_path / "quick.h5") == alone


@pytest.mark.parametrize(
    "command",
    [pytest.param("raise SystemExit(1)", marks=pytest.mark.slow), DIES, TORN],
    ids=["at once", "at its first task", "in its first answer"],
)
def test_so_it_is_if_they_die(alone, learnt, tmp_path, monkeypatch, command):
    monkeypatch.setattr(helpers, "_COMMAND", command)
    colloc.solve(PROBLEM, starts=8, output=tmp_path / "quick.h5")
    assert not any(found for found, _ in learnt)
    assert contents(tmp_path / "quick.h5") == alone


@pytest.mark.parametrize("name", ["random.py", "sitecustomize.py"])
def test_files_of_the_folder_are_not_run_and_what_python_prints_as_it_starts_is_no_answer(
    learnt, tmp_path, monkeypatch, name
):
    (tmp_path / name).write_text(
        "print('hello\\n' * 3); open('ran', 'w').close()", encoding="utf-8"
    )
    monkeypatch.chdir(tmp_path)
    if name == "sitecustomize.py":  # which Python runs, wherever it was told to look for it
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with Run(problem=PROBLEM).under_way(60.0), helpers.helping(PROBLEM) as some:
        some.begin(1e3)
        some.ask(sketched, PROBLEM, PROBLEM.guess, True, [0.1])
        while some.waiting:
            time.sleep(0.01)
        some.await_for(sketched, PROBLEM, PROBLEM.guess, True, [0.1])
    assert learnt[0][0] > 0
    assert (tmp_path / "ran").exists() == (name == "sitecustomize.py")
