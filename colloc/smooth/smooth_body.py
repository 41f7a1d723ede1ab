"""Smooth bodies by their tangent angle alone, as `colloc.mechanics.bodies.Body`."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from colloc.mechanics.bodies import (
    BalancedMotion,
    BalanceSolution,
    Body,
    BoundedAngles,
    Defaults,
    Sliding,
    Stretch,
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
from colloc.system.arguments import check_count, named_arguments
from colloc.system.errors import ProblemError

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


LEGENDRE, FOURIER = "legendre", "fourier"
_MODE_GRID = PanelGrid(np.linspace(0.0, 1.0, 41)[:, None], 8)
_PLACES_A_MODE = 4
"""Chebyshev places a mode where |Theta| is bounded, with all that is nearer to each than to others:
polynomials change fast towards the ends."""


@named_arguments
@dataclass(frozen=True)
class ModalBody(SmoothBody):
    """A smooth body of unit length with a few bending modes; its shape coordinates q are their
    amplitudes [rad].

    ``Theta(s, t) = sum_m q_m(t) phi_m(s)``, s from 0 to 1. Modes have zero mean, so that Theta is
    measured from the mean direction of the body.

    Parameters
    ----------
    modes : int
        Number of modes.
    basis : {"legendre", "fourier"}
        Legendre polynomials of degree 1, 2, ... on the body (the curvature is a polynomial), or
        sin(2 pi s), cos(2 pi s), sin(4 pi s), ...: an even number of them.
    panels, order : int
        Gauss panels on the body and nodes on each, for the optimisation; certificates use panels
        that adapt.

    Examples
    --------
    >>> from colloc import Friction, Harmonic, ModalBody, Problem
    >>> body = ModalBody(modes=6)
    >>> Problem("low-modes", body=body, friction=Friction(mu_t=100), gait=Harmonic(1,
    ...     "antipodal")).formulation
    'implicit velocity'
    """

    modes: int = 4
    basis: str = LEGENDRE
    panels: int = 8
    order: int = 6

    def __post_init__(self) -> None:
        if self.basis not in (LEGENDRE, FOURIER):
            raise ProblemError(f"basis must be {LEGENDRE!r} or {FOURIER!r}, not {self.basis!r}.")
        check_count(20, modes=self.modes)
        check_count(200, panels=self.panels)
        check_count(12, least=2, order=self.order)
        if self.basis == FOURIER and self.modes % 2:
            raise ProblemError(
                f"fourier modes come in pairs (sine and cosine); {self.modes} is odd."
            )

    @property
    def n_joint(self) -> int:
        return self.modes

    @property
    def grid(self) -> PanelGrid:
        return PanelGrid(np.linspace(0.0, 1.0, self.panels + 1)[:, None], self.order)

    def modes_at(self, s: np.ndarray) -> np.ndarray:
        """Modes at arc lengths s, ``(*s.shape, modes)``."""
        if self.basis == LEGENDRE:
            x = 2 * s - 1
            modes = [np.ones_like(x), x]
            for k in range(1, self.modes):
                modes.append(((2 * k + 1) * x * modes[k] - k * modes[k - 1]) / (k + 1))
            return np.stack(modes[1:], axis=-1)
        waves = [2 * np.pi * k * s for k in range(1, self.modes // 2 + 1)]
        return np.stack([wave(x) for x in waves for wave in (np.sin, np.cos)], axis=-1)

    @property
    def reversal(self) -> np.ndarray:
        """Theta(1 - s), in axes turned by half a turn: odd modes change their sign."""
        return np.diag(np.resize([-1.0, 1.0], self.modes))

    def describe(self) -> str:
        return f"smooth, {self.modes} {self.basis} modes of its tangent angle, {self.panels} panels"

    def tangent(self, s: np.ndarray, angles: Array) -> Array:
        if s.shape[1] == 1:
            return namespace(angles).matmul(self.modes_at(s[:, 0]), angles)
        return np.einsum("itm,mt->it", self.modes_at(s), angles)

    @property
    def bounded_angles(self) -> BoundedAngles:
        count = _PLACES_A_MODE * self.modes

        def chebyshev(k: np.ndarray) -> np.ndarray:
            return 0.5 - 0.5 * np.cos(np.clip(k * np.pi / count, 0.0, np.pi))

        places, ends = chebyshev(np.arange(count + 1.0)), chebyshev(np.arange(count + 2) - 0.5)
        return BoundedAngles(
            self.modes_at(places),
            tuple(f"tangent at {s:.3f}" for s in places),
            tuple(Stretch(*each, self.modes_at) for each in pairwise(ends.tolist())),
            super().bounded_angles.fine,
        )

    def _project(self, moments: np.ndarray) -> np.ndarray:
        """Amplitudes nearest in the mean square, from inner products with the modes."""
        values = self.modes_at(_MODE_GRID.nodes[:, 0])
        return np.linalg.solve(values.T @ (_MODE_GRID.weights * values), moments)

    def from_chain(self, lengths: np.ndarray) -> np.ndarray:
        """Nearest in the mean square to the chain's staircase of a tangent angle, whose mean
        direction, a rigid rotation, is left out."""
        n, ends = len(lengths), np.append(0.0, np.cumsum(lengths)) / np.sum(lengths)
        edges = np.interp(np.linspace(0, n, 4 * n + 1), np.arange(n + 1), ends)
        grid = PanelGrid(edges[:, None], 12)
        stairs = np.repeat(np.tril(np.ones((n, n - 1)), -1), 4 * grid.order, axis=0)
        return self._project((grid.weights * self.modes_at(grid.nodes[:, 0])).T @ stairs)

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        """``sin(2 pi t - 2 pi waves (s - 1/2))`` as nearly as the modes can."""
        s = _MODE_GRID.nodes[:, 0]
        project = self._project((_MODE_GRID.weights * self.modes_at(s)).T)
        phase = 2 * np.pi * waves * (s - 0.5)
        return -project @ np.sin(phase), project @ np.cos(phase)
