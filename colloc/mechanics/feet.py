"""Feet, wheels and pads: what of a chain touches the floor, each with its share of the weight and a
friction of its own if it has one.

A foot sits on a link, `place` along it from its tail end (0) to its head end (1), and `offset` to
the left of its middle line. A pad is a foot that has an extent along its link.
`colloc.mechanics.floor_contact` says what friction does there.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law
from colloc.system.arguments import STATED_IF_SET, is_number, is_whole, named_arguments, shown
from colloc.system.errors import ProblemError

_SAME = 1e-9
"""Within which numbers of feet are one [body lengths, weights, rad]."""
FOOT, WHEEL, PAD = "foot", "wheel", "pad"
_MOST = 20
"""Feet on a link that `feet=` takes as a number: with more a line is meant."""


@named_arguments
@dataclass(frozen=True)
class Foot:
    """A point of a chain that touches the floor, or a straight part of one.

    Parameters
    ----------
    link : int
        The link it is on, 0 at the tail.
    place : float
        Where on the link, from 0 (the end towards the tail) to 1.
    weight : float, optional
        What it bears, in parts of the body's weight; by default its part of what its link weighs.
    offset : float
        How far it sits to the left of the link's middle line [body lengths].
    friction : Law, optional
        Of its own; by default that of the problem.
    angle : float
        Of the direction that counts as its forward one, to the left of the link's [rad].
    extent : float
        What part of the link it covers, `place` in its middle; 0 for a point (see `Pad`).

    Examples
    --------
    Three links on three feet, the outer ones near the ends:

    >>> from colloc import Chain, Foot
    >>> Chain(feet=(Foot(0, 0.1), Foot(1), Foot(2, 0.9))).symmetric
    True
    """

    link: int
    place: float = 0.5
    weight: float | None = None
    offset: float = field(default=0.0, metadata=STATED_IF_SET)
    friction: Law | None = field(default=None, metadata=STATED_IF_SET)
    angle: float = field(default=0.0, metadata=STATED_IF_SET)
    extent: float = field(default=0.0, metadata=STATED_IF_SET)

    def __post_init__(self) -> None:
        if not is_whole(self.link):
            raise ProblemError(
                f"the link of a foot must be a whole number, 0 for the tail's, not {self.link!r}."
            )
        if not (is_number(self.place) and 0 <= self.place <= 1):
            raise ProblemError(
                f"the place of a foot must lie on its link, from 0 (the end towards the tail) to "
                f"1, not {self.place!r}."
            )
        if self.weight is not None and not (is_number(self.weight) and 0 < self.weight <= 1):
            raise ProblemError(
                f"the weight of a foot must be a positive part of the body's, at most 1, not "
                f"{self.weight!r}."
            )
        for name in ("offset", "angle"):
            if not is_number(getattr(self, name)):
                raise ProblemError(
                    f"the {name} of a foot must be a finite number, not {getattr(self, name)!r}."
                )
        if not (is_number(self.extent) and 0 <= self.extent <= 1):
            raise ProblemError(
                f"the extent of a foot must be a part of its link, from 0 (a point) to 1, not "
                f"{self.extent!r}."
            )
        if abs(self.place - 0.5) + 0.5 * self.extent > 0.5 + _SAME:
            raise ProblemError(
                "a pad must lie on its link, from 0 (the end towards the tail) to 1, "
                f"not from {self.first:.6g} to {self.last:.6g}."
            )
        if self.extent and self.angle:
            raise ProblemError(
                "a pad presses along its link: only a foot, without extent, may be turned by an "
                "angle."
            )
        if isinstance(self.friction, type) or not isinstance(self.friction, Law | None):
            raise ProblemError(
                f"the friction of a foot must be a law of friction, as Friction(), not "
                f"{shown(self.friction)}."
            )

    def from_head(self, n_link: int) -> Foot:
        """The same foot on the body named from its other end."""
        return replace(
            self, link=n_link - 1 - self.link, place=1.0 - self.place, offset=-self.offset
        )

    @property
    def mirrored(self) -> Foot:
        """The foot on the body's mirror image."""
        return replace(self, offset=-self.offset, angle=-self.angle)

    @property
    def kind(self) -> str:
        """What it is: "pad" with an extent, "wheel" if friction of its own is lower forwards and
        backwards, else "foot"."""
        own = self.friction
        rolls = isinstance(own, Friction) and own.mu_f == own.mu_b < own.mu_t
        return PAD if self.extent else WHEEL if rolls else FOOT

    @property
    def first(self) -> float:
        """Where on the link it begins, from 0 to 1."""
        return self.place - 0.5 * self.extent

    @property
    def last(self) -> float:
        """Where on the link it ends; a point where it begins."""
        return self.place + 0.5 * self.extent

    @property
    def point(self) -> tuple[float, float]:
        """Where along the body, counted in links, and beside it: the head end of a link is the tail
        end of the next."""
        return self.link + self.place, self.offset

    def is_like(self, other: Foot) -> bool:
        """Whether two feet are one, up to rounding."""
        own, its = ((f.link, f.place, f.weight or 0.0, f.offset, f.extent) for f in (self, other))
        turns = 1 if self.friction is None or not self.friction.reversible else 2
        turned = abs(np.sin(0.5 * turns * (self.angle - other.angle)))
        return self.friction == other.friction and bool(
            turned < _SAME and np.allclose(own, its, rtol=0, atol=_SAME)
        )


