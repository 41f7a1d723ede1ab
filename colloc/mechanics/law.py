"""What a law of friction has to answer for: the force on a point, and on a straight link, at a velocity; and its traits.

`colloc.mechanics.friction.Friction` is Coulomb's law, the usual one; the package `colloc.laws` has others (docs/howto/laws.md).
Everything else, from the balance to the report, asks only these questions. Velocities are those along and across the body at a
point; of a link (vs, vn, w), its midpoint's and its rotation rate. All arrays are two-dimensional, ``(n_part, n_time)``, NumPy
or CasADi; forces are per length.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from colloc.mechanics.link_friction import LinkForce
from colloc.numerics.arrays import Array

Matrix = tuple[tuple[Any, ...], ...]
"""2 x 2 of a point or 3 x 3 of a link, of arrays."""


@runtime_checkable
class Law(Protocol):
    """Friction per length as a function of the velocity of sliding."""

    def __hash__(self) -> int: ...

    @property
    def degree(self) -> float | None:
        """Of homogeneity: t times the velocity (and delta) makes t^degree times the force. 0 for dry friction, 1 for viscous
        drag, None for a law that has none."""

    @property
    def reversible(self) -> bool:
        """Reversing the velocity reverses the force: body and gait may be read backwards."""

    @property
    def associated(self) -> bool:
        """Minus the force is the gradient of a convex function of the velocity: a balance has exactly one solution."""

    @property
    def regularised(self) -> bool:
        """It depends on delta, the speed below which it is smoothed."""

    @property
    def smallest(self) -> float:
        """Smallest dissipation at unit speed, over all directions: an upper bound of distance per work is its inverse."""

    @property
    def largest(self) -> float:
        """Largest force at unit speed."""

    @property
    def label(self) -> str:
        """The law with its numbers, short."""

    def describe(self) -> str:
        """The same in words, for reports."""

    def in_units_of(self, unit: float) -> Law:
        """The law whose forces are `unit` times smaller."""

    def in_speeds_of(self, unit: float) -> Law:
        """The law as a function of velocities (and delta) in units of `unit`."""

    # at a point
    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        """Tangential and normal force per length."""

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        """Minus its derivative with respect to (vs, vn)."""

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        """A matrix that turns a velocity into minus the force, or a larger one: the safeguard of Newton's method steps with
        it, as the paper's fixed point (eq. deltatilde)."""

    def density_potential(self, vs: Array, vn: Array, delta: Array) -> Array:
        """The function whose gradient is minus the force; of associated laws only."""

    # on a link
    def link_force(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> LinkForce:
        """Force and couple on links of given lengths ``(n_link, 1)``."""

    def link_jacobian(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        """Minus its derivative with respect to (vs, vn, w)."""

    def link_secant(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        """`density_secant`, integrated."""

    def link_potential(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Array:
        """`density_potential`, integrated; of associated laws only."""

    def scaled_laws(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array, force: LinkForce) -> list[Array]:
        """What vanishes where given forces on links obey the law, three arrays scaled like velocities: constraints of a full
        program, so they must be mild where the force is nearly a step."""

    def largest_link_forces(self, length: np.ndarray) -> np.ndarray:
        """Bounds on force, normal force and couple of links ``(n_link, 1)`` at any speed, ``(3 n_link, 1)``; or infinity."""

    @property
    def kernel_numbers(self) -> tuple[float, ...]:
        """The law as the compiled kernel takes it; empty where it does not know the law."""

    @property
    def kernel_source(self) -> str:
        """C that the kernel is compiled with (own_law.h); empty where it has the law in closed form."""


class KernelLaw(NamedTuple):
    """The law of what touches the floor as the compiled kernel takes it."""

    numbers: tuple[float, ...]
    """Empty where it does not know the law."""
    defines: tuple[str, ...] = ()
    """What the kernel is compiled with; nothing for the usual one."""
    own_law: str = ""
    """C of the law (own_law.h)."""


def rate_independent(law: Law) -> bool:
    """The force does not depend on the speed: distance and work belong to the path, and its pacing is a gauge."""
    return law.degree == 0
