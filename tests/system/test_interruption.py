"""Ctrl-C, time that is over: one KeyboardInterrupt ends a block, and compiled code passes it on."""

import signal
import sys
import threading
import time
import weakref

import numpy as np
import pytest

from colloc import Harmonic, Problem, ellipse
from colloc.search.confirm import Solver
from colloc.system.interruption import clear_interrupt, interruptible, is_interrupted, time_limit
from colloc.transcription.full_program import BalancedVelocity
from tests.shared.stages import program_of


def pressed(times, seen, **options):
    with interruptible(**options):
        for _ in range(times):
            seen["pressed"] += 1
            signal.raise_signal(signal.SIGINT)
        seen["known"] = is_interrupted()


def press(times=1, **options):
    """How often Ctrl-C was pressed in a block before an exception came; did the block know?"""
    seen = {"pressed": 0, "known": False}
    with pytest.raises(KeyboardInterrupt):
        pressed(times, seen, **options)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    return seen["pressed"], seen["known"]


def test_a_block_that_asks_stops_by_itself_or_at_its_end_and_at_a_second_ctrl_c_at_once():
    assert press() == (1, True)
    assert press() == (1, True)  # a new block begins anew
    assert press(times=3) == (2, False)


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


def test_ipopt_stops_between_iterations_and_says_nothing(capfd, monkeypatch):
    gait = Harmonic(1, "bilateral")
    problem = Problem(
        "p", ellipse(0.3, 1.0, 0.5), gait=gait, intervals=20, formulation="implicit velocity"
    )
    program, calls = program_of(problem), []
    x = program.feasible(problem.gait.parameters(problem.guess), 0.1)

    def pressed(velocity_map, local, delta, evaluated=BalancedVelocity.__call__):
        calls.append(local)
        if len(calls) == 10:
            signal.raise_signal(signal.SIGINT)
        return evaluated(velocity_map, local, delta)

    monkeypatch.setattr(BalancedVelocity, "__call__", pressed)
    with pytest.raises(KeyboardInterrupt):
        Solver(program).solve_within(x, 0.1, None, np.inf)
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


def test_a_time_limit_ends_a_block_as_ctrl_c_does():
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt), interruptible(polled=False), time_limit(0.2):
        time.sleep(10)
    assert time.monotonic() - begin < 5
    clear_interrupt()
    with interruptible():
        assert not is_interrupted()


def test_in_another_thread_a_time_limit_ends_what_asks_for_it():
    ended = []

    def work():
        try:
            with time_limit(0.05), interruptible():
                while not is_interrupted():
                    time.sleep(0.01)
        except KeyboardInterrupt:
            ended.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join(timeout=10)
    assert ended == [True]
