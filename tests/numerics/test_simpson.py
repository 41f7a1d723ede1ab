"""Simpson's rule, its running integral, and that both are what SciPy computes."""

import numpy as np
import scipy.integrate

from colloc.numerics.simpson import cumulative_simpson, simpson


def test_cubics_are_exact_and_running_integrals_are_so_for_parabolas():
    t = np.linspace(0.5, 2.0, 9)
    step = t[1] - t[0]
    assert abs(simpson(t**3, step) - (2**4 - 0.5**4) / 4) < 1e-14
    np.testing.assert_allclose(cumulative_simpson(t**2, step), (t**3 - 0.5**3) / 3, atol=1e-14)


def test_they_are_scipys():
    rng = np.random.default_rng(0)
    values, t = rng.normal(size=(3, 41)), np.linspace(0.0, 1.0, 41)
    np.testing.assert_allclose(simpson(values, t[1]), scipy.integrate.simpson(values, x=t), atol=1e-14)
    running = scipy.integrate.cumulative_simpson(values, x=t, initial=0.0)
    np.testing.assert_allclose(cumulative_simpson(values, t[1]), running, atol=1e-14)
