"""The law of friction at a point that slides along and across the body with velocity (vs, vn).

Arrays are two-dimensional, ``(n_part, n_time)``, NumPy or CasADi; forces are per length. Integrals
along links follow from it (`colloc.mechanics.friction`).
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from colloc.numerics.arrays import Array

Matrix = tuple[tuple[Any, ...], ...]
"""2 x 2 at a point or 3 x 3 on a link, of arrays."""


@runtime_checkable
class Law(Protocol):
    """Friction per length as a function of the sliding velocity."""

    def __hash__(self) -> int: ...

    @property
    def degree(self) -> float | None:
        """Degree of homogeneity in velocity and delta: 0 dry, 1 viscous; None if there is none."""

    @property
    def reversible(self) -> bool:
        """True if reversing the velocity reverses the force."""

    @property
    def associated(self) -> bool:
        """True if minus the force is the gradient of a convex function: then a balance has exactly
        one solution."""

    @property
    def regularised(self) -> bool:
        """True if it depends on delta, the speed below which it is smoothed."""

    @property
    def smallest(self) -> float:
        """Smallest dissipation at unit speed over all directions; its inverse bounds d/W."""

    @property
    def largest(self) -> float:
        """Largest force at unit speed."""

    @property
    def label(self) -> str:
        """A short name with its numbers."""

    def describe(self) -> str: ...

    def in_units_of(self, unit: float) -> Law:
        """The law with forces divided by `unit`."""

    def in_speeds_of(self, unit: float) -> Law:
        """The law of velocities (and delta) in units of `unit`."""

    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        """Tangential and normal force per length."""

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        """Minus its derivative with respect to (vs, vn)."""

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        """A matrix that turns a velocity into minus the force, or a larger one (paper, eq.
        deltatilde): the safeguard of Newton's method."""

    def density_potential(self, vs: Array, vn: Array, delta: Array) -> Array:
        """Dissipation potential, whose gradient is minus the force; of associated laws only."""

    @property
    def kernel_numbers(self) -> tuple[float, ...]:
        """Parameters for the compiled kernel; empty if it does not have the law."""


def rate_independent(law: Law) -> bool:
    """True if distance and work of a path do not depend on its pace."""
    return law.degree == 0
