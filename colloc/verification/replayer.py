"""What replays gaits: on the level, on a slope, and with inertia."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, singledispatch
from typing import Any

from colloc.gaits.inertia import Paced
from colloc.gaits.regime import Regime
from colloc.gaits.sloped import Slope
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.verification.played import Replay
from colloc.verification.replay import replay


@singledispatch
def replayer(regime: Regime) -> Callable[..., Replay]:
    """Replays a gait, with the arguments of `colloc.verification.replay.replay`; for another regime
    it is registered with ``replayer.register``."""
    return replay


@replayer.register
def _on_slope(regime: Slope) -> Callable[..., Replay]:
    from colloc.verification.slope_replay import slope_replay

    return partial(slope_replay, slope=regime)


@replayer.register
def _with_inertia(regime: Paced) -> Callable[..., Replay]:
    return partial(_at_pace, regime)


def _at_pace(
    regime: Paced, body: Body, friction: Law, path: Any, delta: float, **asked: Any
) -> Replay:
    from colloc.verification.inertial_replay import inertial_replay

    return inertial_replay(body, friction, path, delta, regime=regime.at(path), **asked)
