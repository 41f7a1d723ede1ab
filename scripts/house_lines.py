"""Lines of the library before it had packages, when it got them, and now; and what of today's are new capabilities.

python -m scripts.house_lines [--commit HEAD]

A line of code is one that is not blank, a comment, part of a docstring or an import. A module counts as new if what it does
could not be asked for before; one that replaces another does not.
"""

from __future__ import annotations

import argparse
import ast
import io
import subprocess
import tarfile
from collections import Counter

FLAT, PACKED = "c613bd0", "a631038"
"""The last commit of the flat folder, and the move into packages, which took out what only scripts use."""
NEW = {
    "laws of friction other than Coulomb's": "laws/ mechanics/law numerics/expression",
    "objectives of one's own, fronts of two, what actuators can do": (
        "gaits/objective mechanics/driven_power reduced/driven_slopes studies/pareto commands/pareto pictures/front_figure "
        "mechanics/actuators reduced/actuator_slopes reduced/actuator_rows"
    ),
    "relaxed gaits and the finite ones near them": (
        "gaits/relaxed reduced/mixture_space search/relaxed_search results/relaxation results/realisation "
        "pictures/relaxed_figure"
    ),
    "the best of many starts, and of hops from the best": "search/global_search",
    "optima, saddles and kinks told apart": "reduced/second_order search/saddles numerics/kinks",
    "slopes": (
        "gaits/sloped numerics/orientation verification/gait_on_slope verification/slope verification/heading_map "
        "verification/collocated_slope verification/slope_replay reduced/sloped search/slope_search"
    ),
    "IPOPT's word on every answer": "search/full_program",
    "instants with several balanced motions": "mechanics/solution_branches verification/followed_motion",
    "the balance compiled, with exact slopes": "mechanics/native_kernel mechanics/chain_motion",
    "prescribed motions as problems": "gaits/prescribed smooth/prescribed_body search/prescribed",
    "the multipliers of a bound as a measure, bounds checked again": "bounds/measure bounds/recheck bounds/knots",
    "a problem file begun, archives opened, the Tab key": "commands/init commands/open commands/completion",
    "commands as functions, for notebooks": "studies/calls system/late_binding system/arguments",
    "grids on a cluster": "system/dask_pool",
    "Ctrl-C at any moment": "system/early_interruption",
}
"""What could not be asked for before, and the modules of the library that do it."""


def lines(commit: str) -> dict[str, tuple[int, int]]:
    """Module of the library, by its path in it without ending, to its lines and its lines of code at a commit."""
    packed = subprocess.run(["git", "archive", commit, "colloc"], capture_output=True, check=True).stdout
    found = {}
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        for member in archive:
            file = archive.extractfile(member) if member.name.endswith(".py") else None
            if file is not None:
                text = file.read().decode()
                found[member.name.removeprefix("colloc/").removesuffix(".py")] = (len(text.splitlines()), code_lines(text))
    return found


def code_lines(text: str) -> int:
    """Lines of a module that do something."""
    tree, other = ast.parse(text), set()
    for node in ast.walk(tree):
        words = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        if words or isinstance(node, (ast.Import, ast.ImportFrom)):
            other |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))  # type: ignore[attr-defined]
    rest = (line.strip() for number, line in enumerate(text.splitlines(), 1) if number not in other)
    return sum(bool(line) and not line.startswith("#") for line in rest)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--commit", default="HEAD", help="what counts as now (default: HEAD)")
    flat, packed, now = (lines(commit) for commit in (FLAT, PACKED, parser.parse_args().commit))
    packages: list[Counter[str]] = []
    for known in (packed, now):
        packages.append(Counter())
        for name, (count, _) in known.items():
            packages[-1][name.rpartition("/")[0] or "beside them"] += count
    print("| package | lines at the move | now |\n|---|---|---|")
    for name in sorted(packages[0] | packages[1]):
        print(f"| {name} | {packages[0][name]:,} | {packages[1][name]:,} |")
    print("\n| what | lines | of code |\n|---|---|---|")

    def row(what: str, parts: dict[str, tuple[int, int]]) -> tuple[int, int]:
        count, code = (sum(part[k] for part in parts.values()) for k in (0, 1))
        print(f"| {what} | {count:,} | {code:,} |")
        return count, code

    row("flat folder", flat)
    row("the same less what went to scripts", packed)
    row("now", now)
    old = dict(now)
    for what, modules in NEW.items():
        parts = modules.split()
        row(what, {name: old.pop(name) for name in now if any(f"{name}/".startswith(f"{part.rstrip('/')}/") for part in parts)})
    row("now, less all these", old)


if __name__ == "__main__":
    main()
