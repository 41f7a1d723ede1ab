"""The smooth body of a few modes as a `colloc.mechanics.bodies.Body`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from colloc.mechanics.bodies import ARROWS, IMPLICIT, BalancedMotion, BalanceSolution, Contact, Lifted, Pairs, Sliding, Usual
from colloc.mechanics.friction import Friction, force_density
from colloc.numerics.arrays import Array
from colloc.smooth.balance import solve_smooth
from colloc.smooth.curve import Curve, Panels, curve, node_velocity
from colloc.smooth.modal_balance import TAIL, modal_motion, modal_sliding, modal_slopes, solve_modal
from colloc.smooth.modes import Modes
from colloc.smooth.motion import Motion

_PLACES_A_MODE, _FINE_PLACES = 4, 401
"""Where on the body |Theta| is bounded, and where the certificate looks."""
_OUTLINE = 64
_SHOWN = 5
"""Places along the body whose speeds are drawn."""
_REPLAYED = 1e-8
"""Largest difference of a panel's force, torque or power from those of its halves, where a motion is replayed."""


class Shapes(Protocol):
    """A gait of the modes' amplitudes."""

    def angles(self, t: np.ndarray) -> np.ndarray: ...

    def rates(self, t: np.ndarray) -> np.ndarray: ...


class ModalBody(Modes):
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
    """

    formulations = (IMPLICIT,)
    """Forces on all nodes as variables would be too many for a full program."""
    coordinate, quantity = "mode", "mode"
    looks_for_all_velocities = False
    n_force = 0
    symmetries = ("none", "antipodal")
    symmetric = True
    usual = Usual(
        delta=1e-2, delta_start=0.3, limit=1.5, largest_limit=0.5 * np.pi, limit_name="tangent angle", excess=1e-3,
        delta_influence=2e-2,
    )  # fmt: skip
    """A smooth body has a point at rest at nearly every instant. So its panels have to resolve delta over the rotation rate,
    and the influence of delta is of first order and larger than for links. Below pi/2 the body advances along its mean
    direction and cannot cross itself."""
    hinges = slice(0, 0)
    far_pairs: Pairs = ()

    @property
    def n_joint(self) -> int:
        return self.modes

    def swapped(self, shape: np.ndarray) -> np.ndarray:
        """Theta(1 - s), in axes turned by half a turn."""
        return (self.parities * shape.T).T

    def describe(self) -> str:
        return f"smooth, {self.modes} {self.basis} modes of its tangent angle, {self.panels} panels"

    def sliding(self, friction: Friction, angles: Array, rates: Array, z: Array, delta: Array) -> Sliding:
        return modal_sliding(self, friction, angles, rates, z, delta)

    def with_forces(self, friction: Friction, angles: Array, rates: Array, z: Array, forces: Array, delta: Array) -> Lifted:
        raise NotImplementedError("a smooth body has no full program.")

    def forces(self, friction: Friction, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: float) -> np.ndarray:
        return np.empty((0, angles.shape[1]))

    def largest_forces(self, friction: Friction) -> np.ndarray:
        return np.empty((0, 1))

    def solve(
        self, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float, *, start: np.ndarray | None = None,
        tolerance: float = 1e-11,
    ) -> BalanceSolution:  # fmt: skip
        return solve_modal(self, friction, angles, rates, delta, start, tolerance)

    def motion(
        self, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float, solved: BalanceSolution
    ) -> BalancedMotion:
        return modal_motion(self, friction, angles, rates, delta, solved)

    def slopes(
        self, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float, solved: BalanceSolution
    ) -> np.ndarray:
        return modal_slopes(self, friction, angles, rates, delta, solved)

    def replayed(
        self, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float, start: np.ndarray | None
    ) -> tuple[BalancedMotion, np.ndarray]:
        """On panels that are halved until they resolve the solution, whatever the body's own."""

        def field(columns: np.ndarray):
            def values(s: np.ndarray, t: np.ndarray) -> np.ndarray:
                modes = self.modes_at(np.broadcast_to(s, (len(s), t.size)))
                return np.einsum("itm,mt->it", modes, columns[:, t.astype(int)])

            return values

        shapes = Motion(field(angles), field(rates))
        solved = solve_smooth(
            shapes, friction, np.arange(angles.shape[1]), delta, panels=self.panels, quadrature_tolerance=_REPLAYED
        ).require()
        return BalancedMotion(solved.z, solved.centre, solved.power, solved.bending_power), solved.residual

    def all_velocities(self, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float) -> None:
        """Not looked for."""

    def slowness(self, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float, z: np.ndarray) -> np.ndarray:
        """None: a point at rest moves along the body, and does not come and go."""
        return np.empty((0, angles.shape[1]))

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
        return np.abs(self.modes_at(np.linspace(0.0, 1.0, _FINE_PLACES)) @ angles).max(axis=0)

    def contacts(self, angles: Array, far: Sequence[tuple[int, int]] = ()) -> list[Contact]:
        """None: the bound on the tangent angle excludes them."""
        return []

    def crossing_depth(self, angles: np.ndarray, pairs: Sequence[tuple[int, int]] | None = None) -> np.ndarray:
        return np.zeros(angles.shape[1])

    def passing_depth(self, angles: np.ndarray, pairs: Sequence[tuple[int, int]] | None = None) -> float:
        return 0.0

    def _curve(self, panels: Panels, angles: np.ndarray, rates: np.ndarray) -> Curve:
        modes = self.modes_at(panels.nodes[:, 0])
        return curve(panels, modes @ angles, modes @ rates, TAIL, np.zeros((1, 1)))

    def outline(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        panels = Panels(np.linspace(0.0, 1.0, _OUTLINE + 1)[:, None], 3)
        theta = self.modes_at(panels.nodes[:, 0]) @ angles
        path = panels.edge_path(TAIL) * panels.widths[:, 0]
        return path @ np.cos(theta), path @ np.sin(theta)

    def centre(self, angles: np.ndarray) -> np.ndarray:
        x, y = self._points(self.grid, angles)
        return np.stack([(self.grid.weights * x).sum(axis=0), (self.grid.weights * y).sum(axis=0)])

    def _points(self, panels: Panels, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        theta, widths = self.modes_at(panels.nodes[:, 0]) @ angles, panels.widths
        return panels.integrate(widths * np.cos(theta), TAIL), panels.integrate(widths * np.sin(theta), TAIL)

    def rubbing(
        self, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float, z: np.ndarray, count: int = ARROWS
    ) -> tuple[np.ndarray, np.ndarray]:
        panels = Panels(np.linspace(0.0, 1.0, max(1, count // 3) + 1)[:, None], 3)
        now = self._curve(panels, angles, rates)
        fs, fn = force_density(*node_velocity(now, z), delta, friction)
        force = np.stack([fs * now.cos - fn * now.sin, fs * now.sin + fn * now.cos])
        return np.stack(self._points(panels, angles)), force

    def speeds(self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray) -> tuple[str, np.ndarray]:
        """At equal steps from tail to head."""
        panels = Panels(np.linspace(0.0, 1.0, _SHOWN + 1)[:, None], 5)
        return "part", np.hypot(*node_velocity(self._curve(panels, angles, rates), z))[2::5]

    @property
    def bending(self) -> np.ndarray:
        return np.diff(self.limited, axis=0)

    def seen_from_head(self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        raise NotImplementedError("gaits of a smooth body are never bilateral.")

    def gait_motion(self, gait: Shapes, antipodal: bool) -> Motion:
        """The motion Theta(s, t) of a gait of the modes' amplitudes."""

        def angle(s: np.ndarray, t: np.ndarray) -> np.ndarray:
            return np.einsum("itm,mt->it", self.modes_at(np.broadcast_to(s, (len(s), t.size))), gait.angles(t))

        def rate(s: np.ndarray, t: np.ndarray) -> np.ndarray:
            return np.einsum("itm,mt->it", self.modes_at(np.broadcast_to(s, (len(s), t.size))), gait.rates(t))

        return Motion(angle, rate, stages=(0.0, 0.5) if antipodal else (0.0, 1.0), antipodal=antipodal)
