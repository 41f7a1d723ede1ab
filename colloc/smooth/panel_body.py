"""Smooth bodies of a few shape coordinates, solved on fixed panels."""

from __future__ import annotations

import dataclasses

import numpy as np

from colloc.mechanics.bodies import Body, Defaults, Sliding
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.smooth.balance import TAIL
from colloc.smooth.curve import PanelGrid, curve, mean_velocity, node_velocity, resultant
from colloc.smooth.smooth_body import SmoothBody


class PanelBody(SmoothBody):
    """A body whose tangent angle is a function of a few shape coordinates, for NumPy and CasADi, on
    panels that are the same at all times.

    It has a point at rest at nearly every time: panels have to resolve delta over the rotation
    rate, and the influence of delta is of first order. Below pi/2 it advances along its mean
    direction and cannot cross itself.
    """

    panels: int
    defaults = Defaults(
        coordinate="mode", quantity="mode",
        delta=1e-2, delta_start=0.3, limit=1.5, largest_limit=0.5 * np.pi,
        limit_name="tangent angle", excess=1e-3, delta_influence=2e-2, instants=400,
    )  # fmt: skip

    @property
    def grid(self) -> PanelGrid:
        raise NotImplementedError

    @property
    def _search_grid(self) -> PanelGrid:
        return self.grid

    def sliding(
        self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array
    ) -> Sliding:
        nodes = self.grid.nodes
        theta, rate = self.tangent(nodes, angles), self.turning(nodes, angles, rates)
        now = curve(self.grid, theta, rate, TAIL, np.zeros((1, 1)))
        vs, vn = node_velocity(now, z)
        fs, fn = friction.density(vs, vn, delta)
        power = -namespace(angles, rates, z).sum_rows(now.weight * (fs * vs + fn * vn))
        return Sliding(resultant(now, fs, fn), mean_velocity(now, vs, vn), power)


def panels_of(body: Body) -> int:
    """Panels of its quadrature, which a search doubles; 0 where there is none to refine."""
    return body.panels if isinstance(body, PanelBody) else 0


def on_panels(body: Body, panels: int) -> Body:
    return dataclasses.replace(body, panels=panels) if isinstance(body, PanelBody) else body  # type: ignore[type-var]
