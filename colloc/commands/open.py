"""Command line: what an archive of starts holds, and the whole solution of one of its starts.

Exit codes: 0 opened, 2 bad file or option, 3 not converged, 4 certificate failed, 130 interrupted.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from colloc.commands.ending import NONE_FOUND, OK, command
from colloc.commands.multistart import summary_dict, summary_lines
from colloc.commands.options import add_printing, add_verbose, new_parser, output_path, tell
from colloc.commands.solve import EXIT
from colloc.commands.summary import kept_facts, kept_lines
from colloc.commands.summary import summary_dict as solution_dict
from colloc.commands.summary import summary_lines as solution_lines
from colloc.gaits.starts import LATIN_HYPERCUBE, SAMPLERS
from colloc.results.archive import StartName, archive_at
from colloc.results.distinct_optima import basins
from colloc.system.errors import ProblemError
from colloc.system.progress import StatusLine

_EPILOG = """\
Without --start: the distinct optima of the archive. With it: that start, solved again from its gait
(from its guess, if it had failed) and saved as a result like any other, for colloc report, animate,
verify and export.

  colloc open results/three_link.starts.h5
  colloc open results/three_link.starts.h5 --start 7     results/three_link.start-7.h5"""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser(
        "open", "Show what an archive of starts holds, or make a result of one of them.", _EPILOG
    )
    parser.add_argument(
        "archive", metavar="ARCHIVE.h5", help="an archive that colloc multistart wrote"
    )
    parser.add_argument("--start", type=int, metavar="N", help="the start to make a result of")
    parser.add_argument("--seed", type=int, default=0, help="of the sampler (default: 0)")
    parser.add_argument("--sampler", choices=SAMPLERS, default=LATIN_HYPERCUBE)
    parser.add_argument(
        "--output", metavar="PATH", help="folder, or .h5 file (default: beside the archive)"
    )
    add_printing(parser)
    add_verbose(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    archive = archive_at(options.archive)
    problem, outcomes = archive.problem, archive.of_search(options.sampler, options.seed)
    if options.start is None:
        shown = list(archive.outcomes.values())
        found = basins(problem, shown)
        tell(
            options,
            summary_dict(problem, shown, found, archive.path),
            summary_lines(problem, shown, found),
        )
        return OK if found else NONE_FOUND
    if options.start not in outcomes:
        there = sorted({f"{name.sampler} seed {name.seed}" for name in archive.outcomes})
        raise ProblemError(
            f"{options.archive} holds no start {options.start} of {options.sampler} seed "
            f"{options.seed}; "
            f"it holds {len(archive.outcomes)} starts of {', '.join(there) or 'no sampler'}."
        )
    name = f"{problem.name}.start-{options.start}"
    path = output_path(options.output, Path(options.archive).with_name(f"{name}.h5"))
    from colloc.results.kept import save_result

    # heavy imports only now: a bad option is refused at once
    from colloc.studies.calls import (
        reopened,
    )

    with StatusLine(enabled=not (options.quiet or options.json)) as line:
        line.say(f"{problem.name}: start {options.start}")
        solution = reopened(
            problem, archive.outcomes[StartName(options.sampler, options.seed, options.start)]
        )
    saved = save_result(solution, path)
    facts = {**solution_dict(solution, saved[0].path, None, None), "kept": kept_facts(saved)}
    lines = solution_lines(solution, None, verbose=options.verbose)
    tell(options, facts, [*lines, f"  saved {saved[0].path}", *kept_lines(saved)])
    return EXIT[solution.status]
