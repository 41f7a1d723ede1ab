"""Published results beside those of colloc: python -m benchmarks.published [PART ...] [--output
FOLDER]

Writes FOLDER/published.md (FOLDER is results by default) and the film FOLDER/assets/snakes.svg; or
prints the rows of the named parts, the functions of this module in `PARTS`. Every row is computed
anew; nothing is adjusted to what is published, which is what the named text says, read there, or
what the named program does, run here; *derived* is a formula or an integration written apart from
the library (`benchmarks.peers.drag`), where a text prints no number. A verdict is judged in the code
of the row: agreement to the digits printed, or of the order or sign that a sentence states.

The parts elastica and kinematic, and the film, run other people's simulators: pip install
pyelastica==1.0.0 kinematic-snake==1.0.0. Without them the other rows are made.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from benchmarks.peers import drag, snakes
from benchmarks.tables import markdown_table
from colloc import (
    Chain,
    Corners,
    Fourier,
    Friction,
    Harmonic,
    PathLimit,
    Problem,
    Solution,
    Viscous,
    ellipse,
    replay,
)  # fmt: skip
from colloc.gaits.gait_fields import AnyGait as Gait
from colloc.mechanics.law import Law
from colloc.search.solve import solve
from colloc.smooth.balance import Motion
from colloc.smooth.smooth_body import Wave
from scripts.models.period import period
from scripts.program import command_line

SWIMMER = Viscous(normal=drag.NORMAL, tangential=drag.TANGENTIAL)
PAPER = "Alben 2019"
THREE_LINKS = "Alben, arXiv:2012.03379"
SNAKES = "Alben 2013"
COMMENT = "Raz, Avron, arXiv:0706.3906"
DISPLACED = (
    2.017955906441066, 1.353385144748382, 0.013112519773635,
    0.263823759269392, -0.031456173657342, -0.003626287235861,
)  # fmt: skip
EFFICIENT = (
    1.495398722861924, 1.326600886340017, 0.083253854456986,
    0.089227148110158, -0.034695750579259, -0.044559551791058,
)  # fmt: skip
HEADER = ("paper or program", "quantity", "published", "colloc", "difference")


@dataclass(frozen=True)
class Row:
    """What a text says, or a program does, and what colloc gives: a line of the table."""

    quantity: str
    paper: str
    published: str
    colloc: str
    holds: bool | None  # None: nothing was claimed
    note: str = ""

    @property
    def cells(self) -> tuple[str, ...]:
        """In the order of `HEADER`."""
        verdict = {True: "agrees", False: "**differs**", None: ""}[self.holds]
        last = "; ".join(filter(None, (self.note, verdict)))
        return self.paper, self.quantity, self.published, self.colloc, last


def number(
    what: str, paper: str, published: float, ours: float, tolerance: float, note: str = ""
) -> Row:
    """A row about a number, published to within `tolerance`."""
    holds, note = abs(ours - published) <= tolerance, f"; {note}" if note else ""
    return Row(
        what, paper, f"{published:g}", f"{ours:.5g}", holds, f"{ours - published:+.2g}{note}"
    )


def solved(law: Law, gait: Harmonic, starts: int = 8, **stated: object) -> Solution:
    """The certified optimum of three equal links."""
    found = solve(Problem("published", friction=law, gait=gait, **stated), starts)  # type: ignore[arg-type]
    if found.status != "solved":
        raise RuntimeError(f"{found.problem!r}: {found.status}; {found.message}")
    return found


@cache
def swimmer(
    harmonics: int, symmetry: str, starts: int = 8, objective: str = "towing", floor: float = 0.1
) -> Solution:
    """The best stroke of Purcell's swimmer in a class; with one start, near the straight shape."""
    settings = {
        "objective": objective,
        "guess": ellipse(0, 0.7, 0.7),
        "smallest_shape_speed": floor,
    }
    return solved(SWIMMER, Harmonic(harmonics, symmetry), starts, **settings)


def distance(gait: Gait, instants: int = 400) -> float:
    """How far a stroke takes the swimmer."""
    return replay(Chain(), SWIMMER, gait, 1e-4, instants=instants).distance


def circle(amplitude: float) -> float:
    """The same of a circular stroke."""
    return distance(
        Fourier(np.zeros(2), amplitude * np.eye(2)[:, :1], amplitude * np.eye(2)[:, 1:]), 160
    )


