"""What a space of gaits is made of, so that it can be made again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.bodies import Pairs


class Given(NamedTuple):
    """What a space was made of, besides its problem: made of the same it is the same."""

    edges: np.ndarray | None
    scheme: str
    far: Pairs
    """Pairs of links more than two apart that are kept from crossing."""
