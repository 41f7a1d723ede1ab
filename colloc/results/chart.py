"""Line charts as inline SVG: axes, lines, marks, and a cursor that a script on the page can move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from colloc.results.markup import Markup, element

BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#777777"
COLOURS = (BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY, "#000000", "#8a7a00")
"""The palette of Okabe and Ito, with its yellow darkened to be read on white."""
_LEFT, _RIGHT, _TOP, _BOTTOM = 58, 12, 26, 38


def linear_ticks(low: float, high: float, count: int = 5) -> list[float]:
    """At most `count` + 1 round numbers within [low, high]."""
    span = max(high - low, 1e-300)
    power = 10.0 ** np.floor(np.log10(span / count))
    step = next(power * m for m in (1, 2, 2.5, 5, 10) if span / (power * m) <= count)
    first = np.ceil(low / step - 1e-9)
    return [float(k * step) + 0.0 for k in np.arange(first, np.floor(high / step + 1e-9) + 1)]


def log_ticks(low: float, high: float, count: int = 5) -> list[float]:
    """Powers of ten within [low, high], thinned out to about `count`."""
    first, last = int(np.ceil(np.log10(low) - 1e-9)), int(np.floor(np.log10(high) + 1e-9))
    step = max(1, -(-(last - first + 1) // count))
    return [10.0**k for k in range(first, last + 1, step)]


@dataclass
class Chart:
    """An SVG of `width` x `height` pixels that shows [x_low, x_high] x [y_low, y_high].

    Parameters
    ----------
    x, y : (float, float)
        Limits of the axes.
    title, x_label, y_label : str
    width, height : int
    log_x, log_y : bool
    """

    x: tuple[float, float]
    y: tuple[float, float]
    title: str
    x_label: str = ""
    y_label: str = ""
    width: int = 420
    height: int = 240
    log_x: bool = False
    log_y: bool = False
    parts: list[Markup] = field(default_factory=list)
    legend: list[tuple[str, str]] = field(default_factory=list)

    def px(self, x: np.ndarray | float) -> np.ndarray:
        """Horizontal pixels."""
        return _LEFT + _share(x, self.x, self.log_x) * (self.width - _LEFT - _RIGHT)

    def py(self, y: np.ndarray | float) -> np.ndarray:
        """Vertical pixels, from the top."""
        return self.height - _BOTTOM - _share(y, self.y, self.log_y) * (self.height - _TOP - _BOTTOM)

    def line(self, x: np.ndarray, y: np.ndarray, colour: str, name: str = "", *, width: float = 1.6, dash: str = "") -> None:
        """A polyline through finite points; a named one gets into the legend."""
        good = np.isfinite(x) & np.isfinite(y)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(self.px(x[good]), self.py(y[good]), strict=True))
        style = {"fill": "none", "stroke": colour, "stroke_width": width, "stroke_linejoin": "round"}
        self.parts.append(element("polyline", points=points, stroke_dasharray=dash or None, **style))
        if name:
            self.legend.append((name, colour))

    def marks(self, x: np.ndarray, y: np.ndarray, colour: str, size: float = 3.5, *, hollow: bool = False) -> None:
        """Circles."""
        fill = "white" if hollow else colour
        for a, b in zip(self.px(x), self.py(y), strict=True):
            self.parts.append(element("circle", cx=f"{a:.1f}", cy=f"{b:.1f}", r=size, fill=fill, stroke=colour))

    def level(self, y: float, text: str) -> None:
        """A dotted horizontal line with a word at its right end."""
        at = f"{float(self.py(y)):.1f}"
        right = self.width - _RIGHT
        style = {"stroke": GREY, "stroke_dasharray": "2 3"}
        self.parts.append(element("line", x1=_LEFT, x2=right, y1=at, y2=at, **style))
        self.parts.append(
            element("text", text, x=right - 3, y=f"{float(self.py(y)) - 4:.1f}", text_anchor="end", class_="note")
        )

    def ticks_below(self, x: np.ndarray, colour: str = GREY) -> None:
        """Short strokes on the horizontal axis: a mesh."""
        y = self.height - _BOTTOM
        path = "".join(f"M{a:.1f} {y}v-6" for a in self.px(x))
        self.parts.append(element("path", d=path, stroke=colour, stroke_width=0.8, fill="none"))

    def rectangle(self, x: tuple[float, float], y: tuple[float, float], colour: str) -> None:
        """A filled rectangle in data units."""
        a, b = self.px(np.array(x)), self.py(np.array(y))
        size = {"width": f"{a[1] - a[0]:.2f}", "height": f"{b[0] - b[1]:.2f}"}
        self.parts.append(element("rect", x=f"{a[0]:.2f}", y=f"{b[1]:.2f}", fill=colour, shape_rendering="crispEdges", **size))

    def cursor(self) -> None:
        """A vertical line that the page's script moves along x = phase."""
        low, high = float(self.px(self.x[0])), float(self.px(self.x[1]))
        end = {"y1": _TOP, "y2": self.height - _BOTTOM, "data_low": f"{low:.1f}", "data_high": f"{high:.1f}"}
        self.parts.append(element("line", class_="cursor", x1=f"{low:.1f}", x2=f"{low:.1f}", **end))

    def svg(
        self, x_ticks: Sequence[tuple[float, str]] | None = None, y_ticks: Sequence[tuple[float, str]] | None = None
    ) -> Markup:
        """The drawing; ticks are round numbers unless given as (value, label)."""
        right, bottom = self.width - _RIGHT, self.height - _BOTTOM
        axes = [element("path", d=f"M{_LEFT} {_TOP}V{bottom}H{right}", fill="none", stroke="#333")]
        for value, label in _ticks(self.x, self.log_x) if x_ticks is None else x_ticks:
            at = f"{float(self.px(value)):.1f}"
            axes.append(element("line", x1=at, x2=at, y1=bottom, y2=bottom + 4, stroke="#333"))
            axes.append(element("text", label, x=at, y=bottom + 15, text_anchor="middle", class_="tick"))
        for value, label in _ticks(self.y, self.log_y) if y_ticks is None else y_ticks:
            high = float(self.py(value))
            axes.append(element("line", x1=_LEFT - 4, x2=_LEFT, y1=f"{high:.1f}", y2=f"{high:.1f}", stroke="#333"))
            axes.append(element("text", label, x=_LEFT - 6, y=f"{high + 3.5:.1f}", text_anchor="end", class_="tick"))
        middle = (_TOP + bottom) / 2
        words = [
            element("text", self.title, x=8, y=14, class_="title"),
            element("text", self.x_label, x=(_LEFT + right) / 2, y=self.height - 6, text_anchor="middle", class_="label"),
            element(
                "text", self.y_label, x=12, y=middle, transform=f"rotate(-90 12 {middle})", text_anchor="middle", class_="label"
            ),
        ]
        names = element(
            "text",
            [element("tspan", f"{'  ' if k else ''}{name}", fill=colour) for k, (name, colour) in enumerate(self.legend)],
            x=right,
            y=14,
            text_anchor="end",
            class_="legend",
        )
        box = f"0 0 {self.width} {self.height}"
        return element("svg", axes, self.parts, words, names if self.legend else None, viewBox=box, role="img", class_="chart")


def _share(value: np.ndarray | float, limits: tuple[float, float], log: bool) -> np.ndarray:
    low, high = limits
    if log:
        value, low, high = np.log10(np.maximum(value, 1e-300)), np.log10(low), np.log10(high)
    return np.clip((np.asarray(value, dtype=float) - low) / (high - low), -0.02, 1.02)


def _ticks(limits: tuple[float, float], log: bool) -> list[tuple[float, str]]:
    if log:
        return [(value, f"1e{round(np.log10(value)):d}") for value in log_ticks(*limits)]
    return [(value, f"{value:.6g}".replace("-", "\N{MINUS SIGN}")) for value in linear_ticks(*limits)]
