from dataclasses import replace

from colloc.gaits.regime import LEVEL
from colloc.verification.replay import replayer


def played(body, friction, gait, delta, froude, *, regime=LEVEL, tolerance=1e-5, **asked):
    """A period with inertia, all of which are alike."""
    at = replayer(replace(regime, froude=froude, free=None))
    return at(body, friction, gait, delta, tolerance=tolerance, **asked)
