"""What `scripts.class_table` searches: classes of gaits, and where their searches begin."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from colloc import Chain, Corners, Fourier, FreePath, Friction, Harmonic, Polygon, Problem, ellipse
from colloc.bounds.infinitesimal import SmallGait, small_gait
from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.starts import LATIN_HYPERCUBE, start_gait
from colloc.mechanics.contact import crossing_depth
from colloc.system.row_file import cached, hash_of

SIZE = 0.7
"""Length [rad] of polygons made of infinitesimal gaits."""
FEWER = "fewer links"
"""The start from the best gait of the same class with one link less."""
_STARTS = 6
CACHE = Path("results/small_gaits_chains.sqlite")
_PHASES = np.linspace(0.0, 1.0, 1001)


class Row(NamedTuple):
    """A class of gaits, its mesh intervals, and where searches start: names of other rows, or of gaits (`named_gait`)."""

    gait_class: AnyClass
    intervals: int
    seeds: list[str]


def equal_links(links: int) -> Chain:
    """The chain of so many equal links."""
    return Chain((1 / links,) * links)


def rows(links: int, short: bool) -> dict[str, Row]:
    """Classes by name, in the order in which they are solved."""
    return three_link_rows(short) if links == 3 else chain_rows(links)


def three_link_rows(short: bool) -> dict[str, Row]:
    """The rows of three links; `short`: fewer of them."""
    result: dict[str, Row] = {}
    curvatures = (2, 8) if short else (1, 2, 4, 8, 16, 32)
    for before, k in zip((0, *curvatures), curvatures, strict=False):
        seeds = [f"curvature {before}"] if before else ["large loop"]
        seeds += ["small triangle"] if k >= 8 else ["middle loop"]
        result[f"curvature {k}"] = Row(FreePath(k, "bilateral"), 60 if k < 16 else 80, list(dict.fromkeys(seeds)))
    harmonics = (1, 2, 4) if short else range(1, 9)
    for n in harmonics:
        seeds = [f"harmonics {m}" for m in harmonics if m < n][-1:]
        seeds.append("large loop" if n == 1 else "curvature 8")
        seeds += [f"start {k}" for k in range(4)] if n == 2 and not short else []
        result[f"harmonics {n}"] = Row(Harmonic(n, "bilateral"), 30 + 6 * n, seeds)
    nearest = f"curvature {curvatures[-1]}"
    for m in (3, 4) if short else range(3, 9):
        result |= polygon_rows(m, 10 * m, ["small triangle"], ["best small gait"], [nearest], ["fold"])
    return result


def chain_rows(links: int) -> dict[str, Row]:
    """The rows of four and more links."""
    result: dict[str, Row] = {}
    starts = [f"start {k}" for k in range(_STARTS)]
    few = starts[:2]
    harmonics = (1, 2, 3, 4, 6) if links == 4 else (1, 2, 3, 4)
    for before, n in zip((0, *harmonics), harmonics, strict=False):
        seeds = [FEWER, *(starts if n < 4 else few)]
        if before:
            seeds += [f"harmonics {before}", "curvature 8", "corners 6 corner"]
        result[f"harmonics {n}"] = Row(Harmonic(n, "bilateral"), 24 + 6 * n, seeds)
    for before, k in zip((0, 1, 2, 4), (1, 2, 4, 8), strict=True):
        seeds = [f"curvature {before}"] if before else []
        near = f"harmonics {1 if k == 1 else 2 if k == 2 else 4}"
        result[f"curvature {k}"] = Row(FreePath(k, "bilateral"), 50 if k < 4 else 60, [*seeds, near, FEWER])
    for m in range(3, 7):
        own = [f"corners {m}"] if m % 2 else [f"corners {m} corner", f"corners {m} side"]
        first, more = [FEWER, *starts[2:]], ["curvature 8", FEWER, *few]
        result |= polygon_rows(m, 10 * m, first, ["best small gait"], more, ["fold", *own])
    return result


def polygon_rows(
    corners: int, intervals: int, first: list[str], first_free: list[str], more: list[str], more_free: list[str]
) -> dict[str, Row]:
    """Polygons with so many corners, bilateral and without symmetry; `first` are starts of those with three corners."""
    result: dict[str, Row] = {}
    for axis in ("corner",) if corners % 2 else ("corner", "side"):
        before = [f"corners {corners - 1}{'' if (corners - 1) % 2 else ' ' + axis}"] if corners > 3 else first
        name = f"corners {corners}{'' if corners % 2 else ' ' + axis}"
        result[name] = Row(Polygon(corners, "bilateral", axis), intervals, list(dict.fromkeys([*before, *more])))
    before = [f"corners {corners - 1} free"] if corners > 3 else first_free
    result[f"corners {corners} free"] = Row(Polygon(corners, "none"), intervals, [*before, *more_free])
    return result


def named_gait(name: str, links: int, friction: Friction, gait_class: AnyClass) -> AnyGait:
    """A start by name, for a class."""
    if name == "large loop":
        return ellipse(0, 2.8, 1.3)
    if name == "middle loop":
        return ellipse(0, 1.8, 1.2)
    if name == "small triangle":
        return Corners(np.array([[2.0, 2.9, 2.0], [-2.0, -2.0, -2.9]]))
    if name.startswith("start"):
        joint = np.arange(links - 1) - 0.5 * (links - 2)
        any_guess = Fourier(np.zeros(links - 1), -0.3 * joint[:, None], np.full((links - 1, 1), 0.4))
        seeded = Problem("seeded", any_guess, equal_links(links), gait=gait_class)
        return start_gait(seeded, LATIN_HYPERCUBE, 0, int(name.split()[1]))
    small, shape = known_small_gait(name, links, friction)
    return Corners(small.path(shape, SIZE))


def known_small_gait(name: str, links: int, friction: Friction) -> tuple[SmallGait, np.ndarray]:
    """The best infinitesimal gait over a grid of shapes, "best small gait", or near folded ones, "fold"; and its shape."""
    body = equal_links(links)
    if links == 3:
        if name == "fold":
            shape = np.array([3.0, -0.03])
        else:
            grid = [np.array([a, b]) for a in np.linspace(0.4, 2.8, 4) for b in np.linspace(-2.8, 2.8, 5)]
            shape = max(grid, key=lambda s: small_gait(body, friction, s, directions=36, headings=4).efficiency)
        return small_gait(body, friction, shape), shape
    key = hash_of({"links": links, "law": [friction.mu_t, friction.mu_f, friction.mu_b], "name": name})

    def found() -> dict:
        gait, shape = _searched_small_gait(name, body, friction)
        numbers = {"rates": gait.rates.tolist(), "weights": gait.weights.tolist(), "shape": shape.tolist()}
        return {"efficiency": gait.efficiency, "heading": gait.heading} | numbers

    kept = cached(CACHE, key, found)
    numbers = (np.array(kept[k]) for k in ("rates", "weights"))
    return SmallGait(kept["efficiency"], kept["heading"], *numbers), np.array(kept["shape"])


def _searched_small_gait(name: str, body: Chain, friction: Friction) -> tuple[SmallGait, np.ndarray]:
    """The same, computed: programs over few directions choose, from all shapes, those that are worth one over many."""
    values = (-3.0, 0.03, 3.0) if name == "fold" else (-2.6, -1.3, 0.1, 1.3, 2.6)
    shapes = [np.array(s) for s in product(values, repeat=body.n_joint) if sum(s) > 0]
    if name == "fold":
        shapes = [s for s in shapes if np.abs(s).max() > 2.9]
    shapes = [s for s in shapes if not crossing_depth(body, s[:, None]).any()]
    rough = sorted(shapes, key=lambda s: -small_gait(body, friction, s, 36, 3, 0).efficiency)[:20]
    found = [(small_gait(body, friction, s, 180, 4, 2), s) for s in rough]
    apart = [(g, s) for g, s in found if not crossing_depth(body, Corners(g.path(s, SIZE)).angles(_PHASES)).any()]
    small, shape = max(apart or found, key=lambda item: item[0].efficiency)
    return small, shape
