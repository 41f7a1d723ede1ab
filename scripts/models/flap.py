"""The paper's figure 4: a straight body with two flaps that open and close like a pair of wings.

The flaps are hinged at the body's left end (its tail) and turn in opposite directions, so the net
force is along the body and it can only slide along itself. Its friction is then +-mu per unit
length or none, and a shorter pair of flaps cannot balance any of these: kinetic friction has no
solution. It is a tree, not a chain: both flaps hang on link 0.

For one velocity V of the body, with flap force f along it at V = 0 and body length l, the
delta-regularised balance ``l V/sqrt(V^2 + delta^2) = f`` gives ``V/delta -> f/sqrt(l^2 - f^2)`` as
delta -> 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.mechanics.balance import instant, net_force
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from scripts.models.static_friction import KineticGap

_PARENT_OF_FLAPS = 0


@dataclass(frozen=True)
class FlapBody(Chain):
    """A straight body, link 0, with flaps 1 and 2 hinged at its tail; "joint angles" are the flaps'
    angles from it.

    Everything a `Chain` computes follows from which joints turn a link and which links lead to its
    midpoint, so only these two tables differ.
    """

    lengths: tuple[float, ...] = (0.8, 0.1, 0.1)

    in_series = False

    def _joint_sum(self, reference: int | None) -> np.ndarray:
        full = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        return full if reference is None else full - full[reference]

    def weighted_path(self, reference: int | None) -> np.ndarray:
        full = 0.5 * np.eye(3)
        return (full if reference is None else full - full[reference]) * self.lengths

    def joints(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ends in drawing order, ``(4, n_time)``: tip of flap 1, hinge, tip of flap 2, head of the
        body."""
        first, second = (self.lengths[1 + k] * np.exp(1j * angles[k]) for k in range(2))
        tips = np.stack([first, 0 * first, second, 0 * first + self.lengths[0]])
        return tips.real, tips.imag


def flap_motion(opening: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles and rates ``(2, n_time)`` of mirror-image flaps opened by `opening` [rad]."""
    opening, rate = np.atleast_1d(opening), np.atleast_1d(rate)
    return np.stack([opening, -opening]), np.stack([rate, -rate])


def axial_force(
    body: FlapBody, friction: Friction, opening: float, rate: float, V: np.ndarray, delta: float
) -> np.ndarray:
    """Net friction along the body, ``(n,)``, when it slides along itself with velocities V; the
    others vanish."""
    V = np.asarray(V, dtype=float)
    angles, rates = flap_motion(np.full(V.size, opening), np.full(V.size, rate))
    z = np.zeros((3, V.size))
    z[0] = V
    now = instant(body, friction, angles, rates, z, delta, _PARENT_OF_FLAPS)
    return net_force(now.posture, now.force)[0]


def flap_gap(body: FlapBody, friction: Friction, opening: float, rate: float) -> KineticGap:
    """Unbalanced axial force under kinetic friction just below rest, at rest and just above."""
    below, rest, above = axial_force(
        body, friction, opening, rate, np.array([-1e-9, 0.0, 1e-9]), 1e-18
    )
    return KineticGap(float(below), float(rest), float(above))
