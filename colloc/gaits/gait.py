"""Gaits: functions q(t) of the phase t in [0, 1]; and their symmetries, for which the net rotation
vanishes under any friction. With the exchange of tail and head ``(S q)_j = -q_(n+1-j)``:

- ``bilateral``: q(-t) = S q(t). The second half period repeats the displacement and work of the
  first (paper, appendix A).
- ``antipodal``: q(t + 1/2) = -q(t). The second half period is the mirror image of the first.
"""

import copy
from typing import Any

import numpy as np

from colloc.mechanics.densities import JointMap
from colloc.mechanics.inertia import GRAVITY

_DENSE = np.linspace(0.0, 1.0, 2001)
DELTA_START = 0.01
"""First delta of a search, relative to the shape speed [body lengths per radian of path]."""


class GaitFunction:
    """Base of gaits: ``gait(t)`` is joint angles and rates per period ``(n_joint, n_time)`` at
    phases t. One defines that call, or `angles` and `rates`."""

    n_joint: Any
    is_series = False  # a sum of functions of the phase
    theta: float | None = None  # orientation of the tail link at phase 0, on a slope [rad]
    log_period: float | None = None  # logarithm of the period [sqrt(length / gravity)]
    coordinate = "joint"  # name of a shape coordinate
    joint_map: JointMap | None = None
    rest: np.ndarray | float = 0.0  # part of the angles that scaling leaves as it is

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.angles(t), self.rates(t)

    def angles(self, t: np.ndarray) -> np.ndarray:
        return self(t)[0]

    def rates(self, t: np.ndarray) -> np.ndarray:
        return self(t)[1]

    def transform(self, matrix: np.ndarray) -> Any:
        """The gait with shapes multiplied by a matrix ``(m, n_joint)``."""
        raise NotImplementedError

    def lines(self) -> list[str]:
        """The gait as a formula or in words, a line each."""
        return []

    @property
    def length(self) -> float:
        """Length of the closed path [rad]."""
        return float(np.linalg.norm(np.diff(self.angles(_DENSE)), axis=0).sum())

    @property
    def motor_gait(self) -> Any:
        return self

    def scaled(self, factor: float) -> Any:
        """The gait with all angles but those at rest multiplied by a factor."""
        return self.transform(factor * np.eye(self.n_joint))

    @property
    def mirrored(self) -> Any:
        return self.scaled(-1.0)

    def grown(self, factor: float) -> Any:
        """The gait with shapes multiplied by a factor about their mean, if it can grow."""
        return self

    @property
    def corner_phases(self) -> np.ndarray:
        """Phases in (0, 1) where the rates jump."""
        return np.empty(0)

    @property
    def pointing(self) -> list[str]:
        """Lines on the period and the initial orientation, if the gait has them."""
        lines = []
        if self.log_period is not None:
            period = np.exp(self.log_period)
            lines.append(
                f"a cycle takes {period:.5g} sqrt(L/g), {period / np.sqrt(GRAVITY):.3g} s for "
                f"a body of 1 m: Froude number {period**-2:.4g}"
            )
        if self.theta is not None:
            turned = np.degrees(np.angle(np.exp(1j * self.theta)))
            lines.append(
                f"at t = 0 the tail link points {turned:+.2f}° off straight uphill (+: to the left)"
            )
        return lines

    def with_coordinate(self, coordinate: str) -> Any:
        gait = copy.copy(self)
        object.__setattr__(gait, "coordinate", coordinate)
        return gait

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def __repr__(self) -> str:
        plural = "s" * (self.n_joint > 1)
        return f"<{type(self).__name__} of {self.n_joint} {self.coordinate}{plural}>"


def delta_per_period(gait_class: Any, gait: GaitFunction, delta: float) -> float:
    """Convert delta in the units of a class to body lengths per period of a gait."""
    return delta * gait.length if gait_class.relative_delta else delta


NONE, BILATERAL, ANTIPODAL = SYMMETRIES = ("none", "bilateral", "antipodal")
_SAMPLES = 2000


def fraction(symmetry: str) -> float:
    """Part of the period that is solved; symmetry gives the rest."""
    return 1.0 if symmetry == NONE else 0.5


def solved_phases(symmetry: str, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Phases ``(n_time,)`` of the solved part that give phases t, and whether as images."""
    t = np.asarray(t, dtype=float)
    # whole periods are ends, not starts, so that a path that fails to close shows it
    phase = np.where((t > 0) & (t % 1.0 == 0), 1.0, t % 1.0)
    image = phase > fraction(symmetry)
    other = {NONE: phase, BILATERAL: 1.0 - phase, ANTIPODAL: phase - 0.5}[symmetry]
    return np.where(image, other, phase), image


def both_halves(symmetry: str, phases: np.ndarray) -> np.ndarray:
    """Phases in (0, 1) of phases ``(n,)`` of the solved part and of their images."""
    images = {NONE: phases, BILATERAL: 1 - phases, ANTIPODAL: 0.5 + phases}[symmetry]
    both = np.concatenate([phases, images])
    return np.unique(both[(both > 0) & (both < 1)])


def symmetric_samples(gait: Any, symmetry: str, count: int = _SAMPLES) -> np.ndarray:
    """Sample the solved part of the symmetric gait nearest to a gait, ``(n_joint, count + 1)``.

    Phase 0 moves to the phase about which the gait is closest to the symmetry, if not there.
    """
    if symmetry == NONE:
        return gait.angles(np.linspace(0.0, 1.0, count + 1))
    n = 2 * count
    t = np.arange(n) / n
    angles = gait.angles(t)
    if symmetry == ANTIPODAL:
        angles = 0.5 * (angles - np.roll(angles, count, axis=1))
        return np.concatenate([angles[:, :count], -angles[:, :1]], axis=1)
    exchanged = -angles[::-1]
    # asymmetry about phase k/(2n): sum over i of |q(i) - S q(k - i)|^2, up to a constant minus
    # twice a circular convolution
    spectrum = np.fft.rfft(angles, axis=1) * np.fft.rfft(exchanged, axis=1)
    match = np.fft.irfft(spectrum, n, axis=1).sum(axis=0)
    shift = 0 if match[0] > match.max() - 1e-9 * n else int(np.argmax(match))
    shift += shift % 2 * (1 if match[(shift + 1) % n] > match[shift - 1] else -1)
    angles = np.roll(angles, -(shift // 2), axis=1)
    angles = 0.5 * (angles - np.roll(angles[::-1, ::-1], 1, axis=1))
    return angles[:, : count + 1]
