"""The chain of straight links as a `colloc.mechanics.bodies.Body`."""

from __future__ import annotations

import numpy as np

from colloc.mechanics.balance import instant, net_force, total_power
from colloc.mechanics.bodies import Body, Sliding
from colloc.mechanics.chain_motion import chain_motion
from colloc.mechanics.contact import link_contacts
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.law import Law
from colloc.mechanics.links import Links
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import named_arguments

BALANCED = 1e-9
"""Offset of the feet's load from the centre of mass that counts as none [body lengths]."""


@named_arguments
class Chain(Links, Body):
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

    solve, motion, outline, contacts = solve_balance, chain_motion, Links.joints, link_contacts

    def describe(self) -> str:
        def numbers(values: tuple[float, ...]) -> str:
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

    @property
    def symmetries(self) -> tuple[str, ...]:
        return ("none", "bilateral", "antipodal") if self.symmetric else ("none", "antipodal")

    @property
    def reversal(self) -> np.ndarray | None:
        return -np.eye(self.n_joint)[::-1] if self.symmetric else None

    def sliding(
        self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array
    ) -> Sliding:
        posture, velocity, force = instant(self, friction, angles, rates, z, delta)
        centre = namespace(angles, z).stack(list(self.centre_velocity(posture, velocity)))
        return Sliding(net_force(posture, force), centre, total_power(velocity, force))

    def forces(self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array) -> Array:
        """Contact forces at a tail velocity, ``(n_force, n_time)`` (`FloorContact.force_names`)."""
        return self.contact.forces(friction, self.velocity(self.posture(angles), rates, z), delta)

    def centre(self, angles: np.ndarray) -> np.ndarray:
        return np.concatenate(self.centre_of_mass(self.posture(angles)))

    def footprints(self, angles: np.ndarray, wheel: float = 0.0) -> np.ndarray:
        """Ends of its feet and pads, of wheels drawn `wheel` of their link long, and of links where
        it lies on them, seen from the tail, ``(2, 2, n_part, n_time)``."""
        contact = self.contact
        cos, sin, x, y = (row[contact.links] for row in self.posture(angles))
        drawn = [wheel * (part.kind == "wheel") for part in contact.parts]
        length = np.array(self.lengths)[contact.links] * drawn
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
        arms = (weight @ path[links] - self.mass_column()[:, 0] @ path).astype(complex)
        np.add.at(arms, links, weight * (contact.along + 1j * contact.offset)[:, 0])
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
