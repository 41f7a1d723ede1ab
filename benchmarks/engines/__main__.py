"""Certified gaits in the physics engines: python -m benchmarks.engines [--engine MuJoCo] [--gait
three_link_feet]

Each engine in `benchmarks.engines.players` plays known gaits (`benchmarks.known`) on the same robot
(`benchmarks.engines.task`), at two steps. Its distance and work of a period are held against
colloc's own motion with inertia. Writes results/engines.md and results/engines.png; outcomes are
kept in results/engines.sqlite, so an interrupted run goes on where it stopped. ``--models FOLDER``
writes the robots as URDF with what they have to do, for engines of your own. Needs ``pip install
colloc[engines]``; engines that are not there are named and left out.
"""

from __future__ import annotations

import argparse
import importlib
import json
import pkgutil
import sys
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import colloc
from benchmarks.engines import players
from benchmarks.engines.task import Task, on_feet
from benchmarks.known import known
from benchmarks.tables import cached, markdown_table
from colloc.commands.ending import OK, run
from colloc.mechanics.inertia import GRAVITY
from colloc.pictures.style import BLUE, GREEN, ORANGE, PURPLE, save, styled, subplots

GAITS = (
    "three_link",
    "three_link_two_harmonics",
    "three_link_feet",
    "five_link",
    "serpenoid_snake",
    "wheeled_snake",
)
FROUDE = 0.002, 0.05
"""Slow, 1 m in 7.1 s a period, and fast, in 1.4 s."""
STEPS = (1e-3, 2.5e-4)
"""Of the engines [s]."""
_COLOURS, _MARKERS = (BLUE, ORANGE, GREEN, PURPLE), "osD^"
_SMALLEST = 1e-5
"""Error from which on the figure draws."""


class Outcome(NamedTuple):
    """Relative errors of distance and work at each step, ``(n_step, 2)``; processor seconds a
    second played, at the first."""

    task: Task
    engine: str
    errors: np.ndarray
    pace: float

    def __str__(self) -> str:
        return " \\| ".join(
            ", ".join(f"{100 * value:+.2f}" for value in pair) for pair in self.errors
        )


def tasks(names: Sequence[str]) -> list[Task]:
    rows = [row for row in known() if row.problem.name in names]
    return [
        Task(row.problem.name, on_feet(row.problem.body, row.problem.law), row.gait, f)
        for row in rows
        for f in FROUDE
    ]


def engines() -> Iterator[Any]:
    """Players whose engines are installed."""
    for found in pkgutil.iter_modules(players.__path__):
        try:
            yield importlib.import_module(f"{players.__name__}.{found.name}")
        except ModuleNotFoundError as missing:
            print(f"{found.name}: left out, {missing.name} is not installed.", file=sys.stderr)


def outcome(task: Task, engine: Any) -> dict[str, Any]:
    """Fields of an `Outcome`, as plain numbers (JSON)."""
    errors, pace = [], 0.0
    for step in STEPS:
        begin = time.process_time()
        came_to = task.came_to(engine.play(task, step))
        pace = pace or (time.process_time() - begin) / (task.periods * task.seconds)
        errors.append((came_to / task.certificate[0] - 1).tolist())
    return {"errors": errors, "pace": pace}


def table(outcomes: Sequence[Outcome], at: Sequence[Any]) -> str:
    cells, rows = {(o.task, o.engine): str(o) for o in outcomes}, []
    for task in dict.fromkeys(o.task for o in outcomes):
        (distance, work), (d_error, w_error) = task.certificate
        row = [
            task.name,
            f"{task.froude:g}",
            f"{distance:.5f} ± {d_error:.0e}",
            f"{work:.5f} ± {w_error:.0e}",
        ]
        rows.append(
            row + [cells.get((task, engine.NAME), "no friction with a direction") for engine in at]
        )
    pace = {engine.NAME: [o.pace for o in outcomes if o.engine == engine.NAME] for engine in at}
    played = [e for e in at if pace[e.NAME]]
    said = [
        f"- **{e.NAME}**: {e.SETTINGS}; {np.median(pace[e.NAME]):.2g} s of processor time a second."
        for e in played
    ]
    told = "`python -m benchmarks.engines`: errors of distance, work [%] at steps of 1 \\| 0.25 ms."
    columns = ["gait", "Fr", "distance", "work", *pace]
    return "\n\n".join([told, markdown_table(columns, rows), "\n".join(said)]) + "\n"


