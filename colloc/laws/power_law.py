"""A power law between dry friction and viscous drag: the force grows like a power of the speed.

With ``r = sqrt(vs^2 + vn^2 + delta^2)`` the force per length is ``-(mu_s vs, mu_t vn) r^(power -
1)``, with mu_s = mu_f or mu_b as vs > 0 or < 0: Coulomb friction at power 0, drag at power 1. Wet
granular beds and yield-stress fluids lie between.
"""

from __future__ import annotations

from dataclasses import dataclass

from colloc.laws.formula_law import FormulaLaw
from colloc.mechanics.friction import Coefficients, regularised_speed
from colloc.mechanics.law import Matrix
from colloc.numerics.arrays import Array
from colloc.system.arguments import check_positive, is_number, named_arguments
from colloc.system.errors import ProblemError


@named_arguments
@dataclass(frozen=True)
class PowerLaw(Coefficients, FormulaLaw):
    """Friction that grows like a power of the speed; a `colloc.mechanics.law.Law`.

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
        check_positive(self, "mu_t", "mu_f", "mu_b", of="friction.")
        if not (is_number(self.power) and 0 <= self.power <= 2):
            raise ProblemError(
                f"friction.power must lie in [0, 2], not {self.power!r}; friction that falls with "
                f"speed sticks."
            )

    @property
    def degree(self) -> float:
        return float(self.power)

    @property
    def regularised(self) -> bool:
        return self.power != 1

    @property
    def unit(self) -> float:
        """Of the compiled kernel, which is one for all laws whose coefficients have the same
        ratios."""
        return 1.0 / self.mu_t

    @property
    def formulas(self) -> tuple[str, ...]:
        forward, backward = (f"{mu / self.mu_t:.14g}" for mu in (self.mu_f, self.mu_b))
        growth = f"speed ** {self.power - 1.0!r}"
        along = forward if self.reversible else f"where(vs > 0, {forward}, {backward})"
        potential = (
            (f"speed ** {self.power + 1.0!r} / {self.power + 1.0!r}",) if self.associated else ()
        )
        return f"-{along} * vs * {growth}", f"-vn * {growth}", *potential

    @property
    def label(self) -> str:
        return f"friction ({self.mu_t:g}, {self.mu_f:g}, {self.mu_b:g}) x speed^{self.power:g}"

    def describe(self) -> str:
        each = f"{self.mu_t:g} sideways, {self.mu_f:g} forwards, {self.mu_b:g} backwards"
        return f"{each}, times the speed to the power {self.power:g}"

    def in_units_of(self, unit: float) -> PowerLaw:
        return PowerLaw(
            self.power, mu_t=self.mu_t / unit, mu_f=self.mu_f / unit, mu_b=self.mu_b / unit
        )

    def in_speeds_of(self, unit: float) -> PowerLaw:
        return self.in_units_of(unit**-self.power)

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        """The law's own; above degree 1, where the force outgrows it, so many times that."""
        growth = max(1.0, self.power) * regularised_speed(vs, vn, delta) ** (self.power - 1.0)
        zero = 0.0 * growth
        return (self.tangential(vs) * growth, zero), (zero, self.mu_t * growth)
