"""The smooth body of a few modes: ``Theta(s, t) = sum_m q_m(t) phi_m(s)``, s from 0 to 1.

Modes have zero mean, so that Theta is measured from the mean direction of the body.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from colloc.mechanics.bodies import BoundedAngles, Stretch
from colloc.numerics.arrays import Array, namespace
from colloc.smooth.balance import PanelGrid
from colloc.smooth.smooth_body import SmoothBody
from colloc.system.arguments import check_count, named_arguments
from colloc.system.errors import ProblemError

LEGENDRE, FOURIER = "legendre", "fourier"
_FINE = PanelGrid(np.linspace(0.0, 1.0, 41)[:, None], 8)
_PLACES_A_MODE = 4
"""Chebyshev places a mode where |Theta| is bounded, with all that is nearer to each than to others:
polynomials change fast towards the ends."""


@named_arguments
@dataclass(frozen=True)
class ModalBody(SmoothBody):
    """A smooth body of unit length with a few bending modes; its shape coordinates are their
    amplitudes [rad].

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
        values = self.modes_at(_FINE.nodes[:, 0])
        return np.linalg.solve(values.T @ (_FINE.weights * values), moments)

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
        s = _FINE.nodes[:, 0]
        project = self._project((_FINE.weights * self.modes_at(s)).T)
        phase = 2 * np.pi * waves * (s - 0.5)
        return -project @ np.sin(phase), project @ np.cos(phase)
