"""The best gaits known, and whether links touch in them: python -m scripts.without_contact [--only WORD] [--table]

Links have no thickness in the model, so the most efficient gaits fold the body and slide links along each other. This table
puts beside them the best gaits found whose links keep apart: the gap (`mechanics.contact.gap`: between links that are not
neighbours, and from the free end of a link to its neighbour) is at least 0.05 body lengths all the way. Joints are limited to
pi - arcsin(0.05/l), which keeps neighbours of length l that far apart; what is left is measured. Isotropic friction, equal
links. Resumable: gaits are kept in results/without_contact.json. Writes results/curated/without_contact.md.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from colloc import Corners, FreePath, Friction, Harmonic, Polygon, Problem
from colloc.bounds.infinitesimal import small_gait
from colloc.gaits.gait_fields import AnyClass, AnyGait, fields, gait_from
from colloc.gaits.path_samples import path_length
from colloc.gaits.starts import delta_in, laid_into, prolonged
from colloc.results.solution import SOLVED, Solution
from colloc.search.solve import solve
from colloc.system.errors import CollocError
from colloc.system.replaced_file import replaced_file
from scripts.class_rows import equal_links, named_gait
from scripts.class_table import FAR
from scripts.link_gaps import INSTANTS, LYING, gaps

GAP = 0.05
"""Body lengths: what counts as apart."""
STORE, OUTPUT = Path("results/without_contact.json"), Path("results/curated/without_contact.md")
PAIR = "travelling pair"


class Case(NamedTuple):
    """A search: links, class, start, whether links keep apart, least path length over 2 pi, and delta at unit shape speed.

    The start is another case, `PAIR`, a name that `scripts.class_rows` knows, or the shape of an infinitesimal gait.
    """

    links: int
    gait_class: AnyClass
    start: str | tuple[float, ...]
    apart: bool
    speed: float = 0.1
    delta: float = 1e-4


def cases() -> dict[str, Case]:
    """All searches by name, in the order in which they are made."""
    return {
        "3 fold": Case(3, Polygon(3), (3.0, -0.03), False),
        "3 fold, smaller": Case(3, Polygon(3), (3.0, -0.03), False, 0.02, 2e-5),
        "3 harmonic, apart": Case(3, Harmonic(1, "bilateral"), "middle loop", True),
        "3 harmonic": Case(3, Harmonic(1, "bilateral"), "middle loop", False),
        "3 path": Case(3, FreePath(8, "bilateral"), "middle loop", True),
        "3 harmonics": Case(3, Harmonic(8, "bilateral"), "3 path", True),
        "3 fold, apart": Case(3, Polygon(3), (2.9, -0.03), True),
        "3 fold, apart, smaller": Case(3, Polygon(3), (2.97, -0.03), True, 0.02, 2e-5),
        "4 fold": Case(4, Polygon(3), (3.0, -3.0, 0.03), False),
        "4 fold, richer": Case(4, Polygon(4), "4 fold", False, delta=1e-5),
        "4 apart": Case(4, Polygon(6), (2.8, -2.8, 1.5), True),
        "4 apart, drier": Case(4, Polygon(6), "4 apart", True, delta=1e-5),
        "4 bends": Case(4, Polygon(6, "bilateral", "corner"), (0.05, 0.05, 0.05), True, delta=1e-5),
        "5 fold": Case(5, Polygon(4, "bilateral", "corner"), (-2.9, 2.9, -2.9, 2.9), False),
        "5 pair, apart": Case(5, Polygon(4, "bilateral", "corner"), PAIR, True),
        "5 pair, apart, richer": Case(5, Polygon(6, "bilateral", "corner"), "5 pair, apart", True),
        "5 pair, apart, drier": Case(5, Polygon(6, "bilateral", "corner"), "5 pair, apart, richer", True, delta=1e-5),
    }


def joint_limit(case: Case) -> float:
    """The largest joint angle [rad]."""
    return float(np.pi - np.arcsin(GAP * case.links)) if case.apart else float(np.pi)


def travelling_pair(links: int, limit: float, open_by: float) -> Corners:
    """A zigzag whose joints are open by an angle but for a pair of neighbours, at the limit, that travels along it."""
    joints = np.arange(links - 1)
    pair = [(), *((j, j + 1) for j in joints[:-1])]
    opening = np.array([[0.0 if j in closed else open_by for closed in pair] for j in joints])
    return Corners((limit - opening) * (-1.0) ** (joints[:, None] + 1))


def guess(case: Case, known: dict) -> AnyGait:
    """Where a search starts."""
    if isinstance(case.start, str) and case.start != PAIR:
        stored = known.get(case.start)
        return gait_from(stored["gait"]) if stored else named_gait(case.start, case.links, Friction(), case.gait_class)
    if case.start == PAIR:
        return travelling_pair(case.links, joint_limit(case), 0.5)
    search = {} if case.links == 3 else {"headings": 4, "rounds": 2}  # as `scripts.class_rows` does
    small = small_gait(equal_links(case.links), Friction(), np.array(case.start), **search)
    return Corners(small.path(np.array(case.start), 1.1 * 2 * np.pi * case.speed))


def stated(case: Case, start: AnyGait) -> Problem:
    """The problem of a case; delta is that at unit shape speed, the search begins at 100 times it."""
    body, limit = equal_links(case.links), joint_limit(case)
    delta = delta_in(case.gait_class, start, case.delta)
    laid = laid_into(case.gait_class, start, body, limit, case.speed)
    problem = Problem("apart", laid, body, Friction(), case.gait_class, delta, FAR * delta, limit, case.speed)
    return problem.with_(intervals={Polygon: 30, FreePath: 60, Harmonic: 78}[type(case.gait_class)])


def solved(case: Case, known: dict) -> Solution:
    """The search of a case."""
    start = guess(case, known)
    before = known.get(case.start, {}) if isinstance(case.start, str) else {}
    problem = stated(case, start)
    return solve(prolonged(problem, start, case.gait_class) if "efficiency" in before else problem, 1)


def attempt(case: Case, known: dict) -> dict:
    """One search, as plain numbers."""
    begin = time.process_time()
    try:
        solution = solved(case, known)
    except CollocError as error:
        return {"status": "error", "message": str(error)}
    result: dict = {"status": solution.status, "message": solution.message, "gait": fields(solution.gait)}
    if (c := solution.certificate) is not None:
        result |= {"efficiency": c.efficiency, "at zero delta": c.efficiency_at_zero_delta}
        result |= {"distance": c.distance, "work": c.work, "length": path_length(solution.gait)}
    return result | {"cpu seconds": time.process_time() - begin}


def load() -> dict:
    """The searches kept so far, by name."""
    return json.loads(STORE.read_text()) if STORE.exists() else {}


def keep(name: str, result: dict) -> None:
    """Adds a search to the store."""
    STORE.parent.mkdir(exist_ok=True)
    with replaced_file(STORE) as temporary:
        Path(temporary).write_text(json.dumps(load() | {name: result}))


def line(case: Case, found: dict) -> str:
    """A row of the table."""
    words = f"{case.links} | {class_words(case.gait_class)} | {joint_limit(case):.3f} | "
    words += f"{2 * np.pi * case.speed:.3f} | {case.delta:.0e} | "
    if found["status"] != SOLVED:
        return f"| {words}{found['status']} | | | | | | |"
    least, lying = gaps(equal_links(case.links), gait_from(found["gait"]))
    return (
        f"| {words}{found['efficiency']:.4f} | {found['at zero delta']:.4f} | {found['distance']:.4f} | {found['work']:.4f} | "
        f"{found['length']:.2f} | {least:.3f} | {lying:.0%} |"
    )


def class_words(gait_class: AnyClass) -> str:
    """A class as the table prints it."""
    if isinstance(gait_class, Harmonic):
        return f"{gait_class.harmonics} harmonic{'s' if gait_class.harmonics > 1 else ''}, {gait_class.symmetry}"
    if isinstance(gait_class, FreePath):
        return f"free path, curvature <= {gait_class.curvature:g}, {gait_class.symmetry}"
    return f"polygon, {gait_class.corners} corners, {gait_class.symmetry.replace('none', 'no symmetry')}"


def write(known: dict) -> None:
    """The table of what is known."""
    lines = [
        "# With and without contact: the best gaits known of three, four and five equal links, isotropic friction",
        "",
        "`python -m scripts.without_contact`. Links have no thickness in the model. *Gap*: the smallest distance, over the",
        "whole gait, between links that are not neighbours, and from the free end of a link to its neighbour [body lengths].",
        f"*Lying*: the share of the path on which the gap is below {LYING:g}, so that links lie on each other. Joint limits",
        f"below pi keep neighbours {GAP:g} apart; the gap is measured at {INSTANTS:,} instants. Every efficiency is that of an",
        "independent replay whose certificate holds. Local optima, each from one start.",
        "",
        "| links | class | joint limit | length at least | delta | d/W | delta -> 0 | d | W | length | gap | lying |",
        "|" + "---|" * 12,
        *(line(case, known[name]) for name, case in cases().items() if name in known),
    ]
    OUTPUT.parent.mkdir(parents=True, exist_ok=True)
    OUTPUT.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="searches whose name contains this; they are made again")
    parser.add_argument("--table", action="store_true", help="write the table from what there is")
    options = parser.parse_args()
    for name, case in cases().items() if not options.table else ():
        if (name in load() and not options.only) or options.only not in name:
            continue
        result = attempt(case, load())
        keep(name, result)
        print(
            f"{name:<24s} {result['status']:<18s} {result.get('efficiency', np.nan):.6f} {result['message'][:90]}", flush=True
        )
        if "gait" in result:
            print(f"  gap, lying: {gaps(equal_links(case.links), gait_from(result['gait']))}, {result['cpu seconds']:.0f} s")
    write(load())


if __name__ == "__main__":
    main()
