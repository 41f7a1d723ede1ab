"""Joint angles as finite Fourier series of the phase; among them serpenoid gaits, waves of bending
that travel along a chain (S. Hirose, Biologically Inspired Robots, 1993),

    q_j(t) = offset + sum_k  a_k cos k psi_j + b_k sin k psi_j,      a_1 = 0,

    psi_j = 2 pi t - lag (j - (n + 1) / 2).

These are a map into Fourier series, linear in all parameters but the lag; in the full program it is
a constraint on the Fourier coefficients. And the class without parameters, of a body whose motion
is prescribed: its shape coordinates are the phase as a point on a circle, ``(cos 2 pi t, sin 2 pi
t)``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import product
from typing import Any

import numpy as np

from colloc.gaits.gait import (
    ANTIPODAL,
    BILATERAL,
    NONE,
    GaitFunction,
    both_halves,
    symmetric_samples,
)
from colloc.gaits.linear import LinearClass, largest_coordinate
from colloc.mechanics.bodies import Body
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import (
    STATED_IF_SET,
    check_choice,
    check_count,
    check_finite,
    finite_array,
    named_arguments,
)
from colloc.system.errors import ProblemError

SAME_START = 1e-9
"""Sine of the first joint's first harmonic up to which a gait starts in the phase of its class."""


@named_arguments
@dataclass(frozen=True, eq=False, repr=False)
class Fourier(GaitFunction):
    """Joint angles ``mean + sum_k cos[:, k-1] cos(2 pi k t) + sin[:, k-1] sin(2 pi k t)``.

    Parameters
    ----------
    mean : (n_joint,)
    cos, sin : (n_joint, n_harmonic)
    theta : float, optional
        On a slope: angle of the tail link at phase 0 from straight uphill, positive to the left
        [rad].
    log_period : float, optional
        At a free pace: logarithm of the period [sqrt(length / gravity)].

    Examples
    --------
    >>> from colloc import Fourier
    >>> wave = Fourier(mean=[0, 0, 0], cos=[[0.6], [0.0], [-0.6]], sin=[[0.2], [0.6], [0.2]])
    >>> wave.angles([0.0, 0.25]).round(6).tolist()
    [[0.6, 0.2], [0.0, 0.6], [-0.6, 0.2]]
    """

    mean: np.ndarray
    cos: np.ndarray
    sin: np.ndarray
    theta: float | None = field(default=None, metadata=STATED_IF_SET, kw_only=True)
    log_period: float | None = field(default=None, metadata=STATED_IF_SET, kw_only=True)

    is_series = True

    def __post_init__(self) -> None:
        for name, ndim in (("mean", 1), ("cos", 2), ("sin", 2)):
            object.__setattr__(self, name, finite_array(f"guess.{name}", getattr(self, name), ndim))
        if self.cos.shape != self.sin.shape or len(self.cos) != len(self.mean):
            raise ProblemError(
                f"guess.mean, cos and sin disagree in shape: {self.mean.shape}, {self.cos.shape}, "
                f"{self.sin.shape}."
            )

    @classmethod
    def from_table(cls, table: np.ndarray, *more: Any) -> Any:
        return cls(table[:, 0], table[:, 1::2], table[:, 2::2], *more)

    @property
    def table(self) -> np.ndarray:
        """Coefficients (mean, cos 1, sin 1, cos 2, ...), a row a joint."""
        table = np.empty((self.n_joint, 2 * self.n_harmonic + 1))
        table[:, 0], table[:, 1::2], table[:, 2::2] = self.mean, self.cos, self.sin
        return table

    @property
    def n_joint(self) -> int:
        return len(self.mean)

    @property
    def n_harmonic(self) -> int:
        return self.cos.shape[1]

    @property
    def shape_speed(self) -> float:
        """Root-mean-square shape speed [rad per radian of phase]."""
        k = np.arange(1, self.n_harmonic + 1)
        return float(np.sqrt(0.5 * np.sum(k**2 * (self.cos**2 + self.sin**2))))

    @cached_property
    def _terms(self) -> tuple[np.ndarray, np.ndarray]:
        k = 2 * np.pi * np.arange(1, self.n_harmonic + 1)
        return k[:, None], np.block([[self.cos, self.sin], [k * self.sin, -k * self.cos]])

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        k, terms = self._terms
        now = k * np.asarray(t, dtype=float)
        both = terms @ np.concatenate([np.cos(now), np.sin(now)])
        return self.mean[:, None] + both[: self.n_joint], both[self.n_joint :]

    def lines(self) -> list[str]:
        lines = []
        for j, row in enumerate(self.table):
            mean, *waves = (f"{round(float(a), 4) + 0.0:+.4f}" for a in row)  # no minus zero
            terms = [mean]
            for k, (cos, sin) in enumerate(zip(waves[::2], waves[1::2], strict=True), 1):
                angle = "2πt" if k == 1 else f"{2 * k}πt"
                terms.append(f"{cos} cos {angle} {sin} sin {angle}")
            lines.append(f"{self.coordinate} {j + 1}: {' '.join(terms)}")
        return [*lines, *self.pointing]

    def transform(self, matrix: np.ndarray) -> Fourier:
        return Fourier(*(matrix @ part for part in (self.mean, self.cos, self.sin)))

    def grown(self, factor: float) -> Fourier:
        return Fourier(self.mean, factor * self.cos, factor * self.sin)

    def resize(self, n_harmonic: int) -> Fourier:
        """The gait with harmonics added (zero) or cut."""
        if type(self) is Fourier and n_harmonic == self.n_harmonic:
            return self
        waves, both = np.zeros((2, self.n_joint, n_harmonic)), min(n_harmonic, self.n_harmonic)
        waves[..., :both] = self.cos[:, :both], self.sin[:, :both]
        return Fourier(self.mean, *waves)


