"""How gaits are played, as a problem states it: slowly and on the level, unless its regime says
otherwise.

A regime says what pulls the body, which way counts, what cannot be asked, and the words of reports.
Which states its periods have, and how they are replayed, is registered for its type
(`colloc.motion.kinds.kind_in`); one of your own says how it is replayed (`replay`, and
`reference`: `colloc.verification.reference_motion`).
"""

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
    """Froude number at which gaits are played."""
    free_pace: ClassVar[bool] = False
    """Whether the pace is sought with the gait, whose last parameter it is."""
    grade: ClassVar[float] = 0.0
    """Tangent of the inclination of the ground; +x is straight uphill."""
    slides: ClassVar[bool] = False
    """Whether the body may slide back, so that there may be no gait that is worth anything."""
    spent: ClassVar[str] = "friction"
    """What the joints' work goes into."""
    others: ClassVar[str] = ""
    """Between which motions a certificate looks, where these are not the balanced motions of an
    instant."""
    others_measured: ClassVar[bool] = True
    """Whether it is known what other balanced motions would change."""
    pace: ClassVar[str] = ""
    """Why the pace of a gait matters; "" where it does not."""

    @property
    def slow_on_level(self) -> bool:
        """Whether it is this one, of which most is known."""
        return type(self) is Regime

    @property
    def ahead(self) -> float:
        """Direction whose way counts, where the plane has directions [rad]."""
        return 0.0

    @property
    def keeps_ahead(self) -> bool:
        """Whether no way is made across it."""
        return False

    @property
    def label(self) -> str:
        """For lines that say what a problem asks."""
        return ""

    @property
    def slowly(self) -> Regime:
        """The same, so slow that inertia does not matter."""
        return self

    def check(self, problem: Any) -> None:
        """A `ProblemError` for what cannot be asked of a problem."""

    def class_of(self, gait_class: Any) -> Any:
        """What a class of gaits is here."""
        return gait_class.level

    def at(self, gait: Any) -> Self:
        """The regime of a gait, which may say its pace."""
        return self

    def in_units_of(self, unit: float) -> Self:
        """The same in forces divided by a unit."""
        return self

    def counted(self, way: complex) -> complex:
        """What counts of the way of a period, and the way across that: on the level it is as long
        as it is."""
        return complex(abs(way))

    def pull(self, theta: Array) -> Array | None:
        """An outside force on the centre of mass of a body at orientations theta ``(1, n_time)``,
        in its axes, ``(2, n_time)``; None if there is none. NumPy and CasADi."""
        return None

    def describe(self) -> str:
        """In words, for reports; "" if there is nothing to say."""
        return ""


LEVEL = Regime()
