"""The table and figure of `scripts.class_table`, from the attempts kept so far: python -m scripts.class_report [--links 3]

Reads results/class_table.json; writes results/curated/gait_classes.md and gait_classes.png and .pdf beside it. For four
links: class_table_4.json, gait_classes_4.md and a figure of bodies; so for more.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from colloc import Chain, Friction
from colloc.bounds.infinitesimal import small_gait
from colloc.gaits.gait_fields import gait_from
from colloc.pictures.style import save
from scripts.class_rows import equal_links, known_small_gait
from scripts.figures_classes import GaitPanel, gait_figure
from scripts.frontier_rows import Row, smallest_bound
from scripts.frontier_rows import read as frontier
from scripts.link_gaps import LYING, gaps

CURATED = Path("results/curated")
DELTA = 1e-4
"""At unit shape speed, for every class."""
SHOWN_CHAINS = (
    *("harmonics 1", "harmonics 2", "harmonics 4", "curvature 1", "curvature 8", "corners 4 side", "corners 6 corner"),
    "corners 6 free",
)
SHOWN = ("harmonics 1", "harmonics 2", "harmonics 4", "curvature 2", "curvature 8", "corners 3", "corners 4 free")


def suffix(links: int) -> str:
    """What tells the files of other chains from those of three links."""
    return "" if links == 3 else f"_{links}"


def store(links: int) -> Path:
    """Where attempts are kept."""
    return Path(f"results/class_table{suffix(links)}.json")


def load(links: int) -> dict:
    """The attempts kept so far, by friction, row and start."""
    return json.loads(store(links).read_text()) if store(links).exists() else {}


def order(row: str) -> tuple[int, int, str]:
    kind, number, *rest = row.split()
    return (("harmonics", "curvature", "corners").index(kind), int(number), " ".join(rest))


def class_words(row: str) -> str:
    """A row's class as the table prints it."""
    kind, number, *rest = row.split()
    if kind == "harmonics":
        return f"{number} harmonic{'s' if number != '1' else ''}, bilateral"
    if kind == "curvature":
        return f"free path, curvature <= {number}, bilateral"
    words = {(): "bilateral", ("corner",): "bilateral, axis through a corner", ("side",): "bilateral, axis through a side"}
    return f"polygon, {number} corners, {'no symmetry' if rest == ['free'] else words[tuple(rest)]}"


def best(attempts: dict) -> dict | None:
    """The most efficient certified attempt of a row."""
    solved = [a for a in attempts.values() if a["status"] == "solved"]
    return max(solved, key=lambda a: a["efficiency"]) if solved else None


def table(links: int, friction: str, known: dict) -> list[str]:
    """Lines of one friction set."""
    mu = Friction(*(float(value) for value in friction.split(",")))
    lines = [
        f"## (mu_t, mu_f, mu_b) = ({friction.replace(',', ', ')})",
        "",
        bound_line(mu) if links == 3 else chain_bound_line(links, mu),
        "",
    ]
    lines += [
        "| class | efficiency | delta -> 0 | d | W | path length | gap | lying | replay gap | starts (certified) | best from |",
        "|" + "---|" * 11,
    ]
    for row in sorted(known, key=order):
        attempts, found = known[row], best(known[row])
        tally = f"{len(attempts)} ({sum(a['status'] == 'solved' for a in attempts.values())})"
        if found is None:
            lines.append(f"| {class_words(row)} | none certified | | | | | | | | {tally} | |")
            continue
        seed = next(name for name, a in attempts.items() if a is found)
        least, lying = gaps(equal_links(links), gait_from(found["gait"]))
        efficiency = f"{found['efficiency']:.4f}{'*' if smaller_delta(row, found) else ''}"
        lines.append(
            f"| {class_words(row)} | {efficiency} | {found['at zero delta']:.4f} | {found['distance']:.4f} | "
            f"{found['work']:.4f} | {found['length']:.2f} | "
            f"{least:.3f} | {lying:.0%} | {abs(found['replay gap']):.0e} | {tally} | {seed} |"
        )
    return [*lines, ""]


def smaller_delta(row: str, found: dict) -> bool:
    """Whether a row was solved at less than the usual delta (harmonic gaits measure it per period)."""
    unit = found["length"] if row.startswith("harmonics") else 1.0
    return found["delta"] < 0.3 * DELTA * unit


