"""Command line: a self-contained web page about a result, and its figures one by one for a publication.

Exit codes: 0 written, 2 bad file or option.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from colloc.commands.ending import OK, run
from colloc.commands.options import add_result, new_parser, output_path
from colloc.gaits.problem import Reference
from colloc.pictures.report_page import report_page
from colloc.results.store import load
from colloc.system.progress import StatusLine
from colloc.system.replaced_file import replaced_file

_EPILOG = """\
The page needs no network and no other file: certificate, animation with friction, shape space, speeds, power, convergence,
mesh, problem source, versions, and how to reproduce it. Results that failed get a page too.

  colloc report results/three_link.h5                 results/three_link.html
  colloc report results/three_link.h5 --figures       also results/three_link-*.pdf and .png, one panel each"""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser("report", "Write one self-contained web page about a result.", _EPILOG)
    add_result(parser)
    parser.add_argument("--problem", metavar="FILE.py", help="problem file whose REFERENCE to hold the result against")
    parser.add_argument("--figures", action="store_true", help="also write publication figures, PDF and PNG, one panel each")
    parser.add_argument("--output", metavar="PATH", help="folder, or .html file (default: beside the result)")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    return run(_parser(), _report, arguments)


def _report(options: argparse.Namespace) -> int:
    source = Path(options.result)
    solution = load(source)
    path = output_path(options.output, source.with_suffix(".html"))
    with StatusLine() as line:
        line.say("writing the page")
        page = report_page(solution, _reference(options.problem), _gap(solution, source.parent))
        with replaced_file(path) as temporary:
            Path(temporary).write_text(page, encoding="utf-8")
        figures: list[Path] = []
        if options.figures and solution.levels:
            from colloc.pictures.publication import save_panels

            line.say("drawing the figures")
            figures = save_panels(solution, path.with_suffix(""))
    print(f"saved {path} ({len(page) / 1000:.0f} kB, self-contained)")
    for figure in figures:
        print(f"  {figure}")
    return OK


def _reference(problem_file: str | None) -> Reference | None:
    if problem_file is None:
        return None
    from colloc.gaits.problem_file import read_problem_file

    return read_problem_file(problem_file).reference


def _gap(solution, folder: Path) -> str:
    from colloc.bounds.optimality_gap import gap_line, upper_bound

    if not solution.certificate.replayed:
        return ""
    bound = upper_bound(solution.problem, folder, compute=False)
    return gap_line(solution.problem, solution.certificate.efficiency, bound)


if __name__ == "__main__":
    sys.exit(main())
