"""The smooth body of a few modes as a `colloc.mechanics.bodies.Body`."""

from __future__ import annotations

import numpy as np

from colloc.numerics.arrays import Array, namespace
from colloc.smooth.modes import Modes
from colloc.smooth.panel_body import PanelBody

_PLACES_A_MODE = 4
"""Where on the body |Theta| is bounded."""


class ModalBody(Modes, PanelBody):
    """A smooth body of unit length with a few bending modes; its shape coordinates are their amplitudes [rad].

    Parameters
    ----------
    modes : int
        Number of modes.
    basis : {"legendre", "fourier"}
        Legendre polynomials of degree 1, 2, ... on the body (the curvature is a polynomial), or
        sin(2 pi s), cos(2 pi s), sin(4 pi s), ...: an even number of them.
    panels, order : int
        Gauss panels on the body and nodes on each, for the optimisation; certificates use panels that adapt.

    Examples
    --------
    >>> from colloc import Friction, Harmonic, ModalBody, Problem
    >>> body = ModalBody(modes=6)
    >>> Problem("low-modes", body=body, friction=Friction(mu_t=100), gait=Harmonic(1, "antipodal")).formulation
    'implicit velocity'
    """

    coordinate, quantity = "mode", "mode"
    symmetric = True

    @property
    def n_joint(self) -> int:
        return self.modes

    def swapped(self, shape: np.ndarray) -> np.ndarray:
        """Theta(1 - s), in axes turned by half a turn."""
        return (self.parities * shape.T).T

    def describe(self) -> str:
        return f"smooth, {self.modes} {self.basis} modes of its tangent angle, {self.panels} panels"

    def tangent(self, s: np.ndarray, angles: np.ndarray) -> np.ndarray:
        return np.einsum("itm,mt->it", self.modes_at(s), angles)

    def turning(self, s: np.ndarray, angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
        return self.tangent(s, rates)

    def angle(self, s: np.ndarray, q: Array) -> Array:
        return namespace(q).matmul(self.modes_at(s), q)

    def angle_rate(self, s: np.ndarray, q: Array, rates: Array) -> Array:
        return self.angle(s, rates)

    def angle_slopes(self, s: np.ndarray, q: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        modes = self.modes_at(s)
        none = np.zeros_like(modes)
        return np.concatenate([modes, none], axis=1)[..., None], np.concatenate([none, modes], axis=1)[..., None]

    @property
    def limited(self) -> np.ndarray:
        return self.modes_at(self._places)

    @property
    def _places(self) -> np.ndarray:
        return np.linspace(0.0, 1.0, _PLACES_A_MODE * self.modes + 1)

    @property
    def limit_names(self) -> tuple[str, ...]:
        return tuple(f"tangent at {s:.3f}" for s in self._places)

    def largest_angles(self, angles: np.ndarray) -> np.ndarray:
        """The same modes at all instants, which is faster."""
        return np.abs(self.modes_at(np.linspace(0.0, 1.0, 401)) @ angles).max(axis=0)

    @property
    def bending(self) -> np.ndarray:
        return np.diff(self.limited, axis=0)
