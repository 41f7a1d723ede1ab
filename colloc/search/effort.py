"""How exactly a gait is optimised on the way: three sizes, one table."""

from __future__ import annotations

from dataclasses import dataclass

from colloc.search.certify import KKT


@dataclass(frozen=True)
class Effort:
    """How exactly a gait is optimised.

    Attributes
    ----------
    accuracy : float
        Of the objective, at which SQP stops.
    kkt_error : float
        What the first-order conditions have to keep to then; the objective is off by about its square.
    rounds : int
        Times that the shape checks are moved to the worst instants, and the gait optimised again, at most.
    """

    accuracy: float
    kkt_error: float
    rounds: int


SKETCH = Effort(1e-5, 1e-1, 2)
"""Enough to tell gaits apart. A start that needs more is told apart as it is."""
ROUGH = Effort(1e-8, 1e-3, 12)
"""On the way: delta, or the mesh, will move the gait by more."""
FINE = Effort(1e-14, KKT, 12)
"""At the final delta on the final mesh."""
ITERATIONS = 150
"""Of SQP in a round, at most."""
