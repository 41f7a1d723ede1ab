"""How every command ends: an exit code, one sentence for people where something is wrong, and no
traceback for it.

Exit codes: 0 well; 2 bad problem, option or file; 3 not converged or none found; 4 a certificate
failed; 130 interrupted; 141 the reader of the output left.
Nothing heavy is imported here, so that Ctrl-C ends a command well from its first moments on.
"""

from __future__ import annotations

import argparse
import codecs
import contextlib
import io
import json
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TextIO

from colloc.system.errors import CollocError, OrderWarning, ReadOnlyRunWarning, SlowWarning
from colloc.system.interruption import INTERRUPTED, interruptible

OK, BAD_PROBLEM, NONE_FOUND, FAILED, UNREAD = 0, 2, 3, 4, 141  # the last as shells report SIGPIPE
_IN_WORDS = {"π": " pi ", "δ": "delta", "μ": "mu", "±": "+-", "→": "->", "·": "*", "…": "..."}
_Command = Callable[[argparse.Namespace], int]
_page: list[TextIO] = []
"""Standard output, while it is kept for one JSON object."""


def run(parser: argparse.ArgumentParser, command: _Command, arguments: Sequence[str] | None) -> int:
    """The exit code of a command run on its arguments (None: those of the process);
    `options.command` is all that was typed."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    typed = argparse.Namespace(command=" ".join([parser.prog, *words]))
    return exit_code(lambda: command(parser.parse_args(words, typed)), as_json="--json" in words)


def exit_code(command: Callable[[], int], *, as_json: bool = False) -> int:
    """The exit code of a command; errors made for people, and those of the system, become one
    sentence on standard error.

    A KeyboardInterrupt may carry a sentence about what was kept. With `as_json` standard output is
    kept for one JSON object (`show`), which the sentence is too; all else goes to standard error.
    """
    _open_closed_streams()
    _print_in_words()
    try:
        with interruptible(polled=False), _notes():
            try:
                with _kept_page(as_json):
                    code = command()
            finally:
                sys.stdout.flush()
        if code == INTERRUPTED:
            _end_workers()
        return code
    except CollocError as error:
        return _end(BAD_PROBLEM, "error", str(error), as_json)
    except BrokenPipeError:
        _leave_output()
        sentence = "nobody reads the output any more; what was saved before is kept."
        return _end(UNREAD, "unread", sentence, as_json=False)
    except OSError as error:
        if error.filename is None:
            _leave_output()
        what = f"{error.filename or 'the output'}: {error.strerror or error}"
        return _end(BAD_PROBLEM, "error", f"cannot read or write {what}.", as_json)
    except KeyboardInterrupt as stop:
        _end_workers()
        sentence = f"interrupted; {str(stop) or 'nothing was written.'}"
        return _end(INTERRUPTED, "interrupted", sentence, as_json)


def show(text: str) -> None:
    """Print what a command ends with, on standard output even where that is kept for it."""
    print(text, file=_page[-1] if _page else sys.stdout, flush=True)


@contextlib.contextmanager
def _kept_page(as_json: bool) -> Iterator[None]:
    if not as_json or _page:
        yield
        return
    _page.append(sys.stdout)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        _page.clear()


def _open_closed_streams() -> None:
    """Streams that the caller closed lead nowhere; else the next file that is opened would get
    their number, and what compiled code prints would go into it."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            try:
                os.fstat(number)
            except OSError:
                os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free: this one
            setattr(sys, name, open(os.devnull, "w" if number else "r", encoding="utf-8"))  # noqa: SIM115  as long as we run


@contextlib.contextmanager
def naming_saved_files(saved: Sequence[str]) -> Iterator[None]:
    """A block in which Ctrl-C ends the command by saying which files are saved already."""
    try:
        yield
    except KeyboardInterrupt as stop:
        what = f"{', '.join(saved)} {'are' if len(saved) > 1 else 'is'} saved." if saved else ""
        raise KeyboardInterrupt(str(stop) or what) from None


def _end_workers() -> None:
    """End processes of this one that are still at work, for which Python would wait."""
    if "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():
            child.terminate()


def _end(code: int, status: str, message: str, as_json: bool) -> int:
    if as_json:
        with contextlib.suppress(OSError):
            show(json.dumps({"status": status, "message": message, "exit_code": code}))
    print(f"colloc: {message}", file=sys.stderr)
    return code


def _leave_output() -> None:
    """Let what is still to be printed go nowhere, so that Python does not try again as it ends."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _words_for(error: UnicodeError) -> tuple[str | bytes, int]:
    assert isinstance(error, UnicodeEncodeError)
    letters = error.object[error.start : error.end]
    return "".join(
        _IN_WORDS.get(c) or c.encode("ascii", "backslashreplace").decode() for c in letters
    ), error.end


def _print_in_words() -> None:
    """Letters that the output's encoding does not have are printed as words, or escaped."""
    codecs.register_error("colloc.words", _words_for)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="colloc.words")


@contextlib.contextmanager
def _notes() -> Iterator[None]:
    """Within it, warnings made for people are one line on standard error."""
    with warnings.catch_warnings():
        before = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
            if issubclass(category, (OrderWarning, ReadOnlyRunWarning, SlowWarning)):
                print(f"colloc: {message}", file=sys.stderr)
            else:
                before(message, category, *where, **more)

        warnings.simplefilter("always", ReadOnlyRunWarning)
        warnings.simplefilter("once", OrderWarning)
        warnings.simplefilter("once", SlowWarning)
        warnings.showwarning = show
        yield
