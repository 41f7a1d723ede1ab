"""End of a command: an exit code, and one sentence instead of a traceback.

0 success; 2 bad problem, option or file; 3 not converged or none found; 4 a certificate failed;
130 interrupted; 141 the reader of the output left. Nothing slow is imported here.
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
_json_page: list[TextIO] = []  # standard output while it is reserved for one JSON object


def run(
    parser: argparse.ArgumentParser,
    command: Callable[[argparse.Namespace], int],
    arguments: Sequence[str] | None,
) -> int:
    """Run a command on its arguments, or those of the process; `options.command` is the line."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    typed = argparse.Namespace(command=" ".join([parser.prog, *words]))
    return exit_code(lambda: command(parser.parse_args(words, typed)), as_json="--json" in words)


def exit_code(command: Callable[[], int], *, as_json: bool = False) -> int:
    """Run a command; errors become one sentence on standard error, and with `as_json` an object.

    A KeyboardInterrupt may carry a sentence about what was kept.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:  # closed by the caller: no other file may take its number
            setattr(sys, name, open(os.devnull, "w" if number else "r", encoding="utf-8"))  # noqa: SIM115
    codecs.register_error("colloc.words", _spell_out)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="colloc.words")
    status, sentence, output_fails = "error", "", False
    try:
        with interruptible(polled=False), _short_warnings():
            try:
                with _stdout_for_json(as_json):
                    code = command()
            finally:
                sys.stdout.flush()
    except CollocError as error:
        code, sentence = BAD_PROBLEM, str(error)
    except BrokenPipeError:
        code, as_json, output_fails = UNREAD, False, True
        sentence = "the output was closed by its reader; what was saved before is kept."
    except OSError as error:
        code, output_fails = BAD_PROBLEM, error.filename is None
        what = f"{error.filename or 'the output'}: {error.strerror or error}"
        sentence = f"cannot read or write {what}."
    except KeyboardInterrupt as stop:
        code, status = INTERRUPTED, "interrupted"
        sentence = f"interrupted; {str(stop) or 'nothing was written.'}"
    if code == INTERRUPTED and "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():  # Python would wait for them
            child.terminate()
    if output_fails:  # Python is not to try to print the rest as it ends
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if sentence and as_json:
        with contextlib.suppress(OSError):
            show(json.dumps({"status": status, "message": sentence, "exit_code": code}))
    if sentence:
        print(f"colloc: {sentence}", file=sys.stderr)
    return code


def show(text: str) -> None:
    """Print the result of a command, also where standard output is reserved for it."""
    print(text, file=_json_page[-1] if _json_page else sys.stdout, flush=True)


@contextlib.contextmanager
def _stdout_for_json(as_json: bool) -> Iterator[None]:
    if not as_json or _json_page:
        yield
        return
    _json_page.append(sys.stdout)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        _json_page.clear()


@contextlib.contextmanager
def naming_saved_files(saved: Sequence[str]) -> Iterator[None]:
    """Have Ctrl-C in the block say which files are saved already."""
    try:
        yield
    except KeyboardInterrupt as stop:
        what = f"{', '.join(saved)} {'are' if len(saved) > 1 else 'is'} saved." if saved else ""
        raise KeyboardInterrupt(str(stop) or what) from None


def _spell_out(error: UnicodeError) -> tuple[str | bytes, int]:
    """Print characters that the output's encoding lacks as words, or escaped."""
    assert isinstance(error, UnicodeEncodeError)
    words = (
        _IN_WORDS.get(c) or c.encode("ascii", "backslashreplace").decode()
        for c in error.object[error.start : error.end]
    )
    return "".join(words), error.end


@contextlib.contextmanager
def _short_warnings() -> Iterator[None]:
    own = OrderWarning, ReadOnlyRunWarning, SlowWarning
    with warnings.catch_warnings():
        before = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
            if issubclass(category, own):
                print(f"colloc: {message}", file=sys.stderr)
            else:
                before(message, category, *where, **more)

        for category in own:
            once = category is not ReadOnlyRunWarning
            warnings.simplefilter("once" if once else "always", category)
        warnings.showwarning = show
        yield
