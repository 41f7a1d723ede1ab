"""What a program writes to a pseudo-terminal, and what stands on the screen then."""

import contextlib
import os
import re
import subprocess

_CODE = re.compile(r"\x1b\[([0-9;?]*)([A-Za-z])|\r|\n|[^\x1b\r\n]+")
_SIZE = (24, 100)


def run_in_terminal(words, folder, **environment):
    """Exit code and all that is written, with a terminal as the standard streams."""
    import pty
    import termios

    ours, its = pty.openpty()
    termios.tcsetwinsize(its, _SIZE)
    streams = dict.fromkeys(("stdin", "stdout", "stderr"), its)
    environment = {**os.environ, "TERM": "xterm", **environment}
    with subprocess.Popen(
        [*map(str, words)], cwd=folder, env=environment, start_new_session=True, **streams
    ) as process:
        os.close(its)
        parts = []
        with contextlib.suppress(
            OSError
        ):  # so a terminal says on Linux that its last writer is gone
            while part := os.read(ours, 65536):
                parts.append(part)
        os.close(ours)
    return process.returncode, b"".join(parts).decode()


def screen(written):
    """Lines on the screen in the end, as far as the used codes go; is the cursor seen?"""
    lines, row, column, seen = [""], 0, 0, True
    for code in _CODE.finditer(written):
        text, (number, letter) = code[0], code.groups()
        if text == "\r":
            column = 0
        elif text == "\n":
            row += 1
            lines += [""] * (row + 1 - len(lines))
        elif letter == "A":
            row -= int(number or 1)
        elif letter == "K":
            lines[row] = "" if number == "2" else lines[row][:column]
        elif number == "?25":
            seen = letter == "h"
        elif letter is None:
            lines[row] = lines[row][:column].ljust(column) + text + lines[row][column + len(text) :]
            column += len(text)
        else:
            assert letter == "m", repr(text)  # colours
    return lines, seen
