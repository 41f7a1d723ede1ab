"""Delta-regularised Coulomb friction per unit length, at a point that slides with velocity (vs, vn).

With ``r = sqrt(vs^2 + vn^2 + delta^2)`` the force per length is ``-(mu_s vs, mu_t vn)/r`` (paper, eqs. frictiondelta and
delta). Smooth bodies integrate it by quadrature; straight links have it in closed form (`mechanics.friction`). All arrays
are two-dimensional, ``(n_node, n_time)``, NumPy or CasADi.
"""

from __future__ import annotations

from colloc.mechanics.friction import Friction
from colloc.numerics.arrays import Array, namespace


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
