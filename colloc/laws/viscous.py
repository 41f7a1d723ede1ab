"""Viscous drag: resistive-force theory of a slender body, ``f = -(tangential vs, normal vn)``.

The balance is linear; distance and rotation belong to the path of a gait at any pace, work is
smallest at constant power. Purcell's swimmer is a chain of three links under this law.
"""

from __future__ import annotations

from dataclasses import dataclass

from colloc.mechanics.friction import LineIntegrals, LinkForce, line_integrals, power
from colloc.mechanics.law import Matrix
from colloc.numerics.arrays import Array
from colloc.system.arguments import check_positive, named_arguments


@named_arguments
@dataclass(frozen=True)
class Viscous:
    """Drag per length and speed of a slender body; a law of friction.

    Parameters
    ----------
    normal, tangential : float
        Drag coefficients across and along the body; for a thin filament the first is nearly twice
        the second (J. Gray and G. J. Hancock, J. Exp. Biol. 32, 1955). Only their ratio matters for
        the motion.

    Examples
    --------
    >>> from colloc import Chain, Viscous
    >>> Viscous(normal=2.0, tangential=1.0).associated
    True
    """

    normal: float = 2.0
    tangential: float = 1.0

    by_name = ("normal", "tangential")
    degree = 1.0
    reversible = associated = True
    regularised = False
    kernel_numbers = ()

    def __post_init__(self) -> None:
        check_positive(self, "normal", "tangential", of="friction.")

    @property
    def smallest(self) -> float:
        """Smallest dissipation at unit speed."""
        return min(self.normal, self.tangential)

    @property
    def largest(self) -> float:
        """Largest force at unit speed."""
        return max(self.normal, self.tangential)

    @property
    def label(self) -> str:
        """A short name with its numbers."""
        return f"drag ({self.normal:g}, {self.tangential:g})"

    def describe(self) -> str:
        return f"viscous drag, {self.normal:g} across and {self.tangential:g} along the body"

    def in_units_of(self, unit: float) -> Viscous:
        return Viscous(normal=self.normal / unit, tangential=self.tangential / unit)

    def in_speeds_of(self, unit: float) -> Viscous:
        return self.in_units_of(1.0 / unit)

    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        return -self.tangential * vs, -self.normal * vn

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        zero = 0.0 * vs
        return (self.tangential + zero, zero), (zero, self.normal + zero)

    density_secant = density_jacobian

    def density_potential(self, vs: Array, vn: Array, delta: Array) -> Array:
        return 0.5 * (self.tangential * vs * vs + self.normal * vn * vn)


@line_integrals.register(Viscous)
class ClosedForm(LineIntegrals):
    """Drag on links."""

    def jacobian(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        zero, along, across = 0.0 * vs, self.law.tangential * length, self.law.normal * length
        return (
            (along + zero, zero, zero),
            (zero, across + zero, zero),
            (zero, zero, across * length**2 / 12 + zero),
        )

    secant = jacobian

    def force(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> LinkForce:
        (along, *_), (_, across, _), (*_, turning) = self.jacobian(vs, vn, w, length, delta)
        return LinkForce(-along * vs, -across * vn, -turning * w)

    def potential(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Array:
        return 0.5 * power(vs, vn, w, self.force(vs, vn, w, length, delta))
