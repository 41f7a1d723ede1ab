"""Objective, efficiency, distance and work of a gait by replays, with errors, and for delta ->
0."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from colloc.gaits.objective import EFFICIENCY, Objective
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import PathLimit, PathLimits, Quantity
from colloc.mechanics.law import Law
from colloc.verification.replay import replay
from colloc.verification.replay_record import Path, Replay

PARTS_OF_DELTA = (1.0, 0.1, 0.01)
_DECADE = PARTS_OF_DELTA[1]
_SLOWEST = 0.9
_FEWER = 4
"""Factor on the first instants of replays at smaller deltas."""


@dataclass(frozen=True)
class Limit:
    value: float
    error: float


class Estimate(NamedTuple):
    error: float
    limit: Limit


def extrapolated_limit(values: Sequence[float], errors: Sequence[float]) -> Limit:
    """Limit for delta -> 0 of one gait's value, from its values at delta, delta/10 and delta/100.

    Regularisation acts like c delta at leading order, so a ninth of the last change remains;
    sticking links act like delta log delta, and gaits of the size of delta like delta squared, with
    any signs. So the error is that ninth again; or more where the two changes fall off more slowly;
    and no less than what is left of a linear part of the first change that other parts hide in the
    second.

    Parameters
    ----------
    values, errors : (3,)
        Values of the objective and their own errors.
    """
    first, second = values[1] - values[0], values[2] - values[1]
    linear = _DECADE / (1 - _DECADE)
    falloff = min(abs(second) / max(abs(first), 1e-300), _SLOWEST)
    left = max(max(linear, falloff / (1 - falloff)) * abs(second), linear * _DECADE * abs(first))
    own = (1 + linear) * errors[2] + linear * errors[1]
    return Limit(float(values[2] + linear * second), float(left + own))


class Measured(NamedTuple):
    fine: Replay
    errors: dict[str, float]
    value: Estimate
    efficiency: Estimate


def measured(
    body: Body,
    friction: Law,
    path: Path,
    delta: float,
    *,
    tolerance: float = 1e-6,
    instants: int = 1600,
    breaks: np.ndarray | tuple[float, ...] = (),
    objective: Objective = EFFICIENCY,
    rotation: float | None = 0.0,
    quantities: Iterable[Quantity | str] = (),
    limits: Iterable[PathLimit] | PathLimits = (),
    run: Callable[..., Replay] = replay,
) -> Measured:
    """Measure a path by replays at delta, delta/10 and delta/100; arguments are those of
    `colloc.verification.replay.replay`, the prescribed rotation, and the replay `run`."""
    replays: list[Replay] = []
    smoothed = friction.regularised or any(each.smoothed for each in objective.integrals)
    for part in PARTS_OF_DELTA if smoothed else PARTS_OF_DELTA[:1]:
        near = replays[-1] if replays else None
        begin = max(2 * (instants // (2 * _FEWER)), 4) if replays else instants
        at = (body, friction, path, part * delta)
        asked: dict[str, Any] = {
            "objective": objective,
            "quantities": quantities,
            "limits": limits,
            "turn": rotation or 0.0,
        }
        replays.append(
            run(*at, **asked, instants=begin, tolerance=tolerance, breaks=breaks, near=near)
        )
    known = []
    for aim in (objective, EFFICIENCY):
        values = [aim(each.values) for each in replays]
        errors = [
            abs(value) * _error(each, aim, rotation)
            for value, each in zip(values, replays, strict=True)
        ]
        known.append(
            Estimate(
                errors[0],
                extrapolated_limit(values, errors) if smoothed else Limit(values[0], errors[0]),
            )
        )
    fine = replays[0]
    stated = {name: fine.errors[name] + fine.others.get(name, 0.0) for name in ("distance", "work")}
    stated["distance"] += astray(fine, rotation)
    return Measured(fine, stated, *known)


def astray(replayed: Replay, rotation: float | None) -> float:
    """Change of the distance with the point of the body that is followed, by rotation beyond the
    prescribed one."""
    return 0.0 if rotation is None else abs(replayed.rotation - rotation) * replayed.lever


def _error(replayed: Replay, aim: Objective, rotation: float | None) -> float:
    by_lever = float(aim.relative_error(replayed.values, {"distance": astray(replayed, rotation)}))
    error = replayed.error if aim == replayed.objective else replayed.error_of(aim)
    return error + by_lever + replayed.ambiguity_of(aim)
