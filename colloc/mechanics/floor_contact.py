"""Contacts of a chain with the floor: feet and wheels at points of its links, pads along parts.

A link that lies is one pad. With a and h the place of a part from its link's midpoint and R the
turn into its direction, a part moves with ``v = T (vs, vn, w) = (R (vs - h w, vn + a w), w)``, and
its force and couple f act on the link as ``T' f``. Weights are numbers: no foot lifts or sinks.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from colloc.mechanics.friction import Axle, Friction, LinkForce, LinkVelocity, line_integrals
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import STATED_IF_SET, is_number, is_whole, named_arguments, shown
from colloc.system.errors import ProblemError

FOOT, WHEEL, PAD = "foot", "wheel", "pad"
_TOLERANCE = 1e-9
"""Differences that count as none [body lengths, weights, rad]."""
_MAX_PER_LINK = 20
"""Largest `feet` as a number; with more a line is meant."""
_AT_POINT = {
    "force": "density",
    "jacobian": "density_jacobian",
    "secant": "density_secant",
    "potential": "density_potential",
}
"""Methods of `LineIntegrals`, and of a `Law` at a point."""


@named_arguments
@dataclass(frozen=True)
class Foot:
    """A point of a chain that touches the floor, or a straight part of one.

    Parameters
    ----------
    link : int
        The link it is on, 0 at the tail.
    place : float
        Position on the link, from 0 (the end towards the tail) to 1.
    weight : float, optional
        Load it bears, as a fraction of the body's weight; by default its share of its link's
        weight.
    offset : float
        Distance to the left of the link's middle line [body lengths].
    friction : Law, optional
        Its own law; by default the problem's.
    angle : float
        Direction that counts as forward, to the left of the link's [rad].
    extent : float
        Fraction of the link it covers, centred at `place`; 0 for a point (see `Pad`).

    Examples
    --------
    Three links on three feet, the outer ones near the ends:

    >>> from colloc import Chain, Foot
    >>> len(Chain(feet=(Foot(0, 0.1), Foot(1), Foot(2, 0.9))).feet)
    3
    """

    link: int
    place: float = 0.5
    weight: float | None = None
    offset: float = field(default=0.0, metadata=STATED_IF_SET)
    friction: Law | None = field(default=None, metadata=STATED_IF_SET)
    angle: float = field(default=0.0, metadata=STATED_IF_SET)
    extent: float = field(default=0.0, metadata=STATED_IF_SET)

    def __post_init__(self) -> None:
        def lies(name, low=-np.inf, high=np.inf):
            value = getattr(self, name)
            return is_number(value) and low <= value <= high

        law, bears = self.friction, self.weight is None or (self.weight and lies("weight", 0, 1))
        on_link = "lie on its link, from 0 (the end towards the tail) to 1"
        for name, valid, what in (
            ("link", is_whole(self.link), "be a whole number, 0 for the tail's"),
            ("place", lies("place", 0, 1), on_link),
            ("weight", bears, "be a positive part of the body's, at most 1"),
            ("offset", lies("offset"), "be a finite number"),
            ("angle", lies("angle"), "be a finite number"),
            ("extent", lies("extent", 0, 1), "be a part of its link, from 0 (a point) to 1"),
            (
                "friction",
                isinstance(law, Law | None) and not isinstance(law, type),
                "be a law of friction, as Friction()",
            ),
        ):
            if not valid:
                raise ProblemError(
                    f"the {name} of a foot must {what}, not {shown(getattr(self, name))}."
                )
        if abs(self.place - 0.5) + 0.5 * self.extent > 0.5 + _TOLERANCE:
            raise ProblemError(
                f"a pad must {on_link}, not from {self.first:.6g} to {self.last:.6g}."
            )
        if self.extent and self.angle:
            raise ProblemError(
                "a pad presses along its link: only a foot, without extent, may be turned by an "
                "angle."
            )

    @property
    def kind(self) -> str:
        """Its kind: "pad" with an extent, "wheel" if its own friction is lower along than across,
        else "foot"."""
        friction = self.friction
        rolls = isinstance(friction, Friction) and friction.mu_f == friction.mu_b < friction.mu_t
        rolls = rolls or (isinstance(friction, Axle) and friction.rolling < friction.sideways)
        return PAD if self.extent else WHEEL if rolls else FOOT

    @property
    def first(self) -> float:
        """The end towards the tail, as a fraction of the link."""
        return self.place - 0.5 * self.extent

    @property
    def last(self) -> float:
        """The end towards the head, as a fraction of the link."""
        return self.place + 0.5 * self.extent

    @property
    def mirrored(self) -> Foot:
        return replace(self, offset=-self.offset, angle=-self.angle)

    def from_head(self, n_link: int) -> Foot:
        link, place = n_link - 1 - self.link, 1.0 - self.place
        return replace(self, link=link, place=place, offset=-self.offset)

    def is_like(self, other: Foot) -> bool:
        a, b = ((f.link, f.place, f.weight or 0.0, f.offset, f.extent) for f in (self, other))
        # a reversible law has no forward direction
        turns = 1 if self.friction is None or not self.friction.reversible else 2
        turned = abs(np.sin(0.5 * turns * (self.angle - other.angle))) >= _TOLERANCE
        same = np.allclose(a, b, rtol=0, atol=_TOLERANCE)
        return self.friction == other.friction and same and not turned


def Wheel(
    link: int,
    place: float = 0.5,
    rolling: float = 0.02,
    sideways: float = 1.0,
    angle: float = 0.0,
    axle: bool = False,
    **foot: Any,
) -> Foot:
    """Return a passive wheel: a foot that slides easily along its rolling direction only.

    By default its friction is Coulomb's, `Friction`: that of a skate, a scale or a locked wheel,
    which hold less and less sideways the faster they slide along. A wheel that turns freely on its
    axle has the law `Axle`.

    Parameters
    ----------
    link, place
        As for a `Foot`.
    rolling, sideways : float
        Friction coefficients along the rolling direction, either way, and across it.
    angle : float
        Rolling direction, to the left of the link's [rad].
    axle : bool
        Whether it turns on an axle: `Axle`, else `Friction`.
    **foot
        Weight and offset, as for a `Foot`.

    Returns
    -------
    Foot

    Examples
    --------
    >>> from colloc import Wheel
    >>> Wheel(0).friction.label
    'friction (1, 0.02, 0.02)'
    >>> Wheel(0, axle=True).friction.label
    'axle (0.02, 1)'
    """
    if not (is_number(rolling) and is_number(sideways) and min(rolling, sideways) > 0):
        raise ProblemError(
            f"the coefficients rolling and sideways of a wheel must be positive and finite, not "
            f"{rolling!r} and {sideways!r}."
        )
    if "friction" in foot:
        raise ProblemError(
            "the friction of a wheel is stated by rolling and sideways; for another law of its own "
            "take Foot(link, place, friction=...)."
        )
    friction: Law = Friction(mu_t=sideways, mu_f=rolling, mu_b=rolling)
    if axle:
        friction = Axle(rolling=rolling, sideways=sideways)
    return Foot(link, place, friction=friction, angle=angle, **foot)


def Pad(link: int, first: float = 0.0, last: float = 1.0, **foot: Any) -> Foot:
    """Return a contact that presses evenly between two places of a link.

    Parameters
    ----------
    link : int
        The link it is on, 0 at the tail.
    first, last : float
        Its ends, from 0 (the end towards the tail) to 1.
    **foot
        Weight, offset and friction, as for a `Foot`.

    Returns
    -------
    Foot

    Examples
    --------
    >>> from colloc import Chain, Pad
    >>> len(Chain(feet=tuple(Pad(link, 0.25, 0.75) for link in range(3))).feet)
    3
    """
    if not (is_number(first) and is_number(last) and 0 <= first < last <= 1):
        raise ProblemError(
            f"a pad must lie on its link, from 0 to 1, and must end behind where it begins, not "
            f"from {first!r} to {last!r}: a point is a Foot."
        )
    return Foot(link, 0.5 * (first + last), extent=last - first, **foot)


def whole_links(weights: np.ndarray) -> tuple[Foot, ...]:
    """Pads from end to end, for a body that lies on its links."""
    return tuple(Foot(k, weight=float(weight), extent=1.0) for k, weight in enumerate(weights))


def checked_feet(feet: int | Iterable[Foot], weights: np.ndarray) -> tuple[Foot, ...]:
    """Feet from tail to head, each with its weight, on links that weigh `weights` ``(n_link,)``.

    A number means so many on each link, evenly spread. `ProblemError` for impossible feet.
    """
    if is_whole(feet):
        if not 0 <= feet <= _MAX_PER_LINK:
            raise ProblemError(
                f"body.feet must be 0 (a line) to {_MAX_PER_LINK} on each link, not {feet}."
            )
        places = (np.arange(feet) + 0.5) / max(feet, 1)
        feet = [Foot(link, float(place)) for link in range(weights.size) for place in places]
    parts = list(feet) if isinstance(feet, Iterable) else [feet]
    each = [foot for foot in parts if isinstance(foot, Foot)]
    if len(each) < len(parts):
        raise ProblemError(
            "body.feet must be the number of feet on each link, or a sequence of Foot, Wheel "
            "and Pad."
        )
    if not each:
        return ()
    for foot in each:
        if not 0 <= foot.link < weights.size:
            raise ProblemError(
                f"a foot stands on link {foot.link}, but the links are numbered 0 to "
                f"{weights.size - 1}."
            )

    def weight(foot):
        if foot.weight is not None:
            return float(foot.weight)
        others = [other.weight for other in each if other.link == foot.link]
        left = float(weights[foot.link]) - sum(each for each in others if each is not None)
        if left <= 0:
            raise ProblemError(
                f"the feet on link {foot.link} bear all that it weighs: give the last of them a "
                f"weight, too."
            )
        return left / others.count(None)

    feet = tuple(replace(foot, weight=weight(foot)) for foot in each)
    total = sum(foot.weight or 0.0 for foot in feet)
    if abs(total - 1.0) > _TOLERANCE:
        carried = sorted(set(range(weights.size)) - {foot.link for foot in feet})
        hint = f"; no foot is on link {', '.join(map(str, carried))}, so say who bears its weight"
        raise ProblemError(
            f"the weights of the feet must add up to 1, not {total:.6g}{hint if carried else ''}."
        )
    # the head end of a link is the tail end of the next
    points = {(foot.link + foot.place, foot.offset) for foot in feet}
    if len(points) < 2 and not any(foot.extent for foot in feet):
        raise ProblemError("a body needs feet at two points at least: on one it would spin freely.")
    if not same_feet(feet, [foot.mirrored for foot in feet]):
        raise ProblemError(
            "the feet differ between left and right (offset, angle), which the search takes for "
            "alike: give every foot that is offset or turned its mirror image on the same link."
        )
    return tuple(sorted(feet, key=lambda foot: (foot.link, foot.place, foot.offset)))


def same_feet(feet: Sequence[Foot], others: Sequence[Foot]) -> bool:
    """True if they are the same in any order, up to rounding."""
    left = list(others)
    for foot in feet:
        match = next((other for other in left if foot.is_like(other)), None)
        if match is None:
            return False
        left.remove(match)
    return True


def _of_all(name: str, joined: Any) -> Any:
    return property(lambda feet: joined(getattr(law, name) for law in feet.laws))


@dataclass(frozen=True)
class FeetLaw:
    """Laws of feet that do not all have the same, foot by foot, as one `Law`.

    Its traits are those of all; `FloorContact` asks each law for its force.
    """

    laws: tuple[Law, ...]

    kernel_numbers = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "laws", tuple(self.laws))

    @property
    def degree(self) -> float | None:
        degrees = {law.degree for law in self.laws}
        return degrees.pop() if len(degrees) == 1 else None

    reversible, associated = _of_all("reversible", all), _of_all("associated", all)
    regularised = _of_all("regularised", any)
    smallest, largest = _of_all("smallest", min), _of_all("largest", max)

    @property
    def label(self) -> str:
        return " and ".join(dict.fromkeys(law.label for law in self.laws)) + " by foot"

    def describe(self) -> str:
        counts = {law: self.laws.count(law) for law in self.laws}
        return "; ".join(
            f"{count} {'foot' if count == 1 else 'feet'}: {law.describe()}"
            for law, count in counts.items()
        )

    def in_units_of(self, unit: float) -> FeetLaw:
        return FeetLaw(tuple(law.in_units_of(unit) for law in self.laws))

    def in_speeds_of(self, unit: float) -> FeetLaw:
        return FeetLaw(tuple(law.in_speeds_of(unit) for law in self.laws))

    def density(self, vs: Array, vn: Array, delta: Array) -> Any:
        raise ProblemError(
            "feet have laws of friction of their own: this one is for none but a body that stands "
            "on them."
        )

    density_jacobian = density_secant = density_potential = density


class Group(NamedTuple):
    """Feet, or pads, under one law."""

    rows: list[int]
    law: Law
    pads: bool


class FloorContact:
    """Friction on the links of a chain, from the velocities of their midpoints and their rotation
    rates, ``(n_link, n_time)`` each; NumPy and CasADi.

    lengths: of the links, ``(n_link,)``. parts: feet and pads with their weights. called: "link"
    where the links lie on the floor.
    """

    def __init__(self, lengths: np.ndarray, parts: tuple[Foot, ...], called: str = FOOT) -> None:
        self.parts, self.links, self.called = parts, [part.link for part in parts], called
        names = ("place", "offset", "angle", "weight", "extent")
        place, self.offset, angle, self.weight, extent = (
            np.array([[getattr(part, name)] for part in parts]) for name in names
        )
        length = lengths[self.links][:, None]
        self.along, self.length = (place - 0.5) * length, extent * length
        # weight of feet, weight per length of pads
        self.pressure = self.weight / np.where(self.length > 0, self.length, 1.0)
        cos, sin = self.cos, self.sin = np.cos(angle), np.sin(angle)
        a, h, zero, one = self.along, self.offset, 0.0 * length, np.ones_like(length)
        self._T = np.array(
            ((cos, sin, a * sin - h * cos), (-sin, cos, a * cos + h * sin), (zero, zero, one))
        )[..., 0]  # (3, 3, n_part)
        self.scatter = np.zeros((len(lengths), len(parts)))
        self.scatter[self.links, np.arange(len(parts))] = 1.0
        self.pads = [k for k, part in enumerate(parts) if part.extent > 0]
        middle = len(lengths) // 2
        # links that may stick, the middle one first: initial guesses of a hard balance
        self.rests = tuple(sorted(set(self.links), key=lambda link: (link != middle, link)))
        self._groups: dict[Law, list[Group]] = {}

    @property
    def force_names(self) -> tuple[str, ...]:
        every = range(len(self.parts))
        kinds = ("tangential force", every), ("normal force", every), ("couple", self.pads)
        return tuple(f"{kind} on {self.called} {k + 1}" for kind, rows in kinds for k in rows)

    def couples(self, parts: Sequence[int]) -> list[int]:
        return [2 * len(self.parts) + self.pads.index(part) for part in parts]

    def law(self, friction: Law) -> Law:
        """The problem's law, or a `FeetLaw` where parts have their own."""
        if isinstance(friction, FeetLaw) or all(part.friction is None for part in self.parts):
            return friction
        return FeetLaw(tuple(part.friction or friction for part in self.parts))

    def laws(self, friction: Law) -> tuple[Law, ...]:
        law = self.law(friction)
        return law.laws if isinstance(law, FeetLaw) else (law,) * len(self.parts)

    def rounding(self, friction: Law) -> float:
        """What a speed is known to, over the largest: two feet, or two directions of axles, may
        stick on links that turn, where rotation cancels; friction changes within delta."""
        short = any(part.extent < 1 for part in self.parts)
        short = short or any(isinstance(law, Axle) for law in self.laws(friction))
        return 16 * float(np.finfo(float).eps) if short else 0.0

    def groups(self, friction: Law) -> list[Group]:
        if friction not in self._groups:
            groups: dict[tuple[Law, bool], list[int]] = {}
            laws, feet = self.laws(friction), set(range(len(self.parts))) - set(self.pads)
            for k in (*sorted(feet), *self.pads):
                groups.setdefault((laws[k], k in self.pads), []).append(k)
            self._groups[friction] = [Group(rows, *key) for key, rows in groups.items()]
        return self._groups[friction]

    def velocities(self, velocity: LinkVelocity) -> LinkVelocity:
        vs, vn, w = (row[self.links, :] for row in velocity)
        vs, vn = vs - self.offset * w, vn + self.along * w
        return LinkVelocity(self.cos * vs + self.sin * vn, self.cos * vn - self.sin * vs, w)

    def _evaluate(
        self, friction: Law, velocity: LinkVelocity, delta: Array, name: str
    ) -> list[tuple[Group, Any]]:
        """A quantity of the law at feet, or integrated along pads, by groups."""
        parts, values = self.velocities(velocity), []
        for group in self.groups(friction):
            vs, vn, w = (row[group.rows, :] for row in parts)
            if group.pads:
                integral = getattr(line_integrals(group.law), name)
                values.append((group, integral(vs, vn, w, self.length[group.rows], delta)))
            else:
                values.append((group, getattr(group.law, _AT_POINT[name])(vs, vn, delta)))
        return values

    def forces(self, friction: Law, velocity: LinkVelocity, delta: Array) -> Array:
        """Contact forces ``(n_force, n_time)``, see `force_names`."""
        values, rows = self._evaluate(friction, velocity, delta, "force"), []
        stack = namespace(velocity.vs).stack
        for k in range(3):
            pieces = [(g.rows, self.pressure[g.rows] * f[k]) for g, f in values if k < len(f)]
            if len(pieces) == 1:
                rows.append(pieces[0][1])
            elif pieces:
                order = np.argsort([part for parts, _ in pieces for part in parts])
                rows.append(stack([piece for _, piece in pieces])[order.tolist(), :])
        return stack(rows)

    def on_links(self, forces: Array) -> LinkForce:
        """T' f of contact forces."""
        n, matmul = len(self.parts), namespace(forces).matmul
        along, across = forces[:n, :], forces[n : 2 * n, :]
        fs, fn = self.cos * along - self.sin * across, self.sin * along + self.cos * across
        couple = matmul(self.scatter, self.along * fn - self.offset * fs)
        if self.pads:
            couple = couple + matmul(self.scatter[:, self.pads], forces[2 * n :, :])
        return LinkForce(matmul(self.scatter, fs), matmul(self.scatter, fn), couple)

    def force(self, friction: Law, velocity: LinkVelocity, delta: Array) -> LinkForce:
        return self.on_links(self.forces(friction, velocity, delta))

    def stiffness(
        self, friction: Law, velocity: LinkVelocity, delta: Array, *, secant: bool = False
    ) -> np.ndarray:
        """Minus the derivative of the force on links with respect to (vs, vn, w), or the matrix of
        the fixed point (`Law.density_secant`), ``(3, 3, n_link, n_time)``: sum of T' K T."""
        total, name = np.zeros((3, 3, *velocity.vs.shape)), "secant" if secant else "jacobian"
        for (rows, *_), block in self._evaluate(friction, velocity, delta, name):
            T = self._T[: len(block), :, rows]
            KT = np.einsum("pqnt,qjn->pjnt", self.pressure[rows] * np.array(block), T)
            total += self.scatter[:, rows] @ np.einsum("pin,pjnt->ijnt", T, KT)
        return total

    def potential(self, friction: Law, velocity: LinkVelocity, delta: Array) -> np.ndarray:
        values = self._evaluate(friction, velocity, delta, "potential")
        return np.concatenate([self.pressure[group.rows] * value for group, value in values])

    def largest_forces(self, friction: Law) -> np.ndarray:
        most = np.full((3, len(self.parts), 1), np.inf)
        for rows, law, pads in self.groups(friction):
            if pads:
                most[:, rows] = line_integrals(law).largest_forces(self.length[rows])
            elif law.degree == 0:
                most[:, rows] = law.largest
        most *= self.pressure
        return np.concatenate([most[0], most[1], most[2, self.pads]])

    def most_held(self, friction: Law) -> float:
        return float(self.weight[:, 0] @ [law.largest for law in self.laws(friction)])

    def slowest(self, velocity: LinkVelocity) -> np.ndarray:
        """Speed of the slowest part of each link, ``(n_link, n_time)``; infinite where there is
        none."""
        vs, vn, w = map(np.abs, self.velocities(velocity))
        speed = np.full(velocity.vs.shape, np.inf)
        np.minimum.at(speed, self.links, vs + vn + 0.5 * self.length * w)
        return speed

    def sticking_speeds(self, friction: Law, velocity: LinkVelocity) -> np.ndarray:
        """Speeds that vanish at kinks of the velocity in time, ``(n_part, n_time)``: of the slowest
        point of each part, or along it where directions differ."""
        vs, vn, w = map(np.abs, self.velocities(velocity))
        if not self.law(friction).reversible:
            return vs
        return np.hypot(vs, np.maximum(vn - 0.5 * self.length * w, 0.0))

    def kernel_numbers(self, friction: Law) -> tuple[float, ...]:
        """Contacts and laws for the compiled kernel; empty where a law is not in closed form."""
        law = self.law(friction)
        numbers = [each.kernel_numbers for each in self.laws(law)]
        if not all(numbers):
            return ()
        places = self.along, self.offset, self.cos, self.sin, self.length, self.pressure
        rows, links = list[tuple[float, ...]](), list[int]()
        for link, weight, place, row in zip(
            self.links, self.weight[:, 0], np.hstack(places), numbers, strict=True
        ):
            rows.append((*place, *row[:5]))
            if row[5:]:  # of an axle along, as of a foot at its middle that is turned to the left
                a, h, cos, sin, *_ = place
                rows.append((a, h, -sin, cos, 0.0, weight, *row[5:]))
            links += [link] * (len(rows) - len(links))
        first = np.searchsorted(links, np.arange(len(self.scatter) + 1))
        head = len(self.scatter), len(rows), law.largest, float(law.associated), *first
        return (*head, *np.ravel(rows))
