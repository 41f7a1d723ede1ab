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
        Of the objective, as collocation sees it on a coarse mesh, which may be a little more than a fine one would.
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

    def __str__(self) -> str:
        size = ", as small as its bound allows" if self.on_speed_floor else ""
        return f"{self.value:.4f} at delta {self.delta:.0e} ({self.starts} start{'s' * (self.starts > 1)}{size})"
