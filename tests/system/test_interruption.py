"""Ctrl-C: what was reached is kept, the same command goes on from there, and compiled code does not swallow it."""

import contextlib
import re
import signal
import subprocess
import sys
import time
import weakref

import numpy as np
import pytest

from colloc.collocation.implicit_velocity import ImplicitVelocity
from colloc.collocation.transcription import transcribe
from colloc.collocation.warm_start import feasible_point
from colloc.gaits.harmonic import Harmonic, ellipse
from colloc.gaits.problem import Problem
from colloc.results.store import load
from colloc.search.ipopt import Solver
from colloc.system.interruption import interrupted, interruptible

PROBLEM = """
from colloc import *
PROBLEM = Problem(name="long", gait=Harmonic(1, "bilateral"), guess=ellipse(0.3, 1.0, 0.5), intervals=80,
                  mesh_tolerance=1e-5)
"""
QUICK = """
from colloc import *
PROBLEM = Problem("quick", ellipse(0.0, 1.4, 0.8), gait=Harmonic(1, "bilateral"), delta=0.3, delta_start=0.3, intervals=12)
"""


def test_ctrl_c_keeps_the_levels_and_the_same_command_goes_on(tmp_path):
    (tmp_path / "long.py").write_text(PROBLEM, encoding="utf-8")
    out = tmp_path / "out"
    command = [sys.executable, "-m", "colloc", "solve", str(tmp_path / "long.py"), "--output", str(out), "--no-figure"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    limit = time.monotonic() + 120
    while not (begun := (out / "long.partial.h5").exists()) and process.poll() is None and time.monotonic() < limit:
        time.sleep(0.01)
    assert begun, f"no level ended: {process.communicate()[1] if process.poll() is not None else 'still at the first'}"
    time.sleep(0.1)  # into the next level, where Ctrl-C meets IPOPT
    process.send_signal(signal.SIGINT)
    printed, complaint = process.communicate(timeout=60)
    assert process.returncode == 130
    assert printed == ""
    kept = out / "long.partial.h5"
    assert re.fullmatch(
        rf"colloc: interrupted; \d levels are kept in {kept}; the same command goes on from there.\n", complaint
    )
    assert not (out / "long.h5").exists()
    partial = load(out / "long.partial.h5")
    assert partial.status == "not converged"
    assert partial.history[0].optimal

    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert f"going on from {out / 'long.partial.h5'}" in again.stdout
    assert {path.name for path in out.iterdir()} == {"long.h5"}
    solution = load(out / "long.h5")
    assert solution.status == "solved"
    # what was optimal is not solved again
    last = max(k for k, level in enumerate(partial.history) if level.optimal)
    kept = partial.history[: last + 1]
    for old, new in zip(kept, solution.history, strict=False):
        assert new.seconds == old.seconds
        np.testing.assert_array_equal(new.x, old.x)
    assert len(solution.history) > len(kept)
    assert solution.certificate.efficiency == pytest.approx(0.26003, abs=2e-5)


def pressed(times, seen, **options):
    with interruptible(**options):
        for _ in range(times):
            seen["pressed"] += 1
            signal.raise_signal(signal.SIGINT)
        seen["known"] = interrupted()


def press(times=1, **options):
    """What Ctrl-C does in a block: how often it was pressed before an exception came, and whether the block knew."""
    seen = {"pressed": 0, "known": False}
    with pytest.raises(KeyboardInterrupt):
        pressed(times, seen, **options)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    return seen["pressed"], seen["known"]


def test_a_block_that_asks_is_left_to_stop_by_itself_and_interrupted_at_its_end():
    assert press() == (1, True)
    assert press() == (1, True)  # a new block begins anew


def test_a_second_ctrl_c_is_raised_at_once():
    assert press(times=3) == (2, False)


def test_in_a_command_every_ctrl_c_is_raised_at_once():
    assert press(times=3, polled=False) == (1, False)


def press_in_a_callback():
    class Thing:
        pass

    with interruptible(polled=False):
        thing = Thing()
        reference = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
        del thing
        assert reference() is None
        time.sleep(10)


def test_where_python_would_swallow_ctrl_c_it_comes_again_and_nothing_is_printed(capfd):
    """As in the callbacks of weak references that run while modules are imported."""
    begin, hook = time.monotonic(), sys.unraisablehook
    with pytest.raises(KeyboardInterrupt):
        press_in_a_callback()
    assert time.monotonic() - begin < 5
    assert sys.unraisablehook is hook
    printed = capfd.readouterr()
    assert printed.out + printed.err == ""


def fail(*, after_ctrl_c):
    with interruptible():
        if after_ctrl_c:
            signal.raise_signal(signal.SIGINT)
        raise NotImplementedError


def test_an_error_that_an_interruption_became_is_an_interruption_and_other_errors_are_not():
    with pytest.raises(KeyboardInterrupt):
        fail(after_ctrl_c=True)
    with pytest.raises(NotImplementedError):
        fail(after_ctrl_c=False)


def begin_after_a_swallowed_ctrl_c(begun):
    with interruptible(polled=False):
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        with interruptible():
            begun.append(True)


def test_no_solve_begins_after_an_interruption_that_was_swallowed():
    begun = []
    with pytest.raises(KeyboardInterrupt):
        begin_after_a_swallowed_ctrl_c(begun)
    assert begun == []


def test_ipopt_stops_between_iterations_and_says_nothing(capfd, monkeypatch):
    gait = Harmonic(1, "bilateral")
    problem = Problem("p", ellipse(0.3, 1.0, 0.5), gait=gait, intervals=20, formulation="implicit velocity")
    solver, calls = Solver(transcribe(problem)), []
    x = feasible_point(solver.transcription, problem.gait.parameters(problem.guess), 0.1)

    def pressed(velocity_map, arguments, evaluated=ImplicitVelocity.eval):
        calls.append(arguments)
        if len(calls) == 10:
            signal.raise_signal(signal.SIGINT)
        return evaluated(velocity_map, arguments)

    monkeypatch.setattr(ImplicitVelocity, "eval", pressed)
    with pytest.raises(KeyboardInterrupt):
        solver.solve(x, 0.1)
    assert 10 <= len(calls) < 20
    printed = capfd.readouterr()
    assert printed.out + printed.err == ""


def test_a_handler_of_somebody_else_is_left_alone():
    heard = []
    before = signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    try:
        with interruptible():
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == [signal.SIGINT]


def test_a_damaged_partial_file_is_named_and_fresh_begins_again(tmp_path, capsys):
    from colloc.commands.solve import main

    (tmp_path / "quick.py").write_text(QUICK, encoding="utf-8")
    (tmp_path / "quick.partial.h5").write_text("no levels")
    command = [str(tmp_path / "quick.py"), "--output", str(tmp_path), "--no-figure"]
    assert main(command) == 2
    assert "--fresh begins again" in capsys.readouterr().err
    assert main([*command, "--fresh"]) in (0, 4)
    assert not (tmp_path / "quick.partial.h5").exists()


def test_levels_of_another_problem_are_not_taken_over(tmp_path, capsys, three_link):
    from colloc.commands.solve import main
    from colloc.results.store import save

    (tmp_path / "quick.py").write_text(QUICK, encoding="utf-8")
    save(three_link, tmp_path / "quick.partial.h5")
    main([str(tmp_path / "quick.py"), "--output", str(tmp_path), "--no-figure"])
    assert "going on" not in capsys.readouterr().out
