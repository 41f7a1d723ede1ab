"""Friction on a link: closed form against n Gauss points, against delta: python -m benchmarks --only link_integrals

The reference is the textbook antiderivative in mpmath with 60 digits and more (`benchmarks.reference`). The error is that
of the tangential integral I0 and of the couple's I2, over their exact values; the worst and the median over the links.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.reference import link_moments as exact_moments
from benchmarks.tables import interleaved_seconds, markdown_table
from colloc.mechanics.link_friction import link_moments
from colloc.pictures.style import BLUE, GREEN, ORANGE, SKY, VERMILION, save, styled, subplots

LENGTH = 1 / 3
POINTS = (4, 8, 12, 20, 40, 100)
CLOSED = "closed form"


def gauss_moments(n: int, vs: np.ndarray, vn: np.ndarray, w: np.ndarray, delta: float) -> tuple[np.ndarray, np.ndarray]:
    """I0 and I2 with n Gauss points on the link, as a first version of such a code does it."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    sigma = 0.5 * LENGTH * nodes[:, None]
    weight = 0.5 * LENGTH * weights[:, None] / np.sqrt(vs**2 + (vn + w * sigma) ** 2 + delta**2)
    return weight.sum(axis=0), (weight * sigma**2).sum(axis=0)


def links(kind: str, count: int, delta: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Velocities (vs, vn, w): "sliding" at random, or "pivoting" about a point on the link with vs of order delta."""
    rng = np.random.default_rng(1)
    vs, vn, w = rng.normal(size=(3, count))
    if kind == "pivoting":
        vs, vn = delta * vs, -w * rng.uniform(-0.5, 0.5, count) * LENGTH
    return vs, vn, w


def worst_errors(kind: str, delta: float, count: int) -> dict[str, tuple[float, float]]:
    """Worst and median relative error of every method over the links."""
    vs, vn, w = links(kind, count, delta)
    exact = [exact_moments(float(a), float(b), float(c), LENGTH, delta) for a, b, c in zip(vs, vn, w, strict=True)]
    reference = np.array([[float(m[0]), float(m[2])] for m in exact]).T
    found = {CLOSED: link_moments(vs[None], vn[None], w[None], LENGTH, delta)}
    values = {CLOSED: np.array([found[CLOSED].I0[0], found[CLOSED].I2[0]])}
    values |= {f"Gauss {n}": np.array(gauss_moments(n, vs, vn, w, delta)) for n in POINTS}
    errors = {name: np.max(np.abs(value / reference - 1), axis=0) for name, value in values.items()}
    return {name: (float(e.max()), float(np.median(e))) for name, e in errors.items()}


def nanoseconds_per_link(count: int = 20_000) -> dict[str, float]:
    """Processor time of the three moments (two for Gauss) of one link, in a batch."""
    vs, vn, w = links("sliding", count, 1e-4)
    works: dict[str, Callable[[], object]] = {CLOSED: partial(link_moments, vs[None], vn[None], w[None], LENGTH, 1e-4)}
    works |= {f"Gauss {n}": partial(gauss_moments, n, vs, vn, w, 1e-4) for n in POINTS}
    return {name: 1e9 * seconds / count for name, seconds in interleaved_seconds(works).items()}


def report(quick: bool, folder: Path) -> str:
    """Tables of errors against delta and of times, and a figure."""
    deltas = [10.0**-k for k in ((1, 4, 8, 12) if quick else range(1, 13))]
    count = 60 if quick else 200
    errors = {(kind, d): worst_errors(kind, d, count) for kind in ("sliding", "pivoting") for d in deltas}
    times = nanoseconds_per_link()
    names = [CLOSED, *(f"Gauss {n}" for n in POINTS)]
    parts = []
    for kind in ("sliding", "pivoting"):
        rows = [[f"{d:.0e}", *(errors[kind, d][name][0] for name in names)] for d in deltas]
        parts.append(f"Worst relative error, {kind} links:\n\n" + markdown_table(["delta", *names], rows))
    medians = [["median error, pivoting, delta = 1e-4", *(errors["pivoting", 1e-4][name][1] for name in names)]]
    medians.append(["nanoseconds a link", *(times[name] for name in names)])
    parts.append(markdown_table(["", *names], medians))
    _figure(errors, times, deltas, names, folder)
    return "\n\n".join(parts)


def _figure(errors: dict, times: dict, deltas: list[float], names: list[str], folder: Path) -> None:
    colours = dict(zip(names, ("black", SKY, "#999999", ORANGE, GREEN, BLUE, VERMILION), strict=True))
    with styled():
        figure, (left, right) = subplots(1, 2, figsize=(8.2, 3.3))
        for name in names:
            line = [errors["pivoting", d][name][0] for d in deltas]
            left.loglog(deltas, line, color=colours[name], marker="o", ms=3, label=name)
            near = errors["pivoting", deltas[0]][name][0]
            right.loglog(times[name], near, "o", color=colours[name])
            right.annotate(name, (times[name], near), textcoords="offset points", xytext=(6, -3), fontsize=8)
        left.set(xlabel="delta", ylabel="worst relative error", title="A link that pivots about one of its points")
        left.legend(fontsize=7)
        right.set(
            xlabel="nanoseconds a link", ylabel="worst relative error", title=f"Work against error at delta = {deltas[0]:g}"
        )
        right.margins(x=0.3)
        save(figure, folder / "link_integrals")
