"""How steep crawlers climb: python -m scripts.slopes [--starts 16] [--output results]

For three equal links, bilateral gaits of one to three harmonics and grades up to where none is
found: the gait of least work per climb, beside the most efficient one on the level put on the same
slope. A table, slopes.md, and a figure, slopes.png, which also shows how an antipodal gait turns on
a slope by itself.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np

from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.problem import Problem
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.pictures.style import SERIES, save, styled, subplots
from colloc.results.solution import Solution
from colloc.search.solve import solve
from colloc.system.errors import NotConvergedError
from colloc.verification.differential_motion import SlopeMotion, slope_motion
from scripts.program import command_line

SCENES = (
    ("equal friction", Friction(), 1, (0.0, 0.05, 0.1, 0.15, 0.2)),
    ("equal friction", Friction(), 2, (0.0, 0.05, 0.1, 0.2, 0.3, 0.4)),
    ("equal friction", Friction(), 3, (0.0, 0.05, 0.1, 0.2, 0.3, 0.4)),
    ("friction (10, 1, 1)", Friction(mu_t=10, mu_f=1, mu_b=1), 2, (0.0, 0.3, 1.0, 2.0)),
)
TURNING = Fourier(np.zeros(2), np.array([[1.5], [0.0]]), np.array([[0.0], [1.0]]))
HEAD = (
    *(
        "friction",
        "harmonics",
        "grade",
        "climb/work",
        "climb",
        "work of the joints",
        "heading [deg]",
    ),
    *("climb/work of the gait that is best on the level", "checks"),
)
_PERIODS, _GRADE, _HEADINGS = 60, 0.05, np.pi * np.array([0.05, 0.3, 0.6, -0.2, -0.45, -0.8])


def climbers(
    friction: Friction, harmonics: int, grades: tuple[float, ...], starts: int
) -> list[Solution | None]:
    """The best gait found for every grade, from the one before as a guess; None where none
    climbs."""
    found: list[Solution | None] = []
    guess = None
    for grade in grades:
        problem = Problem(
            "slope", guess, friction=friction, gait=Harmonic(harmonics, "bilateral"), grade=grade
        )
        best = None
        with suppress(NotConvergedError):
            best = solve(problem, starts)
        found.append(best if best is not None and best.certificate.replayed else None)
        guess = guess if found[-1] is None else found[-1].gait
    return found


def heading(best: Solution) -> float:
    """Direction in which a gait would go on the level, from straight uphill [deg]."""
    if best.problem.regime.slow_on_level:
        return 0.0
    at = (
        best.problem.body,
        best.problem.friction,
        best.gait,
        best.delta_per_period,
        best.problem.grade,
    )
    return float(np.degrees(np.angle(np.exp(1j * slope_motion(*at, tolerance=1e-4).headings[0]))))


def row(scene: str, harmonics: int, grade: float, best: Solution | None, level: SlopeMotion) -> str:
    """A line of the table."""
    plain = f"{level.climb[0] / level.joint_work[0]:.4f}" if level.climb[0] > 0 else "slides back"
    if best is None:
        return f"| {scene} | {harmonics} | {grade:g} | none found | | | | {plain} | |"
    found = best.certificate
    verdict = (
        "all hold" if found.passed else "not: " + ", ".join(check.name for check in found.failures)
    )
    numbers = (
        f"{found.value:.4f} | {found.distance:.4f} | {found.work:.4f} | "
        f"{round(heading(best)) + 0:d}"
    )
    return f"| {scene} | {harmonics} | {grade:g} | {numbers} | {plain} | {verdict} |"


Curve = tuple[str, tuple[float, ...], list[Solution | None], list[SlopeMotion]]
"""A scene, its grades, the best gaits for them, and the gait that is best on the level at each."""


def figure(curves: list[Curve], path: Path) -> None:
    """Climb per work over the grade; and ways on a slope of a gait that turns."""
    with styled():
        drawn, (left, right) = subplots(1, 2, figsize=(8.4, 3.6))
        for colour, (name, grades, found, levels) in zip(SERIES, curves, strict=False):
            climbs = [
                (grade, best.certificate.value)
                for grade, best in zip(grades, found, strict=True)
                if best is not None
            ]
            left.plot(*zip(*climbs, strict=True), "o-", color=colour, markersize=4, label=name)
            plain: list[float] = [
                ran.climb[0] / ran.joint_work[0] if ran.joint_work[0] > 0 else np.nan
                for ran in levels
            ]
            left.plot(grades, plain, ":", color=colour)
        left.set(
            xlabel="grade", ylabel="climb / work of the joints", ylim=(0, None), xlim=(-0.02, 1.05)
        )
        left.set_title("best for each slope (dotted: best on the level)")
        left.legend()
        for colour, heading in zip(SERIES, _HEADINGS, strict=False):
            ran = slope_motion(
                Chain(),
                Friction(mu_t=2, mu_f=1, mu_b=1),
                TURNING,
                1e-3,
                _GRADE,
                heading=heading,
                periods=_PERIODS,
                tolerance=1e-4,
            )
            right.plot(
                np.append(0, -np.cumsum(ran.aside)),
                np.append(0, np.cumsum(ran.climb)),
                ".-",
                color=colour,
                markersize=3,
            )
        right.set(
            xlabel="across the slope [body lengths]", ylabel="uphill [body lengths]", aspect="equal"
        )
        right.set_title(f"an antipodal gait turns downhill ({_PERIODS} periods)")
    save(drawn, path)


def main() -> None:
    options = command_line(__doc__, starts=16, output=Path("results"))
    lines, curves = [f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|"], list[Curve]()
    for scene, friction, harmonics, grades in SCENES:
        found = climbers(friction, harmonics, grades, options.starts)
        flat = found[0]
        assert flat is not None  # every class crawls on the level
        levels = [
            slope_motion(Chain(), friction, flat.gait, 1e-4, grade, tolerance=1e-5)
            for grade in grades
        ]
        for grade, best, level in zip(grades, found, levels, strict=True):
            lines.append(row(scene, harmonics, grade, best, level))
            print(lines[-1], flush=True)
        curves.append(
            (f"{scene}, {harmonics} harmonic{'s' * (harmonics > 1)}", grades, found, levels)
        )
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "slopes.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    figure(curves, options.output / "slopes")


if __name__ == "__main__":
    main()