def figure(outcomes: Sequence[Outcome], path: Path) -> None:
    asked = list(dict.fromkeys(o.task for o in outcomes))
    with styled():
        drawn, axes = subplots(1, 2, figsize=(10, 0.3 * len(asked) + 1.6), sharey=True)
        for which, (axis, title) in enumerate(zip(axes, ("distance", "work"), strict=True)):
            doubt = [task.certificate[1][which] / task.certificate[0][which] for task in asked]
            axis.barh(
                range(len(asked)),
                np.maximum(doubt, _SMALLEST),
                color="#d9d9d9",
                label="doubt of the certificate",
            )
            for k, name in enumerate(dict.fromkeys(o.engine for o in outcomes)):
                own = [o for o in outcomes if o.engine == name]
                sizes = np.maximum(np.abs([o.errors[:, which] for o in own]), _SMALLEST).T
                for size, fill, label in zip(sizes, ("none", "full"), (None, name), strict=True):
                    marks: dict[str, Any] = {
                        "color": _COLOURS[k % 4],
                        "marker": _MARKERS[k % 4],
                        "fillstyle": fill,
                    }
                    axis.plot(
                        size,
                        [asked.index(o.task) for o in own],
                        linestyle="none",
                        label=label,
                        **marks,
                    )
            axis.set(
                xscale="log",
                xlim=(_SMALLEST, 2),
                title=f"error of the {title}",
                xlabel="relative; hollow: 1 ms, full: 0.25 ms",
            )
        axes[0].set_yticks(
            range(len(asked)), [f"{task.name}, Fr {task.froude:g}" for task in asked]
        )
        axes[0].invert_yaxis()
        axes[1].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        save(drawn, path)


def write_models(folder: Path, asked: Sequence[Task]) -> None:
    """URDF, and beside it joint angles and rates over the period and what the certificate says, in
    m, kg, s and J."""
    folder.mkdir(parents=True, exist_ok=True)
    for task in asked:
        times = np.linspace(0.0, task.seconds, 500, endpoint=False)
        angles, rates = np.transpose([task.at(t) for t in times], (1, 0, 2)).tolist()
        says = {
            "period": task.seconds,
            "gravity": task.gravity,
            "joints": task.joints,
            "time": times.tolist(),
        }
        says |= {
            "angles": angles,
            "rates": rates,
            "friction": {name: [law.mu_f, law.mu_t] for name, law in task.feet.items()},
        }
        for name, values in zip(("certified", "error"), task.certificate, strict=True):
            says[name] = {"distance": values[0], "work": values[1] * GRAVITY}
        for ending, text in ((".urdf", task.urdf), (".json", json.dumps(says))):
            Path(folder, f"{task.name}_{task.froude:g}{ending}").write_text(text, encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Certified gaits in the physics engines.")
    parser.add_argument(
        "--gait",
        nargs="+",
        choices=GAITS,
        default=list(GAITS),
        help="of the known ones (default: all)",
    )
    parser.add_argument(
        "--engine", nargs="+", metavar="NAME", help="default: all that are installed"
    )
    parser.add_argument(
        "--models",
        type=Path,
        metavar="FOLDER",
        help="write the robots and what they have to do, play nothing",
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("results"),
        help="folder of table and figure (default: results)",
    )
    return run(parser, _play, arguments)


def _play(options: argparse.Namespace) -> int:
    asked = tasks(options.gait)
    if options.models:
        write_models(options.models, asked)
        return OK
    at = [engine for engine in engines() if not options.engine or engine.NAME in options.engine]
    options.output.mkdir(parents=True, exist_ok=True)
    outcomes = []
    for task in asked:
        for engine in at:
            if engine.DIRECTIONS or not task.directed:
                key, play = (
                    f"{task.name} {task.froude} {engine.NAME}: {engine.SETTINGS}",
                    partial(outcome, task, engine),
                )
                kept = cached(options.output / "engines.sqlite", key, play)
                outcomes.append(Outcome(task, engine.NAME, np.array(kept["errors"]), kept["pace"]))
                print(
                    f"{task.name}, Fr {task.froude:g}, {engine.NAME}: {outcomes[-1]} %", flush=True
                )
    if not outcomes:
        raise colloc.ProblemError(
            "no engine that is installed can play these: pip install 'colloc[engines]'."
        )
    (options.output / "engines.md").write_text(table(outcomes, at), encoding="utf-8")
    figure(outcomes, options.output / "engines")
    return OK


if __name__ == "__main__":
    sys.exit(main())
