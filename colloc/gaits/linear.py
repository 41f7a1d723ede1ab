"""Classes of gaits that are linear in their parameters, and their members: sums of functions of the
phase.

    q_j(t) = sum_i T_ji phi_i(t),      T = B p

A class says what its functions phi are, with their derivatives, and which tables T it allows; with
a symmetry, those that are their own image. Fourier series (`colloc.gaits.harmonic`), B-splines and
columns of one's own are such classes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import qr

from colloc.gaits.gait import ClassOfGaits, GaitFunction, finite_array
from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, NONE
from colloc.mechanics.bodies import Body
from colloc.mechanics.joint_map import JointMap
from colloc.system.arguments import STATED_IF_SET, named_arguments
from colloc.system.errors import ProblemError

_COARSE = 16
"""Intervals a period, at least, from which a mesh is grown; also two for every harmonic."""
_SERIES = 64
"""Harmonics through which a path that has no phase of its own is laid into a class."""
_CLOSED = 1e-6
"""Relative distance of an image from the class at which it counts as a member."""
_MOVES = 1e-3
"""Shape speed, of what the parameters may be, below which a guess counts as one that a class has
nothing of."""


@named_arguments
@dataclass(frozen=True, eq=False, repr=False)
class Combination(GaitFunction):
    """Joint angles ``table @ functions(t)`` with the functions of a linear class.

    Parameters
    ----------
    basis : LinearClass
        The class whose functions are meant.
    table : (n_joint, n_function)
        Their coefficients.
    theta : float, optional
        On a slope: angle of the tail link at phase 0 from straight uphill, positive to the left
        [rad].
    log_period : float, optional
        At a free pace: logarithm of the period [sqrt(length / gravity)].

    Examples
    --------
    >>> import numpy as np
    >>> from colloc import BSpline
    >>> BSpline(knots=6).member(np.ones(12), n_joint=2).angles(np.array([0.3])).round(12).tolist()
    [[1.0], [1.0]]
    """

    basis: Any
    table: np.ndarray
    theta: float | None = field(default=None, metadata=STATED_IF_SET, kw_only=True)
    log_period: float | None = field(default=None, metadata=STATED_IF_SET, kw_only=True)

    is_series = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "table", finite_array("guess.table", self.table, 2))
        needed = self.basis.functions(np.zeros(1)).shape[0]
        if self.table.shape[1] != needed:
            raise ProblemError(
                f"guess.table has {self.table.shape[1]} columns, and the class has {needed} "
                f"functions."
            )

    @property
    def n_joint(self) -> int:
        return len(self.table)

    @property
    def mean(self) -> np.ndarray:
        """Of the angles over a period, ``(n_joint,)``."""
        return self.angles(self.basis.instants).mean(axis=1)

    @property
    def shape_speed(self) -> float:
        """Root-mean-square shape speed, in rad per radian of phase."""
        return float(
            np.sqrt((self.rates(self.basis.instants) ** 2).sum(axis=0).mean()) / (2 * np.pi)
        )

    def angles(self, t: np.ndarray) -> np.ndarray:
        return self.table @ self.basis.functions(np.asarray(t, dtype=float)) + self.rest

    def rates(self, t: np.ndarray) -> np.ndarray:
        return self.table @ self.basis.functions(np.asarray(t, dtype=float), 1)

    @property
    def rest(self) -> np.ndarray:  # type: ignore[override]
        return np.asarray(self.basis.offset(self.n_joint))

    @property
    def joint_map(self) -> JointMap | None:  # type: ignore[override]
        found: JointMap | None = self.basis.joint_map(self.n_joint)
        return found

    @property
    def driven(self) -> Any:
        return self.basis.driven(self)

    def lines(self) -> list[str]:
        """The formula, joint by joint, or mode by mode; of the motors, where joints hang on
        them."""
        if self.joint_map is not None:
            lines: list[str] = self.basis.lines(self)
            return lines
        table, names = (
            np.round(self.table, 4) + 0.0,
            [self.basis.label(i) for i in range(self.table.shape[1])],
        )
        rows = (
            " ".join(f"{c:+.4f} {name}" for c, name in zip(row, names, strict=True) if c != 0)
            for row in table
        )
        formula = (f"{self.coordinate} {j}: {row or '0'}" for j, row in enumerate(rows, 1))
        return [f"φ: {self.basis.describe()}", *formula, *self.pointing]

    def mapped(self, matrix: np.ndarray) -> Any:
        """The Fourier series of the gait with shapes multiplied by a matrix ``(m, n_joint)``."""
        return self.basis.series(_SERIES).through(self).mapped(matrix)

    def scaled(self, factor: float) -> Combination:
        """The gait with all angles multiplied by a factor."""
        return Combination(self.basis, factor * self.table)

    @property
    def mirrored(self) -> Combination:
        return self.scaled(-1.0)

    def grown(self, factor: float) -> Combination:
        """The gait with all angles multiplied by a factor: a class need not have constant
        angles."""
        return self.scaled(factor)


class LinearClass(ClassOfGaits):
    """Base of the classes in whose parameters joint angles are linear. One has to say what its
    `functions` are, how fast they vary (`harmonics`), ``series`` and `describe`; the rest follows.

    A problem refuses classes whose functions depend on one another, and symmetries whose images of
    members are none.
    """

    symmetry: str
    harmonics: int
    """As many as the functions need to be resolved."""
    linear = moves_knots = may_tell = True

    def functions(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        """``(n_function, n_time)``: the functions of the phase at phases t, or their derivatives
        per period."""
        raise NotImplementedError

    def label(self, number: int) -> str:
        """What a function, counted from 0, is called where gaits are printed."""
        return f"φ{number + 1}"

    def allowed(self, n_joint: int) -> np.ndarray:
        """``(n_joint * n_function, n_column)``: the tables that are allowed before any symmetry; by
        default all."""
        return np.eye(n_joint * self.functions(np.zeros(1)).shape[0])

    @property
    def instants(self) -> np.ndarray:
        """Phases over which means of the functions are taken, and at which gaits are fitted."""
        n = 32 * (self.harmonics + 1)
        return np.arange(n) / n

    @property
    def seeds(self) -> Any:
        return self.level

    def intervals(self, n_joint: int) -> int:
        """Intervals that a first mesh wants: enough for the waves, and some for stick and slip."""
        return round(self.fraction * (30 + 10 * self.harmonics))

    def fewest_intervals(self, per_interval: int) -> tuple[int, str]:
        """Intervals that a mesh with so many points on each needs at least, and for what."""
        return max(2, -(-4 * self.harmonics // per_interval)), f"{self.harmonics} harmonics"

    def first_edges(self, edges: np.ndarray) -> np.ndarray:
        """The mesh from which a finer one is grown: a coarse uniform one."""
        return np.linspace(
            edges[0], edges[-1], max(int(_COARSE * self.fraction), 2 * self.harmonics) + 1
        )

    def driven(self, gait: Any) -> Any:
        """The gait of what has motors, of a member."""
        return gait

    def offset(self, n_joint: int) -> np.ndarray:
        """Joint angles ``(n_joint, 1)`` that all members have besides."""
        return np.zeros((n_joint, 1))

    def _basis(self, n_joint: int) -> np.ndarray:
        """``(n_joint * n_function, n_parameter)``: parameters to the tables that the class
        allows."""
        return _symmetric_tables(self, n_joint)

    def size(self, n_joint: int, n_interval: int | None = None) -> int:
        """Number of parameters."""
        return self._basis(n_joint).shape[1]

    def check_joints(self, n_joint: int) -> None:
        """A `ProblemError` if bodies with so many joints have no gaits of the class."""
        self._basis(n_joint)

    def retraces(self, n_joint: int) -> bool:
        """As where one function moves all joints: whether the rates of a member drawn by chance
        have one direction."""
        drawn = np.random.default_rng(0).normal(size=self._basis(n_joint).shape[1])
        return bool(np.linalg.matrix_rank(self.rate_matrix(self.instants, n_joint) @ drawn) <= 1)

    def member(self, parameters: np.ndarray, n_joint: int, edges: np.ndarray | None = None) -> Any:
        """The gait of a parameter vector; the mesh does not matter."""
        return Combination(self, (self._basis(n_joint) @ parameters).reshape(n_joint, -1))

    def parameters(self, gait: Any) -> np.ndarray:
        """The parameter vector of the class member nearest to a gait."""
        return self.nearest(gait)

    def nearest(self, gait: Any) -> np.ndarray:
        """The parameter vector of the class member nearest to a gait, in its phase (least squares
        over the period)."""
        if getattr(gait, "basis", None) == self:
            return np.linalg.lstsq(self._basis(gait.n_joint), gait.table.ravel(), rcond=None)[0]
        matrix = self.angle_matrix(self.instants, gait.n_joint)
        angles = (gait.angles(self.instants) - self.offset(gait.n_joint)).T
        return np.linalg.lstsq(matrix.reshape(angles.size, -1), angles.ravel(), rcond=None)[0]

    def through(self, gait: Any) -> Any:
        """The member nearest to a gait; of one that has no phase of its own, to its Fourier series
        in arc length."""
        if getattr(gait, "basis", None) == self:
            return gait
        timed = gait if gait.is_series else self.series(_SERIES).through(gait)
        return self.member(self.parameters(timed), gait.n_joint)

    def guessed(self, gait: Any) -> tuple[Any, float]:
        near = self.member(self.parameters(self.through(gait)), gait.n_joint)
        return near, near.shape_speed

    def first_guess(self, gait: Any) -> Any:
        """The member nearest to a wave; where there is next to nothing of a wave in the class, all
        its functions at once."""
        near = self.through(gait)
        if near.shape_speed > _MOVES * gait.shape_speed:
            return near.scaled(gait.shape_speed / near.shape_speed)
        all_of_it = self.member(np.ones(self.size(gait.n_joint)), gait.n_joint)
        return all_of_it.scaled(gait.shape_speed / all_of_it.shape_speed)

    def largest_parameters(self, body: Body, limit: float) -> np.ndarray:
        """Bounds on the parameters ``(n_parameter,)`` of gaits whose angles keep a limit."""
        largest = max(1.0, np.abs(np.linalg.pinv(body.limited)).sum(axis=1).max())
        matrix = self.angle_matrix(self.instants, body.n_joint)
        # parameters are linear in the angles at the instants
        return (
            largest
            * limit
            * np.abs(np.linalg.pinv(matrix.reshape(-1, matrix.shape[2]))).sum(axis=1)
        )

    def bounds(self, body: Body, limit: float) -> tuple[np.ndarray, np.ndarray]:
        """The least and the most that parameters of gaits whose angles keep a limit may be,
        ``(n_parameter,)`` each."""
        largest = self.largest_parameters(body, limit)
        return -largest, largest

    def angle_matrix(self, t: np.ndarray, n_joint: int) -> np.ndarray:
        """``(n_time, n_joint, n_parameter)``: joint angles at phases t per parameter."""
        return self._combined(self.functions(t), n_joint)

    def rate_matrix(self, t: np.ndarray, n_joint: int) -> np.ndarray:
        """``(n_time, n_joint, n_parameter)``: joint rates per period at phases t per parameter."""
        return self._combined(self.functions(t, 1), n_joint)

    def _combined(self, functions: np.ndarray, n_joint: int) -> np.ndarray:
        basis = self._basis(n_joint).reshape(n_joint, functions.shape[0], -1)
        return np.einsum("wt,jwp->tjp", functions, basis)

    def mean_square_rate(self, n_joint: int) -> np.ndarray:
        """``(n_parameter, n_parameter)``: the mean square shape speed per period as a quadratic
        form of the parameters."""
        rates = self.rate_matrix(self.instants, n_joint)
        return np.einsum("tjp,tjq->pq", rates, rates) / self.instants.size

    def enclosed_area(self, n_joint: int) -> np.ndarray:
        """``(n_parameter, n_parameter)``: the area ``integral of sum_(i<j) (q_i dq_j - q_j dq_i) /
        2`` that a path encloses in the planes of its joints [rad^2], as a quadratic form of the
        parameters; 0 for retraced paths."""
        angles, rates = (
            self.angle_matrix(self.instants, n_joint),
            self.rate_matrix(self.instants, n_joint),
        )
        sign = np.triu(np.ones((n_joint, n_joint)), 1)
        form = 0.5 * np.einsum("tip,ij,tjq->pq", angles, sign - sign.T, rates) / self.instants.size
        return 0.5 * (form + form.T)

    # where searches begin
    def dimension(self, n_joint: int) -> int:
        """Of the unit cube that starts are drawn from."""
        return self.size(n_joint)

    def drawn(self, unit: np.ndarray, n_joint: int) -> Any:
        """The gait that a point of the unit cube stands for; its size does not matter."""
        return self.member((2 * unit - 1) / self._sizes(n_joint), n_joint)

    def moved(self, gait: Any, step: float, fall: int, rng: np.random.Generator) -> Any:
        """The member nearest to a gait, with every coefficient moved by normals of `step` [rad]; of
        harmonic k, where there are such, of ``step / k^fall``."""
        v = self.parameters(self.through(gait))
        return self.member(
            v + step * rng.normal(size=v.size) / self._sizes(gait.n_joint), gait.n_joint
        )

    def _sizes(self, n_joint: int) -> np.ndarray:
        """Largest angle that a unit of every parameter makes [rad]."""
        return np.abs(self.angle_matrix(self.instants, n_joint)).max(axis=(0, 1))


@lru_cache(maxsize=64)
def _symmetric_tables(kind: LinearClass, n_joint: int) -> np.ndarray:
    """A basis of the tables that a class allows and that are their own image under its symmetry."""
    allowed = kind.allowed(n_joint)
    functions = kind.functions(kind.instants)
    angles = np.einsum("jwp,wt->jtp", allowed.reshape(n_joint, len(functions), -1), functions)
    matrix = angles.reshape(-1, allowed.shape[1])
    if (
        np.linalg.matrix_rank(matrix, tol=_CLOSED * np.abs(matrix).max() * np.sqrt(len(matrix)))
        < matrix.shape[1]
    ):
        raise ProblemError(
            f"the functions of the class {type(kind).__name__} depend on one another: leave "
            f"some out."
        )
    if kind.symmetry == NONE:
        return allowed
    images = {
        BILATERAL: lambda: -np.roll(angles[::-1, ::-1], 1, axis=1),
        ANTIPODAL: lambda: -np.roll(angles, angles.shape[1] // 2, axis=1),
    }
    image = images[kind.symmetry]().reshape(matrix.shape)
    turned = np.linalg.lstsq(matrix, image, rcond=None)[0]
    if np.abs(matrix @ turned - image).max() > _CLOSED * np.abs(matrix).max():
        how = (
            "run backwards, seen from the other end,"
            if kind.symmetry == BILATERAL
            else "half a period later, negated,"
        )
        raise ProblemError(
            f"the class {type(kind).__name__} has no symmetry {kind.symmetry!r} for {n_joint} "
            f"joints: its functions {how} are "
            "no combinations of its functions. Take symmetry 'none'."
        )
    own = np.eye(len(turned)) + turned
    _, r, order = qr(own, mode="economic", pivoting=True)
    rank = int((np.abs(np.diag(r)) > _CLOSED * abs(r[0, 0])).sum()) if abs(r[0, 0]) > _CLOSED else 0
    if rank == 0:
        raise ProblemError(
            f"the class {type(kind).__name__} has no gait of symmetry {kind.symmetry!r} but rest."
        )
    return allowed @ own[:, np.sort(order[:rank])]
