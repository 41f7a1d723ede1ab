"""Tensor-product cubic B-splines over the joint angles, with the symmetries of a body built in.

The same knots on [-A, A] in every joint angle, uniform or graded; N = intervals + 3 functions a
joint. A function of the angles is a vector of N^n_joint coefficients, last joint fastest.
Symmetries of the body permute the coefficients, so a function with a given parity has fewer free
ones: ``full = E @ free`` with the sparse matrix of `symmetric_basis`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import combinations

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline, PPoly
from scipy.linalg import qr

from colloc.system.errors import ProblemError

DEGREE = 3
_DEPENDENT = 1e-9
"""Pivot, relative, below which a function is a sum of others."""


@dataclass(frozen=True)
class TensorSpline:
    """The space of tensor-product cubic splines on the cube |angle| <= limit."""

    n_joint: int
    limit: float
    """Half-width of the cube [rad]."""
    intervals: int
    """Knot intervals a joint."""
    graded: tuple[float, ...] = ()
    """The ``intervals - 1`` inner knots, ascending and symmetric about 0; evenly spaced if
    empty."""

    def __post_init__(self) -> None:
        if self.intervals < 1 or self.n_joint < 1 or not self.limit > 0:
            raise ProblemError(
                "a spline needs at least one joint and one interval, and a positive limit."
            )
        inner = np.array(self.graded)
        if self.graded and (
            inner.size != self.intervals - 1
            or (np.diff(self.knots) <= 0).any()
            or np.abs(inner + inner[::-1]).max() > 1e-9
        ):
            raise ProblemError(
                f"graded knots must be {self.intervals - 1} angles, ascending, symmetric and "
                f"within the limit."
            )

    @cached_property
    def knots(self) -> np.ndarray:
        """Ends of the knot intervals, ``(intervals + 1,)``."""
        if not self.graded:
            return np.linspace(-self.limit, self.limit, self.intervals + 1)
        return np.array([-self.limit, *self.graded, self.limit])

    @cached_property
    def extended(self) -> np.ndarray:
        """The knots and as many more beyond either end, ``(intervals + 1 + 2 DEGREE,)``, spaced as
        at that end."""
        beyond = np.arange(1, DEGREE + 1) * (self.knots[1] - self.knots[0])
        return np.concatenate([self.knots[0] - beyond[::-1], self.knots, self.knots[-1] + beyond])

    @cached_property
    def _cubics(self) -> np.ndarray:
        """On every knot interval the four functions that live there, as polynomials 1, x, x^2, x^3
        of the distance from its begin, ``(intervals, 4, 4)``."""
        each = [
            PPoly.from_spline(BSpline(self.extended, one, DEGREE)).c[::-1]
            for one in np.eye(self.per_joint)
        ]
        return np.array(
            [[each[k + i][:, k + DEGREE] for i in range(DEGREE + 1)] for k in range(self.intervals)]
        )

    @property
    def per_joint(self) -> int:
        return self.intervals + 3

    @property
    def size(self) -> int:
        return self.per_joint**self.n_joint

    def _pieces(self, angle: np.ndarray, order: int) -> np.ndarray:
        """Values ``(n, 4)`` of the functions of one joint that live where it is, or of a derivative
        of them."""
        cell = self.cell(angle)
        x = angle - self.knots[cell]
        powers = np.zeros((DEGREE + 1, angle.size))
        for k in range(order, DEGREE + 1):
            powers[k] = np.prod(np.arange(k - order + 1, k + 1)) * x ** (k - order)
        return np.einsum("nfp,pn->nf", self._cubics[cell], powers)

    def cell(self, angle: np.ndarray) -> np.ndarray:
        """The knot interval that holds each angle."""
        return np.clip(np.searchsorted(self.knots, angle, side="right") - 1, 0, self.intervals - 1)

    def matrix(
        self, angles: np.ndarray, orders: tuple[int, ...] | None = None
    ) -> sparse.csr_matrix:
        """Values of all functions at angles ``(n_joint, n)``, or of their partial derivatives of
        the given orders in every joint angle, ``(n, size)``."""
        value = np.ones((angles.shape[1], 1))
        for joint, order in enumerate(orders or (0,) * self.n_joint):
            value = _products(value, self._pieces(angles[joint], order))
        return self._by_function(angles, value)

    def slope(self, angles: np.ndarray, rates: np.ndarray) -> sparse.csr_matrix:
        """Rates of change of all functions for joint rates ``(n_joint, n)``, ``(n, size)``."""
        value, rate = np.ones((angles.shape[1], 1)), np.zeros((angles.shape[1], 1))
        for joint in range(self.n_joint):
            pieces, steepness = (self._pieces(angles[joint], order) for order in (0, 1))
            rate = _products(rate, pieces) + _products(value, rates[joint][:, None] * steepness)
            value = _products(value, pieces)
        return self._by_function(angles, rate)

    def _by_function(self, angles: np.ndarray, value: np.ndarray) -> sparse.csr_matrix:
        """Values ``(n, 4^n_joint)`` of the functions that live where the angles are, in the columns
        of these, ``(n, size)``."""
        n, width = value.shape
        column = np.zeros((n, 1), dtype=np.int32)
        for angle in angles:
            local = self.cell(angle)[:, None] + np.arange(DEGREE + 1)
            column = (column[:, :, None] * self.per_joint + local[:, None]).reshape(n, -1)
        return sparse.csr_matrix(
            (value.ravel(), column.ravel(), np.arange(n + 1) * width), shape=(n, self.size)
        )

    @cached_property
    def roughness(self) -> sparse.csr_matrix:
        """Gram matrix ``(size, size)`` of the second derivatives: ``c.roughness.c`` is about the
        integral of |D^2 f|^2."""
        half = 0.5 * np.diff(self.knots)
        axis = (self.knots[:-1, None] + half[:, None] * np.array([0.5, 1.5])).ravel()
        angles = np.stack([a.ravel() for a in np.meshgrid(*[axis] * self.n_joint, indexing="ij")])
        weights = np.stack(
            [a.ravel() for a in np.meshgrid(*[np.repeat(half, 2)] * self.n_joint, indexing="ij")]
        ).prod(axis=0)
        total = sparse.csr_matrix((self.size, self.size))
        for i in range(self.n_joint):
            for j in range(self.n_joint):
                orders = tuple(int(k == i) + int(k == j) for k in range(self.n_joint))
                second = self.matrix(angles, orders)
                total = total + second.T @ sparse.diags(weights) @ second
        return total.tocsr()

    def symmetric_basis(
        self, mirror: int, swap: int | None, together: int | None = None
    ) -> sparse.csr_matrix:
        """``(size, n_free)``: functions with f(-q) = mirror f(q), and f(-reversed q) = swap f(q)
        unless swap is None; if `together` is given, sums of functions of so many joints each."""
        index = np.arange(self.size).reshape((self.per_joint,) * self.n_joint)
        flipped = index[(slice(None, None, -1),) * self.n_joint]
        group = [(index.ravel(), 1), (flipped.ravel(), mirror)]
        if swap is not None:
            turned = flipped.transpose(tuple(range(self.n_joint))[::-1]).ravel()
            group += [(turned, swap), (flipped.ravel()[turned], mirror * swap)]
        average = sparse.csr_matrix((self.size, self.size))
        everything = np.arange(self.size)
        for image, sign in group:
            average = average + sparse.csr_matrix(
                (np.full(self.size, float(sign)), (everything, image))
            )
        if together is not None and together < self.n_joint:
            summands = average @ self._of_few_joints(together)
            _, r, order = qr(summands.toarray(), mode="economic", pivoting=True)
            rank = np.sum(np.abs(np.diag(r)) > _DEPENDENT * np.abs(r[0, 0]))
            basis = summands.tocsc()[:, np.sort(order[:rank])]
        else:
            # orbits: one free coefficient for each, unless the signs cancel
            representative = np.min([image for image, _ in group], axis=0)
            columns = np.flatnonzero((representative == everything) & (abs(average.diagonal()) > 0))
            basis = average.tocsc()[:, columns]
        return (basis @ sparse.diags(1.0 / abs(basis).max(axis=0).toarray().ravel())).tocsr()

    def _of_few_joints(self, together: int) -> sparse.csc_matrix:
        """``(size, n)``: the functions of `together` joints each, constant in the others, those of
        every choice of joints."""
        one, all_of_them = (
            sparse.csc_matrix(np.ones((self.per_joint, 1))),
            sparse.eye(self.per_joint, format="csc"),
        )
        each = []
        for chosen in combinations(range(self.n_joint), together):
            factors = [all_of_them if joint in chosen else one for joint in range(self.n_joint)]
            each.append(reduce(sparse.kron, factors))
        return sparse.hstack(each, format="csc")


def _products(values: np.ndarray, more: np.ndarray) -> np.ndarray:
    """Of each of the values ``(n, m)`` with each of more ``(n, k)``, ``(n, m k)``."""
    return (values[:, :, None] * more[:, None]).reshape(len(values), -1)
