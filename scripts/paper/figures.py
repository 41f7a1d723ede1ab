"""Every computed figure of the paper, redrawn from the stored parts of
`scripts/reproduce_paper.py`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from colloc.pictures.style import styled
from scripts.paper import figures_bodies, figures_crawlers, figures_maps
from scripts.paper.study import PaperStudy

FIGURES: tuple[tuple[Callable[..., list[Path]], tuple[str, ...]], ...] = (
    (figures_bodies.figure_3, ("instant",)),
    (figures_bodies.figure_4, ("flap",)),
    (figures_bodies.figure_5, ("waves",)),
    (figures_bodies.figure_6, ("waves",)),
    (figures_maps.figure_7, ("optima",)),
    (figures_maps.figure_8, ("connection",)),
    (figures_maps.figure_9, ("static",)),
    (figures_bodies.figure_10, ("static",)),
    (figures_maps.figure_11, ("plane", "optima")),
    (figures_maps.figure_12_maps, ("sweep", "optima")),
    (figures_bodies.figure_12_motion, ("motions",)),
    (figures_crawlers.figure_13, ("crawlers",)),
)
"""Each figure, and the parts whose arrays it takes in this order."""


def draw_all(study: PaperStudy, folder: Path) -> list[Path]:
    """Draw all figures whose parts are finished, and return the files written."""
    paths: list[Path] = []
    with styled():
        for draw, parts in FIGURES:
            if all(study.finished(part) for part in parts):
                paths += draw(*(study.arrays(part) for part in parts), folder)
    return paths
