"""Regularised Coulomb friction per length, ``-(mu_s vs, mu_t vn)/r`` with ``r = sqrt(vs^2 + vn^2 +
delta^2)`` (paper, eqs. frictiondelta and delta)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.mechanics import link_friction
from colloc.mechanics.law import Matrix
from colloc.mechanics.line_integrals import LineIntegrals, line_integrals
from colloc.mechanics.link_friction import LinkForce
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import check_positive, named_arguments
from colloc.system.errors import ProblemError

_LARGEST = 1e9
"""Largest coefficient, far below overflow."""


class Coefficients:
    """Coefficients of sliding across the body, forwards and backwards."""

    mu_t: float
    mu_f: float
    mu_b: float
    by_name = ("mu_t", "mu_f", "mu_b")

    @property
    def smallest(self) -> float:
        return min(self.mu_t, self.mu_f, self.mu_b)

    @property
    def largest(self) -> float:
        return max(self.mu_t, self.mu_f, self.mu_b)

    @property
    def isotropic(self) -> bool:
        """Whether all coefficients are equal."""
        return self.mu_t == self.mu_f == self.mu_b

    @property
    def associated(self) -> bool:
        return self.isotropic

    @property
    def reversible(self) -> bool:
        return self.mu_b == self.mu_f

    def tangential(self, vs: Array) -> Array:
        """Coefficient mu_s of sliding along the body with velocity `vs`."""
        if self.reversible:
            return self.mu_f
        return namespace(vs).where(vs > 0, self.mu_f, self.mu_b)


@named_arguments
@dataclass(frozen=True)
class Friction(Coefficients):
    """Coulomb friction; a law of friction.

    Parameters
    ----------
    mu_t, mu_f, mu_b : float
        Transverse, forward (towards the head) and backward coefficient, in units of the weight;
        all positive (paper, eq. friction).

    Examples
    --------
    >>> from colloc import Friction
    >>> Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3).isotropic
    False
    """

    mu_t: float = 1.0
    mu_f: float = 1.0
    mu_b: float = 1.0

    degree = 0.0
    regularised = True

    def __post_init__(self) -> None:
        check_positive(self, "mu_t", "mu_f", "mu_b", of="friction.")
        if max(self.mu_t, self.mu_f, self.mu_b) > _LARGEST:
            raise ProblemError(
                f"friction holds more than {_LARGEST:g} times what presses: no floor does."
            )

    @property
    def kernel_numbers(self) -> tuple[float, ...]:
        """Coefficients, stretches forwards and backwards, and whether there is a potential."""
        stretches = [float(self.stretch(np.array(side))) for side in (1.0, -1.0)]
        return self.mu_t, self.mu_f, self.mu_b, *stretches, float(self.associated)

    @property
    def label(self) -> str:
        """A short name with its numbers."""
        return f"friction ({self.mu_t:g}, {self.mu_f:g}, {self.mu_b:g})"

    def describe(self) -> str:
        return (
            f"μt = {self.mu_t:g} sideways, μf = {self.mu_f:g} forwards, μb = {self.mu_b:g} "
            f"backwards"
        )

    def in_units_of(self, unit: float) -> Friction:
        return type(self)(mu_t=self.mu_t / unit, mu_f=self.mu_f / unit, mu_b=self.mu_b / unit)

    def in_speeds_of(self, unit: float) -> Friction:
        return self

    def stretch(self, vs: Array) -> Array:
        """Factor of `vs` in the speed r."""
        return 1.0

    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        mu_s, vs = self.tangential(vs), self.stretch(vs) * vs
        r = regularised_speed(vs, vn, delta)
        return -mu_s * vs / r, -self.mu_t * vn / r

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        mu_s, stretch = self.tangential(vs), self.stretch(vs)
        r = regularised_speed(stretch * vs, vn, delta)
        zero = 0.0 * r
        return (stretch * mu_s / r, zero), (zero, self.mu_t / r)

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        mu_s, mu_t, stretch = self.tangential(vs), self.mu_t, self.stretch(vs)
        vs = stretch * vs
        r = regularised_speed(vs, vn, delta)
        es, en, ed = vs / r, vn / r, delta / r
        # 1 - es^2 = en^2 + ed^2 without cancellation
        return (
            (stretch * mu_s * (en * en + ed * ed) / r, -mu_s * es * en / r),
            (-stretch * mu_t * es * en / r, mu_t * (es * es + ed * ed) / r),
        )

    def density_potential(self, vs: Array, vn: Array, delta: Array) -> Array:
        return self.mu_t * regularised_speed(self.stretch(vs) * vs, vn, delta)


@line_integrals.register(Friction)
class ClosedForm(LineIntegrals):
    """Coulomb friction on links, also with the tangential velocity stretched."""

    def force(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> LinkForce:
        return link_friction.link_force(vs, vn, w, length, delta, self.law)

    def jacobian(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        return link_friction.link_force_jacobian(vs, vn, w, length, delta, self.law)

    def secant(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        return link_friction.link_secant(vs, vn, w, length, delta, self.law)

    def potential(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Array:
        stretched = self.law.stretch(vs) * vs
        return self.law.mu_t * link_friction.link_dissipation(stretched, vn, w, length, delta)

    def scaled_laws(
        self, vs: Array, vn: Array, w: Array, length: Array, delta: Array, force: LinkForce
    ) -> list[Array]:
        mu_s, mu_t = self.law.tangential(vs), self.law.mu_t
        vs = self.law.stretch(vs) * vs
        I0, I1, I2 = link_friction.link_moments(vs, vn, w, length, delta)
        return [
            force.tangential / I0 + mu_s * vs,
            force.normal / I0 + mu_t * (vn + w * I1 / I0),
            (force.couple / I0 + mu_t * (vn * I1 / I0 + w * I2 / I0)) * (6 / length),
        ]

    def largest_forces(self, length: np.ndarray) -> np.ndarray:
        mu_s, mu_t = max(self.law.mu_f, self.law.mu_b), self.law.mu_t
        return np.stack([mu_s * length, mu_t * length, mu_t * length**2 / 4])


def regularised_speed(vs: Array, vn: Array, delta: Array) -> Array:
    return namespace(vs, vn, delta).sqrt(vs * vs + vn * vn + delta * delta)
