"""What the programs of scripts/ and benchmarks/ share: their options, and records of one row a line."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any


def command_line(page: str | None, *places: tuple[str, Any], **stated: Any) -> argparse.Namespace:
    """Read the command line of a program that its docstring explains.

    `stated` are options by name: False is a switch, a class that of an option without a default, a
    list takes any number of values, of a class if it holds that, anything else is a default;
    `places` are arguments without a name, of any number if their default is a list.
    """
    parser = argparse.ArgumentParser(
        description=page, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    named = [(f"--{name.replace('_', '-')}", value) for name, value in stated.items()]
    for name, value in (*places, *named):
        if value is False:
            parser.add_argument(name, action="store_true")
        elif isinstance(value, type):
            parser.add_argument(name, type=value)
        elif isinstance(value, list):
            bare = isinstance(value[0], type)
            parser.add_argument(
                name,
                type=value[0] if bare else type(value[0]),
                nargs="*",
                default=[] if bare else value,
            )
        else:
            count = None if name.startswith("--") else "?"
            parser.add_argument(
                name, type=type(value), nargs=count, default=value, help="default: %(default)s"
            )
    return parser.parse_args()


def read_record(path: Path) -> list[dict[str, Any]]:
    """Rows of a record, one JSON object a line; none if there is no file."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def add_to_record(path: Path, rows: Iterable[dict[str, Any]], *, anew: bool = False) -> None:
    """Append rows to a record, or write them in its place."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w" if anew else "a", encoding="utf-8") as file:
        file.writelines(json.dumps(row) + "\n" for row in rows)
