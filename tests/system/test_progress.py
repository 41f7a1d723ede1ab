"""What a person sees while they wait, and that a log sees nothing."""

import io
import time
from dataclasses import replace

import pytest

from colloc.commands.solve import levels_left
from colloc.gaits.harmonic import ellipse
from colloc.gaits.problem import Problem
from colloc.system.progress import StatusLine, duration


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.4, "0 s"), (59.4, "59 s"), (60, "1 min 00 s"), (3599, "59 min 59 s"), (7500, "2 h 05 min")]
)
def test_durations_are_for_people(seconds, text):
    assert duration(seconds) == text


def test_the_line_says_what_and_how_long_and_vanishes():
    stream = Terminal()
    with StatusLine(stream) as line:
        line.say("solving", left=20.0)
        line.say("drawing")
    printed = stream.getvalue()
    assert "\rsolving   0 s, about 20 s left" in printed
    assert "\rdrawing   0 s" in printed
    assert printed.endswith("\r")
    last = printed.rstrip("\r").rsplit("\r", 1)[-1]
    assert last.strip() == ""
    assert len(last) >= len("drawing   0 s")


def test_the_line_ticks_by_itself_and_the_time_left_falls():
    stream = Terminal()
    with StatusLine(stream) as line:
        line.say("solving", left=20.0)
        time.sleep(1.3)
    assert "1 s, about 19 s left" in stream.getvalue()


def test_nothing_is_written_where_nobody_watches():
    log, muted = io.StringIO(), Terminal()
    for line in (StatusLine(log), StatusLine(muted, enabled=False)):
        with line:
            line.say("solving", left=3.0)
            line.clear()
    assert log.getvalue() == ""
    assert muted.getvalue() == ""


def test_levels_left_counts_decades_and_a_refined_mesh(three_link):
    problem = Problem("x", ellipse(0.0, 1.4, 0.8), delta=1e-4, delta_start=0.1)
    levels = [replace(three_link.last, delta=delta) for delta in (0.1, 0.01, 0.003, 1e-3, 1e-4)]
    assert [levels_left(problem, level) for level in levels] == [4, 3, 3, 2, 1]
    assert levels_left(problem.with_(mesh_tolerance=0.0), levels[0]) == 3
