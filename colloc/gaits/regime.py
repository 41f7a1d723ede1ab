"""Regimes in which gaits are played: quasi-static on level ground unless a problem says
otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

from colloc.numerics.arrays import Array


@dataclass(frozen=True)
class Regime:
    """Slowly, on the level. Other kinds of motion derive from it; one of your own is asked for by
    ``Problem(motion=...)``.

    Examples
    --------
    >>> Regime().slow_on_level
    True
    """

    froude: ClassVar[float] = 0.0
    free_pace: ClassVar[bool] = False
    """Whether the pace is a parameter, the last one of a gait."""
    grade: ClassVar[float] = 0.0
    """Tangent of the inclination; +x is straight uphill."""
    slides: ClassVar[bool] = False
    """Whether the body may slide back."""
    spent: ClassVar[str] = "friction"
    """What the joints' work goes into."""
    others: ClassVar[str] = ""
    """Motions compared by a certificate, where these are not balanced motions of an instant."""
    others_measured: ClassVar[bool] = True
    pace: ClassVar[str] = ""
    """Why the pace of a gait matters."""

    @property
    def slow_on_level(self) -> bool:
        return type(self) is Regime

    @property
    def ahead(self) -> float:
        """Direction of travel that counts [rad]."""
        return 0.0

    @property
    def keeps_ahead(self) -> bool:
        return False

    @property
    def label(self) -> str:
        return ""

    @property
    def slowly(self) -> Regime:
        """The quasi-static regime."""
        return self

    def check(self, problem: Any) -> None:
        """Raise `ProblemError` for what this regime cannot do."""

    def class_of(self, gait_class: Any) -> Any:
        """Class of gaits with the static parameters of this regime."""
        return gait_class.level

    def at(self, gait: Any) -> Self:
        """Regime at the pace of a gait."""
        return self

    def in_units_of(self, unit: float) -> Self:
        return self

    def travel_along(self, way: complex) -> complex:
        """Distance that counts, and across it as the imaginary part."""
        return complex(abs(way))

    def pull(self, theta: Array) -> Array | None:
        """Outside force on the centre of mass in body axes, ``(2, n_time)``, at orientations theta
        ``(1, n_time)``; None if there is none. NumPy and CasADi."""
        return None

    def describe(self) -> str:
        return ""


LEVEL = Regime()
