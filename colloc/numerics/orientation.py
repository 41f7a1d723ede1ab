r"""Orientation on a mesh where its rate depends on it: ``theta_ki = theta_0 + sum_(l<k) h_l b.omega_l + h_k (A omega_k)_i``.

With H the matrix of these sums, ``theta = theta_0 + H omega(theta)``. Newton's method, and derivatives of what follows, need
solutions with ``I - H Omega``, Omega being the diagonal matrix of d omega/d theta. Interval by interval that is a small system
in the stages, and one number, the orientation at its begin, is handed on.
"""

from __future__ import annotations

import numpy as np

from colloc.numerics.mesh import Mesh


class Orientation:
    """The equation on a mesh whose neighbours share no stage, for rates per time divided by `unit`; arrays are ``(n_point,)``,
    in order of the stages."""

    def __init__(self, mesh: Mesh, unit: float = 1.0) -> None:
        self._shape = mesh.n, mesh.scheme.s
        self._a, self._b = unit * mesh.h[:, None, None] * mesh.scheme.A, unit * mesh.h[:, None] * mesh.scheme.b
        self.weight = self._b.ravel()

    def turned(self, omega: np.ndarray) -> np.ndarray:
        """``H omega``."""
        rates = omega.reshape(self._shape)
        before = np.concatenate([[0.0], np.cumsum((self._b * rates).sum(axis=1))[:-1]])
        return (before[:, None] + np.einsum("kij,kj->ki", self._a, rates)).ravel()

    def _within(self, slope: np.ndarray) -> np.ndarray:
        """Inverses ``(n, s, s)`` of ``I - h A Omega`` of the intervals."""
        return np.linalg.inv(np.eye(self._shape[1]) - self._a * slope.reshape(self._shape)[:, None, :])

    def solved(self, slope: np.ndarray, right: np.ndarray) -> np.ndarray:
        """x with ``(I - H Omega) x = right``, for Omega of diagonal `slope`."""
        inverse, gain = self._within(slope), self._b * slope.reshape(self._shape)
        own, ahead = np.einsum("kij,kj->ki", inverse, right.reshape(self._shape)), inverse.sum(axis=2)
        found, begin = np.empty(self._shape), 0.0
        for k in range(self._shape[0]):
            found[k] = own[k] + begin * ahead[k]
            begin += gain[k] @ found[k]
        return found.ravel()

    def pulled_back(self, slope: np.ndarray, on_theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What numbers that depend on theta as ``on_theta``, ``(k, n_point)``, owe to theta_0, ``(k,)``, and to rates at given
        theta, ``(k, n_point)``: the sums of mu and ``H' mu``, with ``(I - H Omega)' mu = on_theta``."""
        inverse, gain = self._within(slope), self._b * slope.reshape(self._shape)
        given = on_theta.reshape(len(on_theta), *self._shape)
        on_rates, later = np.empty_like(given), np.zeros(len(on_theta))
        for k in range(self._shape[0] - 1, -1, -1):
            mu = (given[:, k] + later[:, None] * gain[k]) @ inverse[k]
            on_rates[:, k] = mu @ self._a[k] + later[:, None] * self._b[k]
            later = later + mu.sum(axis=1)
        return later, on_rates.reshape(on_theta.shape)
