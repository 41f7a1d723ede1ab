"""Harmonic gaits: joint angles as finite Fourier series of the phase, with or without a symmetry (`colloc.gaits.symmetry`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.gaits.gait import ClassOfGaits, GaitFunction, finite_array
from colloc.gaits.symmetry import ANTIPODAL
from colloc.mechanics.bodies import Body
from colloc.system.arguments import is_whole, named_arguments
from colloc.system.errors import ProblemError

_COARSE = 16
"""Intervals a period, at least, from which a mesh is grown; also two for every harmonic."""


@named_arguments
@dataclass(frozen=True, eq=False, repr=False)
class Fourier(GaitFunction):
    """Joint angles ``mean + sum_k cos[:, k-1] cos(2 pi k t) + sin[:, k-1] sin(2 pi k t)``.

    Parameters
    ----------
    mean : (n_joint,)
    cos, sin : (n_joint, n_harmonic)

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

    is_series = True

    def __post_init__(self) -> None:
        for name, ndim in (("mean", 1), ("cos", 2), ("sin", 2)):
            object.__setattr__(self, name, finite_array(f"guess.{name}", getattr(self, name), ndim))
        if self.cos.shape != self.sin.shape or len(self.cos) != len(self.mean):
            raise ProblemError(
                f"guess.mean, cos and sin disagree in shape: {self.mean.shape}, {self.cos.shape}, {self.sin.shape}."
            )

    @property
    def n_joint(self) -> int:
        return len(self.mean)

    @property
    def shape_speed(self) -> float:
        """Root-mean-square shape speed, in rad per radian of phase."""
        k = np.arange(1, self.n_harmonic + 1)
        return float(np.sqrt(0.5 * np.sum(k**2 * (self.cos**2 + self.sin**2))))

    @property
    def n_harmonic(self) -> int:
        return self.cos.shape[1]

    def _waves(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        k = 2 * np.pi * np.arange(1, self.n_harmonic + 1)[:, None]
        return k, np.cos(k * t), np.sin(k * t)

    def angles(self, t: np.ndarray) -> np.ndarray:
        """Joint angles ``(n_joint, n_time)`` at phases t ``(n_time,)``."""
        _, cos, sin = self._waves(np.asarray(t, dtype=float))
        return self.mean[:, None] + self.cos @ cos + self.sin @ sin

    def rates(self, t: np.ndarray) -> np.ndarray:
        """Joint rates ``(n_joint, n_time)`` per period at phases t."""
        k, cos, sin = self._waves(np.asarray(t, dtype=float))
        return -self.cos @ (k * sin) + self.sin @ (k * cos)

    def lines(self) -> list[str]:
        """The formula, joint by joint, or mode by mode."""
        found = []
        for j in range(self.n_joint):
            terms = [_rounded(self.mean[j])]
            for k in range(self.n_harmonic):
                wave = "2πt" if k == 0 else f"{2 * (k + 1)}πt"
                terms.append(f"{_rounded(self.cos[j, k])} cos {wave} {_rounded(self.sin[j, k])} sin {wave}")
            found.append(f"{self.coordinate} {j + 1}: " + " ".join(terms))
        return found

    def mapped(self, matrix: np.ndarray) -> Fourier:
        """The gait with shapes multiplied by a matrix ``(m, n_joint)``."""
        return Fourier(matrix @ self.mean, matrix @ self.cos, matrix @ self.sin)

    def scaled(self, factor: float) -> Fourier:
        """The gait with all angles multiplied by a factor."""
        return Fourier(factor * self.mean, factor * self.cos, factor * self.sin)

    def grown(self, factor: float) -> Fourier:
        """The gait with all angles multiplied by a factor about their mean."""
        return Fourier(self.mean, factor * self.cos, factor * self.sin)

    def resized(self, n_harmonic: int) -> Fourier:
        """The same gait with harmonics added (zero) or cut."""
        keep = min(n_harmonic, self.n_harmonic)
        cos, sin = np.zeros((2, self.n_joint, n_harmonic))
        cos[:, :keep], sin[:, :keep] = self.cos[:, :keep], self.sin[:, :keep]
        return Fourier(self.mean, cos, sin)


def _rounded(value: float) -> str:
    """With its sign; no minus before zeros."""
    return f"{round(float(value), 4) + 0.0:+.4f}"


def ellipse(A0: float, A1: float, B1: float) -> Fourier:
    """The paper's one-harmonic gait of a three-link body (section V), symmetric about angle 1 = -angle 2.

    Parameters
    ----------
    A0, A1, B1 : float
        ``angle 1 = A0 + A1 cos 2πt + B1 sin 2πt`` and ``angle 2 = -A0 - A1 cos 2πt + B1 sin 2πt`` [rad].

    Examples
    --------
    >>> from colloc import ellipse
    >>> ellipse(A0=0.3, A1=1.0, B1=0.5).angles([0.0])
    array([[ 1.3],
           [-1.3]])
    """
    return Fourier(np.array([A0, -A0]), np.array([[A1], [-A1]]), np.array([[B1], [B1]]))


@named_arguments
@dataclass(frozen=True)
class Harmonic(ClassOfGaits):
    """The class of gaits with `harmonics` harmonics and a given symmetry.

    A member is a parameter vector p; angles are linear in it. Without a symmetry that fixes it, the start phase is
    fixed by taking the first joint's first sine coefficient out.

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

    moves_knots = True

    def __post_init__(self) -> None:
        if not is_whole(self.harmonics, 1, 64):
            raise ProblemError(f"gait.harmonics must be an integer from 1 to 64, not {self.harmonics!r}.")
        self._check_symmetry()
        if self.symmetry == ANTIPODAL and self.harmonics % 2 == 0:
            raise ProblemError(
                f"antipodal gaits have odd harmonics only, as q(t + 1/2) = -q(t): {self.harmonics} would be the same class as "
                f"{self.harmonics - 1}; ask for {self.harmonics - 1} or {self.harmonics + 1}."
            )

    @property
    def without_cusps(self) -> bool:  # type: ignore[override]
        """Whether members come to rest nowhere, but for paths that are retraced: ellipses do not."""
        return self.harmonics == 1

    def intervals(self, n_joint: int) -> int:
        """Intervals that a first mesh wants: enough for the waves, and some for stick and slip."""
        return round(self.fraction * (30 + 10 * self.harmonics))

    def fewest_intervals(self, per_interval: int) -> tuple[int, str]:
        """Intervals that a mesh with so many points on each needs at least, and for what."""
        return max(2, -(-4 * self.harmonics // per_interval)), f"{self.harmonics} harmonics"

    def first_edges(self, edges: np.ndarray) -> np.ndarray:
        """The mesh from which a finer one is grown: a coarse uniform one."""
        return np.linspace(edges[0], edges[-1], max(int(_COARSE * self.fraction), 2 * self.harmonics) + 1)

    def series(self, harmonics: int) -> Harmonic:
        """Fourier series that stand for its gaits: its members are such."""
        return self

    def describe(self) -> str:
        """The class in words, for reports."""
        return f"{self.harmonics} harmonic{'s' if self.harmonics > 1 else ''}, symmetry {self.symmetry}"

    def _basis(self, n_joint: int) -> np.ndarray:
        """``(n_joint * (2 K + 1), n_parameter)``: parameters to (mean, cos_1, sin_1, cos_2, ...) of every joint."""
        columns = []
        for kind in range(2 * self.harmonics + 1):
            odd_harmonic = (kind + 1) // 2 % 2 == 1
            if self.symmetry == ANTIPODAL and not odd_harmonic:
                continue
            sine = kind > 0 and kind % 2 == 0
            for joint in range(n_joint):
                column = np.zeros((n_joint, 2 * self.harmonics + 1))
                column[joint, kind] = 1.0
                if self.symmetry == "bilateral":
                    partner = n_joint - 1 - joint
                    if partner < joint or (partner == joint and not sine):
                        continue
                    column[partner, kind] = 1.0 if sine else -1.0
                elif joint == 0 and kind == 2:
                    continue  # the start phase
                columns.append(column.ravel())
        return np.array(columns).T

    def size(self, n_joint: int, n_interval: int | None = None) -> int:
        """Number of parameters."""
        return self._basis(n_joint).shape[1]

    def fourier(self, parameters: np.ndarray, n_joint: int) -> Fourier:
        """The gait of a parameter vector."""
        table = (self._basis(n_joint) @ parameters).reshape(n_joint, -1)
        return Fourier(table[:, 0], table[:, 1::2], table[:, 2::2])

    def member(self, parameters: np.ndarray, n_joint: int, edges: np.ndarray | None = None) -> Fourier:
        """The gait of a parameter vector; the mesh does not matter."""
        return self.fourier(parameters, n_joint)

    def parameters(self, gait: Fourier) -> np.ndarray:
        """The parameter vector of the class member nearest to `gait`, after shifting its start phase if that is free."""
        gait = gait.resized(self.harmonics)
        if self.symmetry != "bilateral":
            gait = shifted(gait, np.arctan2(gait.sin[0, 0], gait.cos[0, 0]) / (2 * np.pi))
        return self.nearest(gait)

    def nearest(self, gait: Fourier) -> np.ndarray:
        """The parameter vector of the class member nearest to `gait`, in its phase."""
        gait = gait.resized(self.harmonics)
        table = np.zeros((gait.n_joint, 2 * self.harmonics + 1))
        table[:, 0], table[:, 1::2], table[:, 2::2] = gait.mean, gait.cos, gait.sin
        return np.linalg.lstsq(self._basis(gait.n_joint), table.ravel(), rcond=None)[0]

    def largest_parameters(self, body: Body, limit: float) -> np.ndarray:
        """Bounds on the parameters ``(n_parameter,)`` of gaits whose angles keep a limit: a function bounded by L has Fourier
        coefficients of at most 4 L / pi."""
        # coordinates, such as amplitudes of modes, may be larger than what is bounded
        largest = max(1.0, np.abs(np.linalg.pinv(body.limited)).sum(axis=1).max())
        return np.full(self.size(body.n_joint), largest * 4 * limit / np.pi)

    def angle_matrix(self, t: np.ndarray, n_joint: int) -> np.ndarray:
        """``(n_time, n_joint, n_parameter)``: joint angles at phases t per parameter."""
        k = 2 * np.pi * np.arange(1, self.harmonics + 1)[:, None]
        return self._combined(np.ones((1, t.size)), np.cos(k * t), np.sin(k * t), n_joint)

    def rate_matrix(self, t: np.ndarray, n_joint: int) -> np.ndarray:
        """``(n_time, n_joint, n_parameter)``: joint rates per period at phases t per parameter."""
        k = 2 * np.pi * np.arange(1, self.harmonics + 1)[:, None]
        return self._combined(np.zeros((1, t.size)), -k * np.sin(k * t), k * np.cos(k * t), n_joint)

    def mean_square_rate(self, n_joint: int) -> np.ndarray:
        """``(n_parameter, n_parameter)``: the mean square shape speed per period as a quadratic form of the parameters."""
        n_time = 4 * self.harmonics + 4
        rates = self.rate_matrix(np.arange(n_time) / n_time, n_joint)
        return np.einsum("tjp,tjq->pq", rates, rates) / n_time

    def enclosed_area(self, n_joint: int) -> np.ndarray:
        """``(n_parameter, n_parameter)``: the area ``integral of sum_(i<j) (q_i dq_j - q_j dq_i) / 2`` that a path encloses in
        the planes of its joints [rad^2], as a quadratic form of the parameters; 0 for retraced paths."""
        n_time = 4 * self.harmonics + 4
        t = np.arange(n_time) / n_time
        angles, rates = self.angle_matrix(t, n_joint), self.rate_matrix(t, n_joint)
        sign = np.triu(np.ones((n_joint, n_joint)), 1)
        form = 0.5 * np.einsum("tip,ij,tjq->pq", angles, sign - sign.T, rates) / n_time
        return 0.5 * (form + form.T)

    def _combined(self, constant: np.ndarray, cos: np.ndarray, sin: np.ndarray, n_joint: int) -> np.ndarray:
        waves = np.empty((2 * self.harmonics + 1, constant.shape[1]))
        waves[:1], waves[1::2], waves[2::2] = constant, cos, sin
        basis = self._basis(n_joint).reshape(n_joint, waves.shape[0], -1)
        return np.einsum("wt,jwp->tjp", waves, basis)


def harmonics_within(highest: int, symmetry: str) -> Harmonic:
    """The class of all harmonics up to `highest` that gaits of a symmetry have."""
    return Harmonic(highest - 1 if symmetry == ANTIPODAL and highest % 2 == 0 else highest, symmetry)


def shifted(gait: Fourier, phase: float) -> Fourier:
    """The gait started `phase` later: angles(t) becomes angles(t + phase)."""
    k = 2 * np.pi * np.arange(1, gait.n_harmonic + 1) * phase
    cos, sin = np.cos(k), np.sin(k)
    return Fourier(gait.mean, gait.cos * cos + gait.sin * sin, gait.sin * cos - gait.cos * sin)
