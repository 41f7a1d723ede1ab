"""What a law of friction has to answer for: the force on a point that slides, and its traits.

`colloc.mechanics.friction.Friction` is Coulomb's law, the usual one; the package `colloc.laws` has
others (docs/howto/laws.md). Everything else, from the balance to the report, asks only these
questions; what touches the floor integrates (`colloc.mechanics.floor_contact`). Velocities are
those along and across the body at a point. All arrays are two-dimensional, ``(n_part, n_time)``,
NumPy or CasADi; forces are per length.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from colloc.numerics.arrays import Array

Matrix = tuple[tuple[Any, ...], ...]
"""2 x 2 of a point or 3 x 3 of a link, of arrays."""


@runtime_checkable
class Law(Protocol):
    """Friction per length as a function of the velocity of sliding."""

    def __hash__(self) -> int: ...

    @property
    def degree(self) -> float | None:
        """Of homogeneity: t times the velocity (and delta) makes t^degree times the force. 0 for
        dry friction, 1 for viscous drag, None for a law that has none."""

    @property
    def reversible(self) -> bool:
        """Reversing the velocity reverses the force: body and gait may be read backwards."""

    @property
    def associated(self) -> bool:
        """Minus the force is the gradient of a convex function of the velocity: a balance has
        exactly one solution."""

    @property
    def regularised(self) -> bool:
        """It depends on delta, the speed below which it is smoothed."""

    @property
    def smallest(self) -> float:
        """Smallest dissipation at unit speed, over all directions: an upper bound of distance per
        work is its inverse."""

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

    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        """Tangential and normal force per length."""

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        """Minus its derivative with respect to (vs, vn)."""

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        """A matrix that turns a velocity into minus the force, or a larger one: the safeguard of
        Newton's method steps with it, as the paper's fixed point (eq. deltatilde)."""

    def density_potential(self, vs: Array, vn: Array, delta: Array) -> Array:
        """The function whose gradient is minus the force; of associated laws only."""

    @property
    def kernel_numbers(self) -> tuple[float, ...]:
        """The law as the compiled kernel takes it; empty where that does not have it in closed
        form."""


def rate_independent(law: Law) -> bool:
    """The force does not depend on the speed: distance and work belong to the path, and its pacing
    is a gauge."""
    return law.degree == 0
