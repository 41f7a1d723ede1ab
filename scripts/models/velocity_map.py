r"""The velocity map (the paper's "connection"): tail velocities of a three-link body, tabulated and
interpolated.

The balance is homogeneous of degree 1 in the joint rates as long as delta scales along with them.
So it is enough to tabulate tail velocities over *faces* of the square of rates: joint angles x
ratio of the rates, with one rate equal to 1 and the other, ``ratio``, in [-1, 1] (paper, section
V). With mu_b = mu_f the velocities change sign with the rates and two faces do; else there are
four. Elsewhere

    z(angles, rates) = |rate_k| z_face(angles, rate_other / rate_k),        |rate_k| the larger of the two.

Delta: the map holds ``delta``, relative to the larger rate. It returns the velocities at
regularisation speed ``delta |rate_k|``, which follows the gait's pace; a solve at a fixed
regularisation speed differs from it. The difference is of the order of delta where no link sticks
(`scripts/reproduce_paper.py` measures it).

Angles enter through sines and cosines, so the map is 2 pi-periodic in them and has no edges there;
in the ratio one node beyond either end serves the stencils. The velocities are continuous but have
kinks where a link starts to stick: one of these lies on ratio = 0 and is kept on nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from colloc.mechanics.chain import Chain
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.system.errors import ProblemError
from scripts.paper.parallel import parallel_map

STENCILS = {"linear": 2, "cubic": 4}
"""Nodes per axis of the tensor-product Lagrange interpolants."""


@dataclass(frozen=True, eq=False)
class VelocityMap:
    """Tail velocities of a three-link body over shapes and ratios of rates.

    `values` are (u, v, omega) at unit larger rate, ``(n_face, n_angle, n_angle, n_ratio + 2, 3)``,
    with a node more at either end of the ratios; faces: rate 1 = 1, rate 2 = 1, and where mu_b
    differs from mu_f the same with both rates negated. `delta` is relative to the larger rate.
    """

    body: Chain
    friction: Friction
    delta: float
    values: np.ndarray

    def __post_init__(self) -> None:
        faces = 2 if self.friction.reversible else 4
        shape = self.values.shape
        if self.body.n_link != 3:
            raise ProblemError(
                f"a velocity map needs a body of three links, not {self.body.n_link}."
            )
        if (
            len(shape) != 5
            or shape[0] != faces
            or shape[1] != shape[2]
            or shape[4] != 3
            or min(shape[1:4]) < 4
        ):
            raise ProblemError(
                f"values must have shape ({faces}, n_angle, n_angle, n_ratio + 2, 3), not {shape}."
            )
        # wrapped: one node before and two after, for the widest stencil
        wrapped = np.pad(self.values, ((0, 0), (1, 2), (1, 2), (0, 0), (0, 0)), mode="wrap")
        object.__setattr__(self, "_wrapped", np.ascontiguousarray(wrapped))

    @property
    def n_angle(self) -> int:
        return self.values.shape[1]

    @property
    def n_ratio(self) -> int:
        return self.values.shape[3] - 2

    @property
    def angles(self) -> np.ndarray:
        """Nodes of either angle."""
        return _angle_nodes(self.n_angle)

    @property
    def ratios(self) -> np.ndarray:
        """Nodes of the ratio in [-1, 1]."""
        return _ratio_nodes(self.n_ratio)[1:-1]

    def face(self, index: int) -> np.ndarray:
        """Nodal velocities of a face without the extra nodes, ``(n_angle, n_angle, n_ratio,
        3)``."""
        return self.values[index, :, :, 1:-1]

    def tail_velocity(
        self, angles: np.ndarray, rates: np.ndarray, *, method: str = "cubic"
    ) -> np.ndarray:
        """Tail velocities (u, v, omega) in the body frame, by scaling and interpolation."""
        if method not in STENCILS:
            raise ProblemError(f"method must be one of {', '.join(STENCILS)}, not {method!r}.")
        width = STENCILS[method]
        magnitude = np.abs(rates)
        second = magnitude[1] > magnitude[0]
        leading, other = np.where(second, rates[1], rates[0]), np.where(second, rates[0], rates[1])
        ratio = other / np.where(leading == 0.0, 1.0, leading)
        face = second.astype(np.intp)
        if self.friction.reversible:
            scale = leading
        else:
            scale, face = np.abs(leading), face + 2 * (leading < 0)

        i, wi = _stencil(
            (angles[0] + np.pi) * (self.n_angle / (2 * np.pi)), self.n_angle, width, periodic=True
        )
        j, wj = _stencil(
            (angles[1] + np.pi) * (self.n_angle / (2 * np.pi)), self.n_angle, width, periodic=True
        )
        k, wk = _stencil(
            (ratio + 1.0) * (0.5 * (self.n_ratio - 1)), self.n_ratio - 1, width, periodic=False
        )

        table: np.ndarray = self._wrapped  # type: ignore[attr-defined]
        _, n1, n2, n3, _ = table.shape
        flat = table.reshape(-1)
        # windows of `width` nodes along the ratio lie together in memory: one gather each
        windows = np.lib.stride_tricks.as_strided(
            flat,
            shape=(flat.size // 3 - width + 1, 3 * width),
            strides=(3 * flat.itemsize, flat.itemsize),
            writeable=False,
        )
        corner = ((face * n1 + i) * n2 + j) * n3 + k
        along_ratio = np.zeros((angles.shape[1], 3 * width))
        for a in range(width):
            for b in range(width):
                along_ratio += windows[corner + (a * n2 + b) * n3] * (wi[a] * wj[b])[:, None]
        result = np.zeros((3, angles.shape[1]))
        for c in range(width):
            result += wk[c] * along_ratio[:, 3 * c : 3 * c + 3].T
        return result * scale


def _angle_nodes(n_angle: int) -> np.ndarray:
    return 2 * np.pi * np.arange(n_angle) / n_angle - np.pi


def _ratio_nodes(n_ratio: int) -> np.ndarray:
    return 2.0 * np.arange(-1, n_ratio + 1) / (n_ratio - 1) - 1.0


def _stencil(
    x: np.ndarray, cells: int, width: int, *, periodic: bool
) -> tuple[np.ndarray, np.ndarray]:
    """First node of the stencils round coordinates x (in cells), in a table with one more node
    before x = 0; weights."""
    cell = np.floor(x).astype(np.intp)
    if not periodic:
        cell = np.clip(cell, 0, cells - 1)
    f = x - cell
    if periodic:
        cell %= cells
    if width == 2:
        return cell + 1, np.stack([1.0 - f, f])
    g, h, e = f + 1.0, 1.0 - f, 2.0 - f
    return cell, np.stack([-f * h * e / 6.0, g * h * e / 2.0, f * g * e / 2.0, -f * g * h / 6.0])


def face_rates(friction: Friction) -> list[tuple[int, int]]:
    """(leading joint, sign of the rates) of each face."""
    return [(0, 1), (1, 1)] if friction.reversible else [(0, 1), (1, 1), (0, -1), (1, -1)]


def _solve_row(
    task: tuple[int, int, int],
    *,
    body: Chain,
    friction: Friction,
    delta: float,
    n_angle: int,
    n_ratio: int,
) -> np.ndarray:
    """Velocities at all nodes with one first angle on one face, ``(n_angle, n_ratio + 2, 3)``."""
    leading, sign, row = task
    nodes, ratio = _angle_nodes(n_angle), _ratio_nodes(n_ratio)
    second, other = (a.ravel() for a in np.meshgrid(nodes, ratio, indexing="ij"))
    angles = np.stack([np.full_like(second, nodes[row]), second])
    rates = np.empty_like(angles)
    rates[leading], rates[1 - leading] = sign, sign * other
    # rates up to 1 + 2/(n_ratio - 1) at the extra nodes; delta stays that of leading rate 1
    solved = solve_balance(body, friction, angles, rates, delta, tolerance=1e-10).require()
    return solved.z.T.reshape(n_angle, n_ratio + 2, 3)


def velocity_map(
    body: Chain,
    friction: Friction,
    delta: float,
    *,
    n_angle: int = 64,
    n_ratio: int = 65,
    processes: int | None = 1,
    label: str = "",
) -> VelocityMap:
    """Tabulate the tail velocities of a three-link body by direct solves."""
    if body.n_link != 3:
        raise ProblemError(f"a velocity map needs a body of three links, not {body.n_link}.")
    if n_angle < 4 or n_ratio < 3 or n_ratio % 2 == 0:
        raise ProblemError(
            f"a velocity map needs n_angle >= 4 and an odd n_ratio >= 3, not {n_angle} and "
            f"{n_ratio}."
        )
    faces = face_rates(friction)
    tasks = [(leading, sign, row) for leading, sign in faces for row in range(n_angle)]
    solve = partial(
        _solve_row, body=body, friction=friction, delta=delta, n_angle=n_angle, n_ratio=n_ratio
    )
    rows = parallel_map(solve, tasks, processes=processes, label=label)
    values = np.stack(rows).reshape(len(faces), n_angle, n_angle, n_ratio + 2, 3)
    return VelocityMap(body, friction, delta, values)


@dataclass(frozen=True)
class MapError:
    """Differences of interpolated from directly solved tail velocities at random shapes and rates,
    larger rate 1."""

    largest: float
    rms: float
    median: float


def map_error(
    velocity_map: VelocityMap, *, method: str = "cubic", samples: int = 20_000, seed: int = 0
) -> MapError:
    """Compare the map with direct solves (tolerance 1e-11) at shapes and rates drawn uniformly from
    their ranges."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-np.pi, np.pi, (2, samples))
    rates = rng.uniform(-1.0, 1.0, (2, samples))
    rates /= np.abs(rates).max(axis=0)
    solved = solve_balance(
        velocity_map.body, velocity_map.friction, angles, rates, velocity_map.delta
    ).require()
    difference = np.abs(velocity_map.tail_velocity(angles, rates, method=method) - solved.z)
    difference[2] *= 0.5
    worst = difference.max(axis=0)
    return MapError(float(worst.max()), float(np.sqrt(np.mean(worst**2))), float(np.median(worst)))
