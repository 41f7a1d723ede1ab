r"""Regularised Coulomb friction per length, ``-(mu_s vs, mu_t vn)/r`` with ``r = sqrt(vs^2 + vn^2 +
delta^2)`` (paper, eqs. frictiondelta and delta), and laws of friction integrated along links.

Along a straight link vs is constant and ``y = vn + w sigma``. *Coulomb friction in closed form*
is expressed through

    r0, r1   the end values of r,       S = r0 + r1,      a^2 = vs^2 + delta^2
    q        = (w l / S)^2 in [0, 1)
    P        = a^2 + y0 y1 + r0 r1 = (1 - q) S^2 / 2,     Q = a^2 / P
    g        = atanh(sqrt q)/sqrt q,    h = (g - 1)/q

without cancellation for any ``w``, ``vs``, ``vn`` and ``delta > 0``. *Other laws by quadrature*: a
dry law changes within a of y = 0, so Gauss nodes are equally spaced in tau, ``y = a sinh(tau)``.
With tau = m + h x, x in [-1, 1], on a link of length l

    d sigma = l/2 h/sinh(h) cosh(tau)/cosh(m) dx,
    sigma   = l/2 [sinh(h x) - 2 tanh(m) sinh(h (1+x)/2) sinh(h (1-x)/2)]/sinh(h).

Two panels meet at y = 0, or at the end nearest to it: a law may have a kink there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import singledispatch
from typing import Any, NamedTuple, Self

import numpy as np

from colloc.mechanics.law import Matrix
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import check_positive, named_arguments
from colloc.system.errors import ProblemError

_LARGEST = 1e9
"""Largest coefficient, far below overflow."""
_SERIES_LIMIT = 0.1
_H_SERIES = tuple(1.0 / (2 * j + 3) for j in range(16))
"""h = sum q^j / (2j + 3); 16 terms leave less than 1e-16 below the limit, above it the closed form
loses 10 eps."""
_X, _WEIGHT = np.polynomial.legendre.leggauss(20)
"""Gauss nodes of a panel: 1e-9 of the largest force, unless a law changes faster than within a."""
_SMALL = 1e-8
"""h^2 below which three terms of the series are exact."""


class Coefficients:
    mu_t: float
    mu_f: float
    mu_b: float
    by_name: tuple[str, ...] = ("mu_t", "mu_f", "mu_b")

    @property
    def smallest(self) -> float:
        return min(self.mu_t, self.mu_f, self.mu_b)

    @property
    def largest(self) -> float:
        return max(self.mu_t, self.mu_f, self.mu_b)

    @property
    def isotropic(self) -> bool:
        return self.mu_t == self.mu_f == self.mu_b

    associated = isotropic

    @property
    def reversible(self) -> bool:
        return self.mu_b == self.mu_f

    def in_units_of(self, unit: float) -> Self:
        scaled = {name: getattr(self, name) / unit for name in self.by_name}
        return replace(self, **scaled)  # type: ignore[type-var]

    def mu_s(self, vs: Array) -> Array:
        """Coefficient of sliding along the body with velocity `vs`."""
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
        check_positive(self, *self.by_name, of="friction.")
        if self.largest > _LARGEST:
            raise ProblemError(
                f"friction holds more than {_LARGEST:g} times what presses: no floor does."
            )

    @property
    def kernel_numbers(self) -> tuple[float, ...]:
        """Coefficients, and stretches forwards and backwards."""
        stretches = [float(self.stretch(np.array(side))) for side in (1.0, -1.0)]
        return self.mu_t, self.mu_f, self.mu_b, *stretches

    @property
    def label(self) -> str:
        return f"friction ({self.mu_t:g}, {self.mu_f:g}, {self.mu_b:g})"

    def describe(self) -> str:
        return (
            f"μt = {self.mu_t:g} sideways, μf = {self.mu_f:g} forwards, μb = {self.mu_b:g} "
            f"backwards"
        )

    def in_speeds_of(self, unit: float) -> Friction:
        return self

    def stretch(self, vs: Array) -> Array:
        """Factor of `vs` in the speed r."""
        return 1.0

    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        mu_s, vs = self.mu_s(vs), self.stretch(vs) * vs
        r = regularised_speed(vs, vn, delta)
        return -mu_s * vs / r, -self.mu_t * vn / r

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        mu_s, stretch = self.mu_s(vs), self.stretch(vs)
        r = regularised_speed(stretch * vs, vn, delta)
        zero = 0.0 * r
        return (stretch * mu_s / r, zero), (zero, self.mu_t / r)

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        mu_s, mu_t, stretch = self.mu_s(vs), self.mu_t, self.stretch(vs)
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


def regularised_speed(vs: Array, vn: Array, delta: Array) -> Array:
    return namespace(vs, vn, delta).sqrt(vs * vs + vn * vn + delta * delta)


class LinkVelocity(NamedTuple):
    """Velocity of links, or parts of them, along and across themselves at their midpoints, and
    rotation rates."""

    vs: Array
    vn: Array
    w: Array


class LinkForce(NamedTuple):
    tangential: Array
    normal: Array
    couple: Array


def power(vs: Array, vn: Array, w: Array, force: LinkForce) -> Array:
    return -(force.tangential * vs + force.normal * vn + force.couple * w)


class LineIntegrals:
    """A law on links: velocities along and across them at their midpoints and rotation rates,
    ``(n_link, n_time)``, lengths ``(n_link, 1)``; NumPy and CasADi. By quadrature; laws in closed
    form register a subclass."""

    def __init__(self, law: Any) -> None:
        self.law = law

    def force(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> LinkForce:
        def at(sigma, y):
            fs, fn = self.law.density(vs, y, delta)
            return fs, fn, sigma * fn

        return LinkForce(*_integrals(at, vs, vn, w, length, delta))

    def jacobian(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        """Minus the derivative of the force with respect to (vs, vn, w), 3 x 3; a switch of
        coefficients is differentiated on its current side."""
        return _matrix(self.law.density_jacobian, vs, vn, w, length, delta)

    def secant(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        return _matrix(self.law.density_secant, vs, vn, w, length, delta)

    def potential(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Array:
        density = self.law.density_potential
        return _integrals(lambda _, y: (density(vs, y, delta),), vs, vn, w, length, delta)[0]

    def scaled_laws(
        self, vs: Array, vn: Array, w: Array, length: Array, delta: Array, force: LinkForce
    ) -> list[Array]:
        """Residuals of the law for link forces that are variables, scaled like velocities: mild
        constraints where the force is nearly a step."""
        integral = self.force(vs, vn, w, length, delta)
        secant = self.secant(vs, vn, w, length, delta)
        return [
            (force.tangential - integral.tangential) / secant[0][0],
            (force.normal - integral.normal) / secant[1][1],
            (force.couple - integral.couple) / secant[1][1] * (6 / length),
        ]

    def largest_forces(self, length: np.ndarray) -> np.ndarray:
        """Bounds on force, normal force and couple at any speed, ``(3, n_link, 1)``."""
        return np.full((3, *length.shape), np.inf)


line_integrals = singledispatch(LineIntegrals)
"""The `LineIntegrals` of a law."""


def _integrals(
    integrand: Callable[[Array, Array], tuple[Array, ...]],
    vs: Array,
    vn: Array,
    w: Array,
    length: Array,
    delta: Array,
) -> list[Array]:
    """Integrals over links of functions of sigma and the normal velocity there."""
    total: list[Array] = []
    for sigma, y, weight in _gauss_nodes(vs, vn, w, length, delta):
        terms = [weight * each for each in integrand(sigma, y)]
        if isinstance(vs, np.ndarray):
            terms = [term.sum(axis=0) for term in terms]
        total = [a + b for a, b in zip(total, terms, strict=True)] if total else terms
    return total


def _matrix(density: Any, vs: Array, *at: Array) -> Matrix:
    def entries(sigma, y):
        (ss, sn), (ns, nn) = density(vs, y, at[-1])
        couple = sigma * ns, sigma * nn, sigma * sigma * nn
        return ss, sn, sigma * sn, ns, nn, sigma * nn, *couple

    integrals = _integrals(entries, vs, *at)
    return tuple(tuple(integrals[k : k + 3]) for k in (0, 3, 6))


def _gauss_nodes(
    vs: Array, vn: Array, w: Array, length: Array, delta: Array
) -> Iterator[tuple[Array, Array, Array]]:
    """Distance from the midpoint, normal velocity, and weight of nodes; weights add up to the
    length. With CasADi one node after the other, with NumPy those of a panel along a first axis."""
    xp = namespace(vs, vn, w, delta)
    if isinstance(vs, np.ndarray):
        places = [(_X[:, None, None], _WEIGHT[:, None, None])]
    else:
        places = list(zip(_X, _WEIGHT, strict=True))
    a = xp.sqrt(vs * vs + delta * delta)
    half = 0.5 * length * w
    y0, y1 = vn - half, vn + half
    r0, r1 = xp.sqrt(a * a + y0 * y0), xp.sqrt(a * a + y1 * y1)
    # sinh(2 h) = (y1 r0 - y0 r1)/a^2; where both ends have one sign that cancels
    same = y0 * y1 > 0
    both = xp.where(same, y1 * r0 + y0 * r1, 1.0)
    h = 0.5 * xp.arcsinh(
        xp.where(same, (y1 - y0) * (y1 + y0) / both, (y1 * r0 - y0 * r1) / (a * a))
    )
    m = xp.arcsinh(y0 / a) + h
    tilt, square = xp.tanh(m), h * h
    small = square < _SMALL
    safe = xp.where(small, 1.0, h)
    per_sinh = 1.0 / xp.sinh(safe)
    width = 0.5 * length * xp.where(small, 1.0 - square / 6, safe * per_sinh) / xp.cosh(m)
    slowest = -m * xp.where(small, 0.0, 1.0) / safe
    slowest = xp.where(slowest > 1.0, 1.0, xp.where(slowest < -1.0, -1.0, slowest))
    for reach, centre in (
        (0.5 * (slowest + 1.0), 0.5 * (slowest - 1.0)),
        (0.5 * (1.0 - slowest), 0.5 * (slowest + 1.0)),
    ):
        for place, weight in places:
            x = centre + reach * place
            tau, rest = m + h * x, 1.0 - x * x
            bend = 1.0 - square * rest / 12
            series = x * (1.0 - square * rest / 6) - 0.5 * tilt * h * rest * bend
            product = xp.sinh(0.5 * safe * (1.0 + x)) * xp.sinh(0.5 * safe * (1.0 - x))
            share = xp.where(small, series, (xp.sinh(safe * x) - 2.0 * tilt * product) * per_sinh)
            yield 0.5 * length * share, a * xp.sinh(tau), weight * reach * width * xp.cosh(tau)


@line_integrals.register(Friction)
class ClosedForm(LineIntegrals):
    """Coulomb friction on links, also with the tangential velocity stretched."""

    def force(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> LinkForce:
        mu_s, mu_t, vs = self.law.mu_s(vs), self.law.mu_t, self.law.stretch(vs) * vs
        a2, _, S, Q, g, h = _roots(vs, vn, w, length, delta)
        return LinkForce(
            -mu_s * vs * 2.0 * length * g / S,
            -mu_t * 2.0 * vn * length / S,
            -mu_t * w * length**3 / S * (0.5 * Q - a2 * h / (S * S)),
        )

    def moments(
        self, vs: Array, vn: Array, w: Array, length: Array, delta: Array
    ) -> tuple[Array, Array, Array]:
        """Integrals of sigma^j / r, j = 0, 1, 2."""
        a2, _, S, Q, g, h = _roots(self.law.stretch(vs) * vs, vn, w, length, delta)
        l3 = length**3
        return (
            2.0 * length * g / S,
            -2.0 * vn * w * l3 * h / S**3,
            l3 / S * (0.5 * Q + (2.0 * vn * vn - a2) * h / (S * S)),
        )

    def jacobian(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        mu_s, mu_t, stretch = self.law.mu_s(vs), self.law.mu_t, self.law.stretch(vs)
        vs = stretch * vs
        a2, r0r1, S, Q, _, h = _roots(vs, vn, w, length, delta)
        l3 = length**3
        # integrals of 1/r^3 (times a^2), y/r^3, sigma y/r^3, and (delta^2 + y^2)/r^3
        a2J0 = length * S * Q / r0r1
        a2J1 = -vn * w * l3 * Q / (r0r1 * S)
        E = a2 + vn * vn
        a2J2 = 2.0 * l3 * a2 * h / S**3 + l3 * (E * Q - 0.5 * a2) / (S * r0r1)
        y_r3 = 2.0 * vn * length / (S * r0r1)
        sy_r3 = w * l3 / S * (2.0 * h / (S * S) + (Q - 0.5) / r0r1)
        along = a2J0 * (delta * delta / a2) + vn * y_r3 + w * sy_r3
        return (
            (stretch * mu_s * along, -mu_s * vs * y_r3, -mu_s * vs * sy_r3),
            (-stretch * mu_t * vs * y_r3, mu_t * a2J0, mu_t * a2J1),
            (-stretch * mu_t * vs * sy_r3, mu_t * a2J1, mu_t * a2J2),
        )

    def secant(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        mu_s, mu_t = self.law.mu_s(vs), self.law.mu_t
        I0, I1, I2 = self.moments(vs, vn, w, length, delta)
        zero = 0.0 * I0
        return (
            (self.law.stretch(vs) * mu_s * I0, zero, zero),
            (zero, mu_t * I0, mu_t * I1),
            (zero, mu_t * I1, mu_t * I2),
        )

    def potential(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Array:
        a2, _, S, _, g, _ = _roots(self.law.stretch(vs) * vs, vn, w, length, delta)
        return self.law.mu_t * (length / S * (vn * vn + 0.25 * S * S + a2 * g))

    def scaled_laws(
        self, vs: Array, vn: Array, w: Array, length: Array, delta: Array, force: LinkForce
    ) -> list[Array]:
        mu_s, mu_t = self.law.mu_s(vs), self.law.mu_t
        I0, I1, I2 = self.moments(vs, vn, w, length, delta)
        return [
            force.tangential / I0 + mu_s * (self.law.stretch(vs) * vs),
            force.normal / I0 + mu_t * (vn + w * I1 / I0),
            (force.couple / I0 + mu_t * (vn * I1 / I0 + w * I2 / I0)) * (6 / length),
        ]

    def largest_forces(self, length: np.ndarray) -> np.ndarray:
        mu_s, mu_t = max(self.law.mu_f, self.law.mu_b), self.law.mu_t
        return np.stack([mu_s * length, mu_t * length, mu_t * length**2 / 4])


def _roots(vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> tuple[Array, ...]:
    """a^2, r0 r1, S, Q, g and h of the closed forms."""
    xp = namespace(vs, vn, w, delta)
    a2 = vs * vs + delta * delta
    half = 0.5 * length * w
    y0, y1 = vn - half, vn + half
    r0, r1 = xp.sqrt(a2 + y0 * y0), xp.sqrt(a2 + y1 * y1)
    S = r0 + r1
    r0r1 = r0 * r1
    # P = T + r0 r1 cancels where T < 0; there P = a^2 (w l)^2 / (r0 r1 - T).
    T = a2 + y0 * y1
    opposite = T < 0
    Q = xp.where(opposite, r0r1 - T, a2) / xp.where(opposite, 4.0 * half * half, r0r1 + T)
    # squared before |w| appears: behind an absolute value automatic differentiation loses q'' at
    # w = 0
    signed_root_q = 2.0 * half / S
    q = signed_root_q * signed_root_q
    small = q < _SERIES_LIMIT
    h_small = 0.0
    for coefficient in reversed(_H_SERIES):
        h_small = h_small * q + coefficient
    safe = xp.where(small, 0.5, xp.abs(signed_root_q))
    # 1 - q = 2 P / S^2 = 2 a^2 / (Q S^2)
    g_large = 0.5 * xp.log((1.0 + safe) * (1.0 + safe) * Q * S * S / (2.0 * a2)) / safe
    h = xp.where(small, h_small, (g_large - 1.0) / (safe * safe))
    return a2, r0r1, S, Q, 1.0 + q * h, h


# a wheel on an axle: its part across is a law of Coulomb in whose speed the velocity along does not
# count, and so is its part along, turned by a right angle


class _Across(Friction):
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
        return min(self.rolling, self.sideways)

    @property
    def largest(self) -> float:
        return math.hypot(self.rolling, self.sideways)

    @property
    def label(self) -> str:
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
class OnLinks(ClosedForm):
    """A row of wheels along a link, all of which roll alike."""

    scaled_laws = LineIntegrals.scaled_laws

    def __init__(self, law: Axle) -> None:
        super().__init__(_Across(mu_t=law.sideways, mu_f=law.rolling, mu_b=law.rolling))
        self.axle = law

    def force(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> LinkForce:
        along = length * self.axle.density(vs, vn, delta)[0]
        return super().force(vs, vn, w, length, delta)._replace(tangential=along)

    def jacobian(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        (_, *none), *across = super().jacobian(vs, vn, w, length, delta)
        return (length * self.axle.density_jacobian(vs, vn, delta)[0][0], *none), *across

    def secant(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Matrix:
        (_, *none), *across = super().secant(vs, vn, w, length, delta)
        return (length * self.axle.density_secant(vs, vn, delta)[0][0], *none), *across

    def potential(self, vs: Array, vn: Array, w: Array, length: Array, delta: Array) -> Array:
        along = length * self.axle.rolling * regularised_speed(vs, 0.0 * vs, delta)
        return super().potential(vs, vn, w, length, delta) + along
