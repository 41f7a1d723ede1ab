"""The law: delta-regularised Coulomb friction per unit length, at a point that slides with velocity (vs, vn).

With ``r = sqrt(vs^2 + vn^2 + delta^2)`` the force per length is ``-(mu_s vs, mu_t vn)/r`` (paper, eqs. frictiondelta and
delta). Smooth bodies integrate it by quadrature; straight links have it in closed form (`mechanics.link_friction`). All arrays
are two-dimensional, ``(n_node, n_time)``, NumPy or CasADi.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.numerics.arrays import Array, namespace
from colloc.system.argument_names import named_arguments
from colloc.system.errors import ProblemError


@named_arguments
@dataclass(frozen=True)
class Friction:
    """Friction coefficients, in units of the weight.

    Parameters
    ----------
    mu_t, mu_f, mu_b : float
        Transverse, forward (towards the head) and backward coefficient; all positive (paper, eq. friction).

    Examples
    --------
    >>> from colloc import Friction
    >>> Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3).isotropic
    False
    """

    mu_t: float = 1.0
    mu_f: float = 1.0
    mu_b: float = 1.0

    def __post_init__(self) -> None:
        for name in ("mu_t", "mu_f", "mu_b"):
            value = getattr(self, name)
            if not isinstance(value, (int, float, np.floating)) or not np.isfinite(value) or value <= 0:
                raise ProblemError(f"friction.{name} must be a positive finite number, not {value!r}.")

    @property
    def smallest(self) -> float:
        return min(self.mu_t, self.mu_f, self.mu_b)

    @property
    def largest(self) -> float:
        return max(self.mu_t, self.mu_f, self.mu_b)

    @property
    def isotropic(self) -> bool:
        """The law is the gradient of a convex dissipation potential, so the balance has exactly one solution."""
        return self.mu_t == self.mu_f == self.mu_b

    @property
    def reversible(self) -> bool:
        """Reversing the rates reverses the motion (mu_b = mu_f)."""
        return self.mu_b == self.mu_f

    def tangential(self, vs: Array) -> Array:
        """Coefficient mu_s of a link that slides along itself with velocity `vs`; no switch where mu_b = mu_f."""
        if self.reversible:
            return self.mu_f
        return namespace(vs).where(vs > 0, self.mu_f, self.mu_b)


def regularised_speed(vs: Array, vn: Array, delta: Array) -> Array:
    """r; it is also the density of the isotropic dissipation potential, whose gradient is minus the force at mu = 1."""
    return namespace(vs, vn, delta).sqrt(vs * vs + vn * vn + delta * delta)


def force_density(vs: Array, vn: Array, delta: Array, friction: Friction) -> tuple[Array, Array]:
    """Tangential and normal friction force per unit length."""
    r = regularised_speed(vs, vn, delta)
    return -friction.tangential(vs) * vs / r, -friction.mu_t * vn / r


def secant_density(vs: Array, vn: Array, delta: Array, friction: Friction) -> tuple[tuple[Array, Array], ...]:
    """Minus force over velocity with r frozen, as a 2 x 2 tuple: the law of the paper's fixed point (eq. deltatilde)."""
    r = regularised_speed(vs, vn, delta)
    zero = 0.0 * r
    return (friction.tangential(vs) / r, zero), (zero, friction.mu_t / r)


def density_jacobian(vs: Array, vn: Array, delta: Array, friction: Friction) -> tuple[tuple[Array, Array], ...]:
    """Minus the derivative of `force_density` with respect to (vs, vn), as a 2 x 2 tuple; symmetric if isotropic."""
    r = regularised_speed(vs, vn, delta)
    mu_s, mu_t, es, en, ed = friction.tangential(vs), friction.mu_t, vs / r, vn / r, delta / r
    # 1 - es^2 = en^2 + ed^2 without cancellation
    return (
        (mu_s * (en * en + ed * ed) / r, -mu_s * es * en / r),
        (-mu_t * es * en / r, mu_t * (es * es + ed * ed) / r),
    )
