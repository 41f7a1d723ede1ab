"""Viscous drag: resistive-force theory of a slender body in a fluid so viscous that inertia does not count.

Force per length is linear in the velocity, ``f = -(tangential vs, normal vn)``. The balance is linear, and distance and
rotation belong to the path of a gait whatever its pace; work does not: it is smallest at constant power. Purcell's swimmer is a
chain of three links under this law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from colloc.mechanics.law import Matrix
from colloc.mechanics.link_friction import LinkForce
from colloc.numerics.arrays import Array
from colloc.system.arguments import check_positive, named_arguments


@named_arguments
@dataclass(frozen=True)
class Viscous:
    """Drag per length and speed of a slender body; a `colloc.mechanics.law.Law`.

    Parameters
    ----------
    normal, tangential : float
        Drag coefficients across and along the body; for a thin filament the first is nearly twice the second (J. Gray and
        G. J. Hancock, J. Exp. Biol. 32, 1955). Only their ratio matters for the motion.

    Examples
    --------
    >>> from colloc import Chain, Viscous
    >>> Viscous(normal=2.0, tangential=1.0).associated
    True
    """

    normal: float = 2.0
    tangential: float = 1.0

    degree = 1.0
    reversible = associated = True
    regularised = False
    kernel_numbers: ClassVar[tuple[float, ...]] = ()
    kernel_source = ""

    def __post_init__(self) -> None:
        check_positive(self, "normal", "tangential", of="friction.")

    @property
    def smallest(self) -> float:
        return min(self.normal, self.tangential)

    @property
    def largest(self) -> float:
        return max(self.normal, self.tangential)

    @property
    def label(self) -> str:
        return f"drag ({self.normal:g}, {self.tangential:g})"

    def describe(self) -> str:
        return f"viscous drag, {self.normal:g} across and {self.tangential:g} along the body"

    def in_units_of(self, unit: float) -> Viscous:
        return Viscous(self.normal / unit, self.tangential / unit)

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

    def link_force(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> LinkForce:
        return LinkForce(-self.tangential * length * vs, -self.normal * length * vn, -self.normal * length**3 / 12 * w)

    def link_jacobian(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        zero = 0.0 * vs
        return (
            (self.tangential * length + zero, zero, zero),
            (zero, self.normal * length + zero, zero),
            (zero, zero, self.normal * length**3 / 12 + zero),
        )

    link_secant = link_jacobian

    def link_potential(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Array:
        return 0.5 * length * (self.tangential * vs * vs + self.normal * (vn * vn + length**2 / 12 * w * w))

    def scaled_laws(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array, force: LinkForce) -> list[Array]:
        own = self.link_force(vs, vn, w, length, delta)
        return [
            (force.tangential - own.tangential) / length,
            (force.normal - own.normal) / length,
            (force.couple - own.couple) * (6 / length**2),
        ]

    def largest_link_forces(self, length: np.ndarray) -> np.ndarray:
        return np.full((3 * length.size, 1), np.inf)
