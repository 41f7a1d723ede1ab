"""A relaxed gait: at each instant the joints move in a mixture of a few directions, in fractions of no time each.

Work and distance are homogeneous of degree 1 in the joint rates, but not linear. So it may pay to chatter: to run through a few
directions of rates again and again at nearly the same shape. In the limit of ever shorter turns the shape drifts with the mean
of the directions, while the body moves, and pays, as the mean of what it does in each (a relaxed control; Sager's outer
convexification). Limits are reached by no gait, but as nearly as one likes: `Mixture.realised` repeats the directions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from colloc.gaits.gait import DELTA_START, ClassOfGaits
from colloc.gaits.harmonic import Harmonic, harmonics_within
from colloc.gaits.polygon import Corners
from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, BOTH, NONE, SYMMETRIES
from colloc.system.arguments import is_whole, named_arguments
from colloc.system.errors import ProblemError

_IDLE = 1e-9
"""Part of the gait's length below which a direction's time counts as none."""
_PIECES, _PARAMETERS = 240, 400
"""Pieces over a period, and at most so many parameters of the part that is solved: as many as a dense search can take."""


@named_arguments
@dataclass(frozen=True, eq=False)
class Mixture:
    """A relaxed gait, piece by piece: on each the mixture is constant, so that the mean shape moves on a straight line.

    Parameters
    ----------
    durations : (n_piece, n_direction)
        Time spent in every direction at unit shape speed, so path travelled in it [rad].
    directions : (n_piece, n_direction, n_joint)
        Unit vectors of joint rates.
    start : (n_joint,)
        Joint angles at the begin [rad].
    symmetry : {"none", "bilateral", "antipodal", "both"}
        The pieces are those of the part that it leaves; "both" leaves a quarter of the period.
    """

    durations: np.ndarray
    directions: np.ndarray
    start: np.ndarray
    symmetry: str = NONE

    def __post_init__(self) -> None:
        for name in ("durations", "directions", "start"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=float))
        n_piece, n_direction = self.durations.shape if self.durations.ndim == 2 else (0, 0)
        if not n_piece or self.directions.shape != (n_piece, n_direction, self.start.size):
            shapes = f"{self.durations.shape}, {self.directions.shape}, {self.start.shape}"
            raise ProblemError(f"mixture.durations, directions and start disagree: {shapes}.")
        if not all(np.isfinite(a).all() for a in (self.durations, self.directions, self.start)):
            raise ProblemError("mixture: all numbers must be finite.")
        if (self.durations < 0).any() or not self.durations.sum() > 0:
            raise ProblemError("mixture.durations must not be negative, nor all zero.")
        if np.abs(np.linalg.norm(self.directions, axis=2) - 1).max() > 1e-9:
            raise ProblemError("mixture.directions must be unit vectors.")
        if self.symmetry not in (*SYMMETRIES, BOTH):
            raise ProblemError(f"mixture.symmetry must be one of {', '.join((*SYMMETRIES, BOTH))}, not {self.symmetry!r}.")

    theta = None

    @property
    def n_joint(self) -> int:
        return self.start.size

    @property
    def mirrored(self) -> Mixture:
        """Its mirror image: all angles are negative."""
        return replace(self, directions=-self.directions, start=-self.start)

    @cached_property
    def shapes(self) -> np.ndarray:
        """Joint angles where pieces meet, ``(n_joint, n_piece + 1)``."""
        steps = np.einsum("nk,nkj->jn", self.durations, self.directions)
        return self.start[:, None] + np.concatenate([np.zeros((self.n_joint, 1)), np.cumsum(steps, axis=1)], axis=1)

    @property
    def shares(self) -> np.ndarray:
        """Of the time of every piece, that its directions take ``(n_piece, n_direction)``."""
        return self.durations / np.maximum(self.durations.sum(axis=1, keepdims=True), 1e-300)

    @cached_property
    def whole(self) -> Mixture:
        """The whole period without symmetry. Images in a mirror or in reversed time come after what they are images of."""
        if self.symmetry == NONE:
            return self
        if self.symmetry == ANTIPODAL:
            return Mixture(np.tile(self.durations, (2, 1)), np.concatenate([self.directions, -self.directions]), self.start)
        half = self
        if self.symmetry == BOTH:
            # q(1/2 - t) = q(t) with its joints in reversed order
            half = self._and_image(-1.0, BILATERAL)
        return half._and_image(1.0, NONE)

    def _and_image(self, sign: float, symmetry: str) -> Mixture:
        """Followed by itself backwards, the joints in reversed order; their rates times `sign`."""
        return Mixture(
            np.concatenate([self.durations, self.durations[::-1]]),
            np.concatenate([self.directions, sign * self.directions[::-1, :, ::-1]]),
            self.start,
            symmetry,
        )

    @cached_property
    def phases(self) -> np.ndarray:
        """Phases where pieces of the whole period meet, from 0 to 1: time is the path travelled at unit shape speed."""
        along = np.concatenate([[0.0], np.cumsum(self.whole.durations.sum(axis=1))])
        return along / along[-1]

    @property
    def corner_phases(self) -> np.ndarray:
        """Phases in (0, 1) where the mixture jumps."""
        phases = np.unique(self.phases)
        return phases[(phases > _IDLE) & (phases < 1 - _IDLE)]

    @property
    def length(self) -> float:
        """Path that the joints travel over the period, all directions counted [rad]; not that of the mean shape."""
        return float(self.whole.durations.sum())

    @property
    def extent(self) -> float:
        """Largest range of a mean joint angle over the period [rad]; 0 for loops at one shape."""
        return float(np.ptp(self.whole.shapes, axis=1).max())

    @property
    def delta_unit(self) -> float:
        """What delta at unit shape speed is multiplied by to get delta per period."""
        return self.length

    def _piece(self, t: np.ndarray) -> np.ndarray:
        pieces = np.searchsorted(self.phases, t, side="right") - 1
        return np.clip(pieces, 0, self.phases.size - 2)

    def angles(self, t: np.ndarray) -> np.ndarray:
        """Mean joint angles ``(n_joint, n_time)`` at phases t in [0, 1]."""
        return np.stack([np.interp(t, self.phases, row) for row in self.whole.shapes])

    def mixed_rates(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rates per period in each direction ``(n_direction, n_joint, n_time)``, and its share ``(n_direction, n_time)``."""
        whole, k = self.whole, self._piece(np.asarray(t))
        return self.length * whole.directions[k].transpose(1, 2, 0), whole.shares[k].T

    def rates(self, t: np.ndarray) -> np.ndarray:
        """Rates of the mean shape ``(n_joint, n_time)`` per period."""
        rates, shares = self.mixed_rates(t)
        return np.einsum("kjt,kt->jt", rates, shares)

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean joint angles, rates in each direction and their shares of the time: what a replay is made from."""
        return self.angles(t), *self.mixed_rates(t)

    def split(self, pieces: int) -> Mixture:
        """The same gait in more pieces, by halving, and so on, those that take longest; pieces that take no time go."""
        time = self.durations.sum(axis=1)
        kept = time > _IDLE * time.sum()
        durations, directions, time = self.durations[kept], self.directions[kept], time[kept]
        parts = np.ones(time.size, dtype=int)
        for _ in range(pieces - time.size):
            parts[np.argmax(time / parts)] += 1
        durations = np.repeat(durations / parts[:, None], parts, axis=0)
        return Mixture(durations, np.repeat(directions, parts, axis=0), self.start, self.symmetry)

    @property
    def mean(self) -> Mixture:
        """The gait that follows the mean shapes in one direction a piece: what would be left without loops."""
        steps = np.diff(self.shapes).T
        size = np.linalg.norm(steps, axis=1)
        moves = size > _IDLE * size.sum()
        return Mixture(size[moves, None], (steps[moves] / size[moves, None])[:, None], self.start, self.symmetry)

    def unmixed(self, repeats: int = 1, sense: int = 1) -> Mixture:
        """The directions of every piece one after the other, `repeats` times: pieces of one direction; see `realised`."""
        if not is_whole(repeats, 1):
            raise ProblemError(f"a mixture is realised by a whole number of repeats, at least 1, not {repeats!r}.")
        least = _IDLE * self.durations.sum()
        sides: list[np.ndarray] = []
        for durations, directions in zip(self.durations, self.directions, strict=True):
            used = durations > least
            steps = durations[used, None] * directions[used] / repeats
            if len(steps) == 1:
                sides += [repeats * steps]
            elif len(steps):
                sides += [_turned(steps, sense)] * repeats
        steps = np.concatenate(sides)
        size = np.linalg.norm(steps, axis=1, keepdims=True)
        return Mixture(size, (steps / size)[:, None], self.start, self.symmetry)

    def realised(self, repeats: int = 1, sense: int = 1) -> Corners:
        """The polygon that runs through the directions of every piece `repeats` times.

        What it loses to the relaxed gait falls like 1/repeats. Directions follow each other by angle, which makes loops; those
        of more than two joints by angle in the plane in which they differ most.

        Parameters
        ----------
        repeats : int
        sense : {1, -1}
            Counter-clockwise loops, or clockwise ones; what they lose is not the same.
        """
        vertices = self.unmixed(repeats, sense).shapes
        if self.symmetry == BOTH:
            vertices = np.concatenate([vertices, vertices[::-1, -2::-1]], axis=1)
        return Corners.through(vertices, BILATERAL if self.symmetry == BOTH else self.symmetry)


@named_arguments
@dataclass(frozen=True)
class Relaxed(ClassOfGaits):
    """Relaxed gaits: at each instant a mixture of a few directions of joint rates, constant on every piece of the period.

    Parameters
    ----------
    directions : int
        At most so many are mixed; ``n_joint + 2`` suffice for any mixture (Caratheodory). One makes a polygon.
    symmetry : {"none", "bilateral", "antipodal", "both"}
        "both" is bilateral and antipodal: q(-t) = S q(t) and q(t + 1/2) = -q(t), with a quarter of the period to solve.

    Examples
    --------
    >>> Relaxed(directions=3, symmetry="both").fraction
    0.25
    """

    directions: int = 3
    symmetry: str = BOTH

    symmetries = (*SYMMETRIES, BOTH)
    unit_speed = True
    mixes = True
    delta_start = DELTA_START

    def __post_init__(self) -> None:
        if not is_whole(self.directions, 1, 9):
            raise ProblemError(f"gait.directions must be a whole number from 1 to 9, not {self.directions!r}.")
        self._check_symmetry()

    def intervals(self, n_joint: int) -> int:
        """Pieces of the part that is solved."""
        each = self.directions * (2 if n_joint == 2 else 1 + n_joint)
        return max(8, round(min(self.fraction * _PIECES, _PARAMETERS / each)))

    def describe(self) -> str:
        return f"relaxed gaits that mix {self.directions} directions, symmetry {self.symmetry}"

    def series(self, harmonics: int) -> Harmonic:
        """Fourier series in arc length that stand for the mean shapes of its gaits."""
        return harmonics_within(harmonics, self.finite.symmetry)

    # finite gaits that come near: polygons
    @property
    def finite(self) -> Relaxed:
        """The class in the symmetry of its finite gaits: one that has both is kept as a bilateral half."""
        return replace(self, symmetry=BILATERAL) if self.symmetry == BOTH else self

    def size(self, n_joint: int, n_interval: int) -> int:
        """Number of parameters of a polygon of so many straight pieces: its vertices."""
        return n_joint * (n_interval + 1)

    def member(self, parameters: np.ndarray, n_joint: int, edges: np.ndarray) -> Corners:
        """The polygon of a parameter vector; its phases follow from its sides."""
        return Corners.through(parameters.reshape(-1, n_joint).T, self.finite.symmetry)


def _turned(steps: np.ndarray, sense: int) -> np.ndarray:
    """Steps ``(n, n_joint)`` in the order of their angle in the plane in which they differ most."""
    plane = np.linalg.svd(steps - steps.mean(axis=0))[2][:2] if steps.shape[1] > 2 else np.eye(2)
    return steps[np.argsort(sense * np.arctan2(*(plane[::-1] @ steps.T)))]
