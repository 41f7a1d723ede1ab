"""Smooth bodies by their tangent angle alone, as `colloc.mechanics.bodies.Body`."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from colloc.mechanics.bodies import (
    BalancedMotion,
    BalanceSolution,
    Body,
    BoundedAngles,
    Defaults,
    Sliding,
)
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.smooth.balance import (
    TAIL,
    Curve,
    Motion,
    PanelGrid,
    SmoothSolution,
    curve,
    node_velocity,
    resultant,
    solve_smooth,
)

_OUTLINE = PanelGrid(np.linspace(0.0, 1.0, 97)[:, None], 3)
_FINE = np.linspace(0.0, 1.0, 401)[:, None]
_REPLAY_TOLERANCE = 1e-8
"""Largest difference of a panel's force, torque or power from its halves in a replay."""


class SmoothBody(Body):
    """A curve of unit length. Below pi/2 it cannot cross itself. A point rests at nearly all times,
    and moves along it: no kinks, but panels of a search, which are the same at all times, have to
    resolve delta over the rotation rate, and the influence of delta is of first order."""

    defaults = Defaults(
        coordinate="mode", quantity="mode",
        delta=1e-2, delta_start=0.3, limit=1.5, largest_limit=0.5 * np.pi,
        limit_name="tangent angle", excess=1e-3, delta_influence=2e-2, instants=400,
    )  # fmt: skip

    @property
    def grid(self) -> PanelGrid | None:
        """Fixed panels of a search; None where they adapt."""
        return None

    def tangent(self, s: np.ndarray, angles: Array) -> Array:
        """Theta ``(n_node, n_time)`` at arc lengths s ``(n_node, 1 or n_time)``; for CasADi, too,
        where there is a `grid`."""
        raise NotImplementedError

    def turning(self, s: np.ndarray, angles: Array, rates: Array) -> Array:
        """Rate of Theta; here of one that is linear in the shape coordinates."""
        return self.tangent(s, rates)

    def breaks(self, angles: np.ndarray) -> np.ndarray:
        """Arc lengths ``(n_break, n_time)`` at which Theta is not smooth."""
        return np.empty((0, angles.shape[1]))

    @property
    def bounded_angles(self) -> BoundedAngles:
        none = np.empty((0, self.n_joint))
        return BoundedAngles(none, (), fine=lambda angles: self.tangent(_FINE, angles))

    def on_panels(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, **settings: Any
    ) -> SmoothSolution:
        """The balance on panels; those adapt, unless settings of `solve_smooth` have a grid."""

        def at(t: np.ndarray) -> np.ndarray:  # the phase counts the shapes
            return t.astype(int)

        motion = Motion(
            lambda s, t: self.tangent(s, angles[:, at(t)]),
            lambda s, t: self.turning(s, angles[:, at(t)], rates[:, at(t)]),
            lambda t: self.breaks(angles[:, at(t)]),
        )
        t = np.arange(angles.shape[1])
        settings = {"quadrature_tolerance": _REPLAY_TOLERANCE} | settings
        return solve_smooth(motion, friction, t, delta, **settings)

    def sliding(
        self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array
    ) -> Sliding:
        if self.grid is None:
            slid = self.on_panels(friction, angles, rates, float(np.max(delta)), slide=z)
            return Sliding(slid.force, slid.centre, slid.power[None])
        nodes = self.grid.nodes
        theta, rate = self.tangent(nodes, angles), self.turning(nodes, angles, rates)
        now = curve(self.grid, theta, rate, TAIL, np.zeros((1, 1)))
        vs, vn = node_velocity(now, z)
        fs, fn = friction.density(vs, vn, delta)
        power = -namespace(angles, rates, z).sum_rows(now.weight * (fs * vs + fn * vn))
        return Sliding(resultant(now, fs, fn), resultant(now, vs, vn)[:2, :], power)

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
        how: Any = {"grid": self.grid, "start": None if self.grid is None else start}
        slid = self.on_panels(friction, angles, rates, delta, tolerance=tolerance, **how)
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
        slid = self.on_panels(friction, angles, rates, delta, slide=solved.z, grid=self.grid)
        return BalancedMotion(solved.z, slid.centre, slid.power, slid.bending_power)

    def _curve(self, angles: np.ndarray) -> Curve:
        zero = np.zeros((1, 1))
        return curve(_OUTLINE, self.tangent(_OUTLINE.nodes, angles), zero, TAIL, zero)

    def outline(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        now, width = self._curve(angles), _OUTLINE.widths
        return _OUTLINE.to_edges(width * now.cos, TAIL), _OUTLINE.to_edges(width * now.sin, TAIL)

    def centre(self, angles: np.ndarray) -> np.ndarray:
        now = self._curve(angles)
        x, y = now.arm_s * now.sin + now.arm_n * now.cos, now.arm_n * now.sin - now.arm_s * now.cos
        return np.stack([(now.weight * axis).sum(axis=0) for axis in (x, y)])


def panels_of(body: Body) -> int:
    """Panels of its quadrature, which a search doubles; 0 where there is none to refine."""
    return getattr(body, "panels", 0)


def on_panels(body: Body, panels: int) -> Body:
    return dataclasses.replace(body, panels=panels) if panels_of(body) else body  # type: ignore[type-var]


def accurate_motion(
    body: Body,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    start: np.ndarray | None,
) -> tuple[BalancedMotion, np.ndarray]:
    """The motion for a certificate, of smooth bodies on panels that adapt, and its residual."""
    if isinstance(body, SmoothBody):
        slid = body.on_panels(friction, angles, rates, delta).require()
        motion = BalancedMotion(slid.z, slid.centre, slid.power, slid.bending_power)
        return motion, slid.residual
    solved = body.solve(friction, angles, rates, delta, start=start).require()
    return body.motion(friction, angles, rates, delta, solved), solved.residual
