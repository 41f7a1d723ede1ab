"""A smooth body that is solved on fixed panels, as a `colloc.mechanics.bodies.Body`: what such
bodies answer alike."""

from __future__ import annotations

import dataclasses
from typing import Self

import numpy as np

from colloc.mechanics.bodies import Usual
from colloc.numerics.arrays import Array
from colloc.smooth.curve import PanelGrid
from colloc.smooth.panel_balance import panel_motion, panel_sliding, panel_slopes, solved_on_panels
from colloc.smooth.smooth_body import SmoothBody


class PanelBody(SmoothBody):
    """A body with a few shape coordinates; it answers `colloc.smooth.panel_balance.PanelShapes`."""

    symmetries = ("none", "antipodal")
    usual = Usual(
        delta=1e-2, delta_start=0.3, limit=1.5, largest_limit=0.5 * np.pi,
        limit_name="tangent angle", excess=1e-3,
        delta_influence=2e-2, instants=400,
    )  # fmt: skip
    """A smooth body has a point at rest at nearly every instant. So its panels have to resolve
    delta over the rotation rate, and the influence of delta is of first order and larger than for
    links. Below pi/2 the body advances along its mean direction and cannot cross itself."""

    def on_panels(self, panels: int) -> Self:
        return dataclasses.replace(self, panels=panels)  # type: ignore[type-var]

    @property
    def grid(self) -> PanelGrid:
        """The panels, the same at all times."""
        raise NotImplementedError

    def angle(self, s: np.ndarray, q: Array) -> Array:
        """Theta at fixed places."""
        raise NotImplementedError

    def angle_rate(self, s: np.ndarray, q: Array, rates: Array) -> Array:
        """Its rate."""
        raise NotImplementedError

    def angle_slopes(
        self, s: np.ndarray, q: np.ndarray, rates: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of both."""
        raise NotImplementedError

    sliding, solve, motion, slopes = panel_sliding, solved_on_panels, panel_motion, panel_slopes

    @property
    def bending(self) -> np.ndarray:
        return np.diff(self.limited, axis=0)
