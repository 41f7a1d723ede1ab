"""Chains of straight links: where the links are and how fast they move, given shape, rates and one
velocity.

Frame: the body frame of the paper, tail link along +x. Link tangent angles are ``phi_i = sum of the
first i joint angles`` (the paper's Theta); joint angles are its Delta-theta, positive
counter-clockwise, counted from the tail. The rigid velocity ``z = (u, v, omega)`` is that of a
*reference*: the tail point, or the midpoint of a link. The second choice keeps the relative
precision of a link at rest, which the first loses by cancellation.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from colloc.mechanics.feet import Foot, checked_feet, read_alike_from_both_ends, whole_links
from colloc.mechanics.floor_contact import FloorContact
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import STATED_IF_SET, is_number
from colloc.system.errors import ProblemError

_SHORTEST = 1e-6
"""Of a link, over the body: shorter ones move nothing, and drown in rounding."""
TAIL = None
"""The reference of `Links.posture`: the free end of link 0; an integer means the midpoint of that
link."""
_WHOLES = {"weights": "the body's weight", "masses": "the body's mass"}
"""What adds up to 1."""


class Posture(NamedTuple):
    """Links in the body frame, each ``(n_link, n_time)``: direction cosines, and midpoints seen
    from the reference."""

    cos: Array
    sin: Array
    x: Array
    y: Array


class LinkVelocity(NamedTuple):
    """Velocity of each link, ``(n_link, n_time)``: tangential and normal at its midpoint, and
    rotation rate."""

    vs: Array
    vn: Array
    w: Array


@dataclass(frozen=True)
class Links:
    """Straight links joined end to end: their geometry. `colloc.mechanics.chain.Chain` is the
    body."""

    lengths: tuple[float, ...] = (1 / 3, 1 / 3, 1 / 3)
    """Link lengths from tail to head; they add up to the body length, 1."""
    width: float = field(default=0.0, metadata=STATED_IF_SET)
    """Of every link [body lengths], see `colloc.mechanics.contact`; by default links are lines."""
    weights: tuple[float, ...] = field(default=(), metadata=STATED_IF_SET)
    """By which the links press on the floor, in parts of the body's; by default they press evenly
    everywhere."""
    feet: tuple[Foot, ...] | int = field(default=(), metadata=STATED_IF_SET)
    """What it stands on, from tail to head; by default the links lie on the floor along their
    length."""
    masses: tuple[float, ...] = field(default=(), metadata=STATED_IF_SET)
    """Of the links, in parts of the body's; by default they are as heavy as they press."""
    inertias: tuple[float, ...] = field(default=(), metadata=STATED_IF_SET)
    """Of the links about their midpoints [body mass x length^2]; by default those of uniform
    rods."""

    def __post_init__(self) -> None:
        lengths, width = _numbers("lengths", self.lengths), self.width
        if len(lengths) < 2:
            raise ProblemError("body.lengths needs at least two links.")
        _check_parts("lengths", lengths, "the body length")
        if min(lengths) < _SHORTEST:
            raise ProblemError(
                f"body.lengths has a link of {min(lengths):g}: no link may be shorter than "
                f"{_SHORTEST:g} of the body."
            )
        if not (is_number(width) and 0 <= width < min(lengths)):
            raise ProblemError(
                f"body.width must be a number from 0 to below the shortest link, not {width!r}."
            )
        parts = {
            name: _numbers(name, getattr(self, name)) for name in ("weights", "masses", "inertias")
        }
        for name, values in parts.items():
            if values and len(values) != len(lengths):
                raise ProblemError(
                    f"body.{name} has {len(values)} values; give one for each of the "
                    f"{len(lengths)} links."
                )
            if values and name in _WHOLES:
                _check_parts(name, values, _WHOLES[name])
        if not all(0 <= inertia < np.inf for inertia in parts["inertias"]):
            raise ProblemError(
                f"body.inertias must be finite and not negative, not {parts['inertias']}."
            )
        for name, value in {"lengths": lengths, "width": float(width), **parts}.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "feet", checked_feet(self.feet, self.weight_column()[:, 0]))

    @property
    def standing_on(self) -> tuple[Foot, ...]:
        """The feet, one by one."""
        return () if isinstance(self.feet, int) else self.feet

    @cached_property
    def contact(self) -> FloorContact:
        """What touches the floor."""
        lengths = np.array(self.lengths)
        if feet := self.standing_on:
            return FloorContact(lengths, feet)
        return FloorContact(lengths, whole_links(self.weight_column()[:, 0]), "link")

    def law(self, friction: Law) -> Law:
        """The law of friction of what touches the floor, where the problem states `friction`."""
        return self.contact.law(friction)

    @property
    def in_series(self) -> bool:
        """Every link hangs on the one before it, as the compiled kernel takes for granted; a tree
        of links says no."""
        return True

    @property
    def n_link(self) -> int:
        return len(self.lengths)

    @property
    def n_joint(self) -> int:
        return len(self.lengths) - 1

    @property
    def symmetric(self) -> bool:
        """Lengths, weights, masses and feet read the same from both ends."""
        parts = self.lengths, self.weights, self.masses, self.inertias
        alike = all(np.allclose(own, own[::-1], rtol=0, atol=1e-14) for own in parts)
        return alike and read_alike_from_both_ends(self.standing_on, self.n_link)

    def length_column(self) -> np.ndarray:
        """Lengths as an ``(n_link, 1)`` column."""
        return np.array(self.lengths)[:, None]

    def pressure_column(self) -> np.ndarray:
        """Weight per length of the links, over that of a body which is as heavy everywhere,
        ``(n_link, 1)``."""
        return (
            np.array(self.weights)[:, None] / self.length_column()
            if self.weights
            else np.ones((self.n_link, 1))
        )

    def weight_column(self) -> np.ndarray:
        """Weights by which the links press, as an ``(n_link, 1)`` column."""
        return np.array(self.weights or self.lengths)[:, None]

    def mass_column(self) -> np.ndarray:
        """Masses as an ``(n_link, 1)`` column."""
        return np.array(self.masses)[:, None] if self.masses else self.weight_column()

    def inertia_column(self) -> np.ndarray:
        """Moments of inertia of the links about their midpoints, as an ``(n_link, 1)`` column."""
        return (
            np.array(self.inertias)[:, None]
            if self.inertias
            else self.mass_column() * self.length_column() ** 2 / 12
        )

    def _joint_sum(self, reference: int | None) -> np.ndarray:
        """``(n_link, n_joint)``: joint quantities to link angles, relative to the reference link
        (the tail link: 0)."""
        full = np.tril(np.ones((self.n_link, self.n_joint)), -1)
        return full if reference is TAIL else full - full[reference]

    def _path(self, reference: int | None) -> np.ndarray:
        """``(n_link, n_link)``: link vectors to midpoints, relative to the reference point."""
        full = np.tril(np.ones((self.n_link, self.n_link)), -1) + 0.5 * np.eye(self.n_link)
        return full if reference is TAIL else full - full[reference]

    def weighted_path(self, reference: int | None) -> np.ndarray:
        """``(n_link, n_link)``: directions of links to midpoints, relative to the reference
        point."""
        return self._path(reference) * self.lengths

    def tangent_angles(self, angles: Array) -> Array:
        """Link tangent angles in the body frame, ``(n_link, n_time)``, from joint angles
        ``(n_joint, n_time)``."""
        return namespace(angles).matmul(self._joint_sum(TAIL), angles)

    def posture(self, angles: Array, reference: int | None = TAIL) -> Posture:
        """Directions and midpoints of the links in the body frame, from joint angles ``(n_joint,
        n_time)``."""
        xp = namespace(angles)
        phi = self.tangent_angles(angles)
        cos, sin = xp.cos(phi), xp.sin(phi)
        path = self.weighted_path(reference)
        return Posture(cos, sin, xp.matmul(path, cos), xp.matmul(path, sin))

    def velocity(
        self, posture: Posture, rates: Array, z: Array, reference: int | None = TAIL
    ) -> LinkVelocity:
        """Link velocities (paper, eq. dtz0) for joint rates ``(n_joint, n_time)`` and rigid
        velocity z ``(3, n_time)``."""
        xp = namespace(rates, z, posture.cos)
        path = self.weighted_path(reference)
        w = xp.matmul(self._joint_sum(reference), rates) + z[2:3, :]
        vx = z[0:1, :] - xp.matmul(path, w * posture.sin)
        vy = z[1:2, :] + xp.matmul(path, w * posture.cos)
        return LinkVelocity(
            vx * posture.cos + vy * posture.sin, vy * posture.cos - vx * posture.sin, w
        )

    def tail_velocity(
        self, posture: Posture, rates: np.ndarray, z: np.ndarray, reference: int | None
    ) -> np.ndarray:
        """Velocity of the tail, ``(3, n_time)``, when `z` is that of `reference` (whose posture is
        given)."""
        if reference is TAIL:
            return z
        link = self.velocity(posture, rates, z, reference)
        half = 0.5 * self.lengths[0]
        # the tail link has direction (1, 0) in the body frame
        return np.stack([link.vs[0], link.vn[0] - half * link.w[0], link.w[0]])

    def centre_of_mass(self, posture: Posture) -> tuple[Array, Array]:
        """Centre of mass relative to the reference, two ``(1, n_time)`` rows."""
        xp = namespace(posture.x)
        mass = self.mass_column()
        return xp.sum_rows(mass * posture.x), xp.sum_rows(mass * posture.y)

    def centre_velocity(self, posture: Posture, link: LinkVelocity) -> tuple[Array, Array]:
        """Velocity of the centre of mass in body-frame axes, two ``(1, n_time)`` rows."""
        xp = namespace(link.vs)
        mass = self.mass_column()
        return (
            xp.sum_rows(mass * (link.vs * posture.cos - link.vn * posture.sin)),
            xp.sum_rows(mass * (link.vs * posture.sin + link.vn * posture.cos)),
        )

    def joints(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Link end points in the body frame, x and y, each ``(n_link + 1, n_time)``, tail first."""
        phi = self.tangent_angles(angles)
        length = self.length_column()
        start = np.zeros((1, phi.shape[1]))
        return (
            np.concatenate([start, np.cumsum(length * np.cos(phi), axis=0)]),
            np.concatenate([start, np.cumsum(length * np.sin(phi), axis=0)]),
        )


def _numbers(name: str, values: Iterable) -> tuple[float, ...]:
    try:
        return tuple(float(value) for value in values)
    except (TypeError, ValueError):
        raise ProblemError(f"body.{name} must be a sequence of numbers, not {values!r}.") from None


def _check_parts(name: str, parts: tuple[float, ...], whole: str) -> None:
    if not all(np.isfinite(parts)) or min(parts) <= 0:
        raise ProblemError(f"body.{name} must be positive and finite, not {parts}.")
    if abs(sum(parts) - 1.0) > 1e-12:
        raise ProblemError(f"body.{name} must add up to {whole} 1, not {sum(parts):.12g}.")
