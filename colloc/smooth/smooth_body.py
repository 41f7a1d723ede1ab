"""What all smooth bodies answer alike, from their tangent angle alone
(`colloc.mechanics.bodies.Body`)."""

from __future__ import annotations

import numpy as np

from colloc.mechanics.balance_results import BalancedMotion
from colloc.mechanics.bodies import ARROWS, Body
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array
from colloc.smooth.balance import TAIL, SmoothSolution, solve_smooth
from colloc.smooth.curve import Curve, PanelGrid, curve, node_velocity
from colloc.smooth.motion import Motion

_OUTLINE, _NODES = 96, 3
_SHOWN = 5
"""Places along the body whose speeds are drawn."""
_FINE_PLACES = 401
_REPLAYED = 1e-8
"""Largest difference of a panel's force, torque or power from those of its halves, where a motion
is replayed."""


class SmoothBody(Body):
    """A curve of unit length by its tangent angle. Below pi/2 it cannot cross itself, and a point
    at rest moves along it and makes no kinks; forces on all nodes as variables would be too many
    for a full program."""

    def tangent(self, s: np.ndarray, angles: Array) -> Array:
        """Theta ``(n_node, n_time)`` at arc lengths s ``(n_node, 1 or n_time)`` of shapes
        ``(n_joint, n_time)``."""
        raise NotImplementedError

    def turning(self, s: np.ndarray, angles: Array, rates: Array) -> Array:
        """Its rate."""
        raise NotImplementedError

    def breaks(self, angles: np.ndarray) -> np.ndarray:
        """Arc lengths ``(n_break, n_time)`` at which Theta is not smooth; none unless a body says
        so."""
        return np.empty((0, angles.shape[1]))

    def on_adaptive_panels(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, **settings
    ) -> SmoothSolution:
        """The balance on panels that are halved until they resolve it; settings as for
        `solve_smooth`."""

        def at(t: np.ndarray) -> np.ndarray:  # the phase counts the shapes
            return t.astype(int)

        motion = Motion(
            lambda s, t: self.tangent(s, angles[:, at(t)]),
            lambda s, t: self.turning(s, angles[:, at(t)], rates[:, at(t)]),
            lambda t: self.breaks(angles[:, at(t)]),
        )
        settings = {"quadrature_tolerance": _REPLAYED} | settings
        return solve_smooth(motion, friction, np.arange(angles.shape[1]), delta, **settings)

    def replayed(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        start: np.ndarray | None,
    ) -> tuple[BalancedMotion, np.ndarray]:
        """On panels that adapt, whatever those of a search."""
        solved = self.on_adaptive_panels(friction, angles, rates, delta).require()
        return BalancedMotion(
            solved.z, solved.centre, solved.power, solved.bending_power
        ), solved.residual

    def largest_angles(self, angles: np.ndarray) -> np.ndarray:
        places = np.linspace(0.0, 1.0, _FINE_PLACES)[:, None]
        return np.asarray(np.abs(self.tangent(places, angles)).max(axis=0))

    def _curve(
        self, n: int, order: int, angles: np.ndarray, rates: np.ndarray
    ) -> tuple[PanelGrid, Curve]:
        """The body on n equal panels."""
        panels = PanelGrid(
            np.repeat(np.linspace(0.0, 1.0, n + 1)[:, None], angles.shape[1], axis=1), order
        )
        s = panels.nodes
        return panels, curve(
            panels, self.tangent(s, angles), self.turning(s, angles, rates), TAIL, np.zeros((1, 1))
        )

    def _at_equal_steps(self, count: int, angles: np.ndarray, rates: np.ndarray) -> Curve:
        """The middles of so many equal parts of the body, integrated on no fewer than `_OUTLINE`
        panels."""
        # an odd number, so that one of them lies in the middle
        each = 1 + 2 * (_OUTLINE // (2 * count))
        _, now = self._curve(count * each, _NODES, angles, rates)
        return Curve(*(row[_NODES * each // 2 :: _NODES * each] for row in now))

    def outline(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        panels, now = self._curve(_OUTLINE, _NODES, angles, np.zeros_like(angles))
        path = panels.edge_path(TAIL)
        return path @ (panels.widths * now.cos), path @ (panels.widths * now.sin)

    def centre(self, angles: np.ndarray) -> np.ndarray:
        _, now = self._curve(_OUTLINE, _NODES, angles, np.zeros_like(angles))
        return np.stack([(now.weight * axis).sum(axis=0) for axis in _places(now)])

    def rubbing(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        z: np.ndarray,
        count: int = ARROWS,
    ) -> tuple[np.ndarray, np.ndarray]:
        now = self._at_equal_steps(count, angles, rates)
        fs, fn = friction.density(*node_velocity(now, z), delta)
        return np.stack(_places(now)), np.stack(
            [fs * now.cos - fn * now.sin, fs * now.sin + fn * now.cos]
        )

    def speeds(
        self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray
    ) -> tuple[str, np.ndarray]:
        """At equal steps from tail to head."""
        return "part", np.hypot(*node_velocity(self._at_equal_steps(_SHOWN, angles, rates), z))


def _places(now: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Where the nodes are, seen from the reference: their arms turned back into the axes."""
    return now.arm_s * now.sin + now.arm_n * now.cos, now.arm_n * now.sin - now.arm_s * now.cos
