"""Command line: solve a problem file, certify the result, save it and draw it.

Exit codes: 0 solved, 2 bad problem or option, 3 not converged, 4 certificate failed, 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from colloc.errors import CollocError, ProblemError
from colloc.problem import FORMULATIONS, Problem, Reference
from colloc.problem_file import read_problem_file
from colloc.solution import CERTIFICATE_FAILED, NOT_CONVERGED, SOLVED, Level, Solution

if TYPE_CHECKING:
    from colloc.bound import Bound

EXIT = {SOLVED: 0, NOT_CONVERGED: 3, CERTIFICATE_FAILED: 4}
BAD_PROBLEM, INTERRUPTED = 2, 130


class Parser(argparse.ArgumentParser):
    """Refuses bad options in one sentence, with the exit code of a bad problem."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_PROBLEM, f"colloc: {message}; see {self.prog} --help.\n")


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="python -m colloc.solve",
        description="Find the gait of largest efficiency d/W for a problem file, and certify it by an independent replay.",
        epilog="Exit codes: 0 solved; 2 bad problem or option; 3 not converged; 4 certificate failed. "
        "A failed solve is kept as NAME.failed.h5 and never replaces a good NAME.h5.",
    )
    parser.add_argument("problem", help="a Python file that states PROBLEM, for example problems/three_link.py")
    parser.add_argument("--delta", type=float, metavar="SPEED", help="final regularisation speed of friction")
    parser.add_argument("--mesh", type=int, metavar="N", help="intervals of the first mesh")
    parser.add_argument("--mesh-tolerance", type=float, metavar="TOL", help="relative efficiency error to refine to; 0: never")
    parser.add_argument("--scheme", metavar="NAME", help="trapezoid, hermite-simpson, gauss-N or radau-N")
    parser.add_argument("--formulation", choices=FORMULATIONS, help="how the balance becomes constraints")
    parser.add_argument("--start", metavar="FILE.h5", help="start from the gait of an earlier result")
    parser.add_argument("--output", metavar="PATH", default="results", help="folder, or .h5 file (default: results/NAME.h5)")
    parser.add_argument(
        "--bound", action="store_true", help="compute an upper bound on every gait (a minute; kept in bounds.json)"
    )
    parser.add_argument("--no-figure", action="store_true", help="do not draw NAME.png and NAME.pdf")
    parser.add_argument("--json", action="store_true", help="print one JSON object on standard output, and nothing else")
    parser.add_argument("--quiet", action="store_true", help="print the final summary only")
    return parser


def _changed(problem: Problem, options: argparse.Namespace) -> Problem:
    """The problem with the command line's changes."""
    wanted = {
        "delta": options.delta,
        "intervals": options.mesh,
        "mesh_tolerance": options.mesh_tolerance,
        "scheme": options.scheme,
        "formulation": options.formulation,
    }
    changes: dict[str, object] = {name: value for name, value in wanted.items() if value is not None}
    if options.start is not None:
        from colloc.store import load

        changes["guess"] = load(options.start).gait
    return problem.with_(**changes) if changes else problem


def _target(output: str, problem: Problem) -> Path:
    """The file to write, in a folder that exists and can be written."""
    path = Path(output)
    path = path if path.suffix == ".h5" else path / f"{problem.name}.h5"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ProblemError(f"cannot make the folder {path.parent}: {error.strerror or error}.") from None
    if not os.access(path.parent, os.W_OK) or path.is_dir():
        raise ProblemError(f"cannot write {path}; choose another --output.")
    return path


def level_line(level: Level) -> str:
    """One line about a level of the continuation."""
    flag = "" if level.optimal else f"   ({level.status})"
    return (
        f"{level.delta:9.1e} {level.edges.size - 1:6d} {level.efficiency:11.6f} {level.distance:9.5f} {level.work:9.5f} "
        f"{level.iterations:6d} {level.seconds:8.2f}{flag}"
    )


LEVEL_HEADER = "    delta   mesh  efficiency         d         W   iter  seconds"


