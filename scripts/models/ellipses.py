r"""The paper's three-parameter family of one-harmonic gaits: which are admissible, and grids of
them.

``angle_1 = A0 + A1 cos + B1 sin``, ``angle_2 = -A0 - A1 cos + B1 sin`` (paper, section V). A0, A1,
B1 >= 0 holds one of each class of gaits that have equal distance and work: half a period of phase
turns (A1, B1) into (-A1, -B1), the mirror image turns all signs, and time reversal (mu_b = mu_f)
turns B1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth
from colloc.system.errors import ProblemError

_CHECKED_PHASES = 400


def ellipse_angles(gaits: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles and rates, each ``(2, n_gait, n_time)``, of gaits ``(3, n_gait)`` (A0, A1, B1)
    at phases t."""
    A0, A1, B1 = np.asarray(gaits, dtype=float)[:, :, None]
    cos, sin = np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)
    along, across = A0 + A1 * cos, B1 * sin
    along_rate, across_rate = -2 * np.pi * A1 * sin, 2 * np.pi * B1 * cos
    return np.stack([along + across, across - along]), np.stack(
        [along_rate + across_rate, across_rate - along_rate]
    )


def contact_reach(gaits: np.ndarray) -> np.ndarray:
    """Largest value of ``min(2 angle_1 + angle_2, angle_1 + 2 angle_2)`` along each gait ``(3,
    n_gait)``, exactly.

    With equal links, links 1 and 3 cross iff it exceeds 2 pi. With c = A0 + A1 cos it is the
    maximum of ``3 B1 sin - |c|``: where c = 0, unless the maximum of ``3 B1 sin - c`` lies at c >
    0.
    """
    A0, A1, B1 = np.abs(np.asarray(gaits, dtype=float))
    radius = np.hypot(A1, 3 * B1)
    # c at the maximum of the smooth branch is A0 - A1^2/radius
    smooth = A0 * radius >= A1 * A1
    ratio = np.divide(A0, A1, out=np.ones_like(A0), where=~smooth)
    return np.where(smooth, radius - A0, 3 * B1 * np.sqrt(np.clip(1 - ratio * ratio, 0, None)))


def admissible(
    body: Chain, gaits: np.ndarray, joint_limit: float = np.pi, slack: float = 1e-9
) -> np.ndarray:
    """Whether gaits ``(3, n_gait)`` keep |angles| <= joint_limit and links apart: exact for three
    equal links.

    For unequal links crossing is looked for at 400 phases of half a period.
    """
    gaits = np.asarray(gaits, dtype=float)
    A0, A1, B1 = np.abs(gaits)
    inside = A0 + np.hypot(A1, B1) <= joint_limit + slack
    if len(set(body.lengths)) == 1:
        return inside & (contact_reach(gaits) <= 2 * np.pi + slack)
    for gait in np.flatnonzero(inside):
        angles, _ = ellipse_angles(gaits[:, gait : gait + 1], np.linspace(0, 0.5, _CHECKED_PHASES))
        inside[gait] = crossing_depth(body, angles[:, 0]).max() <= slack
    return inside


def largest_amplitude(body: Chain, A0: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Largest admissible ``hypot(A1, B1)`` for a centre A0 and direction ``angle = atan2(B1, A1)``,
    by bisection."""
    A0, angle = np.broadcast_arrays(np.asarray(A0, dtype=float), angle)
    low, high = np.zeros(A0.shape), np.full(A0.shape, np.pi)
    for _ in range(52):
        middle = 0.5 * (low + high)
        gaits = np.stack([A0, middle * np.cos(angle), middle * np.sin(angle)])
        inside = admissible(body, gaits.reshape(3, -1), slack=0.0).reshape(A0.shape)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low


@dataclass(frozen=True, eq=False)
class GaitGrid:
    """A rectangular grid of gaits, and the admissible ones on it."""

    A0: np.ndarray
    A1: np.ndarray
    B1: np.ndarray
    inside: np.ndarray

    @property
    def gaits(self) -> np.ndarray:
        """The admissible gaits ``(3, n_gait)``, in the order of ``inside`` flattened."""
        return np.stack(
            [a[self.inside] for a in np.meshgrid(self.A0, self.A1, self.B1, indexing="ij")]
        )

    def unflattened(self, values: np.ndarray) -> np.ndarray:
        """Values of the admissible gaits on the whole grid, NaN elsewhere."""
        result = np.full(self.inside.shape, np.nan)
        result[self.inside] = values
        return result


def gait_grid(body: Chain, step: float, *, A0: np.ndarray | None = None) -> GaitGrid:
    """Gaits with A0, A1, B1 >= 0 on a grid of the given step [rad]; `A0` replaces the first
    axis."""
    if not 0 < step <= 1:
        raise ProblemError(f"the step of a grid of gaits must lie in (0, 1], not {step!r}.")
    nodes = step * np.arange(int(np.pi / step + 1e-9) + 1)
    first = nodes if A0 is None else np.atleast_1d(np.asarray(A0, dtype=float))
    shape = (first.size, nodes.size, nodes.size)
    gaits = np.stack(np.meshgrid(first, nodes, nodes, indexing="ij")).reshape(3, -1)
    return GaitGrid(first, nodes, nodes, admissible(body, gaits).reshape(shape))
