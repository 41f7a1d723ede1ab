"""Smooth bodies by their tangent angle alone, as `colloc.mechanics.bodies.Body`."""

from __future__ import annotations

from typing import Any

import numpy as np

from colloc.mechanics.bodies import BalancedMotion, BalanceSolution, Body, BoundedAngles
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array
from colloc.smooth.balance import TAIL, SmoothSolution, solve_smooth
from colloc.smooth.curve import Curve, PanelGrid, curve
from colloc.smooth.motion import Motion

_OUTLINE = PanelGrid(np.linspace(0.0, 1.0, 97)[:, None], 3)
_FINE = np.linspace(0.0, 1.0, 401)[:, None]
_REPLAY_TOLERANCE = 1e-8
"""Largest difference of a panel's force, torque or power from its halves in a replay."""


class SmoothBody(Body):
    """A curve of unit length. Below pi/2 it cannot cross itself; a point at rest moves along it and
    makes no kinks; forces on all nodes would be too many variables for a full program."""

    def tangent(self, s: np.ndarray, angles: Array) -> Array:
        """Theta ``(n_node, n_time)`` at arc lengths s ``(n_node, 1 or n_time)``."""
        raise NotImplementedError

    def turning(self, s: np.ndarray, angles: Array, rates: Array) -> Array:
        """Rate of Theta."""
        raise NotImplementedError

    def breaks(self, angles: np.ndarray) -> np.ndarray:
        """Arc lengths ``(n_break, n_time)`` at which Theta is not smooth."""
        return np.empty((0, angles.shape[1]))

    @property
    def bounded_angles(self) -> BoundedAngles:
        none = np.empty((0, self.n_joint))
        return BoundedAngles(none, (), fine=lambda angles: self.tangent(_FINE, angles))

    def on_panels(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        quadrature_tolerance: float = _REPLAY_TOLERANCE,
        **settings: Any,
    ) -> SmoothSolution:
        """The balance on panels; those adapt, unless settings of `solve_smooth` have a grid."""

        def at(t: np.ndarray) -> np.ndarray:  # the phase counts the shapes
            return t.astype(int)

        motion = Motion(
            lambda s, t: self.tangent(s, angles[:, at(t)]),
            lambda s, t: self.turning(s, angles[:, at(t)], rates[:, at(t)]),
            lambda t: self.breaks(angles[:, at(t)]),
        )
        return solve_smooth(
            motion, friction, np.arange(angles.shape[1]), delta,
            quadrature_tolerance=quadrature_tolerance, **settings,
        )  # fmt: skip

    @property
    def _search_grid(self) -> PanelGrid | None:
        """Fixed panels of a search; None where they adapt."""
        return None

    def solve(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        *,
        start: np.ndarray | None = None,
        tolerance: float = 1e-11,
    ) -> BalanceSolution:
        grid = self._search_grid
        slid = self.on_panels(
            friction, angles, rates, delta, tolerance=tolerance, grid=grid,
            start=None if grid is None else start,
        )  # fmt: skip
        converged, tail = slid.residual <= tolerance, np.zeros(slid.t.size, dtype=int)
        return BalanceSolution(slid.z, slid.residual, slid.iterations, converged, tail, slid.z)

    def motion(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> BalancedMotion:
        grid = self._search_grid
        slid = self.on_panels(friction, angles, rates, delta, slide=solved.z, grid=grid)
        return BalancedMotion(solved.z, slid.centre, slid.power, slid.bending_power)

    def _curve(self, angles: np.ndarray) -> Curve:
        zero = np.zeros((1, 1))
        return curve(_OUTLINE, self.tangent(_OUTLINE.nodes, angles), zero, TAIL, zero)

    def outline(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        path, now = _OUTLINE.edge_path(TAIL) * _OUTLINE.widths[:, 0], self._curve(angles)
        return path @ now.cos, path @ now.sin

    def centre(self, angles: np.ndarray) -> np.ndarray:
        now = self._curve(angles)
        x, y = now.arm_s * now.sin + now.arm_n * now.cos, now.arm_n * now.sin - now.arm_s * now.cos
        return np.stack([(now.weight * axis).sum(axis=0) for axis in (x, y)])


def accurate_motion(
    body: Body,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    start: np.ndarray | None,
) -> tuple[BalancedMotion, np.ndarray]:
    """The motion for a certificate, and its residual ``(n_time,)``: of smooth bodies on panels that
    adapt, whatever those of a search."""
    if isinstance(body, SmoothBody):
        slid = body.on_panels(friction, angles, rates, delta).require()
        motion = BalancedMotion(slid.z, slid.centre, slid.power, slid.bending_power)
        return motion, slid.residual
    solved = body.solve(friction, angles, rates, delta, start=start).require()
    return body.motion(friction, angles, rates, delta, solved), solved.residual
