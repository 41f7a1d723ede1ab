"""A power law between dry friction and viscous drag: wet granular beds, yield-stress fluids.

With ``r = sqrt(vs^2 + vn^2 + delta^2)`` the force per length is ``-(mu_s vs, mu_t vn) r^(power -
1)``, with mu_s = mu_f or mu_b as vs > 0 or < 0.
"""

from __future__ import annotations

from dataclasses import dataclass

from colloc.mechanics.friction import Coefficients, regularised_speed
from colloc.mechanics.law import Matrix
from colloc.numerics.arrays import Array
from colloc.system.arguments import check_positive, is_number, named_arguments
from colloc.system.errors import ProblemError


@named_arguments
@dataclass(frozen=True)
class PowerLaw(Coefficients):
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

    kernel_numbers = ()

    def __post_init__(self) -> None:
        check_positive(self, "mu_t", "mu_f", "mu_b", of="friction.")
        if not (is_number(self.power) and 0 <= self.power <= 2):
            raise ProblemError(
                f"friction.power must lie in [0, 2], not {self.power!r}; friction that falls with "
                f"speed sticks."
            )

    @property
    def degree(self) -> float:
        """Degree of homogeneity in velocity and delta."""
        return float(self.power)

    @property
    def regularised(self) -> bool:
        """Whether it depends on delta."""
        return self.power != 1

    @property
    def label(self) -> str:
        """A short name with its numbers."""
        return f"friction ({self.mu_t:g}, {self.mu_f:g}, {self.mu_b:g}) x speed^{self.power:g}"

    def describe(self) -> str:
        each = f"{self.mu_t:g} sideways, {self.mu_f:g} forwards, {self.mu_b:g} backwards"
        return f"{each}, times the speed to the power {self.power:g}"

    def in_units_of(self, unit: float) -> PowerLaw:
        scaled = {name: getattr(self, name) / unit for name in self.by_name}
        return PowerLaw(self.power, **scaled)

    def in_speeds_of(self, unit: float) -> PowerLaw:
        return self.in_units_of(unit**-self.power)

    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        growth = regularised_speed(vs, vn, delta) ** (self.power - 1.0)
        return -self.tangential(vs) * vs * growth, -self.mu_t * vn * growth

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        mu_s, mu_t, r = self.tangential(vs), self.mu_t, regularised_speed(vs, vn, delta)
        growth, p = r ** (self.power - 1.0), self.power - 1.0
        es, en = vs / r, vn / r
        cross = p * es * en * growth
        return (
            (mu_s * growth * (1.0 + p * es * es), mu_s * cross),
            (mu_t * cross, mu_t * growth * (1.0 + p * en * en)),
        )

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        # above degree 1 the force outgrows it
        growth = max(1.0, self.power) * regularised_speed(vs, vn, delta) ** (self.power - 1.0)
        zero = 0.0 * growth
        return (self.tangential(vs) * growth, zero), (zero, self.mu_t * growth)

    def density_potential(self, vs: Array, vn: Array, delta: Array) -> Array:
        power = self.power + 1.0
        return self.mu_t / power * regularised_speed(vs, vn, delta) ** power
