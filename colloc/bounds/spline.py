"""Tensor-product cubic B-splines over the joint angles, with the symmetries of a body.

A function is a vector of (intervals + 3)^n_joint coefficients, last joint fastest. Symmetries
permute these, so a function with given parities has fewer free ones: ``full = E @ free``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import combinations

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.linalg import qr

from colloc.system.errors import ProblemError

DEGREE = 3
_DEPENDENT = 1e-9  # pivot, relative, below which a function is a sum of others


@dataclass(frozen=True)
class TensorSpline:
    """Tensor-product cubic splines on the cube |angle| <= limit [rad]."""

    n_joint: int
    limit: float
    intervals: int
    graded: tuple[float, ...] = ()
    """Inner knots, ascending and symmetric about 0; evenly spaced if empty."""

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
        if not self.graded:
            return np.linspace(-self.limit, self.limit, self.intervals + 1)
        return np.array([-self.limit, *self.graded, self.limit])

    @cached_property
    def extend(self) -> np.ndarray:
        beyond = np.arange(1, DEGREE + 1) * (self.knots[1] - self.knots[0])
        return np.concatenate([self.knots[0] - beyond[::-1], self.knots, self.knots[-1] + beyond])

    @property
    def per_joint(self) -> int:
        return self.intervals + DEGREE

    @property
    def size(self) -> int:
        return self.per_joint**self.n_joint

    def cell(self, angle: np.ndarray) -> np.ndarray:
        return np.clip(np.searchsorted(self.knots, angle, side="right") - 1, 0, self.intervals - 1)

    def _local(self, angle: np.ndarray) -> np.ndarray:
        """Indices ``(n, 4)`` of the functions of one joint that live at an angle."""
        return self.cell(angle)[:, None] + np.arange(DEGREE + 1)

    def _pieces(self, angle: np.ndarray, order: int) -> np.ndarray:
        every = BSpline(self.extend, np.eye(self.per_joint), DEGREE)(angle, nu=order)
        return np.take_along_axis(every, self._local(angle), axis=1)

    def matrix(
        self, angles: np.ndarray, orders: tuple[int, ...] | None = None
    ) -> sparse.csr_matrix:
        """Functions, or partial derivatives of given orders, at angles ``(n_joint, n)``, ``(n,
        size)``."""
        value = np.ones((angles.shape[1], 1))
        for angle, order in zip(angles, orders or (0,) * self.n_joint, strict=True):
            value = _products(value, self._pieces(angle, order))
        return self._columns(angles, value)

    def slope(self, angles: np.ndarray, rates: np.ndarray) -> sparse.csr_matrix:
        """Rates of change of all functions for joint rates ``(n_joint, n)``, ``(n, size)``."""
        value, change = np.ones((angles.shape[1], 1)), np.zeros((angles.shape[1], 1))
        for angle, rate in zip(angles, rates, strict=True):
            pieces, steepness = (self._pieces(angle, order) for order in (0, 1))
            change = _products(change, pieces) + _products(value, rate[:, None] * steepness)
            value = _products(value, pieces)
        return self._columns(angles, change)

    def _columns(self, angles: np.ndarray, value: np.ndarray) -> sparse.csr_matrix:
        """Put values ``(n, 4^n_joint)`` into the columns of their functions."""
        n, width = value.shape
        column = np.zeros((n, 1), dtype=np.int32)
        for angle in angles:
            column = (column[:, :, None] * self.per_joint + self._local(angle)[:, None]).reshape(
                n, -1
            )
        return sparse.csr_matrix(
            (value.ravel(), column.ravel(), np.arange(n + 1) * width), shape=(n, self.size)
        )

    @cached_property
    def roughness(self) -> sparse.csr_matrix:
        """Gram matrix of the second derivatives: ``c.roughness.c`` is about the integral of |D^2
        f|^2."""
        half = 0.5 * np.diff(self.knots)
        axis = (self.knots[:-1, None] + half[:, None] * np.array([0.5, 1.5])).ravel()
        angles, widths = (
            np.stack([a.ravel() for a in np.meshgrid(*[each] * self.n_joint, indexing="ij")])
            for each in (axis, np.repeat(half, 2))
        )
        weights = sparse.diags(widths.prod(axis=0))
        total = sparse.csr_matrix((self.size, self.size))
        for i in range(self.n_joint):
            for j in range(self.n_joint):
                orders = tuple(int(k == i) + int(k == j) for k in range(self.n_joint))
                second = self.matrix(angles, orders)
                total = total + second.T @ weights @ second
        return total.tocsr()

    def symmetric_basis(
        self, mirror: int, swap: int | None, together: int | None = None
    ) -> sparse.csr_matrix:
        """Basis ``(size, n_free)`` of functions with f(-q) = mirror f(q), f(-reversed q) = swap
        f(q); with `together`, of sums of functions of so many joints."""
        index = np.arange(self.size).reshape((self.per_joint,) * self.n_joint)
        flipped = index[(slice(None, None, -1),) * self.n_joint]
        group = [(index.ravel(), 1), (flipped.ravel(), mirror)]
        if swap is not None:
            turned = flipped.transpose().ravel()
            group += [(turned, swap), (flipped.ravel()[turned], mirror * swap)]
        every, average = np.arange(self.size), sparse.csr_matrix((self.size, self.size))
        for image, sign in group:
            entries = np.full(self.size, float(sign)), (every, image)
            average = average + sparse.csr_matrix(entries)
        if together is not None and together < self.n_joint:
            summands = average @ self._functions_of(together)
            _, r, order = qr(summands.toarray(), mode="economic", pivoting=True)
            rank = np.sum(np.abs(np.diag(r)) > _DEPENDENT * np.abs(r[0, 0]))
            basis = summands.tocsc()[:, np.sort(order[:rank])]
        else:
            # orbits: one free coefficient for each, unless the signs cancel
            representative = np.min([image for image, _ in group], axis=0)
            alive = (representative == every) & (abs(average.diagonal()) > 0)
            basis = average.tocsc()[:, np.flatnonzero(alive)]
        return (basis @ sparse.diags(1.0 / abs(basis).max(axis=0).toarray().ravel())).tocsr()

    def _functions_of(self, together: int) -> sparse.csc_matrix:
        """Functions ``(size, n)`` of so many joints, for every choice."""
        constant = sparse.csc_matrix(np.ones((self.per_joint, 1)))
        free = sparse.eye(self.per_joint, format="csc")
        return sparse.hstack(
            [
                reduce(sparse.kron, [free if k in some else constant for k in range(self.n_joint)])
                for some in combinations(range(self.n_joint), together)
            ],
            format="csc",
        )


def _products(values: np.ndarray, more: np.ndarray) -> np.ndarray:
    return (values[:, :, None] * more[:, None]).reshape(len(values), -1)
