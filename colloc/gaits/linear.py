"""Gaits that are linear in their parameters p: sums of functions of the phase,

q_j(t) = sum_i T_ji phi_i(t) + rest_j,      T = B p.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from colloc.gaits.gait import BILATERAL, NONE, SYMMETRIES, GaitFunction, fraction
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import JointMap
from colloc.numerics.mesh import Mesh
from colloc.system.arguments import STATED_IF_SET, check_choice, finite_array, named_arguments
from colloc.system.errors import ProblemError

_SERIES, _START_SERIES = 64, 2
"""Harmonics of the Fourier series in arc length that a path is projected through, and of starts."""
_CLOSED = 1e-6
"""Relative distance of an image from the class at which it counts as a member."""


@named_arguments
@dataclass(frozen=True, eq=False, repr=False)
class Combination(GaitFunction):
    """Joint angles ``table @ basis.functions(t)``, table ``(n_joint, n_function)``."""

    basis: Any  # the LinearClass
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
        return self.angles(self.basis.instants).mean(axis=1)

    @property
    def shape_speed(self) -> float:
        """Root-mean-square shape speed [rad per radian of phase]."""
        squares = (self.rates(self.basis.instants) ** 2).sum(axis=0)
        return float(np.sqrt(squares.mean()) / (2 * np.pi))

    def angles(self, t: np.ndarray) -> np.ndarray:
        return self.table @ self.basis.functions(np.asarray(t, dtype=float)) + self.rest

    def rates(self, t: np.ndarray) -> np.ndarray:
        return self.table @ self.basis.functions(np.asarray(t, dtype=float), 1)

    @property
    def rest(self) -> np.ndarray:  # type: ignore[override]
        return self.basis.offset(self.n_joint)

    @property
    def joint_map(self) -> JointMap | None:  # type: ignore[override]
        return self.basis.joint_map(self.n_joint)

    @property
    def motor_gait(self) -> Any:
        return self.basis.motor_gait(self)

    def lines(self) -> list[str]:
        if (joints := self.joint_map) is not None:
            stuck = [j for j, gears in enumerate(joints.matrix) if not gears.any()]
            at = [f"joint {j + 1}: {joints.rest[j]:+.4f}" for j in stuck]
            return [*self.motor_gait.lines(), *at]
        formulas = []
        for j, row in enumerate(np.round(self.table, 4) + 0.0, 1):
            terms = [f"{c:+.4f} {self.basis.label(i)}" for i, c in enumerate(row) if c != 0]
            formulas.append(f"{self.coordinate} {j}: {' '.join(terms) or '0'}")
        return [f"φ: {self.basis.describe()}", *formulas, *self.pointing]

    def transform(self, matrix: np.ndarray) -> Any:
        return self.basis.series(_SERIES).through(self).transform(matrix)

    def scaled(self, factor: float) -> Combination:
        return Combination(self.basis, factor * self.table)

    grown = scaled  # a class need not have constant angles


class LinearClass:
    """Base of classes of gaits. A class has to define `functions`, `harmonics`, `series` and
    `describe`; docs/howto/own_gait_class.md."""

    symmetry: str
    harmonics: int
    """Harmonics that resolve the functions."""
    free = True  # has parameters
    linear = True  # angles are linear in the parameters of the search
    relative_delta = False  # delta is relative to the shape speed, as the pace does not matter
    delta_start: float | None = None  # first delta of a search; None: the body's default
    stages: tuple[float, ...] = ()  # phases that every mesh has as edges

    def functions(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        """phi ``(n_function, n_time)`` at phases t, or the derivatives per period."""
        raise NotImplementedError

    def series(self, harmonics: int) -> Any:
        """The class of Fourier series with about so many harmonics that stand for the gaits."""
        raise NotImplementedError

    def describe(self) -> str:
        raise NotImplementedError

    def label(self, number: int) -> str:
        """Name of a function, counted from 0, in formulas."""
        return f"φ{number + 1}"

    def table_basis(self, n_joint: int) -> np.ndarray:
        """Basis ``(n_joint * n_function, n_column)`` of the tables T allowed without a symmetry."""
        return np.eye(n_joint * self.functions(np.zeros(1)).shape[0])

    def _basis(self, n_joint: int) -> np.ndarray:
        return _symmetric_tables(self, n_joint)

    def _check_symmetry(self) -> None:
        check_choice(SYMMETRIES, **{"gait.symmetry": self.symmetry})

    def with_symmetry(self, symmetry: str) -> Any:
        return dataclasses.replace(self, symmetry=symmetry)  # type: ignore[type-var]

    def check_joints(self, n_joint: int) -> None:
        """Raise a `ProblemError` if bodies with so many shape coordinates have no such gaits."""
        if self.relative_delta and n_joint < 2:
            raise ProblemError(
                f"the class {type(self).__name__} needs a body of at least three links, or two "
                f"modes."
            )
        self._basis(n_joint)

    def joint_map(self, n_joint: int) -> JointMap | None:
        return None

    def motor_gait(self, gait: Any) -> Any:
        return gait

    @property
    def fraction(self) -> float:
        return fraction(self.symmetry)

    # meshes
    @property
    def instants(self) -> np.ndarray:
        """Phases at which means are taken and gaits are fitted."""
        n = 32 * (self.harmonics + 1)
        return np.arange(n) / n

    @property
    def pieces(self) -> np.ndarray:
        """Times from 0 to the end of the solved part between which members are smooth."""
        return np.array([0.0, self.fraction])

    def intervals(self, n_joint: int) -> int:
        """Intervals of a first mesh: enough for the waves, and some for stick and slip."""
        return round(self.fraction * (30 + 10 * self.harmonics))

    def fewest_intervals(self, per_interval: int) -> tuple[int, str]:
        """Least intervals of a mesh with so many points on each, and the reason."""
        return max(2, -(-4 * self.harmonics // per_interval)), f"{self.harmonics} harmonics"

    def edges(self, n: int) -> np.ndarray:
        """Edges of a mesh of about n intervals on the solved part of the cycle."""
        ends = self.pieces
        shares = np.round(n * np.diff(ends) / ends[-1]).astype(int)
        counts = np.maximum(2 if self.relative_delta else 1, shares)
        pieces = zip(ends, ends[1:], counts, strict=False)
        return np.concatenate([*(np.linspace(a, b, k + 1)[:-1] for a, b, k in pieces), ends[-1:]])

    def phases(self, gait: Any, times: np.ndarray) -> np.ndarray:
        """Phases of a member at times of its program."""
        return times

    def times(self, gait: Any, phases: np.ndarray) -> np.ndarray:
        """Edges of a program's mesh, from phases of a member."""
        return phases

    # from parameters to gaits
    def size(self, n_joint: int) -> int:
        return self._basis(n_joint).shape[1]

    def offset(self, n_joint: int) -> np.ndarray:
        """Joint angles ``(n_joint, 1)`` that do not depend on the parameters."""
        joint_map = self.joint_map(n_joint)
        return np.zeros((n_joint, 1)) if joint_map is None else joint_map.offset

    def member(self, parameters: np.ndarray, n_joint: int) -> Any:
        return Combination(self, self.table(parameters, n_joint))

    def trajectory(self, parameters: np.ndarray, n_joint: int) -> Any:
        """The gait in the time of a program, in which angles are linear in the parameters."""
        return self.member(parameters, n_joint)

    def angle_matrix(self, t: np.ndarray, n_joint: int, derivative: int = 0) -> np.ndarray:
        """Joint angles per parameter ``(n_time, n_joint, n_parameter)``, or derivatives."""
        functions = self.functions(t, derivative)
        basis = self._basis(n_joint).reshape(n_joint, functions.shape[0], -1)
        return np.einsum("wt,jwp->tjp", functions, basis)

    def table(self, parameters: np.ndarray, n_joint: int) -> np.ndarray:
        """T of a gait, ``(n_joint, n_function)``."""
        return (self._basis(n_joint) @ parameters).reshape(n_joint, -1)

    def pull_back(self, on_angles: np.ndarray, functions: np.ndarray) -> np.ndarray:
        """Derivatives along the parameters ``(n_time, n_parameter)``, from those along angles
        ``(n_joint, n_time)`` that are ``T functions``."""
        basis = self._basis(len(on_angles))
        on_tables = on_angles.T[:, :, None] * functions.T[:, None]
        return on_tables.reshape(-1, len(basis)) @ basis

    def rates_on(self, mesh: Mesh, n_joint: int) -> np.ndarray:
        """Joint rates per parameter at the points of a mesh, at corners that of the interval."""
        return self.angle_matrix(mesh.times, n_joint, 1)

    def mean_square_rate(self, n_joint: int) -> np.ndarray:
        """Quadratic form ``(n_parameter, n_parameter)`` of the mean square shape speed."""
        rates = self.angle_matrix(self.instants, n_joint, 1)
        return np.einsum("tjp,tjq->pq", rates, rates) / self.instants.size

    def bounds(self, body: Body, limit: float) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest parameters ``(n_parameter,)`` of gaits whose angles keep a limit."""
        matrix = self.angle_matrix(self.instants, body.n_joint)
        inverse = np.linalg.pinv(matrix.reshape(-1, matrix.shape[2]))
        largest = largest_coordinate(body) * limit * np.abs(inverse).sum(axis=1)
        return -largest, largest

    # from gaits to parameters
    def parameters(self, gait: Any) -> np.ndarray:
        """Parameters of the member nearest to a gait."""
        return self.project(gait)

    def project(self, gait: Any) -> np.ndarray:
        """Parameters of the member nearest to a gait in its phase, in least squares."""
        if getattr(gait, "basis", None) == self:
            return np.linalg.lstsq(self._basis(gait.n_joint), gait.table.ravel(), rcond=None)[0]
        matrix = self.angle_matrix(self.instants, gait.n_joint)
        angles = (gait.angles(self.instants) - self.offset(gait.n_joint)).T
        return np.linalg.lstsq(matrix.reshape(angles.size, -1), angles.ravel(), rcond=None)[0]

    def is_synchronous(self, gait: Any) -> bool:
        """True if a gait starts in the phase in which members do."""
        return True

    def through(self, gait: Any) -> Any:
        """The member nearest to a gait; of a path without a phase, to its Fourier series."""
        if self.relative_delta or getattr(gait, "basis", None) == self:
            return gait
        timed = gait if gait.is_series else self.series(_SERIES).through(gait)
        return self.member(self.parameters(timed), gait.n_joint)

    # where searches begin
    @property
    def start_class(self) -> Any:
        return self.series(_START_SERIES) if self.relative_delta else self

    def sample_dimension(self, n_joint: int) -> int:
        return self.size(n_joint)

    def sample(self, unit: np.ndarray, n_joint: int) -> Any:
        """The gait of a point of the unit cube ``(sample_dimension,)``, up to its size."""
        return self.member((2 * unit - 1) / self._sizes(n_joint), n_joint)

    def perturb(self, gait: Any, step: float, fall: int, rng: np.random.Generator) -> Any:
        """Perturb coefficients by normals of ``step`` [rad]; of harmonic k ``step / k^fall``."""
        v = self.parameters(self.through(gait))
        by = step * rng.normal(size=v.size) / self._sizes(gait.n_joint)
        return self.member(v + by, gait.n_joint)

    def _sizes(self, n_joint: int) -> np.ndarray:
        return np.abs(self.angle_matrix(self.instants, n_joint)).max(axis=(0, 1))


def largest_coordinate(body: Body) -> float:
    """Largest shape coordinate per unit of the angles that are limited, at least 1."""
    return max(1.0, np.abs(np.linalg.pinv(body.bounded_angles.rows)).sum(axis=1).max())


def enclosed_area(gait_class: LinearClass, n_joint: int) -> np.ndarray:
    """Quadratic form of the enclosed area ``integral of sum_(i<j) (q_i dq_j - q_j dq_i) / 2``."""
    instants = gait_class.instants
    angles, rates = (gait_class.angle_matrix(instants, n_joint, order) for order in (0, 1))
    sign = np.triu(np.ones((n_joint, n_joint)), 1)
    form = 0.5 * np.einsum("tip,ij,tjq->pq", angles, sign - sign.T, rates) / instants.size
    return 0.5 * (form + form.T)


@lru_cache(maxsize=64)
def _symmetric_tables(kind: LinearClass, n_joint: int) -> np.ndarray:
    """A basis of the allowed tables that are their own image under the symmetry of a class."""
    allowed, name = kind.table_basis(n_joint), type(kind).__name__
    functions = kind.functions(kind.instants)
    angles = np.einsum("jwp,wt->jtp", allowed.reshape(n_joint, len(functions), -1), functions)
    matrix = angles.reshape(-1, allowed.shape[1])
    largest = np.abs(matrix).max()
    rank = np.linalg.matrix_rank(matrix, tol=_CLOSED * largest * np.sqrt(len(matrix)))
    if rank < matrix.shape[1]:
        raise ProblemError(
            f"the functions of the class {name} depend on one another: leave some out."
        )
    if kind.symmetry == NONE:
        return allowed
    if kind.symmetry == BILATERAL:
        how, image = "run backwards, seen from the other end,", np.roll(angles[::-1, ::-1], 1, 1)
    else:
        how, image = "half a cycle later, negated,", np.roll(angles, angles.shape[1] // 2, axis=1)
    image = -image.reshape(matrix.shape)
    turned = np.linalg.lstsq(matrix, image, rcond=None)[0]
    if np.abs(matrix @ turned - image).max() > _CLOSED * largest:
        raise ProblemError(
            f"the class {name} has no symmetry {kind.symmetry!r} for {n_joint} joints: its "
            f"functions {how} are no combinations of its functions. Take symmetry 'none'."
        )
    rest, columns = np.eye(len(turned)) + turned, list[int]()
    symmetric, closed = rest.copy(), _CLOSED * max(1.0, np.abs(turned).max())
    while (sizes := np.linalg.norm(rest, axis=0)).max() > closed:
        # of equal columns, as of splines, the first one: parameters mean the same on any machine
        columns.append(int((sizes > (1 - _CLOSED) * sizes.max()).argmax()))
        direction = rest[:, columns[-1]] / sizes[columns[-1]]
        rest = rest - np.outer(direction, direction @ rest)
    if not columns:
        raise ProblemError(f"the class {name} has no gait of symmetry {kind.symmetry!r} but rest.")
    return allowed @ symmetric[:, np.sort(columns)]
