"""A smooth body on fixed panels as `mechanics.damped_newton` sees it: what the iteration evaluates
on a batch of instants."""

from __future__ import annotations

import numpy as np

from colloc.mechanics.damped_newton import Evaluated
from colloc.mechanics.law import Law
from colloc.smooth.curve import Curve, PanelGrid, curve, node_velocity, pulled_back, resultant


class PanelFields:
    """Tangent angle and its rate at the nodes ``(n_node, n_time)``, and the rate at the edges
    ``(n_panel + 1, n_time)``."""

    def __init__(
        self, panels: PanelGrid, angle: np.ndarray, rate: np.ndarray, edge_rate: np.ndarray
    ) -> None:
        self.panels, self.angle, self.rate, self.edge_rate = panels, angle, rate, edge_rate


class PanelBatch:
    """Instants on given panels that share a reference edge."""

    def __init__(
        self, fields: PanelFields, friction: Law, members: np.ndarray, reference: int
    ) -> None:
        self.fields, self.friction, self.members, self.reference = (
            fields,
            friction,
            members,
            reference,
        )
        self.panels = PanelGrid(fields.panels.edges[:, members], fields.panels.order)
        self.edge_rate = fields.edge_rate[:, members]
        anchor_rate = self.edge_rate[reference : reference + 1]
        self.curve = np.stack(
            curve(
                self.panels,
                fields.angle[:, members],
                fields.rate[:, members],
                reference,
                anchor_rate,
            )
        )

    def evaluate(self, select: np.ndarray, z: np.ndarray, delta: np.ndarray) -> Evaluated:
        """Nodes ``(9, n_node, n)``, curve, then velocity; net force and potential at z."""
        body, friction = Curve(*self.curve[:, :, select]), self.friction
        vs, vn = node_velocity(body, z)
        force = resultant(body, *friction.density(vs, vn, delta))
        potential = (
            (body.weight * friction.density_potential(vs, vn, delta)).sum(axis=0)
            if friction.associated
            else None
        )
        return np.stack([*body, vs, vn]), force, potential

    def matrix(self, nodes: np.ndarray, delta: np.ndarray, *, newton: bool) -> np.ndarray:
        vs, vn = nodes[7:]
        law = self.friction.density_jacobian if newton else self.friction.density_secant
        return pulled_back(Curve(*nodes[:7]), law(vs, vn, delta))

    def edge_velocity(self, z: np.ndarray) -> np.ndarray:
        """Velocity and rotation rate of every edge, ``(3, n_edge, n)``, in the axes of Theta."""
        f, a = self.fields, self.reference
        path = f.panels.edge_path(a)
        width, angle = f.panels.widths[:, self.members], f.angle[:, self.members]
        turning = width * (f.rate[:, self.members] - self.edge_rate[a] + z[2])
        return np.stack(
            [
                z[0] - path @ (turning * np.sin(angle)),
                z[1] + path @ (turning * np.cos(angle)),
                z[2] + self.edge_rate - self.edge_rate[a],
            ]
        )

    def panel_speed(self, z: np.ndarray) -> np.ndarray:
        """Largest speed of a node in each panel, ``(n_panel, n)``; infinite for panels of width
        zero."""
        vs, vn = node_velocity(Curve(*self.curve), z)
        speed = np.hypot(vs, vn).reshape(self.fields.panels.n, -1, z.shape[1]).max(axis=1)
        return np.where(
            np.diff(self.fields.panels.edges[:, self.members], axis=0) > 0, speed, np.inf
        )

    def largest_speed(self, z: np.ndarray) -> np.ndarray:
        """Largest speed of a node, ``(n,)``."""
        vs, vn = node_velocity(Curve(*self.curve), z)
        return np.hypot(vs, vn).max(axis=0)

    def slowest(self, z: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        anchor = np.argmin(self.panel_speed(z), axis=0)
        return anchor, np.take_along_axis(self.edge_velocity(z), anchor[None, None], 1)[:, 0]
