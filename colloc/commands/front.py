"""Families of gaits as commands save them: members, table and figure; and the table of a front."""

from __future__ import annotations

import argparse
import csv
import io
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from colloc.commands import main as cli
from colloc.commands.ending import naming_saved_files
from colloc.gaits.problem_file import ProblemFile
from colloc.results.kept import Saved, save_result
from colloc.results.solution import Solution
from colloc.system.files import write_text

if TYPE_CHECKING:
    from colloc.studies.families import ParetoFront

Found = tuple[Any, dict[str, Any], list[str], list[Saved]]
"""A family, facts about it, lines for people, and what is saved."""


def find_family(
    options: argparse.Namespace,
    stated: ProblemFile,
    table: Path,
    find: Callable[[Callable[..., None]], Any],
    describe: Callable[[Any, dict[Path, Solution]], tuple[str, dict[str, Any], list[str]]],
) -> Found:
    """Find a family, save its members and its table, and draw it.

    `find` is called with what shows progress. From the family and its members by their paths
    `describe` gives the text of the table, facts, and lines for people.
    """
    from colloc.studies.solve import checkpoints_in

    members, saved, name = dict[Path, Solution](), list[Saved](), stated.problem.name
    with checkpoints_in(table.with_suffix("")):
        with cli.status_line(options) as line:

            def say(what: str, point: Solution | None = None) -> None:
                value = point and f": {point.problem.objective.short} = {point.value:.6g}"
                line.say(f"{name}: {what}{value or ''}")

            family = find(say)
        named = {f"{k:02d}": point for k, point in enumerate(family.points)}
        if spot := getattr(family, "on_the_spot", None):
            named |= {f"spot_{k:02d}": point for k, point in enumerate(spot.points)}
        for stem, solution in named.items():
            solution.source = stated.source
            saved += (one := save_result(solution, table.with_suffix("") / f"{stem}.h5"))
            members[one[0].path] = solution
        content, facts, lines = describe(family, members)
        write_text(table, content)
        points, files = f", {next(iter(members))} ...", [table]
        if not options.no_figure:
            from colloc.pictures.style import save as save_figure

            with naming_saved_files([f"{table}{points}"]):
                files += save_figure(family.plot(), table.with_suffix(""), ("png",))
        last = f"  saved {', '.join(map(str, files))}{points}"
    return family, facts | {"file": str(table)}, [f"{name}: {lines[0]}", *lines[1:], last], saved


def find_front(options: argparse.Namespace, stated: ProblemFile, table: Path, **how: Any) -> Found:
    """Find, save and draw a front, by arguments of `colloc.pareto_front`."""
    from colloc.studies.families import pareto_front

    def find(say: Callable[..., None]) -> ParetoFront:
        def report(k: int, point: Solution) -> None:
            say(f"gait {k} of the front", point)

        say("the ends of the front")
        return pareto_front(stated.problem, **how, progress=report)

    return find_family(options, stated, table, find, _front_table)


def _front_table(
    front: ParetoFront, members: dict[Path, Solution]
) -> tuple[str, dict[str, Any], list[str]]:
    (names, shown), gaps = front.in_units, {gap.after: gap for gap in front.gaps}
    aims, rows = [aim.expression for aim in front.objectives], list[dict[str, Any]]()
    lines = [
        f"{front.title}, {len(members)} gait{'s' * (len(members) > 1)}",
        f"      {''.join(f'{name:>16s}' for name in names)}",
    ]
    every = zip(members.items(), front.values.tolist(), shown.tolist(), strict=True)
    for k, ((path, point), values, numbers) in enumerate(every):
        both = zip((*aims, *names), (*values, *numbers), strict=True)
        rows.append(
            {"point": k}
            | {name: x for name, x in both if name in aims or numbers != values}
            | {name: getattr(point, name) for name in ("distance", "work", "status")}
            | {"file": str(path), "gap": gaps[k].why if k in gaps else ""}
        )
        lines.append(f"  {k:3d} {''.join(f'{x:16.7g}' for x in numbers)}  {point.status}")
        if k in gaps:
            lines.append(f"       no gait found between: {gaps[k].why}")
    lines += [f"  {front.narrow}"] * bool(front.narrow)
    content = io.StringIO(newline="")
    writer = csv.DictWriter(content, rows[0])
    writer.writeheader()
    writer.writerows(rows)
    facts = {
        "objectives": [aim.fields() for aim in front.objectives],
        "points": rows,
        "gaps": [asdict(gap) for gap in front.gaps],
    }
    return content.getvalue(), facts, lines