def Wheel(
    link: int,
    place: float = 0.5,
    rolling: float = 0.02,
    sideways: float = 1.0,
    angle: float = 0.0,
    **foot: Any,
) -> Foot:
    """A passive wheel: a foot that slides easily along its rolling direction, and hardly across it.

    Parameters
    ----------
    link, place
        As of a `Foot`.
    rolling, sideways : float
        Coefficients of friction along its rolling direction, either way, and across it.
    angle : float
        Of the rolling direction, to the left of the link's [rad].
    **foot
        Weight and offset, as of a `Foot`.

    Returns
    -------
    Foot

    Examples
    --------
    >>> from colloc import Wheel
    >>> Wheel(0).friction.label
    'friction (1, 0.02, 0.02)'
    """
    for name, value in (("rolling", rolling), ("sideways", sideways)):
        if not (is_number(value) and value > 0):
            raise ProblemError(
                f"the coefficient {name} of a wheel must be positive and finite, not {value!r}."
            )
    return Foot(
        link,
        place,
        friction=Friction(mu_t=sideways, mu_f=rolling, mu_b=rolling),
        angle=angle,
        **foot,
    )


def Pad(link: int, first: float = 0.0, last: float = 1.0, **foot: Any) -> Foot:
    """What presses evenly between two places of a link: a rubber pad, a ski, or the link itself.

    Parameters
    ----------
    link : int
        The link it is on, 0 at the tail.
    first, last : float
        Where on the link it begins and ends, from 0 (the end towards the tail) to 1.
    **foot
        Weight, offset and friction, as of a `Foot`.

    Returns
    -------
    Foot

    Examples
    --------
    >>> from colloc import Chain, Pad
    >>> Chain(feet=tuple(Pad(link, 0.25, 0.75) for link in range(3))).symmetric
    True
    """
    for name, value in (("begins", first), ("ends", last)):
        if not (is_number(value) and 0 <= value <= 1):
            raise ProblemError(
                f"the place where a pad {name} must lie on its link, from 0 to 1, not {value!r}."
            )
    if not first < last:
        raise ProblemError(
            f"a pad must end behind where it begins, not at {last!r} and {first!r}: a point is "
            f"a Foot."
        )
    return Foot(link, 0.5 * (first + last), extent=last - first, **foot)


def whole_links(weights: np.ndarray) -> tuple[Foot, ...]:
    """The links of a body that lies on them: pads from end to end."""
    return tuple(
        Foot(link, weight=float(weight), extent=1.0) for link, weight in enumerate(weights)
    )


