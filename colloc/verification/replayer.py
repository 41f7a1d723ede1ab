"""What replays the gaits of a problem: on the level, on a slope, or with inertia."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from colloc.gaits.problem import Problem
from colloc.verification.replay import Replay, replay


def replayer(problem: Problem) -> Callable[..., Replay]:
    """Replays a gait, with the arguments of `colloc.verification.replay.replay`."""
    if problem.froude:
        from colloc.verification.inertial_replay import inertial_replay

        return partial(inertial_replay, froude=problem.froude)
    if problem.slope is not None:
        from colloc.verification.slope_replay import slope_replay

        return partial(slope_replay, slope=problem.slope)
    return replay