def bound_line(friction: Friction) -> str:
    """What no gait can exceed, as far as it is known here, and what the smallest gaits reach."""
    mu = (friction.mu_t, friction.mu_f, friction.mu_b)
    least = smallest_bound(Row(mu, float(np.pi), 3, 0.0), frontier())
    trivial = 1 / friction.smallest
    upper = f"{least:.4f} (sampled; scripts.frontier)" if least < trivial else f"{trivial:.4g} = 1/min(mu)"
    places = {"(2.2, -2.2)": (2.2, -2.2), "the fold (pi, 0)": (3.1415, 0.0)}
    at = {name: small_gait(Chain(), friction, np.array(shape)).efficiency for name, shape in places.items()}
    reached = ", ".join(f"{value:.4f} at {name}" for name, value in at.items())
    return f"Upper bound on every gait: {upper}. Infinitesimal gaits reach {reached}."


def chain_bound_line(links: int, friction: Friction) -> str:
    """The same for four and more links."""
    reached = {name: known_small_gait(name, links, friction) for name in ("best small gait", "fold")}
    words = [f"{g.efficiency:.4f} at ({', '.join(f'{a:g}' for a in shape)})" for g, shape in reached.values()]
    return (
        f"Upper bound on every gait: {1 / friction.smallest:.4g} = 1/min(mu); the program of a smaller one does not finish for "
        "more than three links (docs/bound.md). Infinitesimal gaits on a coarse grid of shapes, from which searches start, "
        f"reach {words[0]} and, near a fold, {words[1]}."
    )


HEADS = {3: "three", 4: "four", 5: "five"}


def head(links: int) -> list[str]:
    """The title and what holds for all rows."""
    command = "`python -m scripts.class_table` (`--friction mu_t,mu_f,mu_b --short` for the shorter tables)."
    command = command if links == 3 else f"`python -m scripts.class_table --links {links}`."
    lines = [
        f"# Efficiency against class of gaits, {HEADS.get(links, links)} equal links",
        "",
        f"{command} Joint limit pi; path",
        "length at least 0.628 rad; sides of polygons at least 0.02 rad; delta = 1e-4 at unit shape speed, 1e-5 in rows with",
        "an asterisk, where delta changes the efficiency by more than 1 %. Every efficiency is that of an independent replay",
        "whose certificate holds (replay gap at most 1e-4); the class is explained in docs/gait_classes.md. Local optima of",
        "few starts: a class may hold better ones. Starts that failed under earlier code and were repeated count once.",
        "Links have no thickness. *Gap*: the smallest distance, over the whole gait, between links that are not neighbours,",
        "and from the free end of a link to its neighbour [body lengths]; *lying*: the share of the path on which it is",
        f"below {LYING:g}, so that links lie on each other. The best gaits whose links keep 0.05 apart: without_contact.md.",
    ]
    if links > 3:
        lines.append('"Fewer links": the best gait of the class with one link less, laid into the longer chain.')
    return [*lines, ""]


def write(links: int, known: dict) -> None:
    """Writes results/curated/gait_classes.md, and .png/.pdf for three links, from the attempts kept so far."""
    lines = head(links)
    for friction in known:
        lines += table(links, friction, known[friction])
    CURATED.mkdir(parents=True, exist_ok=True)
    (CURATED / f"gait_classes{suffix(links)}.md").write_text("\n".join(lines), encoding="utf-8")
    draw(links, known)


def draw(links: int, known: dict) -> None:
    """The figure: bodies and joint angles of some rows."""
    body, panels = equal_links(links), []
    for row in SHOWN if links == 3 else SHOWN_CHAINS:
        found = best(known.get("1,1,1", {}).get(row, {}))
        if found is not None:
            gait = gait_from(found["gait"])
            _, lying = gaps(body, gait)
            name = class_words(row).replace(", bilateral", "").replace("<=", "≤")
            title = f"{name}: d/W = {found['efficiency']:.4f}, d = {found['distance']:.3f}"
            panels.append(GaitPanel(f"{title}, lying {lying:.0%}" if lying > 0 else title, gait))
    if panels:
        save(gait_figure(panels, body), CURATED / f"gait_classes{suffix(links)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, default=3, help="equal links (default: 3)")
    links = parser.parse_args().links
    known = load(links)
    if not known:
        parser.error(f"there is no {store(links)}; python -m scripts.class_table makes it.")
    write(links, known)


if __name__ == "__main__":
    main()
