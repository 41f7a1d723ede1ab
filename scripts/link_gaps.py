"""How close links come to each other along a gait, for tables of efficiencies: links without a width may touch."""

from __future__ import annotations

import numpy as np

from colloc import Chain
from colloc.gaits.gait_fields import AnyGait
from colloc.mechanics.contact import gap

LYING = 0.01
"""Body lengths: links with a smaller gap count as lying on each other."""
INSTANTS = 8001
_PHASES = np.linspace(0.0, 1.0, INSTANTS)


def gaps(body: Chain, gait: AnyGait) -> tuple[float, float]:
    """Smallest gap along a gait [body lengths], and the share of its path on which links lie on each other."""
    angles = gait.angles(_PHASES)
    between, steps = gap(body, angles), np.linalg.norm(np.diff(angles), axis=0)
    lying = 0.5 * (between[1:] + between[:-1]) < LYING
    return float(between.min()), float(steps[lying].sum() / steps.sum())
