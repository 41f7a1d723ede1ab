"""What touches the floor: feet at points of a chain's links, and pads along parts of them; a link
that lies is one pad.

A contact turns the velocities of links into the friction on them, with derivatives, and says which
forces a full program has for variables. Feet ask the law of friction at a point, pads its integral
along a straight line, in closed form where there is one (`colloc.mechanics.line_integrals`). With
the velocity of a part in its own direction, and its force and couple f,

    v = T (vs, vn, w) = (R (vs - h w, vn + a w), w),     on the link T' f,

a and h its place from the link's midpoint, R the turn into its own direction. A foot lifts nothing
and sinks nowhere: its weight is a number. One that changes with the shape would be a function of
the posture here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from colloc.mechanics.feet import FeetLaw, Foot
from colloc.mechanics.law import Law, Matrix
from colloc.mechanics.line_integrals import line_integrals
from colloc.mechanics.link_friction import LinkForce
from colloc.numerics.arrays import Array, namespace

FOOT = "foot"
"""What a part is called, where it is not a whole link."""


class LinkVelocities(Protocol):
    """As `colloc.mechanics.links.LinkVelocity`; of parts, too."""

    @property
    def vs(self) -> Array: ...
    @property
    def vn(self) -> Array: ...
    @property
    def w(self) -> Array: ...


class _PartVelocity(NamedTuple):
    """Of the middles of parts, along and across their own directions, and how fast they turn,
    ``(n_part, n_time)`` each."""

    vs: Array
    vn: Array
    w: Array


class _Group(NamedTuple):
    """Parts of one kind under one law."""

    rows: list[int]
    law: Law
    pads: bool


def from_middle(n: int) -> list[int]:
    """Numbers of n links, the middle one first."""
    return [n // 2, *(link for link in range(n) if link != n // 2)]


class FloorContact:
    """Friction on the links of a chain, from the velocities of their midpoints and their rotation
    rates, ``(n_link, n_time)`` each; NumPy and CasADi.

    Parameters
    ----------
    lengths : (n_link,)
        Of the links.
    parts : tuple of Foot
        Feet and pads, each with its weight.
    called : str
        What they are called: "link" where the links lie on the floor.
    """

    def __init__(self, lengths: np.ndarray, parts: tuple[Foot, ...], called: str = FOOT) -> None:
        self.parts, self.links, self.called = parts, [part.link for part in parts], called
        names = ("place", "offset", "angle", "weight", "extent")
        place, self.offset, angle, self.weight, extent = (
            np.array([[getattr(part, name)] for part in parts]) for name in names
        )
        own = lengths[self.links][:, None]
        self.along, self.length = (place - 0.5) * own, extent * own
        self.pressure = self.weight / np.where(self.length > 0, self.length, 1.0)
        """Weight of feet, weight per length of pads."""
        self.cos, self.sin = np.cos(angle), np.sin(angle)
        self._turn = (
            (self.cos, self.sin, self.along * self.sin - self.offset * self.cos),
            (-self.sin, self.cos, self.along * self.cos + self.offset * self.sin),
            (0.0 * own, 0.0 * own, np.ones_like(own)),
        )
        self._scatter = np.zeros((len(lengths), len(parts)))
        self._scatter[self.links, np.arange(len(parts))] = 1.0
        self._pads = [k for k, part in enumerate(parts) if part.extent > 0]
        self._points = [k for k, part in enumerate(parts) if part.extent == 0]
        self.rests = tuple(link for link in from_middle(len(lengths)) if link in self.links)
        """Links that may be at rest: from each of them a balance is sought that is not found
        otherwise."""
        self._short = any(part.extent < 1 for part in parts)
        """A part that is shorter than its link may rest while that turns."""

    @property
    def rounding(self) -> float:
        """What rounding leaves of the force, times delta over the largest rate; 0 where the solver
        need not reckon with it.

        Two feet may hold on links that turn, where what turns them cancels: each speed is then
        known to some units of rounding of the largest, and its friction changes within delta."""
        return 16 * float(np.finfo(float).eps) if self._short else 0.0

    @property
    def n_force(self) -> int:
        """Number of forces that are variables of a full program: along and across every part, and
        the couples on pads."""
        return 2 * len(self.parts) + len(self._pads)

    @property
    def force_names(self) -> tuple[str, ...]:
        """What they are."""
        kinds = (
            ("tangential force", range(len(self.parts))),
            ("normal force", range(len(self.parts))),
            ("couple", self._pads),
        )
        return tuple(f"{kind} on {self.called} {k + 1}" for kind, rows in kinds for k in rows)

    @cached_property
    def _own(self) -> dict[Law, FeetLaw]:
        return {}

    def law(self, friction: Law) -> Law:
        """The law of friction of all that touches, where the problem states `friction`: that, or
        one that has another for every part, where some have their own."""
        if isinstance(friction, FeetLaw) or all(part.friction is None for part in self.parts):
            return friction
        if friction not in self._own:
            self._own[friction] = FeetLaw(tuple(part.friction or friction for part in self.parts))
        return self._own[friction]

    def _each(self, friction: Law) -> tuple[Law, ...]:
        law = self.law(friction)
        return law.laws if isinstance(law, FeetLaw) else (law,) * len(self.parts)

    @cached_property
    def _grouped(self) -> dict[Law, list[_Group]]:
        return {}

    def couples(self, parts: Sequence[int]) -> list[int]:
        """Which of the forces are the couples on pads."""
        return [2 * len(self.parts) + self._pads.index(part) for part in parts]

    def groups(self, friction: Law) -> list[_Group]:
        """The parts, those of one kind and law together."""
        if friction not in self._grouped:
            each, found = self._each(friction), []
            for rows, pads in ((self._points, False), (self._pads, True)):
                laws = dict.fromkeys(each[k] for k in rows)
                found += [_Group([k for k in rows if each[k] == law], law, pads) for law in laws]
            self._grouped[friction] = found
        return self._grouped[friction]

    def _evaluated(
        self,
        friction: Law,
        velocity: LinkVelocities,
        delta: Array,
        of: tuple[Callable[[Law], Callable], Callable[[Law], Callable]],
    ) -> list[tuple[_Group, Any]]:
        """What laws say of points, and of lines."""
        moves, found = self.velocities(velocity), []
        for group in self.groups(friction):
            own = [part[group.rows, :] for part in moves]
            at = (*own, self.length[group.rows], delta) if group.pads else (*own[:2], delta)
            found.append((group, of[group.pads](group.law)(*at)))
        return found

    def _in_order(self, pieces: Sequence[tuple[list[int], Array]]) -> Array:
        """Rows of some parts each, as rows of all of them, from the tail."""
        if len(pieces) == 1:
            return pieces[0][1]
        rows = [k for some, _ in pieces for k in some]
        return namespace(*(piece for _, piece in pieces)).stack([piece for _, piece in pieces])[
            np.argsort(rows).tolist(), :
        ]

    def velocities(self, velocity: LinkVelocities) -> _PartVelocity:
        """Of the parts."""
        vs, vn, w = (
            velocity.vs[self.links, :],
            velocity.vn[self.links, :],
            velocity.w[self.links, :],
        )
        vs, vn = vs - self.offset * w, vn + self.along * w
        return _PartVelocity(self.cos * vs + self.sin * vn, self.cos * vn - self.sin * vs, w)

    def on_links(self, forces: Array) -> LinkForce:
        """The friction on links that the variables mean."""
        n, xp = len(self.parts), namespace(forces)
        along, across = forces[:n, :], forces[n : 2 * n, :]
        fs, fn = self.cos * along - self.sin * across, self.sin * along + self.cos * across
        sums = [
            xp.matmul(self._scatter, part) for part in (fs, fn, self.along * fn - self.offset * fs)
        ]
        if self._pads:
            sums[2] = sums[2] + xp.matmul(self._scatter[:, self._pads], forces[2 * n :, :])
        return LinkForce(*sums)

    def forces(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Array:
        """The variables' values, ``(n_force, n_time)``."""
        said = self._evaluated(
            friction,
            velocity,
            delta,
            (lambda law: law.density, lambda law: line_integrals(law).force),
        )
        rows = [
            [(g.rows, self.pressure[g.rows] * own[k]) for g, own in said if k < len(own)]
            for k in range(3)
        ]
        return namespace(velocity.vs).stack([self._in_order(pieces) for pieces in rows if pieces])

    def force(self, friction: Law, velocity: LinkVelocities, delta: Array) -> LinkForce:
        """On the links."""
        return self.on_links(self.forces(friction, velocity, delta))

    def _blocks(self, said: list[tuple[_Group, Matrix]]) -> Matrix:
        """3 x 3 of links from 3 x 3 of pads and 2 x 2 of feet: sum of T' K T."""
        on_parts: list[list[list[tuple[list[int], Array]]]] = [
            [[] for _ in range(3)] for _ in range(3)
        ]
        for group, own in said:
            turn = [[entry[group.rows] for entry in row] for row in self._turn]
            ways = [[p for p in range(len(own)) if turn[p][i].any()] for i in range(3)]
            none = 0.0 * own[0][0]
            for i in range(3):
                for j in range(3):
                    entry = sum(
                        (turn[p][i] * own[p][q] * turn[q][j] for p in ways[i] for q in ways[j]),
                        none,
                    )
                    on_parts[i][j].append((group.rows, self.pressure[group.rows] * entry))
        return tuple(
            tuple(self._scatter @ self._in_order(pieces) for pieces in row) for row in on_parts
        )

    def stiffness(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Matrix:
        """Minus the derivative of the force on links with respect to (vs, vn, w), 3 x 3."""
        of = (lambda law: law.density_jacobian, lambda law: line_integrals(law).jacobian)
        return self._blocks(self._evaluated(friction, velocity, delta, of))

    def secant(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Matrix:
        """The matrix of the paper's fixed point (`colloc.mechanics.law.Law.density_secant`)."""
        of = (lambda law: law.density_secant, lambda law: line_integrals(law).secant)
        return self._blocks(self._evaluated(friction, velocity, delta, of))

    def potential(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Array:
        """The dissipation potential of the parts, row by row; of associated laws only."""
        of = (lambda law: law.density_potential, lambda law: line_integrals(law).potential)
        said = self._evaluated(friction, velocity, delta, of)
        return self._in_order(
            [(group.rows, self.pressure[group.rows] * own) for group, own in said]
        )

    def largest_forces(self, friction: Law) -> np.ndarray:
        """Their largest magnitudes, ``(n_force, 1)``."""
        found = np.full((3, len(self.parts), 1), np.inf)
        for rows, law, pads in self.groups(friction):
            if pads:
                found[:, rows] = (
                    line_integrals(law).largest_forces(self.length[rows]).reshape(3, -1, 1)
                )
            elif law.degree == 0:
                found[:, rows] = law.largest
        found *= self.pressure
        return np.concatenate([found[0], found[1], found[2, self._pads]])

    def most_held(self, friction: Law) -> float:
        """The largest pull on the body that friction may hold, over its weight."""
        return float(self.weight[:, 0] @ [law.largest for law in self._each(friction)])

    def slowest(self, velocity: LinkVelocities) -> np.ndarray:
        """How fast the slowest part of each link moves, ``(n_link, n_time)``; infinite for a
        carried link."""
        vs, vn, w = map(np.abs, self.velocities(velocity))
        found = np.full(velocity.vs.shape, np.inf)
        np.minimum.at(found, self.links, vs + vn + 0.5 * self.length * w)
        return found

    def slowness(self, friction: Law, velocity: LinkVelocities) -> np.ndarray:
        """What has to vanish for a kink of the velocities in time, ``(n_part, n_time)``: the speed
        of the slowest point of each part, or the one along it where directions differ."""
        vs, vn, w = map(np.abs, self.velocities(velocity))
        return (
            np.hypot(vs, np.maximum(vn - 0.5 * self.length * w, 0.0))
            if self.law(friction).reversible
            else vs
        )

    @cached_property
    def _kernel_numbers(self) -> dict[Law, tuple[float, ...]]:
        return {}

    def kernel_numbers(self, friction: Law) -> tuple[float, ...]:
        """All that touches and its laws, for the compiled kernel; empty where one of them is
        neither Coulomb's nor elliptic."""
        if friction not in self._kernel_numbers:
            law = self.law(friction)
            numbers = [each.kernel_numbers[:5] for each in self._each(law)]
            first = np.searchsorted(self.links, np.arange(len(self._scatter) + 1))
            head = len(self._scatter), len(self.parts), law.largest, float(law.associated), *first
            places = self.along, self.offset, self.cos, self.sin, self.length, self.pressure
            self._kernel_numbers[friction] = (
                (*head, *np.hstack([*places, numbers]).ravel()) if all(numbers) else ()
            )
        return self._kernel_numbers[friction]

    def speeds(self, velocity: LinkVelocities) -> tuple[str, np.ndarray]:
        """Of what is drawn as sticking or sliding, and what it is called: of the middles of links;
        of feet, and of pads where they are fastest."""
        vs, vn, w = map(np.abs, self.velocities(velocity))
        return self.called, np.hypot(vs, vn + 0.5 * self.length * w if self.called == FOOT else vn)

    def points(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where friction is drawn, about `count` points along pads, and every foot: the part of
        each point, and its place from the midpoint of that part's link, along and offset,
        ``(n,)``."""
        many = max(2, count // max(len(self._pads), 1))
        share = (np.arange(many) + 0.5) / many - 0.5
        part = np.array([*self._points, *np.tile(self._pads, many).astype(int)])
        ahead = np.concatenate([np.zeros(len(self._points)), np.repeat(share, len(self._pads))])
        return part, self.along[part, 0] + ahead * self.length[part, 0], self.offset[part, 0]

    def at_points(
        self, friction: Law, velocity: LinkVelocities, delta: float, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Friction there, along and across the link: on a link that lies per length, ``(n,
        n_time)`` each; on a foot, and on pads beside feet as if all of it moved like this."""
        part, along, _ = self.points(count)
        vs, vn, w = self.velocities(velocity)
        each, turned = (
            self._each(friction),
            vn[part] + (along - self.along[part, 0])[:, None] * w[part],
        )
        force = [each[k].density(vs[[k]], turned[[i]], delta) for i, k in enumerate(part)]
        fs, fn = (np.concatenate([own[side] for own in force]) for side in (0, 1))
        pressed = (self.weight if self.called == FOOT else self.pressure)[part]
        cos, sin = self.cos[part], self.sin[part]
        return pressed * (cos * fs - sin * fn), pressed * (sin * fs + cos * fn)