def summary_lines(solution: Solution, reference: Reference | None) -> list[str]:
    """What a person wants to know at the end."""
    lines = [f"{solution.problem.name}: {solution.status} in {solution.seconds:.1f} s"]
    certificate = solution.certificate
    if certificate is not None:
        lines += [
            f"  efficiency d/W  {certificate.efficiency:.6f} +- {certificate.efficiency_error:.0e} by independent replay "
            f"({certificate.instants} instants); {certificate.efficiency_at_zero_delta:.6f} for delta -> 0",
            f"  distance d      {certificate.distance:.6f}      work W  {certificate.work:.6f}",
        ]
        lines += [f"  gait            {text}" for text in _gait_lines(solution)]
        for check in certificate.checks:
            mark = "ok " if check.passed else "NO "
            lines.append(f"  {mark} {check.name:<21s} {check.value:9.1e}  (<= {check.threshold:.0e})  {check.meaning}")
        if reference is not None:
            difference = certificate.efficiency - reference.efficiency
            agree = "agrees with" if abs(difference) <= reference.tolerance else "DIFFERS from"
            lines.append(f"  {agree} {reference.efficiency:g} +- {reference.tolerance:g} ({reference.source})")
    if solution.message:
        lines.append(f"  {solution.message}")
    return lines


def _gait_lines(solution: Solution) -> list[str]:
    gait = solution.gait
    lines = []
    for j in range(gait.n_joint):
        terms = [f"{gait.mean[j]:+.4f}"]
        for k in range(gait.n_harmonic):
            wave = "2πt" if k == 0 else f"{2 * (k + 1)}πt"
            terms.append(f"{gait.cos[j, k]:+.4f} cos {wave} {gait.sin[j, k]:+.4f} sin {wave}")
        lines.append(f"joint {j + 1}: " + " ".join(terms))
    return lines


def summary_dict(solution: Solution, path: Path, reference: Reference | None, bound: Bound | None) -> dict:
    """The same as one JSON object."""
    certificate = solution.certificate
    result: dict = {
        "name": solution.problem.name,
        "status": solution.status,
        "message": solution.message,
        "file": str(path),
        "problem_hash": solution.problem.hash,
        "seconds": solution.seconds,
        "delta": solution.last.delta,
        "efficiency": solution.efficiency,
        "distance": solution.distance,
        "work": solution.work,
        "iterations": sum(level.iterations for level in solution.levels),
        "gait": {key: getattr(solution.gait, key).tolist() for key in ("mean", "cos", "sin")},
        "certificate": None,
        "reference": None,
        "bound": None if bound is None else {"sampled": bound.sampled, "guaranteed": bound.guaranteed},
        "versions": solution.versions,
    }
    if certificate is not None:
        result["certificate"] = {
            "passed": certificate.passed,
            "efficiency": certificate.efficiency,
            "efficiency_error": certificate.efficiency_error,
            "efficiency_at_zero_delta": certificate.efficiency_at_zero_delta,
            "checks": {c.name: {"value": c.value, "threshold": c.threshold, "passed": c.passed} for c in certificate.checks},
        }
    if reference is not None:
        keys = ("efficiency", "tolerance", "source")
        result["reference"] = {key: getattr(reference, key) for key in keys}
    return result


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    quiet = options.quiet or options.json
    try:
        stated = read_problem_file(options.problem)
        problem = _changed(stated.problem, options)
        path = _target(options.output, problem)
        return _solve(problem, stated.source, stated.reference, path, options, quiet)
    except CollocError as error:
        print(f"colloc: {error}", file=sys.stderr)
        return BAD_PROBLEM
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  the reader of a pipe left; the result is saved
        return BAD_PROBLEM
    except KeyboardInterrupt:
        print("colloc: interrupted; nothing was written.", file=sys.stderr)
        return INTERRUPTED


def _solve(
    problem: Problem, source: str, reference: Reference | None, path: Path, options: argparse.Namespace, quiet: bool
) -> int:
    # heavy imports only now: a bad problem is refused at once
    from colloc.gap import gap_line, upper_bound
    from colloc.optimise import maximise_efficiency
    from colloc.store import save

    if not quiet:
        print(LEVEL_HEADER, flush=True)

    def show(level: Level) -> None:
        if not quiet:
            print(level_line(level), flush=True)

    solution = maximise_efficiency(problem, show)
    solution.source = source
    if solution.status != SOLVED:
        path = path.with_suffix(".failed.h5")
    save(solution, path)
    bound = upper_bound(problem, path.parent, compute=options.bound)
    efficiency = solution.efficiency if solution.certificate is None else solution.certificate.efficiency
    if not options.no_figure:
        from colloc.figures import save_figure, solution_figure

        save_figure(solution_figure(solution), path)
    if options.json:
        print(json.dumps(summary_dict(solution, path, reference, bound)))
    else:
        print("\n".join([*summary_lines(solution, reference), gap_line(problem, efficiency, bound)]))
        print(f"  saved {path}" + ("" if options.no_figure else f", {path.with_suffix('.png')}"))
    return EXIT[solution.status]


if __name__ == "__main__":
    sys.exit(main())
