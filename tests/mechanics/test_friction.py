"""Closed-form link integrals against quadrature that shares nothing with them, and against their
own identities."""

import itertools

import numpy as np
import pytest

from colloc.mechanics.friction import Friction, line_integrals, power
from colloc.system.errors import ProblemError

COULOMB = line_integrals(Friction())


def graded_quadrature(vs, vn, w, length, delta, order, weight):
    """Integral of sigma^order weight(r, y) over a link: Gauss panels graded geometrically towards
    the slowest point."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half = 0.5 * length
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        slowest = np.where(w == 0, 0.0, np.clip(-vn / np.where(w == 0, 1, w), -half, half))
    total, magnitude = np.zeros_like(vs), np.zeros_like(vs)
    for end, sign in ((half, 1.0), (-half, -1.0)):
        span = np.abs(end - slowest)
        edges = np.concatenate([[0.0], 2.0 ** np.arange(-70, 1)])
        for a, b in itertools.pairwise(edges):
            x = a + (b - a) * 0.5 * (nodes + 1)
            offset = sign * span[:, None] * x
            sigma = slowest[:, None] + offset
            at_slowest = vn + w * slowest
            y = at_slowest[:, None] + w[:, None] * offset
            r = np.sqrt(vs[:, None] ** 2 + y**2 + delta[:, None] ** 2)
            piece = sigma**order * weight(r, y) * weights * 0.5 * (b - a) * span[:, None]
            total += piece.sum(axis=1)
            magnitude += np.abs(piece).sum(axis=1)
    return total, magnitude


def random_links(seed, count):
    """Velocities over 13 decades with exact zeros, delta down to 1e-12."""
    rng = np.random.default_rng(seed)
    vs, vn, w = 10 ** rng.uniform(-12, 1, (3, count)) * rng.choice([-1, 1], (3, count))
    length, delta = rng.uniform(0.05, 1, count), 10 ** rng.uniform(-12, 0, count)
    vs[::7], vn[::11], w[::13] = 0.0, 0.0, 0.0
    return vs, vn, w, length, delta


def test_moments_agree_with_graded_quadrature_over_all_regimes():
    vs, vn, w, length, delta = random_links(1, 4000)
    moments = COULOMB.moments(vs, vn, w, length, delta)
    for order, closed in enumerate(moments):
        reference, magnitude = graded_quadrature(
            vs, vn, w, length, delta, order, lambda r, y: 1 / r
        )
        assert np.max(np.abs(closed - reference) / magnitude) < 1e-13


def test_normal_force_and_couple_agree_with_graded_quadrature():
    vs, vn, w, length, delta = random_links(2, 3000)
    force = line_integrals(Friction(mu_t=2.0)).force(vs, vn, w, length, delta)
    for order, closed in ((0, force.normal), (1, force.couple)):
        reference, magnitude = graded_quadrature(
            vs, vn, w, length, delta, order, lambda r, y: -2.0 * y / r
        )
        assert np.max(np.abs(closed - reference) / np.maximum(magnitude, 1e-300)) < 1e-13


def test_isotropic_force_is_minus_the_gradient_of_the_dissipation_and_its_jacobian_the_hessian():
    rng = np.random.default_rng(6)
    length = np.array([[0.35]])
    for _ in range(100):
        delta = 10 ** rng.uniform(-2, 0)
        v = rng.normal(size=3) * 10 ** rng.uniform(-2, 0, 3)
        step = 1e-5 * np.linalg.norm([*v, delta])

        def potential(x, d=delta):
            return COULOMB.potential(*(np.array([[c]]) for c in x), length, d).item()

        def force(x, d=delta):
            return np.array(
                [c.item() for c in COULOMB.force(*(np.array([[c]]) for c in x), length, d)]
            )

        shifts = step * np.eye(3)
        gradient = np.array([potential(v + h) - potential(v - h) for h in shifts]) / (2 * step)
        hessian = np.array([force(v - h) - force(v + h) for h in shifts]) / (2 * step)
        blocks = COULOMB.jacobian(*(np.array([[c]]) for c in v), length, delta)
        jacobian = np.array([[np.asarray(entry).item() for entry in row] for row in blocks])
        np.testing.assert_allclose(gradient, -force(v), atol=1e-8 * max(1, np.abs(force(v)).max()))
        np.testing.assert_allclose(hessian, jacobian, atol=1e-7 * np.abs(jacobian).max())
        assert np.linalg.eigvalsh(jacobian).min() > 0


@pytest.mark.parametrize(
    ("vs", "vn", "known"),
    [(3.0, 4.0, (-0.45, -0.8)), (1.0, 0.0, (-0.75, 0.0)), (-1.0, 0.0, (3.5, 0.0))],
)
def test_pure_translation_gives_coulomb_friction_in_the_limit(vs, vn, known):
    law, at = Friction(mu_t=2.0, mu_f=1.5, mu_b=7.0), (np.array([v]) for v in (vs, vn, 0.0))
    force = line_integrals(law).force(*at, 0.5, 1e-9)
    np.testing.assert_allclose(np.ravel(force), [*known, 0.0], rtol=1e-12, atol=1e-15)


def test_dissipation_is_at_least_the_smallest_coefficient_times_the_speed():
    vs, vn, w, length, _ = random_links(7, 2000)
    delta = np.full(2000, 1e-12)
    friction = Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
    work = power(vs, vn, w, line_integrals(friction).force(vs, vn, w, length, delta))
    speed = COULOMB.potential(vs, vn, w, length, delta)
    moving = speed > 1e-9
    assert np.all(work[moving] >= friction.smallest * speed[moving] * (1 - 1e-2))
    assert np.all(work >= 0)


@pytest.mark.parametrize(
    "bad",
    [{"mu_t": -1}, {"mu_f": 0}, {"mu_b": float("nan")}, {"mu_t": float("inf")}, {"mu_f": "1"}],
)
def test_unphysical_coefficients_are_refused_by_name(bad):
    with pytest.raises(ProblemError, match=next(iter(bad))):
        Friction(**bad)
