"""Laws of friction in closed form other than Coulomb's: elliptic, viscous, a power of the speed.

Elliptic: dry friction with unequal coefficients and one balance. Its dissipation ``D = sqrt((mu_s
vs)^2 + (mu_t vn)^2)``, with mu_s = mu_f or mu_b as vs > 0 or < 0, is convex, and the force minus
its gradient (Goyal, Ruina and Papadopoulos, Wear 143, 1991). With the tangential velocity stretched
by mu_s/mu_t the closed forms of equal coefficients hold on links.

Power: ``-(mu_s vs, mu_t vn) r^(power - 1)`` with ``r = sqrt(vs^2 + vn^2 + delta^2)``, between dry
friction and viscous drag: wet granular beds, yield-stress fluids.

Viscous: resistive-force theory of a slender body, ``-(tangential vs, normal vn)``. The balance is
linear; distance and rotation belong to the path of a gait at any pace.
"""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Self

from colloc.mechanics.friction import (
    Coefficients,
    Friction,
    LineIntegrals,
    LinkForce,
    line_integrals,
    power,
    regularised_speed,
)
from colloc.mechanics.law import Matrix
from colloc.numerics.arrays import Array
from colloc.system.arguments import check_positive, check_range, named_arguments


@named_arguments
@dataclass(frozen=True)
class Elliptic(Friction):
    """Associated friction with an elliptic dissipation; a law of friction.

    Parameters
    ----------
    mu_t, mu_f, mu_b : float
        Friction on sliding across the body, forwards and backwards, in units of the weight; all
        positive.

    Examples
    --------
    >>> from colloc import Elliptic
    >>> Elliptic(mu_t=1.7, mu_f=1.0, mu_b=1.3).associated
    True
    """

    associated = True

    @property
    def label(self) -> str:
        return f"elliptic {super().label}"

    def describe(self) -> str:
        return f"{super().describe()}, elliptic"

    def stretch(self, vs: Array) -> Array:
        return self.mu_s(vs) / self.mu_t


class _Power(Coefficients):
    power: float
    kernel_numbers = ()

    @property
    def degree(self) -> float:
        return float(self.power)

    @property
    def regularised(self) -> bool:
        return self.power != 1

    def in_speeds_of(self, unit: float) -> Self:
        return self.in_units_of(unit**-self.power)

    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        growth = regularised_speed(vs, vn, delta) ** (self.power - 1.0)
        return -self.mu_s(vs) * vs * growth, -self.mu_t * vn * growth

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        mu_s, mu_t, p = self.mu_s(vs), self.mu_t, self.power - 1.0
        r = regularised_speed(vs, vn, delta)
        es, en, growth = vs / r, vn / r, r**p
        cross = p * es * en * growth
        return (
            (mu_s * growth * (1.0 + p * es * es), mu_s * cross),
            (mu_t * cross, mu_t * growth * (1.0 + p * en * en)),
        )

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        # above degree 1 the force outgrows it
        growth = max(1.0, self.power) * regularised_speed(vs, vn, delta) ** (self.power - 1.0)
        zero = 0.0 * growth
        return (self.mu_s(vs) * growth, zero), (zero, self.mu_t * growth)


@named_arguments
@dataclass(frozen=True)
class PowerLaw(_Power):
    """Friction that grows like a power of the speed; a law of friction.

    Parameters
    ----------
    power : float
        From 0 (dry) to 2; 1 is viscous.
    mu_t, mu_f, mu_b : float
        Force per length at unit speed across the body, forwards and backwards; all positive.

    Examples
    --------
    >>> from colloc import PowerLaw
    >>> PowerLaw(power=0.5, mu_t=2.0).degree
    0.5
    """

    power: float = 0.5
    mu_t: float = 1.0
    mu_f: float = 1.0
    mu_b: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self, *self.by_name, of="friction.")
        check_range(0.0, 2.0, **{"friction.power": self.power})

    @property
    def label(self) -> str:
        return f"friction ({self.mu_t:g}, {self.mu_f:g}, {self.mu_b:g}) x speed^{self.power:g}"

    def describe(self) -> str:
        each = f"{self.mu_t:g} sideways, {self.mu_f:g} forwards, {self.mu_b:g} backwards"
        return f"{each}, times the speed to the power {self.power:g}"

    def density_potential(self, vs: Array, vn: Array, delta: Array) -> Array:
        power = self.power + 1.0
        return self.mu_t / power * regularised_speed(vs, vn, delta) ** power


@named_arguments
@dataclass(frozen=True)
class Viscous(_Power):
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
    power, associated = 1.0, True
    mu_t = property(attrgetter("normal"))
    mu_f = mu_b = property(attrgetter("tangential"))

    def __post_init__(self) -> None:
        check_positive(self, *self.by_name, of="friction.")

    @property
    def label(self) -> str:
        return f"drag ({self.normal:g}, {self.tangential:g})"

    def describe(self) -> str:
        return f"viscous drag, {self.normal:g} across and {self.tangential:g} along the body"

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
