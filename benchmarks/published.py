"""Printed results of other people's work beside ours: python -m benchmarks.published [--output
FOLDER]

Writes FOLDER/published.md (FOLDER is results by default). Every row is computed anew, in about a
minute; nothing is adjusted to what is printed. *Printed* is what the named text says, read there;
*derived* is a formula or an integration of our own, written apart from the library
(`benchmarks.peers.drag`), where a text prints no number. A verdict is judged in the row's own code:
agreement to the digits printed, or of the order or sign that a sentence states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from benchmarks.peers import drag
from benchmarks.tables import markdown_table
from colloc import Chain, Fourier, Friction, Harmonic, Problem, Solution, Viscous, ellipse, replay
from colloc.gaits.gait_fields import AnyGait as Gait
from colloc.mechanics.law import Law
from colloc.search.solve import solve
from colloc.smooth.balance import Motion
from colloc.smooth.prescribed_body import Wave
from scripts.models.period import period
from scripts.program import command_line

SWIMMER = Viscous(normal=drag.NORMAL, tangential=drag.TANGENTIAL)
PAPER = "S. Alben, Efficient sliding locomotion with isotropic friction (2019)"
THREE_LINKS = (
    "S. Alben, Efficient sliding locomotion of three-link bodies, arXiv:2012.03379, abstract"
)
SNAKES = "S. Alben, Optimizing snake locomotion in the plane, Proc. R. Soc. A 469 (2013), abstract"
COMMENT = "O. Raz and J. E. Avron, comment on Tam and Hosoi, arXiv:0706.3906"
DISPLACED = (
    2.017955906441066,
    1.353385144748382,
    0.013112519773635,
    0.263823759269392,
    -0.031456173657342,
    -0.003626287235861,
)
EFFICIENT = (
    1.495398722861924,
    1.326600886340017,
    0.083253854456986,
    0.089227148110158,
    -0.034695750579259,
    -0.044559551791058,
)
AGREES, DIFFERS = "agrees", "**differs**"


@dataclass(frozen=True)
class Row:
    """What a text says and what we find: a line of the table."""

    what: str
    source: str
    printed: str
    ours: str
    difference: str
    verdict: str


def number(
    what: str, source: str, printed: float, ours: float, tolerance: float, note: str = ""
) -> Row:
    """A row about a number, printed to within `tolerance`."""
    verdict = AGREES if abs(ours - printed) <= tolerance else DIFFERS
    return Row(
        what,
        source,
        f"{printed:g}",
        f"{ours:.5g}",
        f"{ours - printed:+.2g}",
        verdict + (f"; {note}" if note else ""),
    )


def sentence(what: str, source: str, printed: str, ours: str, holds: bool, note: str = "") -> Row:
    """A row about a sentence."""
    return Row(
        what,
        source,
        printed,
        ours,
        "",
        (AGREES if holds else DIFFERS) + (f"; {note}" if note else ""),
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
    source = (
        "G. L. Wagner and E. Lauga, Crawling scallop, arXiv:1303.2669, abstract, on viscous fluids"
    )
    return sentence(
        "retraced stroke", source, "no locomotion on average", f"d = {gone:.1g}", gone < 1e-12
    )


def circular_optimum() -> Row:
    gait = swimmer(1, "antipodal").gait
    axes = np.linalg.svd(np.column_stack([gait.cos, gait.sin]), compute_uv=False)
    ours = f"semi-axes {axes[0]:.3f} and {axes[1]:.3f} rad round 0"
    return sentence(
        "most efficient moderate stroke",
        COMMENT,
        "an approximate circle at the centre",
        ours,
        axes[0] < 1.2 * axes[1],
    )


def nearly_harmonic() -> Row:
    share = swimmer(1, "antipodal").measured.value / swimmer(5, "antipodal").measured.value
    ours = f"one harmonic has {share:.3f} of the efficiency of five"
    return sentence(
        "Tam and Hosoi's most efficient stroke",
        f"{PAPER}, section V",
        "close to a time-harmonic motion",
        ours,
        share > 0.9,
    )


def large_strokes() -> Row:
    ratio = swimmer(5, "bilateral").measured.value / swimmer(5, "antipodal").measured.value
    note = (
        "larger strokes do win; the printed ratio is for a limit on the angles that the "
        "text we "
        "read has lost, ours for none"
    )
    return number(
        "efficiency of a large off-centre stroke over the centred one",
        COMMENT,
        1.53,
        ratio,
        5e-3,
        note,
    )


def printed_stroke(coefficients: Sequence[float]) -> Fourier:
    """A stroke by its coefficients (a1, b1, a3, b3, a5, b5) along the diagonals of the plane of
    joint angles."""
    cos, sin = np.zeros((2, 5)), np.zeros((2, 5))
    cos[:, ::2] = np.outer([1.0, 1.0], coefficients[::2]) / np.sqrt(2)
    sin[:, ::2] = np.outer([1.0, -1.0], coefficients[1::2]) / np.sqrt(2)
    return Fourier(np.zeros(2), cos, sin)


def half_axes(gait: Gait) -> str:
    """How far a stroke goes along the two diagonals."""
    angles = gait.angles(np.linspace(0.0, 1.0, 2001))
    return " and ".join(
        f"{np.abs(angles[0] + side * angles[1]).max() / np.sqrt(2):.3f}" for side in (1, -1)
    )


def at_best_pace(gait: Gait) -> float:
    """Lighthill's efficiency of a stroke's path run through at constant power."""
    t = (np.arange(4000) + 0.5) / 4000
    body, at = Chain(), (SWIMMER, gait.angles(t), gait.rates(t), 1e-4)
    power = body.motion(*at, body.solve(*at)).power
    return float((distance(gait) / np.sqrt(power).mean()) ** 2)


def strokes_of_others() -> list[Row]:
    """Strokes that a program of others prints as optimal for the same swimmer, beside the optima
    found from them."""
    source, rows = (
        "coefficients in OSU-LRAM/GeometricSystemPlotter, shchf_LowRe_{}.m; replayed here",
        [],
    )
    for objective, name, coefficients, value, what in (
        ("distance", "MaxDisplacement", DISPLACED, distance, "distance"),
        ("towing", "MaxEfficiency", EFFICIENT, at_best_pace, "d²/W at its best pace"),
    ):
        theirs = printed_stroke(coefficients)
        ours = solved(SWIMMER, Harmonic(5, "antipodal"), 1, objective=objective, guess=theirs).gait
        printed, found = value(theirs), value(ours)
        axes = f"half-axes {half_axes(theirs)} rad", f"half-axes {half_axes(ours)} rad"
        verdict = (
            AGREES
            if abs(found / printed - 1) < 1e-3
            else "**ours is better**"
            if found > printed
            else DIFFERS
        )
        shown = f"{printed:.6f}, {axes[0]}", f"{found:.6f}, {axes[1]}"
        rows.append(
            Row(
                f"best moderate stroke: {what}",
                source.format(name),
                *shown,
                f"{found - printed:+.2g}",
                verdict,
            )
        )
    return rows


def reversal() -> Row:
    found = minimize_scalar(circle, bounds=(1.5, 2.9), method="bounded", options={"xatol": 1e-6})
    ours = f"the circular stroke stands still at {found.x:.4f} rad"
    holds = found.fun < 1e-6 and min(circle(1.5), circle(2.9)) > 0.05
    source = "O. Wiezel and Y. Or, arXiv:1603.02268, abstract"
    return sentence("direction of large strokes", source, "reversal of the direction", ours, holds)


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
        "derived: isoperimetric ellipse of F. Alouges et al., arXiv:1801.04687 "
        "(abstract), in "
        "the metric of the power"
    )
    return number(
        "largest d/W of small strokes, period 1",
        source,
        round(drag.best_small_stroke(), 6),
        ours,
        1e-5,
    )


def small_wave() -> Row:
    amplitude, number_of_waves = 0.05, 16.0
    moved = period(
        Wave("sine", amplitude, number_of_waves).prescribed(),
        SWIMMER,
        1e-3,
        intervals=1,
        nodes=6,
        quadrature_tolerance=1e-8,
    ).d
    # in units of the wave's own speed times mean squared slope
    ours = moved * number_of_waves / (amplitude**2 / 2)
    source = (
        "derived: long filament of J. Gray and G. J. Hancock (1955), c_n/c_t - 1 for small slopes"
    )
    return number(
        "speed of a small wave along a filament",
        source,
        drag.NORMAL / drag.TANGENTIAL - 1,
        ours,
        1e-2,
    )


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
    said = (
        "linear resistance: relative efficiencies much lower except at very large normal friction"
    )
    return sentence(
        "linear against dry resistance",
        THREE_LINKS,
        said,
        "; ".join(lines),
        parts[0] < 0.2 and parts[1] > 0.9,
    )


def symmetric_ellipses() -> Row:
    values = {
        s: solved(Friction(), Harmonic(1, s), 24).measured.value
        for s in ("none", "bilateral", "antipodal")
    }
    best = max(values["bilateral"], values["antipodal"])
    ours = ", ".join(f"{name} {value:.4f}" for name, value in values.items())
    said = "symmetric ellipses have about the same peak efficiency as all"
    return sentence(
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

    best = minimize(
        loss,
        (0.35, 0.4),
        method="Nelder-Mead",
        options={"maxfev": 120, "xatol": 1e-3, "fatol": 1e-5},
    )
    return number(
        "third optimum, offset 2.5",
        f"{PAPER}, section V",
        0.094,
        -best.fun,
        1.5e-3,
        "at that offset",
    )


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


def amplitude_exponent() -> Row:
    frictions, best = (1e3, 1e4, 1e5), []
    for mu in frictions:
        search = {"bounds": (0.05, 1.0), "method": "bounded", "options": {"xatol": 1e-4}}
        best.append(
            minimize_scalar(
                lambda a, mu=mu: (
                    -_efficiency(
                        Wave("sine", a, 2.0).prescribed(), Friction(mu_t=mu, mu_f=1, mu_b=1)
                    )
                ),
                **search,
            ).x
        )
    slopes = np.diff(np.log(best)) / np.diff(np.log(frictions))
    ours = f"{slopes[0]:.4f} from mu_t = 1e3 to 1e4, {slopes[1]:.4f} to 1e5"
    holds = abs(slopes[1] + 0.25) < 5e-3 and abs(slopes[1] + 0.25) < abs(slopes[0] + 0.25)
    return sentence(
        "best amplitude of a sine wave against mu_t",
        SNAKES,
        "decays as the power -1/4",
        ours,
        holds,
    )


PARTS: tuple[Callable[[], Row | list[Row]], ...] = (
    scallop, strokes_of_others, circular_optimum, nearly_harmonic, large_strokes, reversal,
    small_stroke, best_small_stroke,
    small_wave, resistance_laws, symmetric_ellipses, ellipse_optima, waves, amplitude_exponent,
)  # fmt: skip


def document() -> str:
    """The page."""
    rows: list[Row] = []
    for part in PARTS:
        found = part()
        rows += found if isinstance(found, list) else [found]
    header = ("what", "source", "printed", "ours", "difference", "verdict")
    best = swimmer(5, "bilateral").measured
    text = [
        "# Published results beside ours",
        "",
        "Written by `python -m benchmarks.published`. Nothing is adjusted to what is printed; "
        "*derived* rows have no printed",
        "number and are held against formulas written apart from the library. Purcell's swimmer "
        "has three equal links of",
        "length 1/3 and drag (2, 1); its efficiency is Lighthill's, d²/W at unit tangential drag "
        "in a period of 1.",
        "",
        markdown_table(header, [tuple(vars(row).values()) for row in rows]),
        "",
        f"The best stroke of the swimmer found here: d²/W = {best.value:.5f}, five harmonics, "
        f"bilateral, certified.",
        "",
        "Not in the table: Tam and Hosoi (2007), Becker, Koehler and Stone (2003), Raz and Avron "
        "(2008) and Jing and Alben",
        "(2013) print numbers, but not in a text that could be read for this page; and crawlers "
        "that stretch along a line",
        "(Gidoni, Noselli and DeSimone) or have inertia (Wagner and Lauga) are other bodies than "
        "those of colloc.",
    ]  # fmt: skip
    return "\n".join(text) + "\n"


def main() -> None:
    arguments = command_line(__doc__, output=Path("results"))
    arguments.output.mkdir(parents=True, exist_ok=True)
    (arguments.output / "published.md").write_text(document(), encoding="utf-8")
    print(f"{arguments.output / 'published.md'}")


if __name__ == "__main__":
    main()
