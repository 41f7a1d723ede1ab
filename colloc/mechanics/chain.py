"""The chain of straight links as a `colloc.mechanics.bodies.Body`.

Frame: the body frame of the paper, tail link along +x. Link tangent angles are ``phi_i = sum of the
first i joint angles`` (the paper's Theta); joint angles are its Delta-theta, positive
counter-clockwise, counted from the tail. For references see `colloc.mechanics.balance`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from colloc.mechanics.balance import TAIL, Posture, instant, net_force, total_power
from colloc.mechanics.bodies import FORMULATIONS, IMPLICIT, Body, Sliding
from colloc.mechanics.contact import link_contacts
from colloc.mechanics.fixed_point import chain_motion, solve_balance
from colloc.mechanics.floor_contact import FloorContact, Foot, checked_feet, same_feet, whole_links
from colloc.mechanics.friction import LinkVelocity
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import STATED_IF_SET, is_number, named_arguments
from colloc.system.errors import ProblemError

BALANCED = 1e-9
"""Offset of the feet's load from the centre of mass that counts as none [body lengths]."""
_SHORTEST = 1e-6
"""Shortest link over the body: shorter ones drown in rounding."""


@named_arguments
@dataclass(frozen=True)
class Chain(Body):
    """A chain of straight links joined end to end; its shape coordinates are the joint angles.

    Parameters
    ----------
    lengths : tuple of float
        Link lengths from tail to head; they add up to the body length, 1.
    width : float
        Width of every link [body lengths]: links do not overlap except neighbours about their
        joint. By default links are lines, which must not cross but may lie on each other. Friction
        is that of the lines either way.
    weights : tuple of float
        Load of the links on the floor, from tail to head, as fractions of the body's weight; by
        default in proportion to their lengths. A law's force per length is multiplied by the weight
        per length, so drag of a fluid goes with the default only.
    feet : int or tuple of Foot
        Contacts: so many on each link, evenly spread (one: its middle), or a `Foot`, `Wheel` or
        `Pad` each. By default the links lie on the floor along their length.
    masses : tuple of float
        Masses of the links as fractions of the body's; by default their weights. They decide the
        centre of mass, and inertia (`colloc.Problem.froude`).
    inertias : tuple of float
        Moments of inertia of the links about their midpoints [body mass x length^2]; by default
        those of uniform rods.

    Examples
    --------
    >>> from colloc import Chain
    >>> Chain((0.25, 0.5, 0.25), width=0.02).n_joint
    2
    """

    lengths: tuple[float, ...] = (1 / 3, 1 / 3, 1 / 3)
    width: float = field(default=0.0, metadata=STATED_IF_SET)
    weights: tuple[float, ...] = field(default=(), metadata=STATED_IF_SET)
    feet: tuple[Foot, ...] | int = field(default=(), metadata=STATED_IF_SET)
    masses: tuple[float, ...] = field(default=(), metadata=STATED_IF_SET)
    inertias: tuple[float, ...] = field(default=(), metadata=STATED_IF_SET)

    solve, motion, contacts = solve_balance, chain_motion, link_contacts
    in_series = True  # every link hangs on the one before it, as the compiled kernel assumes

    def __post_init__(self) -> None:
        wholes = {
            "lengths": "the body length",
            "weights": "the body's weight",
            "masses": "the body's mass",
            "inertias": "",
        }
        for name, whole in wholes.items():
            value = getattr(self, name)
            try:
                values = tuple(float(each) for each in value)
            except (TypeError, ValueError):
                raise ProblemError(
                    f"body.{name} must be a sequence of numbers, not {value!r}."
                ) from None
            object.__setattr__(self, name, values)
            if name == "lengths" and len(values) < 2:
                raise ProblemError("body.lengths needs at least two links.")
            if len(values) not in (0, self.n_link):
                raise ProblemError(
                    f"body.{name} has {len(values)} values; give one for each of the "
                    f"{self.n_link} links."
                )
            if not all(0 < each < np.inf or (each == 0 and not whole) for each in values):
                sign = "positive and finite" if whole else "finite and not negative"
                raise ProblemError(f"body.{name} must be {sign}, not {values}.")
            if whole and values and abs(sum(values) - 1.0) > 1e-12:
                raise ProblemError(f"body.{name} must add up to {whole} 1, not {sum(values):.12g}.")
        shortest = min(self.lengths)
        if shortest < _SHORTEST:
            raise ProblemError(
                f"body.lengths has a link of {shortest:g}: no link may be shorter than "
                f"{_SHORTEST:g} of the body."
            )
        if not (is_number(self.width) and 0 <= self.width < shortest):
            raise ProblemError(
                f"body.width must be a number from 0 to below the shortest link, not "
                f"{self.width!r}."
            )
        object.__setattr__(self, "width", float(self.width))
        object.__setattr__(self, "feet", checked_feet(self.feet, self.weight_column()[:, 0]))

    @property
    def n_link(self) -> int:
        return len(self.lengths)

    @property
    def n_joint(self) -> int:
        return len(self.lengths) - 1

    @property
    def standing_on(self) -> tuple[Foot, ...]:
        """The feet; none if it lies on its links."""
        return () if isinstance(self.feet, int) else self.feet

    @cached_property
    def contact(self) -> FloorContact:
        lengths = np.array(self.lengths)
        if self.standing_on:
            return FloorContact(lengths, self.standing_on)
        return FloorContact(lengths, whole_links(self.weight_column()[:, 0]), "link")

    def law(self, friction: Law) -> Law:
        return self.contact.law(friction)

    def length_column(self) -> np.ndarray:
        return np.array(self.lengths)[:, None]

    def weight_column(self) -> np.ndarray:
        return np.array(self.weights or self.lengths)[:, None]

    def mass_column(self) -> np.ndarray:
        return np.array(self.masses)[:, None] if self.masses else self.weight_column()

    def inertia_column(self) -> np.ndarray:
        if self.inertias:
            return np.array(self.inertias)[:, None]
        return self.mass_column() * self.length_column() ** 2 / 12

    def _joint_sum(self, reference: int | None) -> np.ndarray:
        """Joint angles to link angles relative to the reference link, ``(n_link, n_joint)``."""
        full = np.tril(np.ones((self.n_link, self.n_joint)), -1)
        return full if reference is TAIL else full - full[reference]

    def weighted_path(self, reference: int | None) -> np.ndarray:
        """Link directions to midpoints relative to the reference point, ``(n_link, n_link)``."""
        full = np.tril(np.ones((self.n_link, self.n_link)), -1) + 0.5 * np.eye(self.n_link)
        return (full if reference is TAIL else full - full[reference]) * self.lengths

    def tangent_angles(self, angles: Array) -> Array:
        return namespace(angles).matmul(self._joint_sum(TAIL), angles)

    def posture(self, angles: Array, reference: int | None = TAIL) -> Posture:
        xp, phi = namespace(angles), self.tangent_angles(angles)
        cos, sin, path = xp.cos(phi), xp.sin(phi), self.weighted_path(reference)
        return Posture(cos, sin, xp.matmul(path, cos), xp.matmul(path, sin))

    def velocity(
        self, posture: Posture, rates: Array, z: Array, reference: int | None = TAIL
    ) -> LinkVelocity:
        """Link velocities (paper, eq. dtz0) for joint rates ``(n_joint, n_time)`` and the rigid
        velocity z ``(3, n_time)`` of the reference."""
        xp = namespace(rates, z, posture.cos)
        path = self.weighted_path(reference)
        w = xp.matmul(self._joint_sum(reference), rates) + z[2:3, :]
        vx = z[0:1, :] - xp.matmul(path, w * posture.sin)
        vy = z[1:2, :] + xp.matmul(path, w * posture.cos)
        return LinkVelocity(
            vx * posture.cos + vy * posture.sin, vy * posture.cos - vx * posture.sin, w
        )

    def tail_velocity(
        self, posture: Posture, rates: Array, z: Array, reference: int | None
    ) -> Array:
        """Velocity of the tail, ``(3, n_time)``, when `z` is that of `reference`, from which the
        posture is seen."""
        if reference is TAIL:
            return z
        vs, vn, w = (row[0:1, :] for row in self.velocity(posture, rates, z, reference))
        # the tail link has direction (1, 0) in the body frame
        return namespace(vs).stack([vs, vn - 0.5 * self.lengths[0] * w, w])

    def centre_of_mass(self, posture: Posture) -> tuple[Array, Array]:
        """Centre of mass relative to the reference, two rows."""
        xp, mass = namespace(posture.x), self.mass_column()
        return xp.sum_rows(mass * posture.x), xp.sum_rows(mass * posture.y)

    def centre_velocity(self, posture: Posture, link: LinkVelocity) -> tuple[Array, Array]:
        """Velocity of the centre of mass in body-frame axes, two rows."""
        xp, mass = namespace(link.vs), self.mass_column()
        return (
            xp.sum_rows(mass * (link.vs * posture.cos - link.vn * posture.sin)),
            xp.sum_rows(mass * (link.vs * posture.sin + link.vn * posture.cos)),
        )

    def joints(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Link end points in the body frame, x and y, each ``(n_link + 1, n_time)``, tail first."""
        phi, length = self.tangent_angles(angles), self.length_column()
        start = np.zeros((1, phi.shape[1]))
        return (
            np.concatenate([start, np.cumsum(length * np.cos(phi), axis=0)]),
            np.concatenate([start, np.cumsum(length * np.sin(phi), axis=0)]),
        )

    outline = joints

    def centre(self, angles: np.ndarray) -> np.ndarray:
        return np.concatenate(self.centre_of_mass(self.posture(angles)))

    def sliding(
        self,
        friction: Law,
        angles: Array,
        rates: Array,
        z: Array,
        delta: Array,
        reference: int | None = TAIL,
    ) -> Sliding:
        posture, velocity, force = instant(self, friction, angles, rates, z, delta, reference)
        centre = namespace(angles, z).stack(list(self.centre_velocity(posture, velocity)))
        return Sliding(net_force(posture, force), centre, total_power(velocity, force))

    def forces(self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array) -> Array:
        """Contact forces at a tail velocity, ``(n_force, n_time)`` (`FloorContact.force_names`)."""
        return self.contact.forces(friction, self.velocity(self.posture(angles), rates, z), delta)

    @cached_property
    def symmetric(self) -> bool:
        """True if lengths, weights, masses and feet are the same from both ends."""
        parts = self.lengths, self.weights, self.masses, self.inertias
        same = all(np.allclose(row, row[::-1], rtol=0, atol=1e-14) for row in parts)
        feet = self.standing_on
        return same and same_feet(feet, [foot.from_head(self.n_link) for foot in feet])

    @property
    def symmetries(self) -> tuple[str, ...]:
        return ("none", "bilateral", "antipodal") if self.symmetric else ("none", "antipodal")

    @property
    def reversal(self) -> np.ndarray | None:
        return -np.eye(self.n_joint)[::-1] if self.symmetric else None

    def describe(self) -> str:
        def numbers(values):
            return ", ".join(f"{value:.4g}" for value in values)

        wide = f", {self.width:.4g} wide" if self.width else ""
        stands = f", on {len(self.standing_on)} feet" if self.feet else ""
        if self.largest_imbalance > BALANCED:
            stands += (
                f" (whose weights press up to {self.largest_imbalance:.3g} beside the centre "
                f"of mass)"
            )
        parts = (
            ("weights", self.weights),
            ("masses", self.masses),
            ("moments of inertia", self.inertias),
        )
        heavy = "".join(f", of {words} {numbers(values)}" for words, values in parts if values)
        lengths = numbers(self.lengths)
        return f"links of lengths {lengths} from the tail{wide}{stands} [body lengths]{heavy}"

    def footprints(self, angles: np.ndarray, wheel: float = 0.0) -> np.ndarray:
        """Ends of its feet and pads, of wheels drawn `wheel` of their link long, and of links where
        it lies on them, seen from the tail, ``(2, 2, n_part, n_time)``."""
        contact = self.contact
        cos, sin, x, y = (row[contact.links] for row in self.posture(angles))
        wheels = [wheel * (part.kind == "wheel") for part in contact.parts]
        length = np.array(self.lengths)[contact.links] * wheels
        along = contact.length + length[:, None] * contact.cos
        across = length[:, None] * contact.sin
        ends = [
            (contact.along + side * along, contact.offset + side * across) for side in (-0.5, 0.5)
        ]
        return np.stack(
            [[x + a * cos - b * sin for a, b in ends], [y + a * sin + b * cos for a, b in ends]]
        )

    def imbalance(self, angles: np.ndarray) -> np.ndarray:
        """Distance of the centre of the load on the floor from the centre of mass [body lengths],
        ``(n_time,)``."""
        places = self.footprints(angles).mean(axis=1)
        load = np.einsum("f,cft->ct", self.contact.weight[:, 0], places)
        return np.hypot(*(load - self.centre(angles)))

    @property
    def largest_imbalance(self) -> float:
        """`imbalance` at the worst shape, whatever the limits of the joints."""
        path, contact = self.weighted_path(None), self.contact
        weight, links = contact.weight[:, 0], contact.links
        arms = weight @ path[links] - self.mass_column()[:, 0] @ path
        np.add.at(arms, links, weight * contact.along[:, 0])  # what is offset has a mirror image
        return float(np.abs(arms).sum())

    def seen_from_head(
        self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Velocity of the head in the axes of the body counted from it, and its heading in the
        body's axes, turned by half a turn [rad]."""
        link = self.velocity(self.posture(angles), rates, z)
        half = 0.5 * self.lengths[-1]
        head = np.stack([link.vs[-1], link.vn[-1] + half * link.w[-1], -link.w[-1]])
        return head, angles.sum(axis=0)

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        """With joint j at s_j along the body: ``q_j = sin(2 pi t - 2 pi waves (s_j - 1/2))``."""
        phase = 2 * np.pi * waves * (np.cumsum(self.lengths)[:-1] - 0.5)
        return -np.sin(phase), np.cos(phase)

    def from_chain(self, lengths: np.ndarray) -> np.ndarray:
        """Every link gets the mean tangent angle of the part of the other chain it covers."""
        theirs, ours = (np.concatenate([[0.0], np.cumsum(b)]) for b in (lengths, self.lengths))
        overlap = np.minimum(ours[1:, None], theirs[1:]) - np.maximum(ours[:-1, None], theirs[:-1])
        means = np.maximum(overlap, 0.0) / self.length_column()
        return np.diff(means @ np.tril(np.ones((lengths.size, lengths.size - 1)), -1), axis=0)


def formulations(body: Body) -> tuple[str, ...]:
    """`FORMULATIONS` for a body, the usual one first."""
    return FORMULATIONS if isinstance(body, Chain) else (IMPLICIT,)
