"""Command line: many starts of a problem file, in parallel and resumable; distinct optima with
their frequencies."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from colloc.commands.ending import INTERRUPTED, NONE_FOUND, OK, command
from colloc.commands.options import (
    add_bound,
    add_printing,
    add_problem,
    changed,
    new_parser,
    output_path,
    tell,
)
from colloc.commands.summary import bound_facts
from colloc.gaits.gait_fields import fields
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import read_problem_file
from colloc.gaits.starts import LARGEST_SEED, LATIN_HYPERCUBE, SAMPLERS, on_speed_floor
from colloc.results.distinct_optima import Basin, basins
from colloc.results.outcome import STATUSES, Outcome, counts
from colloc.results.solution import SOLVED
from colloc.system.arguments import is_whole
from colloc.system.errors import ProblemError
from colloc.system.progress import StatusLine

if TYPE_CHECKING:
    from colloc.results.archive import StartName

_MOST_BASINS_SHOWN = 12
_SEARCH = {"seed": 0, "sampler": LATIN_HYPERCUBE}


_EPILOG = """\
Exit codes: 0 at least one certified optimum; 2 bad problem or option; 3 none found; 130
interrupted.

Start k of a seed is the same gait whatever --starts and --workers are. What the archive of the
problem holds already is not solved again: the same command goes on after Ctrl-C, and a larger
--starts or another --seed adds to it.

  colloc multistart problems/three_link.py --starts 100 --workers 2"""


def _parser() -> argparse.ArgumentParser:
    what = "Solve a problem from many seeded random starts and list the distinct certified optima."
    parser = new_parser("multistart", what, _EPILOG)
    add_problem(parser)
    parser.add_argument(
        "--starts", type=int, default=20, metavar="N", help="starts 0 to N-1 (default: 20)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the sampler (default: 0)")
    parser.add_argument(
        "--workers",
        type=int,
        default=1,
        metavar="N",
        help="processes, one BLAS thread each (default: 1)",
    )
    parser.add_argument(
        "--sampler",
        choices=SAMPLERS,
        default=LATIN_HYPERCUBE,
        help="perturbed: near the problem's guess",
    )
    parser.add_argument(
        "--time-limit",
        type=float,
        default=300.0,
        metavar="S",
        help="seconds for one start (default: 300)",
    )
    parser.add_argument(
        "--retry",
        action="store_true",
        help="solve again what ended in an error, a crash or the time limit",
    )
    add_bound(parser)
    parser.add_argument(
        "--output", metavar="PATH", help="folder, or .h5 file (default: results/NAME.starts.h5)"
    )
    add_printing(parser)
    return parser


def _checked(options: argparse.Namespace) -> None:
    for name, least in (("starts", 1), ("workers", 1), ("seed", 0)):
        if not is_whole(getattr(options, name), least, LARGEST_SEED):
            raise ProblemError(
                f"--{name} must be at least {least}, and at most {LARGEST_SEED}, not "
                f"{getattr(options, name)}."
            )
    if not options.time_limit > 0:
        raise ProblemError(f"--time-limit must be positive, not {options.time_limit:g}.")


def outcome_line(outcome: Outcome) -> str:
    """One line about a start."""
    return (
        f"{outcome.start:6d} {outcome.value:11.6f} {outcome.iterations:6d} "
        f"{outcome.seconds:8.2f}  {outcome.status}"
    )


OUTCOME_HEADER = " start       value   iter  seconds  status"


def summary_lines(
    problem: Problem, outcomes: Sequence[Outcome], found: Sequence[Basin]
) -> list[str]:
    """What a person wants to know at the end."""
    tally = ", ".join(f"{n} {status}" for status, n in counts(outcomes).items())
    lines = [f"{problem.name}: {len(outcomes)} starts: {tally}; {len(found)} distinct optima"]
    for basin in found[:_MOST_BASINS_SHOWN]:
        share = f"{len(basin.starts)} of {len(outcomes)} starts"
        floor = (
            "  on the bound smallest_shape_speed"
            if on_speed_floor(problem, basin.best.gait)
            else ""
        )
        lines.append(
            f"  {problem.objective.name} {basin.best.value:.6f}  {share:<20s} best: start "
            f"{basin.best.start}{floor}"
        )
    if len(found) > _MOST_BASINS_SHOWN:
        lines.append(f"  ... and {len(found) - _MOST_BASINS_SHOWN} more")
    failures = [o for o in outcomes if o.status != SOLVED]
    lines += [f"  start {o.start}: {o.status}: {o.message}" for o in failures[:_MOST_BASINS_SHOWN]]
    return lines


def summary_dict(
    problem: Problem, outcomes: Sequence[Outcome], found: Sequence[Basin], path: Path | None
) -> dict:
    """The same as one JSON object."""
    return {
        "name": problem.name,
        "problem_hash": problem.hash,
        "file": str(path),
        "starts": len(outcomes),
        "counts": {status: counts(outcomes).get(status, 0) for status in STATUSES},
        "optima": [
            {
                "value": b.best.value,
                "efficiency": b.best.efficiency,
                "frequency": b.frequency,
                "starts": list(b.starts),
                "on_speed_floor": on_speed_floor(problem, b.best.gait),
                "gait": fields(b.best.gait),
            }
            for b in found
        ],
        "failures": [
            {"start": o.start, "status": o.status, "message": o.message}
            for o in outcomes
            if o.status != SOLVED
        ],
    }


def _others_lines(kept: Mapping[StartName, Outcome], shown: int) -> list[str]:
    """What the archive holds besides the starts that were asked for."""
    if len(kept) == shown:
        return []
    best = max(
        kept, key=lambda name: kept[name].value if kept[name].status == SOLVED else -math.inf
    )
    what = (
        f"; the best of all, {kept[best].value:.6f}, is start {best.number} of seed "
        f"{best.seed} "
        f"({best.sampler})"
    )
    return [
        f"  starts in the file besides: "
        f"{len(kept) - shown}{what if kept[best].status == SOLVED else ''}"
    ]


@command(_parser)
def main(options: argparse.Namespace) -> int:
    _checked(options)
    problem = changed(read_problem_file(options.problem).problem, options)
    path = output_path(options.output, Path("results") / f"{problem.name}.starts.h5")
    # heavy imports only now: a bad problem is refused at once
    from colloc.bounds.optimality_gap import gap_line, upper_bound
    from colloc.results.archive import open_archive, save_archive
    from colloc.studies.multistart import run_archive

    quiet = options.quiet or options.json
    archive = open_archive(problem, path)  # or refused, before anything is solved
    done = archive.done(options.sampler, options.seed, options.starts, retry=options.retry)
    # there may be more than memory holds
    todo = (k for k in range(options.starts) if k not in done)
    to_go = options.starts - len(done)
    if not quiet:
        print(f"{len(done)} starts done already, {to_go} to go", flush=True)
        print(OUTCOME_HEADER, flush=True)
    begin = time.perf_counter()
    interrupted = False
    settings = {
        "sampler": options.sampler,
        "seed": options.seed,
        "workers": options.workers,
        "time_limit": options.time_limit,
    }
    try:
        with StatusLine(enabled=not quiet) as line:
            line.say(f"{problem.name}: 0 of {to_go} starts")
            for count, outcome in enumerate(run_archive(archive, todo, **settings), 1):
                if not quiet:
                    line.clear()
                    print(outcome_line(outcome), flush=True)
                left = (time.perf_counter() - begin) / count * (to_go - count)
                line.say(f"{problem.name}: {count} of {to_go} starts", left)
    except KeyboardInterrupt:
        interrupted = True
    save_archive(archive, options.command)
    outcomes = list(archive.of_search(options.sampler, options.seed, options.starts).values())
    found = basins(problem, outcomes)
    lines, bound = summary_lines(problem, outcomes, found), None
    if found:
        bound = upper_bound(problem, path.parent, compute=options.bound)
        lines.append(gap_line(problem, max(basin.best.efficiency for basin in found), bound))
        which = "".join(
            f" --{k} {getattr(options, k)}" for k, v in _SEARCH.items() if getattr(options, k) != v
        )
        lines.append(
            f"  colloc open {path} --start {found[0].best.start}{which}   makes a result of "
            f"the best"
        )
    lines += [*_others_lines(archive.outcomes, len(outcomes)), f"  saved {path}"]
    facts = {
        **summary_dict(problem, outcomes, found, path),
        "bound": bound_facts(bound),
        "interrupted": interrupted,
    }
    tell(options, facts, lines)
    if interrupted:
        print("colloc: interrupted; run the same command again to go on.", file=sys.stderr)
        return INTERRUPTED
    return OK if found else NONE_FOUND