def checked_feet(feet: int | Iterable[Foot], weights: np.ndarray) -> tuple[Foot, ...]:
    """The feet of a body whose links weigh `weights` ``(n_link,)``, from tail to head, each with
    its weight.

    A number means so many on each link, evenly spread. `ProblemError` for feet that no body can
    have.
    """
    if is_whole(feet):
        if not 0 <= feet <= _MOST:
            raise ProblemError(f"body.feet must be 0 (a line) to {_MOST} on each link, not {feet}.")
        each = [(2 * k + 1) / (2 * feet) for k in range(feet)]
        feet = [Foot(link, place) for link in range(weights.size) for place in each]
    given = tuple(feet) if isinstance(feet, Iterable) else (feet,)
    stated = tuple(foot for foot in given if isinstance(foot, Foot))
    if len(stated) < len(given):
        raise ProblemError(
            "body.feet must be the number of feet on each link, or a sequence of Foot, Wheel "
            "and Pad."
        )
    if not stated:
        return ()
    for foot in stated:
        if not 0 <= foot.link < weights.size:
            raise ProblemError(
                f"a foot stands on link {foot.link}, but the links are numbered 0 to "
                f"{weights.size - 1}."
            )
    borne = [_weight(foot, stated, weights) for foot in stated]
    shared, total = (
        tuple(replace(foot, weight=weight) for foot, weight in zip(stated, borne, strict=True)),
        sum(borne),
    )
    if abs(total - 1.0) > _SAME:
        carried = sorted(set(range(weights.size)) - {foot.link for foot in stated})
        hint = (
            f"; no foot is on link {', '.join(map(str, carried))}, so say who bears its weight"
            if carried
            else ""
        )
        raise ProblemError(f"the weights of the feet must add up to 1, not {total:.6g}{hint}.")
    if len({foot.point for foot in shared}) < 2 and not any(foot.extent for foot in shared):
        raise ProblemError("a body needs feet at two points at least: on one it would spin freely.")
    if not _same_set(shared, [foot.mirrored for foot in shared]):
        raise ProblemError(
            "the feet differ between left and right (offset, angle), which the search takes for "
            "alike: give every foot that is "
            "offset or turned its mirror image on the same link."
        )
    return tuple(sorted(shared, key=lambda foot: (foot.link, foot.place, foot.offset)))


def _weight(foot: Foot, feet: tuple[Foot, ...], weights: np.ndarray) -> float:
    """What a foot bears: as stated, or its part of what the other feet of its link leave of the
    link's weight."""
    if foot.weight is not None:
        return float(foot.weight)
    others = [other.weight for other in feet if other.link == foot.link]
    left = float(weights[foot.link]) - sum(weight for weight in others if weight is not None)
    if left <= 0:
        raise ProblemError(
            f"the feet on link {foot.link} bear all that it weighs: give the last of them a "
            f"weight, too."
        )
    return left / others.count(None)


def _same_set(feet: tuple[Foot, ...], others: list[Foot]) -> bool:
    left = list(others)
    for foot in feet:
        match = next((other for other in left if foot.is_like(other)), None)
        if match is None:
            return False
        left.remove(match)
    return True


def read_alike_from_both_ends(feet: tuple[Foot, ...], n_link: int) -> bool:
    """Whether the feet are the same for a body named from its other end."""
    return _same_set(feet, [foot.from_head(n_link) for foot in feet])


def _of_each_foot(*_: Any) -> Any:
    raise ProblemError(
        "feet have laws of friction of their own: this one is for none but a body that stands "
        "on them."
    )


@dataclass(frozen=True)
class FeetLaw:
    """The laws of friction of feet that do not all have the same, foot by foot: a
    `colloc.mechanics.law.Law` of them all.

    What it says of forces is asked of each one (`colloc.mechanics.floor_contact`).
    """

    laws: tuple[Law, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "laws", tuple(self.laws))

    kernel_numbers = ()
    density = density_jacobian = density_secant = density_potential = staticmethod(_of_each_foot)

    @property
    def degree(self) -> float | None:
        degrees = {law.degree for law in self.laws}
        return degrees.pop() if len(degrees) == 1 else None

    @property
    def reversible(self) -> bool:
        return all(law.reversible for law in self.laws)

    @property
    def associated(self) -> bool:
        return all(law.associated for law in self.laws)

    @property
    def regularised(self) -> bool:
        return any(law.regularised for law in self.laws)

    @property
    def smallest(self) -> float:
        return min(law.smallest for law in self.laws)

    @property
    def largest(self) -> float:
        return max(law.largest for law in self.laws)

    @property
    def label(self) -> str:
        return " and ".join(dict.fromkeys(law.label for law in self.laws)) + " by foot"

    def describe(self) -> str:
        counted = {law: self.laws.count(law) for law in self.laws}
        return "; ".join(
            f"{count} {'foot' if count == 1 else 'feet'}: {law.describe()}"
            for law, count in counted.items()
        )

    def in_units_of(self, unit: float) -> FeetLaw:
        return FeetLaw(tuple(law.in_units_of(unit) for law in self.laws))

    def in_speeds_of(self, unit: float) -> FeetLaw:
        return FeetLaw(tuple(law.in_speeds_of(unit) for law in self.laws))
