"""Style, colours (Okabe and Ito) and saving of figures, which are made without pyplot."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib import style
from matplotlib.figure import Figure

from colloc.system.files import replaced_file

BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
GREY, INK = "#777777", "#1d2329"
SERIES = (BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY, GREY, "#8a7a00")  # of links or joints
VELOCITY, FORCE = BLUE, VERMILION
SEQUENTIAL, PHASE = "viridis", "cividis_r"
_DPI = 150
_STYLE: Any = {
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # else every tick is laid out once more, to see that a title is free of it
    "text.hinting": "none",  # a fifth quicker, and true to the font's spacing
    "legend.fontsize": 8,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.dpi": 110,
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "colloc",
    "figure.constrained_layout.use": True,
}


@contextmanager
def figure_style(font_size: float = 9) -> Iterator[None]:
    with style.context(
        ["default", {**_STYLE, "font.size": font_size, "axes.labelsize": font_size}]
    ):
        yield


class Picture(Figure):
    """A figure that notebooks show, as they do those of pyplot."""

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        with figure_style():
            self.savefig(content, format="png")
        return content.getvalue()


def save(
    figure: Figure, stem: Path, kinds: tuple[str, ...] = ("png", "pdf"), dpi: float = _DPI
) -> list[Path]:
    """Write ``STEM.KIND`` for every kind; returns the paths."""
    paths = [stem.with_name(f"{stem.name}.{kind}") for kind in kinds]
    for path, kind in zip(paths, kinds, strict=True):
        with replaced_file(path) as temporary, figure_style():
            how: Any = {
                "pdf": {"metadata": {"CreationDate": None}},
                "png": {"pil_kwargs": {"compress_level": 1}},  # a third quicker, a tenth larger
            }
            figure.savefig(temporary, format=kind, dpi=dpi, **how[kind])
        figure.set_layout_engine("none")  # the first layout holds for the others
    return paths


def snapshot_colours(count: int) -> np.ndarray:
    """Colours from light (first) to dark (last)."""
    return matplotlib.colormaps[PHASE](np.linspace(0.15, 1.0, count))
