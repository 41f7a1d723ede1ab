"""A gait measured by replays: its value, distance and work, with errors, and for delta -> 0."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from colloc.gaits.objective import EFFICIENCY, Objective
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.verification.adaptive_motion import Path, Replay
from colloc.verification.replay import replay

PARTS_OF_DELTA = (1.0, 0.1, 0.01)
_DECADE = PARTS_OF_DELTA[1]
_SLOWEST = 0.9  # ratio of the two changes, at most, from which a limit is extrapolated
_FEWER = 4  # factor on the first instants of replays at smaller deltas


class Limit(NamedTuple):
    value: float
    error: float


class Estimate(NamedTuple):
    error: float
    limit: Limit


class Measured(NamedTuple):
    fine: Replay
    errors: dict[str, float]
    value: Estimate
    efficiency: Estimate


def extrapolated_limit(values: Sequence[float], errors: Sequence[float]) -> Limit:
    """Limit for delta -> 0 of one gait's value, from its values at delta, delta/10 and delta/100
    and their own errors, ``(3,)``.

    Regularisation acts like c delta at leading order, so a ninth of the last change remains;
    sticking links act like delta log delta, and gaits of the size of delta like delta squared, with
    any signs. So the error is that ninth again; or more where the two changes fall off more slowly;
    and no less than what is left of a linear part of the first change that other parts hide in the
    second.
    """
    first, second = values[1] - values[0], values[2] - values[1]
    linear = _DECADE / (1 - _DECADE)
    falloff = min(abs(second) / max(abs(first), 1e-300), _SLOWEST)
    left = max(max(linear, falloff / (1 - falloff)) * abs(second), linear * _DECADE * abs(first))
    own = (1 + linear) * errors[2] + linear * errors[1]
    return Limit(float(values[2] + linear * second), float(left + own))


def measure(
    body: Body,
    friction: Law,
    path: Path,
    delta: float,
    *,
    objective: Objective = EFFICIENCY,
    rotation: float | None = 0.0,
    instants: int = 1600,
    run: Callable[..., Replay] = replay,
    **how: Any,
) -> Measured:
    """Measure a path by replays at delta, delta/10 and delta/100, given the prescribed rotation;
    other arguments are those of the replay `run`."""
    replays: list[Replay] = []
    smoothed = friction.regularised or any(each.depends_on_delta for each in objective.integrals)
    for part in PARTS_OF_DELTA if smoothed else PARTS_OF_DELTA[:1]:
        how |= {"objective": objective, "turn": rotation or 0.0, "instants": instants}
        if replays:
            how |= {"near": replays[-1], "instants": max(2 * (instants // (2 * _FEWER)), 4)}
        replays.append(run(body, friction, path, part * delta, **how))
    known = []
    for aim in (objective, EFFICIENCY):
        values, errors = [aim(each.values) for each in replays], list[float]()
        for value, each in zip(values, replays, strict=True):
            shift = {"distance": astray(each, rotation)}
            error = each.error if aim == each.objective else each.error_of(aim)
            error += float(aim.relative_error(each.values, shift))
            errors.append(abs(value) * (error + each.ambiguity_of(aim)))
        limit = extrapolated_limit(values, errors) if smoothed else Limit(values[0], errors[0])
        known.append(Estimate(errors[0], limit))
    fine = replays[0]
    stated = {name: fine.errors[name] + fine.others.get(name, 0.0) for name in ("distance", "work")}
    stated["distance"] += astray(fine, rotation)
    return Measured(fine, stated, *known)


def astray(replayed: Replay, rotation: float | None) -> float:
    """Change of the distance with the point of the body that is followed, by rotation beyond the
    prescribed one."""
    return 0.0 if rotation is None else abs(replayed.rotation - rotation) * replayed.lever
