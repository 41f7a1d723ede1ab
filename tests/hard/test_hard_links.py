"""Link integrals where closed forms are known to fail: no rotation, nearly none, ends at rest, tiny
and huge delta."""

import numpy as np
import pytest

from colloc import Friction
from colloc.mechanics.friction import line_integrals

COULOMB = line_integrals(Friction())
LENGTH = 1 / 3


def column(*values):
    return [np.array([[v]]) for v in values]


def graded_quadrature(vs, vn, w, length, delta):
    """Integrals over a link, and of sizes: Gauss panels graded towards the slowest point."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half = 0.5 * length
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        slowest = np.where(w == 0, 0.0, np.clip(-vn / np.where(w == 0, 1, w), -half, half))
    total = np.zeros((2, 5, vs.size))
    edges = np.concatenate([[0.0], 2.0 ** np.arange(-70, 1)])
    for span in (half - slowest, -half - slowest):
        for a, wide in zip(edges, np.diff(edges), strict=False):
            offset = span[:, None] * (a + wide * 0.5 * (nodes + 1))
            sigma = slowest[:, None] + offset
            y = (vn + w * slowest)[:, None] + w[:, None] * offset
            share = weights * 0.5 * wide * np.abs(span)[:, None]
            share = share / np.sqrt(vs[:, None] ** 2 + y**2 + delta[:, None] ** 2)
            parts = np.stack([each * share for each in (sigma**0, sigma, sigma**2, y, sigma * y)])
            total += parts.sum(axis=-1), np.abs(parts).sum(axis=-1)
    return total


def test_moments_normal_force_and_couple_agree_with_graded_quadrature_over_all_regimes():
    rng, count = np.random.default_rng(1), 4000
    vs, vn, w = 10 ** rng.uniform(-12, 1, (3, count)) * rng.choice([-1, 1], (3, count))
    length, delta = rng.uniform(0.05, 1, count), 10 ** rng.uniform(-12, 0, count)
    vs[::7], vn[::11], w[::13] = 0.0, 0.0, 0.0
    known, size = graded_quadrature(vs, vn, w, length, delta)
    moments = line_integrals(Friction()).moments(vs, vn, w, length, delta)
    force = line_integrals(Friction(mu_t=2.0)).force(vs, vn, w, length, delta)
    found = np.array([*moments, -0.5 * force.normal, -0.5 * force.couple])
    assert (np.abs(found - known) / np.maximum(size, 1e-300)).max() < 1e-13


@pytest.mark.parametrize("w", [0.0, 5e-324, 1e-300, 1e-160, 1e-30, -1e-23])
@pytest.mark.parametrize("delta", [1.0, 1e-6, 1e-14])
def test_pure_translation_and_near_it(w, delta):
    """Integrals are those of a constant; a rotation below rounding changes nothing."""
    for vs, vn in ((0.0, 0.0), (3.0, 4.0), (0.0, 1e-9), (1e-13, 0.0)):
        root = np.sqrt(vs**2 + vn**2 + delta**2)
        I0, I1, I2 = COULOMB.moments(*column(vs, vn, w), LENGTH, delta)
        np.testing.assert_allclose(I0, LENGTH / root, rtol=1e-14)
        np.testing.assert_allclose(I2, LENGTH**3 / (12 * root), rtol=1e-14)
        assert abs(I1.item()) <= abs(w * vn) * LENGTH**3 / (12 * root**3) * (1 + 1e-10) + 5e-324
        force = line_integrals(Friction(mu_t=2, mu_b=3)).force(*column(vs, vn, w), LENGTH, delta)
        np.testing.assert_allclose(force.tangential, -LENGTH * vs / root, rtol=1e-14, atol=0)
        np.testing.assert_allclose(force.normal, -2 * LENGTH * vn / root, rtol=1e-14, atol=0)
