"""Joint angles as the controllers of robots take them: pulses of servos, a message of ROS 2, a
table in C. Angles and speeds are ``(n_joint, n_time)``."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from colloc.pictures import render
from colloc.system.arguments import is_number, named_arguments, shown
from colloc.system.errors import ProblemError

_PER_DEGREE, _RANGE = 2000 / 180, (500.0, 2500.0)  # of common servos [microseconds]


@named_arguments
@dataclass(frozen=True)
class Servo:
    """Pulses of servos: ``neutral + sign * scale * degrees``, whole ones. Each value is one for all
    joints, or one each.

    Parameters
    ----------
    neutral : float or (n_joint,)
        Of the straight joint: a width in microseconds, or ticks.
    scale : float or (n_joint,)
        Pulses per degree; by default 2000 microseconds for 180 degrees.
    sign : int or (n_joint,)
        -1 where larger pulses turn the joint clockwise.
    clamp : (low, high) or (n_joint, 2), optional
        Pulses beyond are set to these; by default (500, 2500), or none with a scale of one's own.

    Raises
    ------
    ProblemError
        If values are not such numbers.

    Examples
    --------
    >>> import numpy as np
    >>> from colloc import Servo
    >>> Servo(neutral=(1500, 1480), sign=(1, -1)).pulses(np.radians([[0, 30, 120], [0, 30, 0]]))
    (array([[1500, 1833, 2500], [1480, 1147, 1480]]), [1, 0])
    """

    neutral: float | Sequence[float] = 1500.0
    scale: float | Sequence[float] = _PER_DEGREE
    sign: int | Sequence[int] = 1
    clamp: Sequence[Any] | None = None

    def __post_init__(self) -> None:
        if self.clamp is None and is_number(self.scale) and self.scale == _PER_DEGREE:
            object.__setattr__(self, "clamp", _RANGE)
        needs: dict[str, tuple[str, Callable[[np.ndarray], Any]]] = {
            "neutral": ("numbers", np.isfinite),
            "scale": ("positive numbers", lambda x: np.isfinite(x) & (x > 0)),
            "sign": ("1 or -1", lambda x: abs(x) == 1),
            "clamp": ("pairs of a low and a high number", lambda x: np.less(*x.reshape(-1, 2).T)),
        }
        for name, (what, fits) in needs.items():
            if (given := getattr(self, name)) is None:
                continue
            try:
                values = np.array(given, dtype=float).ravel()
                good = values.size > 0 and bool(np.all(fits(values)))
            except (TypeError, ValueError, OverflowError):
                good = False
            if not good:
                raise ProblemError(f"{name} of servos must be {what}, not {shown(given)}.")
            object.__setattr__(self, name, tuple(values.tolist()))

    def pulses(self, angles: np.ndarray) -> tuple[np.ndarray, list[int]]:
        """Whole pulses of angles [rad], and how many of each joint are clamped."""
        columns: list[np.ndarray] = []
        for name, many in (("neutral", 1), ("scale", 1), ("sign", 1), ("clamp", 2)):
            values = np.reshape(getattr(self, name) or (-np.inf, np.inf), (-1, many, 1))
            if len(values) not in (1, len(angles)):
                raise ProblemError(
                    f"{name} of servos is given for {len(values)} joints of {len(angles)}: give it "
                    "once for all, or for each."
                )
            columns += [*values.transpose(1, 0, 2)]
        neutral, scale, sign, low, high = columns
        wanted = neutral + sign * scale * np.degrees(angles)
        kept = np.clip(wanted, low, high)
        return np.rint(kept).astype(int), np.sum(kept != wanted, axis=1).tolist()

    def facts(self) -> dict[str, Any]:
        return {
            "pulses": "neutral + sign * scale * degrees, within clamp, to whole ones; microseconds "
            "by default: 1500 straight, 2000 for 180 degrees",
            **vars(self),
        }


def comment_lines(facts: Mapping[str, Any], mark: str = "#") -> list[str]:
    """Lines of comment, each a JSON value."""
    return [f"{mark} {key}: {json.dumps(value)}" for key, value in facts.items()]


def joint_trajectory(
    facts: Mapping[str, Any],
    names: Sequence[str],
    time: np.ndarray,
    angles: np.ndarray,
    speeds: np.ndarray,
) -> str:
    """A ``trajectory_msgs/msg/JointTrajectory`` in YAML, from time 0 on."""
    # without exponents, which not all readers know
    rows = ([[f"{x:.6f}" for x in row] for row in np.round(x.T, 6) + 0.0] for x in (angles, speeds))
    clock = np.rint(1e9 * (time - time[0])).astype(int).tolist()
    points = zip((divmod(nanoseconds, 10**9) for nanoseconds in clock), *rows, strict=True)
    comment = "\n".join(comment_lines(facts))
    return render("trajectory.yaml", comment=comment, names=names, points=points)


def c_table(
    facts: Mapping[str, Any], path: Path, names: Sequence[str], time: np.ndarray, rows: np.ndarray
) -> str:
    """A C header with samples before time 0, to be sent once, and then those of the cycle: floats
    [rad], or whole pulses. Names begin with that of the file."""
    stem = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    kind, number = "float", lambda x: f"{round(x, 7) + 0.0:.7f}f"
    if rows.dtype == int:
        kind, number = "short" if np.abs(rows).max() < 2**15 else "long", str
    parts = [("ramp", "once, from straight, at rest", time < 0), ("cycle", "for ever", time >= 0)]
    tables = [(x, how, [[*map(number, row)] for row in rows.T[at]]) for x, how, at in parts]
    return render(
        "table.h", facts=facts, kind=kind, names=names, parts=[each for each in tables if each[2]],
        stem=f"gait_{stem}" if stem[:1].isdigit() else stem,
        comment="\n".join(comment_lines(facts, "//")),
    )  # fmt: skip
