"""Ctrl-C: what was reached is kept, the same command goes on from there, and compiled code does not swallow it."""

import contextlib
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from colloc.results.store import load
from colloc.system.interruption import interruptible

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
    limit = time.monotonic() + 60
    while not (out / "long.partial.h5").exists() and time.monotonic() < limit:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    printed, complaint = process.communicate(timeout=60)
    assert process.returncode == 130
    assert printed == ""
    assert "levels are kept in" in complaint
    assert "Traceback" not in complaint
    assert not (out / "long.h5").exists()
    partial = load(out / "long.partial.h5")
    assert partial.status == "not converged"
    assert partial.levels[0].optimal

    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert f"going on from {out / 'long.partial.h5'}" in again.stdout
    assert {path.name for path in out.iterdir()} == {"long.h5"}
    solution = load(out / "long.h5")
    assert solution.status == "solved"
    # what was optimal is not solved again
    last = max(k for k, level in enumerate(partial.levels) if level.optimal)
    kept = partial.levels[: last + 1]
    for old, new in zip(kept, solution.levels, strict=False):
        assert new.seconds == old.seconds
        np.testing.assert_array_equal(new.x, old.x)
    assert len(solution.levels) > len(kept)
    assert solution.certificate.efficiency == pytest.approx(0.26003, abs=2e-5)


def swallow():
    with interruptible(), contextlib.suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_a_swallowed_interrupt_is_raised_at_the_end_of_the_block():
    with pytest.raises(KeyboardInterrupt):
        swallow()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


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
