"""What else a search over many starts met."""

from __future__ import annotations

from dataclasses import dataclass

from colloc.gaits.gait_fields import AnyGait


@dataclass(frozen=True, eq=False)
class Alternative:
    """A gait that a search over many starts met.

    Attributes
    ----------
    value : float
        Of the objective, as collocation sees it on a first mesh.
    delta : float
        To which it was followed.
    starts : int
        How many led to it.
    on_speed_floor : bool
        Whether the bound on the shape speed decided its size.
    gait : AnyGait
    """

    value: float
    delta: float
    starts: int
    on_speed_floor: bool
    gait: AnyGait
