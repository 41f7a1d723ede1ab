"""What touches the floor: a chain's links along their whole length, or feet at points of them.

A contact turns the velocities of links into the friction on them, with derivatives, and says which forces a full program has
for variables. The line integrates a law of friction, in closed form if there is one (`colloc.mechanics.line_integrals`); feet
ask it at a point: with the velocity of a foot of weight p on its link,

    v = R (vs - h w, vn + a w),     force on the link R' f,  couple a f_n - h f_s,     f = p density(v),

a and h its place from the link's midpoint, R the turn into its own direction. A foot lifts nothing and sinks nowhere: its
weight is a number. One that changes with the shape would be a function of the posture here.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from colloc.mechanics.feet import FeetLaw, Foot
from colloc.mechanics.law import KernelLaw, Law, Matrix
from colloc.mechanics.line_integrals import line_integrals
from colloc.mechanics.link_friction import LinkForce
from colloc.numerics.arrays import Array, namespace

FOOT = "foot"
"""What a point of contact is called."""


class LinkVelocities(Protocol):
    """As `colloc.mechanics.links.LinkVelocity`."""

    @property
    def vs(self) -> Array: ...
    @property
    def vn(self) -> Array: ...
    @property
    def w(self) -> Array: ...


class Rest(NamedTuple):
    """A point that does not move, by its link and its place there, and a link that does not turn: where a balance is near."""

    link: int
    along: float
    offset: float
    still: int


def from_middle(n: int) -> list[int]:
    """Numbers of n links, the middle one first."""
    return [n // 2, *(link for link in range(n) if link != n // 2)]


class FloorContact(Protocol):
    """Friction on the links of a chain, from the velocities of their midpoints and their rotation rates,
    ``(n_link, n_time)`` each; NumPy and CasADi."""

    @property
    def n_force(self) -> int:
        """Number of forces that are variables of a full program."""

    @property
    def force_names(self) -> tuple[str, ...]:
        """What they are."""

    def law(self, friction: Law) -> Law:
        """The law of friction of all that touches, where the problem states `friction`."""

    def force(self, friction: Law, velocity: LinkVelocities, delta: Array) -> LinkForce:
        """On the links."""

    def stiffness(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Matrix:
        """Minus its derivative with respect to (vs, vn, w), 3 x 3."""

    def secant(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Matrix:
        """The matrix of the paper's fixed point (`colloc.mechanics.law.Law.density_secant`)."""

    def potential(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Array:
        """The dissipation potential of what touches, row by row; of associated laws only."""

    def forces(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Array:
        """The variables' values, ``(n_force, n_time)``."""

    def on_links(self, forces: Array) -> LinkForce:
        """The friction on links that they mean."""

    def laws(self, friction: Law, velocity: LinkVelocities, forces: Array, delta: Array) -> list[Array]:
        """What vanishes where they obey the law, scaled like velocities."""

    def largest_forces(self, friction: Law) -> np.ndarray:
        """Their largest magnitudes, ``(n_force, 1)``."""

    @property
    def rounding(self) -> float:
        """What rounding leaves of the force, times delta over the largest rate; 0 where the solver need not reckon with it."""

    @property
    def rests(self) -> tuple[Rest, ...]:
        """What may be at rest: from each of them a balance is sought that is not found otherwise."""

    @property
    def further_rests(self) -> tuple[Rest, ...]:
        """Others that are tried where these lead nowhere."""

    def slowest(self, velocity: LinkVelocities) -> np.ndarray:
        """How fast the slowest part of each link's contact moves, ``(n_link, n_time)``; infinite for a carried link."""

    def slowness(self, friction: Law, velocity: LinkVelocities) -> np.ndarray:
        """What has to vanish for a kink of the velocities in time, ``(n_part, n_time)``."""

    def kernel_law(self, friction: Law) -> KernelLaw:
        """The law of all that touches, for the compiled kernel."""

    def speeds(self, velocity: LinkVelocities) -> tuple[str, np.ndarray]:
        """Of what is drawn as sticking or sliding, and what it is called."""

    def points(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where friction is drawn: the link of each point, its place along that from the midpoint and its offset, ``(n,)``."""

    def at_points(self, friction: Law, velocity: LinkVelocities, delta: float, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Friction there, along and across the link: on a line per length, ``(n, n_time)`` each."""


class LineContact:
    """The links press evenly along their length."""

    rounding = 0.0
    further_rests: tuple[Rest, ...] = ()
    force_names: tuple[str, ...]

    def __init__(self, lengths: np.ndarray, pressure: np.ndarray) -> None:
        self._length, self._pressure = lengths, pressure
        kinds = ("tangential force", "normal force", "couple")
        self.force_names = tuple(f"{kind} on link {i + 1}" for kind in kinds for i in range(len(lengths)))
        self.rests = tuple(Rest(link, 0.0, 0.0, link) for link in from_middle(len(lengths)))

    @property
    def n_force(self) -> int:
        return 3 * len(self._length)

    def law(self, friction: Law) -> Law:
        return friction

    def force(self, friction: Law, velocity: LinkVelocities, delta: Array) -> LinkForce:
        own = line_integrals(friction).force(velocity.vs, velocity.vn, velocity.w, self._length, delta)
        return LinkForce(*(self._pressure * part for part in own))

    def _pressed(self, blocks: Matrix) -> Matrix:
        return tuple(tuple(self._pressure * a for a in row) for row in blocks)

    def stiffness(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Matrix:
        return self._pressed(line_integrals(friction).jacobian(velocity.vs, velocity.vn, velocity.w, self._length, delta))

    def secant(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Matrix:
        return self._pressed(line_integrals(friction).secant(velocity.vs, velocity.vn, velocity.w, self._length, delta))

    def potential(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Array:
        return self._pressure * line_integrals(friction).potential(velocity.vs, velocity.vn, velocity.w, self._length, delta)

    def forces(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Array:
        return namespace(velocity.vs).stack(list(self.force(friction, velocity, delta)))

    def on_links(self, forces: Array) -> LinkForce:
        n = len(self._length)
        return LinkForce(forces[:n, :], forces[n : 2 * n, :], forces[2 * n :, :])

    def laws(self, friction: Law, velocity: LinkVelocities, forces: Array, delta: Array) -> list[Array]:
        own = LinkForce(*(part / self._pressure for part in self.on_links(forces)))
        return line_integrals(friction).scaled_laws(velocity.vs, velocity.vn, velocity.w, self._length, delta, own)

    def largest_forces(self, friction: Law) -> np.ndarray:
        return line_integrals(friction).largest_forces(self._length) * np.tile(self._pressure, (3, 1))

    def slowest(self, velocity: LinkVelocities) -> np.ndarray:
        return np.abs(velocity.vs) + np.abs(velocity.vn) + 0.5 * self._length * np.abs(velocity.w)

    def slowness(self, friction: Law, velocity: LinkVelocities) -> np.ndarray:
        """Speed of the slowest point of each link, or tangential speed where directions differ."""
        if not friction.reversible:
            return np.abs(velocity.vs)
        beyond = np.maximum(np.abs(velocity.vn) - 0.5 * self._length * np.abs(velocity.w), 0.0)
        return np.hypot(velocity.vs, beyond)

    def kernel_law(self, friction: Law) -> KernelLaw:
        return friction.kernel

    def speeds(self, velocity: LinkVelocities) -> tuple[str, np.ndarray]:
        """Of the midpoints of the links."""
        return "link", np.hypot(velocity.vs, velocity.vn)

    def points(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        n, many = len(self._length), max(2, count // len(self._length))
        share = (np.arange(many) + 0.5) / many - 0.5
        return np.tile(np.arange(n), many), (share[:, None] * self._length[:, 0]).ravel(), np.zeros(n * many)

    def at_points(self, friction: Law, velocity: LinkVelocities, delta: float, count: int) -> tuple[np.ndarray, np.ndarray]:
        link, along, _ = self.points(count)
        vn = velocity.vn[link] + along[:, None] * velocity.w[link]
        fs, fn = friction.density(velocity.vs[link], vn, delta)
        return self._pressure[link] * fs, self._pressure[link] * fn


class PointContact:
    """Feet at points of the links."""

    rounding = 16 * float(np.finfo(float).eps)
    """Two feet may hold on links that turn, where what turns them cancels: each speed is then known to some units of rounding
    of the largest, and its friction changes within delta."""

    def __init__(self, lengths: np.ndarray, feet: tuple[Foot, ...]) -> None:
        self.feet, self.links = feet, [foot.link for foot in feet]
        column = {name: np.array([[getattr(foot, name)] for foot in feet]) for name in ("place", "offset", "angle", "weight")}
        self.along = (column["place"] - 0.5) * lengths[self.links][:, None]
        self.offset, self.weight = column["offset"], column["weight"]
        self.cos, self.sin = np.cos(column["angle"]), np.sin(column["angle"])
        # the velocity of a foot in its own directions, per velocity (vs, vn, w) of its link
        self._turn = (
            (self.cos, self.sin, self.along * self.sin - self.offset * self.cos),
            (-self.sin, self.cos, self.along * self.cos + self.offset * self.sin),
        )
        self._scatter = np.zeros((len(lengths), len(feet)))
        self._scatter[self.links, np.arange(len(feet))] = 1.0
        order = from_middle(len(lengths))
        points = sorted(zip(self.links, self.along[:, 0], self.offset[:, 0], strict=True), key=lambda at: order.index(at[0]))
        self.rests = tuple(Rest(*at, at[0]) for at in points)
        self.further_rests = tuple(Rest(*at, link) for at in points for link in order if link != at[0])
        self.force_names = tuple(f"force {way} at foot {i + 1}" for way in ("along", "across") for i in range(len(feet)))

    @property
    def n_force(self) -> int:
        """Along and across every foot."""
        return 2 * len(self.feet)

    @cached_property
    def _own(self) -> dict[Law, FeetLaw]:
        return {}

    def law(self, friction: Law) -> Law:
        """That of the problem; or one that has another row for every foot, where some have their own."""
        if isinstance(friction, FeetLaw) or all(foot.friction is None for foot in self.feet):
            return friction
        if friction not in self._own:
            self._own[friction] = FeetLaw(tuple(foot.friction or friction for foot in self.feet))
        return self._own[friction]

    def _each(self, law: Law) -> tuple[Law, ...]:
        return law.laws if isinstance(law, FeetLaw) else (law,) * len(self.feet)

    def velocities(self, velocity: LinkVelocities) -> tuple[Array, Array]:
        """Of the feet along and across their own directions, ``(n_foot, n_time)`` each."""
        vs, vn, w = velocity.vs[self.links, :], velocity.vn[self.links, :], velocity.w[self.links, :]
        vs, vn = vs - self.offset * w, vn + self.along * w
        return self.cos * vs + self.sin * vn, self.cos * vn - self.sin * vs

    def on_links(self, forces: Array) -> LinkForce:
        n = len(self.feet)
        along, across = forces[:n, :], forces[n:, :]
        fs, fn = self.cos * along - self.sin * across, self.sin * along + self.cos * across
        sums = [namespace(forces).matmul(self._scatter, part) for part in (fs, fn, self.along * fn - self.offset * fs)]
        return LinkForce(*sums)

    def forces(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Array:
        own = self.law(friction).density(*self.velocities(velocity), delta)
        return namespace(velocity.vs).stack([self.weight * part for part in own])

    def force(self, friction: Law, velocity: LinkVelocities, delta: Array) -> LinkForce:
        return self.on_links(self.forces(friction, velocity, delta))

    def _blocks(self, density: Matrix) -> Matrix:
        """3 x 3 of links from 2 x 2 of feet."""
        turn, sums = self._turn, range(2)
        on_feet = [
            [sum(turn[p][i] * density[p][q] * turn[q][j] for p in sums for q in sums) for j in range(3)] for i in range(3)
        ]
        return tuple(tuple(self._scatter @ (self.weight * entry) for entry in row) for row in on_feet)

    def stiffness(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Matrix:
        return self._blocks(self.law(friction).density_jacobian(*self.velocities(velocity), delta))

    def secant(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Matrix:
        return self._blocks(self.law(friction).density_secant(*self.velocities(velocity), delta))

    def potential(self, friction: Law, velocity: LinkVelocities, delta: Array) -> Array:
        return self.weight * self.law(friction).density_potential(*self.velocities(velocity), delta)

    def laws(self, friction: Law, velocity: LinkVelocities, forces: Array, delta: Array) -> list[Array]:
        """Forces less the law's, over the law's secant: velocities."""
        law, at, n = self.law(friction), (*self.velocities(velocity), delta), len(self.feet)
        own, secant = law.density(*at), law.density_secant(*at)
        return [(forces[k * n : (k + 1) * n, :] / self.weight - own[k]) / secant[k][k] for k in range(2)]

    def largest_forces(self, friction: Law) -> np.ndarray:
        largest = [each.largest if each.degree == 0 else np.inf for each in self._each(self.law(friction))]
        return np.tile(self.weight * np.array(largest)[:, None], (2, 1))

    def slowest(self, velocity: LinkVelocities) -> np.ndarray:
        speed, found = sum(np.abs(part) for part in self.velocities(velocity)), np.full(velocity.vs.shape, np.inf)
        np.minimum.at(found, self.links, speed)
        return found

    def slowness(self, friction: Law, velocity: LinkVelocities) -> np.ndarray:
        """Speed of each foot, or the one along it where directions differ."""
        along, across = self.velocities(velocity)
        return np.hypot(along, across) if friction.reversible else np.abs(along)

    @cached_property
    def _of_kernel(self) -> dict[Law, KernelLaw]:
        return {}

    def kernel_law(self, friction: Law) -> KernelLaw:
        """Feet under Coulomb's law or the elliptic one, each its own, or all under one law that is stated as formulas."""
        if friction not in self._of_kernel:
            self._of_kernel[friction] = self._in_the_kernel(self.law(friction))
        return self._of_kernel[friction]

    def _in_the_kernel(self, law: Law) -> KernelLaw:
        own, stated = [each.kernel for each in self._each(law)], law.kernel
        if any(not each.numbers or each.own_law != stated.own_law for each in own):
            return KernelLaw()
        numbers = [each.numbers[:5] for each in own]
        degree, unit, speed_unit = numbers[0][1:4]  # of a law that is stated as formulas
        first = np.searchsorted(self.links, np.arange(len(self._scatter) + 1))
        feet = np.hstack([self.along, self.offset, self.cos, self.sin, self.weight, numbers])
        head = len(self._scatter), law.largest, float(law.associated), degree, unit, speed_unit
        return KernelLaw((*head, *first, *feet.ravel()), ("FEET", *stated.defines), stated.own_law)

    def speeds(self, velocity: LinkVelocities) -> tuple[str, np.ndarray]:
        return FOOT, np.hypot(*self.velocities(velocity))

    def points(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return np.array(self.links), self.along[:, 0], self.offset[:, 0]

    def at_points(self, friction: Law, velocity: LinkVelocities, delta: float, count: int) -> tuple[np.ndarray, np.ndarray]:
        along, across = np.split(self.forces(friction, velocity, delta), 2)
        return self.cos * along - self.sin * across, self.sin * along + self.cos * across
