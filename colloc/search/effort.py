"""How exactly a gait is optimised on the way: three sizes, one table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.search.certify import EXACT


@dataclass(frozen=True)
class Effort:
    """How exactly a gait is optimised.

    Attributes
    ----------
    kkt_error : float
        What the first-order conditions have to keep to; the objective is off by about its square.
    """

    kkt_error: float

    @property
    def accuracy(self) -> float:
        """Of the objective, at which SQP stops: well below what the conditions leave."""
        return 1e-3 * self.kkt_error**2

    @property
    def rounds(self) -> int:
        """Times that the shape checks are moved to the worst instants, and the gait optimised
        again, at most: two a digit."""
        return 2 * round(-np.log10(self.kkt_error))


SKETCH = Effort(1e-1)
"""Enough to tell gaits apart. A start that needs more is told apart as it is."""
ROUGH = Effort(1e-3)
"""On the way: delta, or the mesh, will move the gait by more."""
FINE = Effort(EXACT)
"""At the final delta on the final mesh."""