def scallop() -> Row:
    line = np.array([[1.2], [-0.5]])

    def path(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.sin(2 * np.pi * t) * line, 2 * np.pi * np.cos(2 * np.pi * t) * line

    gone = replay(Chain(), SWIMMER, path, 1e-4, instants=80, most_instants=160).distance
    source = "Wagner, Lauga, arXiv:1303.2669, on viscous fluids"
    return Row(
        "retraced stroke", source, "no locomotion on average", f"d = {gone:.1g}", gone < 1e-12
    )


def circular_optimum() -> Row:
    gait = swimmer(1, "antipodal").gait
    axes = np.linalg.svd(np.column_stack([gait.cos, gait.sin]), compute_uv=False)
    ours = f"semi-axes {axes[0]:.3f} and {axes[1]:.3f} rad round 0"
    what, said = "most efficient moderate stroke", "an approximate circle at the centre"
    return Row(what, COMMENT, said, ours, axes[0] < 1.2 * axes[1])


def nearly_harmonic() -> Row:
    share = swimmer(1, "antipodal", 1).measured.value / swimmer(5, "antipodal", 1).measured.value
    ours = f"one harmonic has {share:.3f} of the efficiency of five"
    what, said = "Tam and Hosoi's most efficient stroke", "close to a time-harmonic motion"
    return Row(what, f"{PAPER}, section V", said, ours, share > 0.9)


def large_strokes() -> Row:
    ratio = swimmer(5, "bilateral").measured.value / swimmer(5, "antipodal", 1).measured.value
    note = "larger strokes do win; theirs keep to a limit on the angles that the text we read lost"
    what = "efficiency of a large off-centre stroke over the centred one"
    return number(what, COMMENT, 1.53, ratio, 5e-3, note)


def printed_stroke(coefficients: Sequence[float]) -> Fourier:
    """A stroke by its coefficients (a1, b1, a3, b3, a5, b5) along the diagonals of the plane of
    joint angles."""
    cos, sin = np.zeros((2, 5)), np.zeros((2, 5))
    cos[:, ::2] = np.outer([1.0, 1.0], coefficients[::2]) / np.sqrt(2)
    sin[:, ::2] = np.outer([1.0, -1.0], coefficients[1::2]) / np.sqrt(2)
    return Fourier(np.zeros(2), cos, sin)


def at_best_pace(gait: Gait) -> float:
    """Lighthill's efficiency of a stroke's path run through at constant power."""
    t = (np.arange(4000) + 0.5) / 4000
    body, at = Chain(), (SWIMMER, gait.angles(t), gait.rates(t), 1e-4)
    power = body.motion(*at, body.solve(*at)).power
    return float((distance(gait) / np.sqrt(power).mean()) ** 2)


def strokes_of_others() -> list[Row]:
    """Strokes that a program prints as optimal for the same swimmer, beside the optima from
    them."""
    rows = []
    for objective, name, coefficients, value, what in (
        ("distance", "MaxDisplacement", DISPLACED, distance, "distance"),
        ("towing", "MaxEfficiency", EFFICIENT, at_best_pace, "d²/W at its best pace"),
    ):
        theirs = printed_stroke(coefficients)
        ours = solved(SWIMMER, Harmonic(5, "antipodal"), 1, objective=objective, guess=theirs).gait
        gain = value(ours) - value(theirs)
        better = gain > 1e-3 * value(theirs)
        rows.append(
            Row(
                f"best moderate stroke: {what}",
                f"GeometricSystemPlotter, shchf_LowRe_{name}.m; replayed",
                f"{value(theirs):.6f}",
                f"{value(ours):.6f}",
                None if better else abs(gain) < 1e-3 * value(theirs),
                f"{gain:+.2g}" + "; from theirs colloc finds a better one" * better,
            )
        )
    return rows


def reversal() -> Row:
    found = minimize_scalar(circle, bounds=(1.5, 2.9), method="bounded", options={"xatol": 1e-6})
    ours = f"the circular stroke stands still at {found.x:.4f} rad"
    holds = found.fun < 1e-6 and min(circle(1.5), circle(2.9)) > 0.05
    source = "Wiezel, Or, arXiv:1603.02268"
    return Row("direction of large strokes", source, "reversal of the direction", ours, holds)


def small_stroke() -> Row:
    size = 0.02
    ours = circle(size) / (np.pi * size**2)
    exact = drag.displacement_per_area()
    source = "derived: curl and bracket of the connection at the straight shape (5/243)"
    return number("displacement of a small stroke per area", source, round(exact, 7), ours, 1e-5)


def best_small_stroke() -> Row:
    sizes = (0.1, 0.05)
    values = [swimmer(1, "antipodal", 1, "distance / work", size).measured.value for size in sizes]
    ours = values[1] + (values[1] - values[0]) / 3  # errors fall like the square of the size
    source = (
        "derived: isoperimetric ellipse of F. Alouges et al., arXiv:1801.04687 (abstract), in the "
        "metric of the power"
    )
    exact = round(drag.best_small_stroke(), 6)
    return number("largest d/W of small strokes, period 1", source, exact, ours, 1e-5)


def small_wave() -> Row:
    amplitude, waves = 0.05, 16.0
    wave = Wave("sine", amplitude, waves).prescribed()
    how: Any = {"intervals": 1, "nodes": 6, "quadrature_tolerance": 1e-8}
    # in units of the wave's own speed times mean squared slope
    ours = period(wave, SWIMMER, 1e-3, **how).d * waves / (amplitude**2 / 2)
    source = (
        "derived: long filament of J. Gray and G. J. Hancock (1955), c_n/c_t - 1 for small slopes"
    )
    exact = drag.NORMAL / drag.TANGENTIAL - 1
    return number("speed of a small wave along a filament", source, exact, ours, 1e-2)


def resistance_laws() -> Row:
    lines, parts = [], []
    for mu in (2.0, 100.0):
        gaits = [Harmonic(1, symmetry) for symmetry in ("antipodal", "bilateral")]
        dry = max(solved(Friction(mu_t=mu), gait).measured.value for gait in gaits)
        linear = max(
            solved(Viscous(normal=mu, tangential=1.0), gait, objective="towing").measured.value
            for gait in gaits
        )
        lines.append(f"{linear:.4f} against {dry:.4f} at {mu:g}")
        parts.append(linear / dry)
    said = "relative efficiencies much lower if linear, except at very large normal friction"
    holds = parts[0] < 0.2 and parts[1] > 0.9
    return Row("linear against dry resistance", THREE_LINKS, said, "; ".join(lines), holds)


def symmetric_ellipses() -> Row:
    values = {
        s: solved(Friction(), Harmonic(1, s), 24).measured.value
        for s in ("none", "bilateral", "antipodal")
    }
    best = max(values["bilateral"], values["antipodal"])
    ours = ", ".join(f"{name} {value:.4f}" for name, value in values.items())
    said = "symmetric ellipses have about the same peak efficiency as all"
    return Row(
        "symmetric subspaces, equal coefficients",
        THREE_LINKS,
        said,
        ours,
        abs(best / values["none"] - 1) < 0.02,
    )


def ellipse_optima() -> list[Row]:
    rows = []
    for what, printed, tolerance, guess in (
        ("best ellipse, equal coefficients", 0.259, 1.5e-3, ellipse(0.1, 2.5, 1.2)),
        ("second optimum, offset 1.1", 0.207, 1.5e-3, ellipse(1.1, 0.7, 1.1)),
    ):
        found = solved(Friction(), Harmonic(1, "bilateral"), 1, guess=guess)
        note = f"found at offset {abs(found.gait.mean[0]):.2f}"
        rows.append(
            number(what, f"{PAPER}, section V", printed, found.measured.value, tolerance, note)
        )
    return [*rows, third_ellipse()]


def third_ellipse() -> Row:
    """The best ellipse at the printed offset: its optimum in the offset too lies elsewhere."""
    offset = 2.5

    def loss(axes: np.ndarray) -> float:
        if offset + np.hypot(*axes) > np.pi:
            return 0.0
        return -replay(
            Chain(), Friction(), ellipse(offset, *axes), 1e-4, instants=160, tolerance=1e-4
        ).efficiency

    how: Any = {"maxfev": 120, "xatol": 1e-3, "fatol": 1e-5}
    best = -minimize(loss, (0.35, 0.4), method="Nelder-Mead", options=how).fun
    where = f"{PAPER}, section V"
    return number("third optimum, offset 2.5", where, 0.094, best, 1.5e-3, "at that offset")


def waves() -> list[Row]:
    rows = []
    for what, printed, motion, friction in (
        ("sine wave, (100, 1, 1)", 0.76, Wave().prescribed(), Friction(mu_t=100, mu_f=1, mu_b=1)),
        (
            "tanh wave of amplitude 1.3, (1, 100, 100)",
            0.93,
            Wave("tanh", 1.3, 2.0).prescribed(),
            Friction(mu_t=1, mu_f=100, mu_b=100),
        ),
    ):
        ours = _efficiency(motion, friction)
        rows.append(number(what, f"{PAPER}, section III", printed, ours, 5e-3))
    return rows


def _efficiency(motion: Motion, friction: Friction) -> float:
    return float(
        period(motion, friction, 1e-3, intervals=1, nodes=6, quadrature_tolerance=1e-6).efficiency
    )


def peak(value: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """Where a value is largest."""
    how = {"bounds": (low, high), "method": "bounded", "options": {"xatol": tolerance}}
    return float(minimize_scalar(lambda x: -value(x), **how).x)


def amplitude_exponent() -> Row:
    def at(mu: float) -> float:
        law = Friction(mu_t=mu, mu_f=1, mu_b=1)
        return peak(lambda a: _efficiency(Wave("sine", a, 2.0).prescribed(), law), 0.05, 1, 1e-4)

    slopes = np.diff(np.log([at(mu) for mu in (1e3, 1e4, 1e5)])) / np.log(10)
    ours = f"{slopes[0]:.4f} from mu_t = 1e3 to 1e4, {slopes[1]:.4f} to 1e5"
    holds = abs(slopes[1] + 0.25) < 5e-3 and abs(slopes[1] + 0.25) < abs(slopes[0] + 0.25)
    what = "best amplitude of a sine wave against mu_t"
    return Row(what, SNAKES, "decays as the power -1/4", ours, holds)


def link_ratio() -> Row:
    """How much farther than with a middle link twice as long as the others Purcell's square stroke
    takes the best swimmer."""

    def gone(ratio: float, corner: float) -> float:
        body = Chain(tuple(np.array([1.0, ratio, 1.0]) / (2 + ratio)))
        stroke = Corners(corner * np.array([[1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]]))
        how: Any = {"instants": 160, "breaks": stroke.corner_phases}
        return replay(body, SWIMMER, stroke, 1e-4, **how).distance

    found = []
    for corner in np.radians((1.0, 30.0)):
        ratio = peak(lambda ratio, at=corner: gone(ratio, at), 0.3, 3.0, 1e-3)  # type: ignore[misc]
        found.append((ratio, 100 * (gone(ratio, corner) / gone(2.0, corner) - 1)))
    (small, gain), (large, more) = found
    return Row(
        "best link lengths of Purcell's swimmer",
        "Giraldi and others, arXiv:1412.8133",
        "a gain in displacement of roughly 60 % over the classical design",
        f"{gain:.1f} % for small square strokes, {more:.1f} % with corners at 30°, of a middle link "
        f"{small:.3f} and {large:.3f} times the outer ones over one twice as long",
        55 < gain < more < 65,
    )


def wave_of_bending(links: int = 12, starts: int = 1) -> Row:
    """The lag between neighbouring joints in the best small stroke of a swimmer of many links."""
    found = solved(
        SWIMMER,
        Harmonic(1, "antipodal"),
        starts,
        body=Chain((1 / links,) * links),
        joint_limit=0.15,
        objective="distance / work",
        smallest_shape_speed=0.1,
    ).gait
    phases = np.unwrap(np.angle(found.cos[:, 0] - 1j * found.sin[:, 0]))
    lags = np.abs(np.degrees(np.diff(phases)))
    return number(
        f"lag between joints in the best small stroke, {links} links [degrees]",
        "F. Alouges et al., arXiv:1801.04687, abstract of version 1: a travelling wave, of the "
        "shortest possible wavelength of three links, for many links",
        120,
        float(lags.mean()),
        3,
        f"between {lags.min():.1f} and {lags.max():.1f}",
    )


SNAKE, BEND = Friction(mu_t=snakes.SIDEWAYS, mu_f=snakes.FORWARD, mu_b=snakes.BACKWARD), 7.2


@cache
def in_elastica() -> dict[str, tuple[Fourier | None, np.ndarray]]:
    """PyElastica's snake at its optimum, and by the gait that takes a snake of eight links farthest
    with no more bend per body length: the gait, and the nodes in PyElastica. A rod ten times as
    stiff follows the gait; the example's gives way."""
    optimum = snakes.elastica_nodes()
    equal: Any = {"body": Chain((1 / 8,) * 8), "joint_limit": BEND / 8, "froude": snakes.FROUDE}
    farthest = solved(SNAKE, Harmonic(1, "antipodal"), **equal, objective="distance").gait
    at, of = np.arange(1, snakes.ELEMENTS) / snakes.ELEMENTS, np.arange(1, 8) / 8
    cos, sin = (
        np.interp(at, of, 8 / snakes.ELEMENTS * part[:, 0])[:, None]
        for part in (farthest.cos, farthest.sin)
    )
    gait = Fourier(np.zeros(at.size), cos, sin)
    return {
        "PyElastica's optimum by CMA-ES": (None, optimum),
        "colloc's gait": (gait, snakes.elastica_nodes(gait, modulus=1e7, dt=2.5e-5)),
        "colloc's gait in the softer rod of the example": (gait, snakes.elastica_nodes(gait)),
    }


def replayed(body: Chain, gait: Fourier, froude: float) -> float:
    """How far a snake goes in a cycle, with inertia."""
    return replay(body, SNAKE, gait, 1e-3, tolerance=1e-5, froude=froude).distance


def largest_bend(gait: Fourier) -> float:
    """Per body length, of equal links."""
    angles = gait.angles(np.linspace(0.0, 1.0, 401))
    return float((len(angles) + 1) * np.abs(angles).max())


def slow(body: Chain, gait: Fourier) -> tuple[float, float, float]:
    """Distance, d/W and largest moment at a joint [weight x body length] without inertia."""
    limits = [PathLimit("moment", "moment", 1.0)]
    played = replay(body, SNAKE, gait, 1e-3, instants=200, tolerance=1e-4, limits=limits)
    return played.distance, played.efficiency, float(np.max(played.shares))


def elastica() -> list[Row]:
    """PyElastica's snake at its optimum and by the gait of colloc."""
    froude, paper, rows = snakes.FROUDE, "PyElastica", []
    for who, (gait, nodes) in in_elastica().items():
        body, shown = snakes.shapes(nodes)
        published, bend = round(snakes.distance(nodes), 4), largest_bend(shown)
        what = f"{who}: body lengths per cycle, Froude number {froude:g}; its shapes replayed"
        moved = replayed(body, shown, froude)
        rows.append(number(what, paper, published, moved, 0.002, f"bend up to {bend:.2f}"))
        if gait is not None:
            moved = replayed(Chain((1 / snakes.ELEMENTS,) * snakes.ELEMENTS), gait, froude)
            what = f"{who}: the same, as stated"
            rows.append(number(what, paper, published, moved, 0.003, f"bend up to {BEND:g}"))

    def compared(what: str, theirs: tuple[float, ...], ours: tuple[float, ...]) -> Row:
        said = "{:.4f}; {:.4f}; {:.4f}".format
        gains = np.round(100 * np.divide(ours, theirs) - 100) + 0.0  # no minus at zero
        note = "{:+.0f} %; {:+.0f} %; {:+.0f} %".format(*gains)
        what = f"slowly, {what}: body lengths per cycle; d/W; peak moment"
        return Row(what, f"{paper}, its shapes replayed", said(*theirs), said(*ours), None, note)

    first, second, _ = (nodes for _, nodes in in_elastica().values())
    both = [slow(*snakes.shapes(nodes)) for nodes in (first, second)]
    body, shown = snakes.shapes(first, 10)
    theirs = slow(body, shown)
    limits = {"joint_limit": largest_bend(shown) / 10, "torque_limit": theirs[2]}
    equal: Any = {"body": Chain((0.1,) * 10), "objective": "distance", **limits}
    ours = slow(equal["body"], solved(SNAKE, Harmonic(1, "antipodal"), **equal).gait)
    return [*rows, compared("both shapes", *both), compared("ten links as strong", theirs, ours)]


def kinematic() -> list[Row]:
    """The smooth snake of kinematic-snake beside the limit of chains of many links, whose error
    falls with the square of their number."""

    def gone(links: int, froude: float) -> float:
        at, size = 2 * np.pi * np.arange(1, links) / links, snakes.AMPLITUDE / links
        wave = Fourier(np.zeros(links - 1), size * np.cos(at)[:, None], -size * np.sin(at)[:, None])
        return replayed(Chain((1 / links,) * links), wave, froude)

    rows = []
    for froude in (0.1, 1.0):
        coarse, fine = gone(50, froude), gone(100, froude)
        rows.append(
            number(
                f"body lengths per cycle by the wave of its README, Froude number {froude:g}",
                "kinematic-snake",
                round(snakes.kinematic_distance(froude), 5),
                fine + (fine - coarse) / 3,
                1e-4,
                f"100 links: {fine:.5f}, 50: {coarse:.5f}",
            )
        )
    return rows


PARTS: dict[str, Callable[[], Row | list[Row]]] = {
    part.__name__: part
    for part in (
        elastica, kinematic, link_ratio, wave_of_bending, scallop, strokes_of_others,
        circular_optimum, nearly_harmonic, large_strokes, reversal, small_stroke, best_small_stroke,
        small_wave, resistance_laws, symmetric_ellipses, ellipse_optima, waves, amplitude_exponent
    )
}  # fmt: skip
PROGRAMS = "pyelastica==1.0.0 kinematic-snake==1.0.0"


def table(parts: Sequence[str]) -> str:
    """The rows of parts; what is left out for a missing program is printed."""
    rows: list[Row] = []
    for name in parts:
        try:
            made = PARTS[name]()
        except ModuleNotFoundError as missing:
            print(f"{name} is left out: {missing.name} is missing, pip install {PROGRAMS}.")
            continue
        rows += made if isinstance(made, list) else [made]
    return markdown_table(HEADER, [row.cells for row in rows])


def document() -> str:
    """The page."""
    best = swimmer(5, "bilateral").measured
    return f"""# Published results

What papers say and other people's simulators do, beside what colloc gives. Nothing is adjusted.
Simulators are run here: `pip install {PROGRAMS}`, the former with its ContinuumSnakeCase. Of papers
with an arXiv number the abstract is quoted.

![Two snakes in PyElastica: its optimum by CMA-ES, and colloc's gait](assets/snakes.svg)

Both snakes are in PyElastica, on the same floor at the same pace, bent as much; lines are a tenth of
a body length apart. colloc's gait needs a rod ten times as stiff to keep its shape, and more moment
[weight times length]; the last row on PyElastica is its best gait of ten links that bends no more and needs no more.

`python -m benchmarks.published --output docs` makes film and table; with names of parts, such as
`elastica kinematic link_ratio wave_of_bending`, it prints their rows.

{table(list(PARTS))}

*Derived* rows have no printed number and are held against formulas written apart from the library.
Purcell's swimmer has three equal links and drag (2, 1) where nothing else is said; its efficiency is
Lighthill's, d²/W at unit tangential drag in a period of 1. The best stroke of it found here:
d²/W = {best.value:.5f}, five harmonics, bilateral, certified.

Alben 2013: S. Alben, *Optimizing snake locomotion in the plane*, Proc. R. Soc. A 469, abstract. Alben
2019: *Efficient sliding locomotion with isotropic friction*. Tam and Hosoi (2007), Becker, Koehler and
Stone (2003), Raz and Avron (2008) and Jing and Alben (2013) print numbers, but not in a text that
could be read for this page.
"""


def main() -> None:
    arguments = command_line(__doc__, ("parts", [str]), output=Path("results"))
    if unknown := set(arguments.parts) - set(PARTS):
        raise SystemExit(f"no part {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}.")
    if arguments.parts:
        print(table(arguments.parts))
        return
    page, film = arguments.output / "published.md", arguments.output / "assets/snakes.svg"
    film.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(document(), encoding="utf-8")
    with suppress(ModuleNotFoundError):  # as `table` says
        shown = [(name, nodes) for name, (_, nodes) in in_elastica().items()]
        film.write_text(snakes.film(dict(shown[:2])), encoding="utf-8")
        print(film)
    print(page)


if __name__ == "__main__":
    main()
