"""Geometry and kinematics of chains of straight links.

Frame: the body frame of the paper, tail link along +x. Link tangent angles are ``phi_i = sum of the
first i joint angles`` (the paper's Theta); joint angles are its Delta-theta, positive
counter-clockwise, counted from the tail. The rigid velocity ``z = (u, v, omega)`` is that of a
*reference*: the tail point, or the midpoint of a link, which keeps the relative precision of a link
at rest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from colloc.mechanics.floor_contact import (
    FloorContact,
    Foot,
    checked_feet,
    symmetric_feet,
    whole_links,
)
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import STATED_IF_SET, is_number
from colloc.system.errors import ProblemError

_SHORTEST = 1e-6
"""Shortest link over the body: shorter ones drown in rounding."""
TAIL = None
"""The reference at the free end of link 0; an integer means a link's midpoint."""


class Posture(NamedTuple):
    """Direction cosines of the links, and their midpoints seen from the reference, ``(n_link,
    n_time)`` each."""

    cos: Array
    sin: Array
    x: Array
    y: Array


class LinkVelocity(NamedTuple):
    """Tangential and normal velocity of the links' midpoints, and rotation rates, ``(n_link,
    n_time)`` each."""

    vs: Array
    vn: Array
    w: Array


@dataclass(frozen=True)
class Links:
    """Straight links joined end to end; fields as of `colloc.mechanics.chain.Chain`, the body."""

    lengths: tuple[float, ...] = (1 / 3, 1 / 3, 1 / 3)
    width: float = field(default=0.0, metadata=STATED_IF_SET)
    weights: tuple[float, ...] = field(default=(), metadata=STATED_IF_SET)
    feet: tuple[Foot, ...] | int = field(default=(), metadata=STATED_IF_SET)
    masses: tuple[float, ...] = field(default=(), metadata=STATED_IF_SET)
    inertias: tuple[float, ...] = field(default=(), metadata=STATED_IF_SET)

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
        wholes = {"weights": "the body's weight", "masses": "the body's mass", "inertias": None}
        parts = {name: _numbers(name, getattr(self, name)) for name in wholes}
        for name, whole in wholes.items():
            values = parts[name]
            if values and len(values) != len(lengths):
                raise ProblemError(
                    f"body.{name} has {len(values)} values; give one for each of the "
                    f"{len(lengths)} links."
                )
            if values and whole:
                _check_parts(name, values, whole)
        if not all(0 <= inertia < np.inf for inertia in parts["inertias"]):
            raise ProblemError(
                f"body.inertias must be finite and not negative, not {parts['inertias']}."
            )
        for name, value in {"lengths": lengths, "width": float(width), **parts}.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "feet", checked_feet(self.feet, self.weight_column()[:, 0]))

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
        """The law of all contacts, for the problem's `friction`."""
        return self.contact.law(friction)

    @property
    def in_series(self) -> bool:
        """Whether every link hangs on the one before it, as the compiled kernel assumes."""
        return True

    @property
    def n_link(self) -> int:
        return len(self.lengths)

    @property
    def n_joint(self) -> int:
        return len(self.lengths) - 1

    @property
    def symmetric(self) -> bool:
        """Whether lengths, weights, masses and feet are the same from both ends."""
        parts = self.lengths, self.weights, self.masses, self.inertias
        same = all(np.allclose(row, row[::-1], rtol=0, atol=1e-14) for row in parts)
        return same and symmetric_feet(self.standing_on, self.n_link)

    def length_column(self) -> np.ndarray:
        return np.array(self.lengths)[:, None]

    def pressure_column(self) -> np.ndarray:
        """Weight per length of the links over that of a uniform body, ``(n_link, 1)``."""
        if not self.weights:
            return np.ones((self.n_link, 1))
        return np.array(self.weights)[:, None] / self.length_column()

    def weight_column(self) -> np.ndarray:
        return np.array(self.weights or self.lengths)[:, None]

    def mass_column(self) -> np.ndarray:
        return np.array(self.masses)[:, None] if self.masses else self.weight_column()

    def inertia_column(self) -> np.ndarray:
        """Moments of inertia of the links about their midpoints, ``(n_link, 1)``."""
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
        """Link tangent angles in the body frame, ``(n_link, n_time)``."""
        return namespace(angles).matmul(self._joint_sum(TAIL), angles)

    def posture(self, angles: Array, reference: int | None = TAIL) -> Posture:
        xp = namespace(angles)
        phi = self.tangent_angles(angles)
        cos, sin = xp.cos(phi), xp.sin(phi)
        path = self.weighted_path(reference)
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
        """Centre of mass relative to the reference, two ``(1, n_time)`` rows."""
        xp, mass = namespace(posture.x), self.mass_column()
        return xp.sum_rows(mass * posture.x), xp.sum_rows(mass * posture.y)

    def centre_velocity(self, posture: Posture, link: LinkVelocity) -> tuple[Array, Array]:
        """Velocity of the centre of mass in body-frame axes, two ``(1, n_time)`` rows."""
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
