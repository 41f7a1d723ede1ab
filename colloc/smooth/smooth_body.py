"""What all smooth bodies answer alike, from their tangent angle alone (`colloc.mechanics.bodies.Body`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from colloc.mechanics.balance_results import BalancedMotion, Lifted
from colloc.mechanics.bodies import ARROWS, IMPLICIT, Pairs, Stretch
from colloc.mechanics.contact import Contact
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array
from colloc.smooth.balance import SmoothSolution, solve_smooth
from colloc.smooth.curve import Curve, PanelGrid, curve, node_velocity
from colloc.smooth.motion import Motion

TAIL = 0
_OUTLINE, _NODES = 96, 3
_SHOWN = 5
"""Places along the body whose speeds are drawn."""
_FINE_PLACES = 401
_REPLAYED = 1e-8
"""Largest difference of a panel's force, torque or power from those of its halves, where a motion is replayed."""


class SmoothBody:
    """A curve of unit length by its tangent angle; below pi/2 it cannot cross itself."""

    formulations: tuple[str, ...] = (IMPLICIT,)
    """Forces on all nodes as variables would be too many for a full program."""
    n_force = 0
    force_names: tuple[str, ...] = ()
    looks_for_all_velocities = False
    hinges = slice(0, 0)
    drawn_width = 0.0
    far_pairs: Pairs = ()
    schedule: tuple[float, ...] = ()
    first_panels = 16
    panels: int = 0
    """Where nothing is searched for, panels adapt."""

    @property
    def stretches(self) -> tuple[Stretch, ...]:
        """None unless a body says so."""
        return ()

    def on_panels(self, panels: int) -> Self:
        return self

    def tangent(self, s: np.ndarray, angles: np.ndarray) -> np.ndarray:
        """Theta ``(n_node, n_time)`` at arc lengths s ``(n_node, n_time)`` of shapes ``(n_joint, n_time)``."""
        raise NotImplementedError

    def turning(self, s: np.ndarray, angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Its rate."""
        raise NotImplementedError

    def breaks(self, angles: np.ndarray) -> np.ndarray:
        """Arc lengths ``(n_break, n_time)`` at which Theta is not smooth; none unless a body says so."""
        return np.empty((0, angles.shape[1]))

    def _motion_of(self, angles: np.ndarray, rates: np.ndarray) -> Motion:
        """Shapes in a row as a motion whose phase counts them."""

        def at(t: np.ndarray) -> np.ndarray:
            return t.astype(int)

        return Motion(
            lambda s, t: self.tangent(np.broadcast_to(s, (len(s), t.size)), angles[:, at(t)]),
            lambda s, t: self.turning(np.broadcast_to(s, (len(s), t.size)), angles[:, at(t)], rates[:, at(t)]),
            lambda t: self.breaks(angles[:, at(t)]),
        )

    def on_adaptive_panels(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, **settings
    ) -> SmoothSolution:
        """The balance on panels that are halved until they resolve it; settings as for `solve_smooth`."""
        phases = np.arange(angles.shape[1])
        settings = {"panels": self.first_panels, "quadrature_tolerance": _REPLAYED} | settings
        return solve_smooth(self._motion_of(angles, rates), friction, phases, delta, **settings)

    def replayed(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, start: np.ndarray | None
    ) -> tuple[BalancedMotion, np.ndarray]:
        """On panels that adapt, whatever those of a search."""
        solved = self.on_adaptive_panels(friction, angles, rates, delta).require()
        return BalancedMotion(solved.z, solved.centre, solved.power, solved.bending_power), solved.residual

    def all_velocities(self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float) -> None:
        """Not looked for."""

    def slowness(self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, z: np.ndarray) -> np.ndarray:
        """None: a point at rest moves along the body, and does not come and go."""
        return np.empty((0, angles.shape[1]))

    def footprints(self, angles: np.ndarray) -> np.ndarray:
        return np.zeros((2, 2, 0, angles.shape[1]))

    def imbalance(self, angles: np.ndarray) -> np.ndarray:
        return np.zeros(angles.shape[1])

    def law(self, friction: Law) -> Law:
        return friction

    def with_forces(self, friction: Law, angles: Array, rates: Array, z: Array, forces: Array, delta: Array) -> Lifted:
        raise NotImplementedError("a smooth body has no full program.")

    def forces(self, friction: Law, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: float) -> np.ndarray:
        return np.empty((0, angles.shape[1]))

    def largest_forces(self, friction: Law) -> np.ndarray:
        return np.empty((0, 1))

    def largest_angles(self, angles: np.ndarray) -> np.ndarray:
        places = np.repeat(np.linspace(0.0, 1.0, _FINE_PLACES)[:, None], angles.shape[1], axis=1)
        return np.abs(self.tangent(places, angles)).max(axis=0)

    def contacts(self, far: Sequence[tuple[int, int]] = ()) -> list[Contact]:
        """None: the bound on the tangent angle excludes them."""
        return []

    def crossing_depth(self, angles: np.ndarray, pairs: Sequence[tuple[int, int]] | None = None) -> np.ndarray:
        return np.zeros(angles.shape[1])

    def passing_depth(self, angles: np.ndarray, pairs: Sequence[tuple[int, int]] | None = None) -> float:
        return 0.0

    def _curve(self, n: int, order: int, angles: np.ndarray, rates: np.ndarray) -> tuple[PanelGrid, Curve]:
        """The body on n equal panels."""
        panels = PanelGrid(np.repeat(np.linspace(0.0, 1.0, n + 1)[:, None], angles.shape[1], axis=1), order)
        s = panels.nodes
        return panels, curve(panels, self.tangent(s, angles), self.turning(s, angles, rates), TAIL, np.zeros((1, 1)))

    def _at_equal_steps(self, count: int, angles: np.ndarray, rates: np.ndarray) -> Curve:
        """The middles of so many equal parts of the body, integrated on no fewer than `_OUTLINE` panels."""
        each = 1 + 2 * (_OUTLINE // (2 * count))  # an odd number, so that one of them lies in the middle
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
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, z: np.ndarray, count: int = ARROWS
    ) -> tuple[np.ndarray, np.ndarray]:
        now = self._at_equal_steps(count, angles, rates)
        fs, fn = friction.density(*node_velocity(now, z), delta)
        return np.stack(_places(now)), np.stack([fs * now.cos - fn * now.sin, fs * now.sin + fn * now.cos])

    def speeds(self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray) -> tuple[str, np.ndarray]:
        """At equal steps from tail to head."""
        return "part", np.hypot(*node_velocity(self._at_equal_steps(_SHOWN, angles, rates), z))

    def seen_from_head(self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        raise NotImplementedError("gaits of a smooth body are never bilateral.")


def _places(now: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Where the nodes are, seen from the reference: their arms turned back into the axes."""
    return now.arm_s * now.sin + now.arm_n * now.cos, now.arm_n * now.sin - now.arm_s * now.cos
