"""What a search over many starts tells while it is under way."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchStep:
    """How far a search over many starts has come.

    Attributes
    ----------
    what : str
        What is counted: "starts" tried on a coarse mesh, or "gaits" followed to the final delta.
    done, count : int
        Gaits may be followed for less than their count: those of finite size only until one is found.
    efficiency : float
        Of the best gait so far, as collocation sees it; NaN before there is one.
    delta : float
        At which that is; NaN before.
    """

    what: str
    done: int
    count: int
    efficiency: float
    delta: float

    def __str__(self) -> str:
        best = f"; best d/W = {self.efficiency:.4f} at delta = {self.delta:.0e}" if self.delta > 0 else ""
        return f"{self.done} of {self.count} {self.what}{best}"
