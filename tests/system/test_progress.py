"""What a person sees while they wait, and that a log sees nothing."""

import io
import sys
import time

import pytest

from colloc.system.progress import StatusLine, duration
from tests.shared.terminal import screen

WIPED = "\x1b[1A\x1b[2K"
"""Up to the line, and the line erased."""


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (59.4, "59 s"), (60, "1 min 00 s"), (3599, "59 min 59 s"), (7500, "2 h 05 min")],
)
def test_durations_are_for_people(seconds, text):
    assert duration(seconds) == text


def test_the_line_says_what_and_how_long_and_vanishes():
    stream = Terminal()
    with StatusLine(stream) as line:
        line.say("solving", left=20.0)
        line.say("drawing")
    printed = stream.getvalue()
    assert "solving   0 s, about 20 s left" in printed
    assert "drawing   0 s" in printed
    # nothing is foretold of the drawing
    assert printed.count(" left") == printed.count("about 20 s left")
    assert printed.endswith(WIPED)


@pytest.mark.parametrize("left", [float("inf"), float("nan"), 0.0, -3.0])
def test_a_time_that_nobody_knows_is_not_told(left):
    stream = Terminal()
    with StatusLine(stream) as line:
        line.say("solving", left)
    assert "solving   0 s" in stream.getvalue()
    assert "left" not in stream.getvalue()


def test_what_is_printed_in_between_stands_on_a_line_of_its_own():
    stream = Terminal()
    with StatusLine(stream) as line:
        line.say("0 of 2 [starts]")
        line.clear()
        stream.write("a row\n")
        line.say("1 of 2 [starts]")
    before, after = stream.getvalue().split("a row\n")
    assert before.endswith(WIPED)
    assert "0 of 2 [starts]   0 s" in before
    assert "1 of 2 [starts]   0 s" in after
    assert after.endswith(WIPED)


def test_a_warning_while_the_line_is_shown_stands_on_a_line_of_its_own(monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := Terminal())
    with StatusLine() as line:
        line.say("solving")
        print("colloc: the disk is full", file=sys.stderr)
        line.say("drawing")
    lines, cursor = screen(stream.getvalue().replace("\n", "\r\n"))
    assert [line for line in lines if line] == ["colloc: the disk is full"]
    assert cursor


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
