"""What replays gaits: on the level, on a slope, or with inertia."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from colloc.gaits.sloped import Slope
from colloc.verification.replay import Replay, replay


def replayer(slope: Slope | None, froude: float) -> Callable[..., Replay]:
    """Replays a gait, with the arguments of `colloc.verification.replay.replay`."""
    if froude:
        from colloc.verification.inertial_replay import inertial_replay

        return partial(inertial_replay, froude=froude)
    if slope is not None:
        from colloc.verification.slope_replay import slope_replay

        return partial(slope_replay, slope=slope)
    return replay
