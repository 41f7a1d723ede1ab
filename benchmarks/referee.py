"""Check the table of known gaits by replaying each, and add better ones:
python -m benchmarks.referee [--only NAME] [--add FILE.h5 --by COMMAND].

Exit codes: 0 every row holds, 2 bad table or result, or one that is not better, 4 a row does not
hold, 130 interrupted.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.known import known, row_of, save_known, with_row
from colloc.commands.main import FAILED, OK, PRINTING, flag, option, run, status_line, tell
from colloc.results.store import load
from colloc.system.errors import CollocError, ProblemError
from colloc.system.files import alone_in

_EPILOG = """\
A row is a problem, a gait and a value; the referee replays the gait, and believes nothing else. A
result is taken in if it is certified, and better than what is known of the same question: body,
friction, class of gaits, objective, limits and delta.

  python -m benchmarks.referee
  python -m benchmarks.referee --only three_link
  python -m benchmarks.referee --add results/mine.h5 --by "colloc solve mine.py"    into known.json"""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.referee",
        description="Replay the best known gaits; add better ones.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    table = "another table than benchmarks/known.json; with --add (default: known.json) begun as a copy of that"
    for name, settings in (
        option(str, "--table FILE.json", table),
        option(str, "--only NAME", "rows of the problem of this name"),
        flag("--dry", "check bounds under dry friction as well"),
        option(str, "--add FILE.h5", "a result to take in"),
        option(str, "--by COMMAND", "with --add: the command that anyone can find it with"),
        *PRINTING,
    ):
        parser.add_argument(name, **settings)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    return run(_parser(), _referee, arguments)


def _referee(options: argparse.Namespace) -> int:
    if (options.add is None) != (options.by is None):
        raise ProblemError("--add and --by go together: a result, and the command that finds it.")
    return _taken_in(options) if options.add else _checked(options, known(options.table))


def _checked(options: argparse.Namespace, rows: Sequence) -> int:
    chosen = [row for row in rows if options.only in (None, row.statement["name"])]
    if not chosen:
        raise ProblemError(f"the table has no row of {options.only}.")
    told, lines = [], []
    with status_line(options) as progress:
        for number, row in enumerate(chosen):
            name = row.statement["name"]
            progress.say(f"{name}: replaying, {number + 1} of {len(chosen)}")
            try:
                complaint = row.complaint(row.certificate()) or (
                    row.dry_complaint() if options.dry else ""
                )
            except CollocError as error:
                complaint = str(error)
            told.append(
                {
                    "name": name,
                    "value": row.value,
                    "value_error": row.value_error,
                    "complaint": complaint,
                }
            )
            lines.append(
                f"  {'NO ' if complaint else 'ok '} {name:<28s} {row.value:.8f} +- "
                f"{row.value_error:.0e}  {complaint}"
            )
    failed = sum(bool(each["complaint"]) for each in told)
    verdict = f"{len(told) - failed} of {len(told)} rows hold"
    tell(options, {"rows": told, "failed": failed}, [verdict, *(line.rstrip() for line in lines)])
    return FAILED if failed else OK


def _taken_in(options: argparse.Namespace) -> int:
    solution = load(options.add)
    new = row_of(solution, options.by)
    table = Path(options.table or "known.json")
    with alone_in(table.parent):  # no other takes a row in between the reading and the writing
        save_known(with_row(known(table if table.exists() else None), new), table)
    said = (
        f"{new.statement['name']}: {new.value:.8f} +- {new.value_error:.0e} is the best "
        f"that is "
        f"known; saved {table}"
    )
    tell(options, {"name": new.statement["name"], "value": new.value, "table": str(table)}, [said])
    return OK


if __name__ == "__main__":
    sys.exit(main())
