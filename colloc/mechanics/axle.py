"""The friction of a wheel on an axle: along it and across it dry, each by itself.

The part across is a law of Coulomb in whose speed the velocity along does not count, and so is the
part along, turned by a right angle: closed forms and the compiled kernel are those of `Friction`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from colloc.mechanics.friction import (
    ClosedForm,
    Friction,
    LineIntegrals,
    LinkForce,
    line_integrals,
    regularised_speed,
)
from colloc.mechanics.law import Matrix
from colloc.numerics.arrays import Array
from colloc.system.arguments import check_positive, named_arguments


class _Across(Friction):
    """Dry friction across alone."""

    associated = True

    def stretch(self, vs: Array) -> Array:
        return 0.0


@named_arguments
@dataclass(frozen=True)
class Axle:
    """Rolling resistance along and dry friction across, one regardless of the other; a law of
    friction.

    A wheel that turns on an axle has both: however fast it rolls, it slips sideways only when
    pushed with `sideways` times its load. Under `Friction` and `Elliptic`, as under a skate or a
    scale that slides, sliding one way uses up what holds the other way. Snake-robot papers write it
    as Coulomb friction with a sign function for each direction (Liljebäck et al., Snake Robots,
    2013). It has a convex potential: one motion is balanced.

    Parameters
    ----------
    rolling, sideways : float
        Friction along the body, either way, and across it, in units of the weight; both positive.

    Examples
    --------
    >>> from colloc import Axle, Chain, Problem
    >>> Problem("snake", body=Chain(feet=1), friction=Axle(rolling=0.02, sideways=1.0)).law.label
    'axle (0.02, 1)'
    """

    rolling: float = 0.02
    sideways: float = 1.0

    by_name = ("rolling", "sideways")
    degree = 0.0
    reversible = associated = regularised = True

    def __post_init__(self) -> None:
        check_positive(self, *self.by_name, of="friction.")

    @property
    def smallest(self) -> float:
        """Smallest dissipation at unit speed."""
        return min(self.rolling, self.sideways)

    @property
    def largest(self) -> float:
        """Largest force at unit speed."""
        return math.hypot(self.rolling, self.sideways)

    @property
    def label(self) -> str:
        """A short name with its numbers."""
        return f"axle ({self.rolling:g}, {self.sideways:g})"

    def describe(self) -> str:
        return f"{self.rolling:g} rolling and {self.sideways:g} sideways, each by itself"

    def in_units_of(self, unit: float) -> Axle:
        return Axle(rolling=self.rolling / unit, sideways=self.sideways / unit)

    def in_speeds_of(self, unit: float) -> Axle:
        return self

    @property
    def kernel_numbers(self) -> tuple[float, ...]:
        """Numbers of the part across, then of the part along."""
        across, along = _Across(mu_t=self.sideways), _Across(mu_t=self.rolling)
        return across.kernel_numbers + along.kernel_numbers

    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        (ss, _), (_, nn) = self.density_secant(vs, vn, delta)
        return -ss * vs, -nn * vn

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        zero = 0.0 * (vs + vn)
        rs, rn = regularised_speed(vs, zero, delta), regularised_speed(zero, vn, delta)
        return (self.rolling / rs, zero), (zero, self.sideways / rn)

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        (ss, zero), (_, nn) = self.density_secant(vs, vn, delta)
        along, across = delta * ss / self.rolling, delta * nn / self.sideways
        return (along * along * ss, zero), (zero, across * across * nn)

    def density_potential(self, vs: Array, vn: Array, delta: Array) -> Array:
        rs, rn = (regularised_speed(v, 0.0 * v, delta) for v in (vs, vn))
        return self.rolling * rs + self.sideways * rn


@line_integrals.register(Axle)
class OnLinks(LineIntegrals):
    """A row of wheels along a link, all of which roll alike."""

    def __init__(self, law: Axle) -> None:
        super().__init__(law)
        mu_t, mu_s = law.sideways, law.rolling
        self._across = ClosedForm(_Across(mu_t=mu_t, mu_f=mu_s, mu_b=mu_s))

    def force(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> LinkForce:
        along = length * self.law.density(vs, vn, delta)[0]
        return self._across.force(vs, vn, w, length, delta)._replace(tangential=along)

    def _with_along(self, name: str, vs: Array, *rest: Array) -> Matrix:
        (_, *none), *across = getattr(self._across, name)(vs, *rest)
        vn, _, length, delta = rest
        (ss, _), _ = getattr(self.law, f"density_{name}")(vs, vn, delta)
        return (length * ss, *none), *across

    def jacobian(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        return self._with_along("jacobian", vs, vn, w, length, delta)

    def secant(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        return self._with_along("secant", vs, vn, w, length, delta)

    def potential(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Array:
        along = length * self.law.rolling * regularised_speed(vs, 0.0 * vs, delta)
        return self._across.potential(vs, vn, w, length, delta) + along

    def largest_forces(self, length: np.ndarray) -> np.ndarray:
        return self._across.largest_forces(length)
