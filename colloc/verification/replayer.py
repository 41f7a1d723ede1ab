"""What replays gaits: on the level, on a slope, and with inertia."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, singledispatch

from colloc.gaits.inertia import Paced
from colloc.gaits.regime import Regime
from colloc.gaits.sloped import Slope
from colloc.verification.played import Replay
from colloc.verification.replay import replay


@singledispatch
def replayer(regime: Regime) -> Callable[..., Replay]:
    """Replays a gait, with the arguments of `colloc.verification.replay.replay`; for another regime
    it is registered with ``replayer.register``."""
    return replay


@replayer.register
def _(regime: Slope) -> Callable[..., Replay]:
    from colloc.verification.slope import slope_replay  # loads what integrates

    return partial(slope_replay, slope=regime)


@replayer.register
def _(regime: Paced) -> Callable[..., Replay]:
    from colloc.verification.inertial_motion import inertial_replay

    return partial(inertial_replay, regime=regime)
