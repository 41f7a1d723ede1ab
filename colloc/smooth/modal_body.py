"""The smooth body of a few modes as a `colloc.mechanics.bodies.Body`."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from colloc.mechanics.bodies import BalancedMotion, BalanceSolution, Sliding, Usual
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array
from colloc.smooth.modal_balance import modal_motion, modal_sliding, modal_slopes, solve_modal
from colloc.smooth.modes import Modes
from colloc.smooth.motion import Motion
from colloc.smooth.smooth_body import SmoothBody

_PLACES_A_MODE = 4
"""Where on the body |Theta| is bounded."""


class Shapes(Protocol):
    """A gait of the modes' amplitudes."""

    def angles(self, t: np.ndarray) -> np.ndarray: ...

    def rates(self, t: np.ndarray) -> np.ndarray: ...


class ModalBody(SmoothBody, Modes):
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
    symmetries = ("none", "antipodal")
    symmetric = True
    usual = Usual(
        delta=1e-2, delta_start=0.3, limit=1.5, largest_limit=0.5 * np.pi, limit_name="tangent angle", excess=1e-3,
        delta_influence=2e-2, instants=400,
    )  # fmt: skip
    """A smooth body has a point at rest at nearly every instant. So its panels have to resolve delta over the rotation rate,
    and the influence of delta is of first order and larger than for links. Below pi/2 the body advances along its mean
    direction and cannot cross itself."""

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

    def sliding(self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array) -> Sliding:
        return modal_sliding(self, friction, angles, rates, z, delta)

    def solve(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, *, start: np.ndarray | None = None,
        tolerance: float = 1e-11,
    ) -> BalanceSolution:  # fmt: skip
        return solve_modal(self, friction, angles, rates, delta, start, tolerance)

    def motion(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, solved: BalanceSolution
    ) -> BalancedMotion:
        return modal_motion(self, friction, angles, rates, delta, solved)

    def slopes(self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, solved: BalanceSolution) -> np.ndarray:
        return modal_slopes(self, friction, angles, rates, delta, solved)

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

    def gait_motion(self, gait: Shapes, antipodal: bool) -> Motion:
        """The motion Theta(s, t) of a gait of the modes' amplitudes."""

        def wide(s: np.ndarray, t: np.ndarray) -> np.ndarray:
            return np.broadcast_to(s, (len(s), t.size))

        return Motion(
            lambda s, t: self.tangent(wide(s, t), gait.angles(t)),
            lambda s, t: self.tangent(wide(s, t), gait.rates(t)),
            stages=(0.0, 0.5) if antipodal else (0.0, 1.0),
            antipodal=antipodal,
        )