def ellipse(A0: float, A1: float, B1: float) -> Fourier:
    """The paper's one-harmonic gait of a three-link body (section V), symmetric about angle 1 =
    -angle 2.

    Parameters
    ----------
    A0, A1, B1 : float
        ``angle 1 = A0 + A1 cos 2πt + B1 sin 2πt`` and ``angle 2 = -A0 - A1 cos 2πt + B1 sin 2πt``
        [rad].

    Examples
    --------
    >>> from colloc import ellipse
    >>> ellipse(A0=0.3, A1=1.0, B1=0.5).angles([0.0])
    array([[ 1.3],
           [-1.3]])
    """
    check_finite(A0=A0, A1=A1, B1=B1)
    return Fourier(np.array([A0, -A0]), np.array([[A1], [-A1]]), np.array([[B1], [B1]]))


@named_arguments
@dataclass(frozen=True)
class Harmonic(LinearClass):
    """The class of gaits with `harmonics` harmonics and a given symmetry.

    Parameters
    ----------
    harmonics : int
        The highest; antipodal gaits have odd ones alone, so that theirs is odd.
    symmetry : {"none", "bilateral", "antipodal"}

    Raises
    ------
    ProblemError
        If the symmetry leaves gaits nothing of the highest harmonic.

    Examples
    --------
    >>> from colloc import Harmonic
    >>> Harmonic(harmonics=2, symmetry="bilateral").describe()
    '2 harmonics, symmetry bilateral'
    """

    harmonics: int = 1
    symmetry: str = "none"

    def __post_init__(self) -> None:
        k = self.harmonics
        check_count(64, **{"gait.harmonics": k})
        self._check_symmetry()
        if self.symmetry == ANTIPODAL and k % 2 == 0:
            raise ProblemError(
                f"antipodal gaits have odd harmonics only, as q(t + 1/2) = -q(t): {k} would be "
                f"the same class as {k - 1}; ask for {k - 1} or {k + 1}."
            )

    def series(self, harmonics: int) -> Harmonic:
        return self

    def describe(self) -> str:
        plural = "s" * (self.harmonics > 1)
        return f"{self.harmonics} harmonic{plural}, symmetry {self.symmetry}"

    def functions(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        # 1, cos 1, sin 1, cos 2, ...
        k = 2 * np.pi * np.arange(1, self.harmonics + 1)[:, None]
        cos, sin = np.cos(k * t), np.sin(k * t)
        pairs = ((cos, sin), (-sin, cos), (-cos, -sin))
        waves = np.empty((2 * self.harmonics + 1, t.size))
        waves[0] = derivative == 0
        waves[1::2], waves[2::2] = (k**derivative * wave for wave in pairs[derivative])
        return waves

    @property
    def instants(self) -> np.ndarray:
        n = 4 * self.harmonics + 4  # means of products are exact
        return np.arange(n) / n

    def _basis(self, n_joint: int) -> np.ndarray:
        return _series_basis(self.harmonics, self.symmetry, n_joint)

    def member(self, parameters: np.ndarray, n_joint: int) -> Fourier:
        with np.errstate(over="ignore", invalid="ignore"):  # a series refuses what is not finite
            table = (self._basis(n_joint) @ parameters).reshape(n_joint, -1)
        return Fourier.from_table(table)

    def parameters(self, gait: Fourier) -> np.ndarray:
        """Parameters of the nearest member, after shifting the start phase if that is free."""
        gait = gait.resize(self.harmonics)
        if self.symmetry != BILATERAL:
            gait = shift_phase(gait, np.arctan2(gait.sin[0, 0], gait.cos[0, 0]) / (2 * np.pi))
        return self.project(gait)

    def project(self, gait: Fourier) -> np.ndarray:
        table = gait.resize(self.harmonics).table
        return np.linalg.lstsq(self._basis(gait.n_joint), table.ravel(), rcond=None)[0]

    def is_synchronous(self, gait: Fourier) -> bool:
        return self.symmetry == BILATERAL or bool(abs(gait.sin[0, 0]) < SAME_START)

    def through(self, gait: Any) -> Fourier:
        """The series of a gait in its own phase, with symmetry and harmonics of the class."""
        if isinstance(gait, Fourier):
            return gait
        half = symmetric_samples(gait, self.symmetry)
        whole = half[:, :-1]
        if self.symmetry != NONE:
            image = -half[::-1, ::-1] if self.symmetry == BILATERAL else -half
            whole = np.concatenate([whole, image[:, :-1]], axis=1)
        spectrum = np.fft.rfft(whole, axis=1)[:, : self.harmonics + 1] * (2 / whole.shape[1])
        return Fourier(0.5 * spectrum[:, 0].real, spectrum[:, 1:].real, -spectrum[:, 1:].imag)

    def bounds(self, body: Body, limit: float) -> tuple[np.ndarray, np.ndarray]:
        # a function bounded by L has Fourier coefficients of at most 4 L / pi
        largest = np.full(self.size(body.n_joint), largest_coordinate(body) * 4 * limit / np.pi)
        return -largest, largest

    def sample_dimension(self, n_joint: int) -> int:
        return n_joint * (2 * self.harmonics + 1)

    def sample(self, unit: np.ndarray, n_joint: int) -> Fourier:
        table = (2 * unit - 1).reshape(n_joint, -1)
        fall = 1.0 / np.arange(1, self.harmonics + 1)  # no harmonic dominates the rates
        cos, sin = np.split(table[:, 1:], 2, axis=1)
        return Fourier(table[:, 0], cos * fall, sin * fall)

    def perturb(self, gait: Any, step: float, fall: int, rng: np.random.Generator) -> Fourier:
        series = self.through(gait).resize(self.harmonics)
        steps = step / np.arange(1, self.harmonics + 1) ** fall
        parts = (series.mean, step), (series.cos, steps), (series.sin, steps)
        moved = Fourier(*(part + size * rng.normal(size=part.shape) for part, size in parts))
        return self.member(self.parameters(moved), gait.n_joint)


def harmonics_within(highest: int, symmetry: str) -> Harmonic:
    """The class of all harmonics up to `highest` that gaits of a symmetry have."""
    even = symmetry == ANTIPODAL and highest % 2 == 0
    return Harmonic(highest - 1 if even else highest, symmetry)


def series_of(gait_class: LinearClass, harmonics: int) -> Harmonic:
    return harmonics_within(harmonics, gait_class.symmetry)


def shift_phase(gait: Fourier, phase: float) -> Fourier:
    """The gait started `phase` later: angles(t) becomes angles(t + phase)."""
    k = 2 * np.pi * np.arange(1, gait.n_harmonic + 1) * phase
    cos, sin = np.cos(k), np.sin(k)
    return Fourier(gait.mean, gait.cos * cos + gait.sin * sin, gait.sin * cos - gait.cos * sin)


@lru_cache(maxsize=64)
def _series_basis(harmonics: int, symmetry: str, n_joint: int) -> np.ndarray:
    columns, n_function = [], 2 * harmonics + 1
    for function, joint in product(range(n_function), range(n_joint)):
        harmonic, sine = (function + 1) // 2, function > 0 and function % 2 == 0
        column, partner = np.zeros((n_joint, n_function)), n_joint - 1 - joint
        column[joint, function] = 1.0
        if symmetry == ANTIPODAL and harmonic % 2 == 0:
            continue
        if symmetry == BILATERAL:
            if partner < joint or (partner == joint and not sine):
                continue
            column[partner, function] = 1.0 if sine else -1.0
        elif joint == 0 and function == 2:
            continue  # the start phase is free: no first sine of the first joint
        columns.append(column.ravel())
    return np.array(columns).T


_COMPLEX_STEP = 1e-30
_LAGS = np.linspace(-np.pi, np.pi, 361)  # first guesses of the lag of a gait


@named_arguments
@dataclass(frozen=True, eq=False, repr=False)
class SerpenoidSeries(Fourier):
    """The Fourier series of a serpenoid gait with its lag [rad of phase a joint], positive where
    the wave travels towards the head."""

    lag: float

    def lines(self) -> list[str]:
        amplitude = float(np.hypot(self.cos[0, 0], self.sin[0, 0]))
        offset = np.round(self.mean[0], 4) + 0.0
        waves = abs(self.lag) * (self.n_joint + 1) / (2 * np.pi)
        return [
            f"serpenoid: amplitude {amplitude:.4f} rad, offset {offset:+.4f} rad, lag "
            f"{self.lag:+.4f} rad a joint ({waves:.3f} waves along the body, towards the "
            f"{'head' if self.lag > 0 else 'tail'})",
            *super().lines(),
        ]


@named_arguments
@dataclass(frozen=True)
class Serpenoid(Harmonic):
    """The class of serpenoid gaits: an amplitude, a lag from joint to joint, an offset that turns,
    temporal harmonics.

    Its parameters are the lag, the offset where there is no symmetry, and the amplitudes: two or
    three numbers with one harmonic, for any number of links.

    Parameters
    ----------
    harmonics : int
        Of the wave in time; antipodal gaits have odd ones alone.
    symmetry : {"none", "bilateral", "antipodal"}
        Without one there is an offset, the same in all joints.

    Raises
    ------
    ProblemError
        If the symmetry leaves gaits nothing of the highest harmonic.

    Examples
    --------
    >>> from colloc import Chain, Friction, Problem, Serpenoid
    >>> snake = Problem("snake", body=Chain((1 / 8,) * 8), friction=Friction(mu_t=10),
    ...     gait=Serpenoid(symmetry="antipodal"))
    >>> snake.gait.describe()
    'serpenoid, 1 harmonic, symmetry antipodal'
    """

    linear = False

    def describe(self) -> str:
        return f"serpenoid, {super().describe()}"

    def check_joints(self, n_joint: int) -> None:
        if n_joint < 2:
            raise ProblemError(
                "a serpenoid wave travels along a chain: the class Serpenoid needs at least three "
                "links."
            )

    @property
    def _waves(self) -> list[tuple[int, bool]]:
        waves = [(1, True)]
        for k in range(2, self.harmonics + 1):
            if self.symmetry == ANTIPODAL and k % 2 == 0:
                continue
            waves += [(k, True)] if self.symmetry == BILATERAL else [(k, False), (k, True)]
        return waves

    @property
    def n_wave(self) -> int:
        """Number of parameters of the wave; the Fourier coefficients follow them."""
        return 1 + int(self.symmetry == NONE) + len(self._waves)

    def coefficients(self, wave: Array, n_joint: int) -> list[list[Array]]:
        """(mean, cos 1, sin 1, cos 2, ...) of every joint, of a wave; NumPy or CasADi."""
        xp, lag = namespace(wave), wave[0]
        offset = wave[1] if self.symmetry == NONE else 0 * lag
        amplitudes = [wave[i] for i in range(self.n_wave - len(self._waves), self.n_wave)]
        table = []
        for place in _places(n_joint):
            row = [offset, *[0 * lag] * (2 * self.harmonics)]
            for (k, sine), amplitude in zip(self._waves, amplitudes, strict=True):
                cos, sin = xp.cos(k * place * lag), xp.sin(k * place * lag)
                row[2 * k - 1] += amplitude * (-sin if sine else cos)
                row[2 * k] += amplitude * (cos if sine else sin)
            table.append(row)
        return table

    def coefficient_slopes(self, wave: np.ndarray, n_joint: int) -> np.ndarray:
        """Derivatives of `coefficients`, ``(n_joint * (2 K + 1), n_wave)``, by complex steps."""
        steps = wave + 1j * _COMPLEX_STEP * np.eye(self.n_wave)
        columns: list = [np.ravel(self.coefficients(step, n_joint)).imag for step in steps]
        return np.array(columns).T / _COMPLEX_STEP

    def full(self, wave: np.ndarray, n_joint: int) -> np.ndarray:
        """The parameters of a wave, then its Fourier coefficients."""
        return np.concatenate([wave, np.ravel(self.coefficients(wave, n_joint))])

    def _basis(self, n_joint: int) -> np.ndarray:
        n = n_joint * (2 * self.harmonics + 1)  # the Fourier coefficients alone enter the angles
        return np.hstack([np.zeros((n, self.n_wave)), np.eye(n)])

    def member(self, parameters: np.ndarray, n_joint: int) -> SerpenoidSeries:
        with np.errstate(over="ignore", invalid="ignore"):  # a series refuses what is not finite
            table = np.array(self.coefficients(parameters[: self.n_wave], n_joint), dtype=float)
        return SerpenoidSeries.from_table(table, float(parameters[0]))

    def parameters(self, gait: Fourier) -> np.ndarray:
        """Parameters of the nearest wave, after shifting the start phase if that is free."""
        lag, start = self._lag_and_start(gait)
        gait = gait.resize(self.harmonics)
        if abs(start) > SAME_START:
            gait = shift_phase(gait, -start / (2 * np.pi))
        wave = _at_the_middle(gait, lag)
        offset = [gait.mean.mean()] if self.symmetry == NONE else []
        amplitudes = (-wave[k - 1].imag if sine else wave[k - 1].real for k, sine in self._waves)
        return np.array([lag, *offset, *amplitudes])

    project = parameters

    def is_synchronous(self, gait: Fourier) -> bool:
        return abs(self._lag_and_start(gait)[1]) <= SAME_START

    def _lag_and_start(self, gait: Fourier) -> tuple[float, float]:
        """Lag at which the joints agree best on the wave they are part of, and by how much it
        starts off the phase of members [rad]."""
        lag, gait = getattr(gait, "lag", None), gait.resize(self.harmonics)

        def disagreement(lag):
            wave = _at_the_middle(gait, lag)
            amplitudes = wave.imag if self.symmetry == BILATERAL else np.abs(wave)
            return -float(np.sum(amplitudes**2))

        if lag is None:
            from scipy.optimize import minimize_scalar

            first = _LAGS[np.argmin([disagreement(lag) for lag in _LAGS])]
            step = _LAGS[1] - _LAGS[0]
            bounds = max(first - step, -np.pi), min(first + step, np.pi)
            how: Any = {"method": "bounded", "options": {"xatol": 1e-12}}
            lag = float(minimize_scalar(disagreement, bounds=bounds, **how).x)
        first = _at_the_middle(gait, lag)[0]
        in_phase = self.symmetry == BILATERAL or first == 0
        return lag, 0.0 if in_phase else float(np.angle(1j * first))

    def bounds(self, body: Body, limit: float) -> tuple[np.ndarray, np.ndarray]:
        _, largest = super().bounds(body, limit)
        largest[0] = np.pi  # a lag of a whole turn more is the same wave
        return -largest, largest


def _places(n_joint: int) -> np.ndarray:
    return np.arange(n_joint) - 0.5 * (n_joint - 1)


def _at_the_middle(gait: Fourier, lag: float) -> Any:
    """Amplitudes ``cos - i sin`` of the wave of a lag that is nearest to a gait, at the middle of
    the body, ``(n_harmonic,)``."""
    k = np.arange(1, gait.n_harmonic + 1)
    phase = np.exp(1j * k * lag * _places(gait.n_joint)[:, None])
    return ((gait.cos - 1j * gait.sin) * phase).mean(axis=0)


_INTERVALS_A_STAGE = 4
_CIRCLE = Fourier(np.zeros(2), np.array([[1.0], [0.0]]), np.array([[0.0], [1.0]]))


@dataclass(frozen=True, eq=False, repr=False)
class Phases(GaitFunction):
    """A body's run through its phases; `schedule` as `Prescribed.stages`."""

    schedule: tuple[float, ...] = (0.0, 1.0)
    symmetry: str = NONE

    shape_speed = 1.0
    n_joint = 2

    def __post_init__(self) -> None:
        object.__setattr__(self, "schedule", tuple(float(t) for t in self.schedule))

    @property
    def corner_phases(self) -> np.ndarray:
        return both_halves(self.symmetry, np.array(self.schedule))

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _CIRCLE(t)


@dataclass(frozen=True)
class Prescribed(LinearClass):
    """The class of a prescribed motion.

    Parameters
    ----------
    stages : tuple of float
        Phases from 0 to the solved part of the period, between which the motion is smooth.
    symmetry : {"none", "antipodal"}
        Antipodal: the second half period is the mirror image of the first.
    """

    stages: tuple[float, ...] = (0.0, 1.0)
    symmetry: str = NONE

    free, harmonics = False, 1
    series = series_of

    def __post_init__(self) -> None:
        stages = tuple(float(t) for t in self.stages)
        object.__setattr__(self, "stages", stages)
        check_choice((NONE, ANTIPODAL), **{"gait.symmetry": self.symmetry})
        ends = (stages[0], stages[-1]) if len(stages) > 1 else ()
        if ends != (0.0, self.fraction) or min(np.diff(stages)) <= 0:
            raise ProblemError(
                f"gait.stages must ascend from 0 to {self.fraction:g}, not {stages}."
            )

    @property
    def pieces(self) -> np.ndarray:
        return np.array(self.stages)

    def intervals(self, n_joint: int) -> int:
        return _INTERVALS_A_STAGE * (len(self.stages) - 1)

    def fewest_intervals(self, per_interval: int) -> tuple[int, str]:
        return len(self.stages) - 1, "the stages"

    def describe(self) -> str:
        return f"a prescribed motion, symmetry {self.symmetry}"

    def _basis(self, n_joint: int) -> np.ndarray:
        return np.empty((0, 0))

    def member(self, parameters: np.ndarray, n_joint: int) -> Phases:
        return Phases(self.stages, self.symmetry)

    def through(self, gait: Any) -> Any:
        return gait
