"""Constraint rows of a transcription, kind by kind: bounds, a linear part, and what each block
contributes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from colloc.numerics.mesh import Mesh


@dataclass(eq=False)
class Group:
    """Constraint rows of one kind: bounds, linear part, and what the outputs of each named block
    contribute."""

    name: str
    lower: np.ndarray
    upper: np.ndarray
    linear: sparse.csr_matrix
    parts: dict[str, sparse.csr_matrix] = field(default_factory=dict)

    @property
    def m(self) -> int:
        return self.lower.size


def selector(columns: np.ndarray, n: int) -> sparse.csr_matrix:
    """``(len(columns), n)`` matrix that picks entries of a vector."""
    rows = np.arange(columns.size)
    return sparse.csr_matrix((np.ones(columns.size), (rows, columns)), shape=(columns.size, n))


def stacked(groups: list[Group], block: str, n_source: int) -> sparse.csr_matrix:
    """The scatter matrix of a block with `n_source` outputs into all rows."""
    # a body with many checks has a group and a block for each: most parts are empty, and no matrix
    # is made for those
    parts = [g.parts.get(block) for g in groups]
    counts = [
        np.zeros(g.m, dtype=int) if part is None else np.diff(part.indptr)
        for g, part in zip(groups, parts, strict=True)
    ]
    there = [part for part in parts if part is not None]
    data, columns = (
        np.concatenate([getattr(part, name) for part in there]) for name in ("data", "indices")
    )
    ends = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    return sparse.csr_matrix((data, columns, ends), shape=(ends.size - 1, n_source))


def equalities(
    name: str,
    linear: sparse.spmatrix,
    parts: dict[str, sparse.csr_matrix] | None = None,
    given: np.ndarray | float = 0.0,
) -> Group:
    """Rows that are as given, by default 0."""
    right = np.zeros(linear.shape[0]) + given
    return Group(name, right, right, sparse.csr_matrix(linear), parts or {})


def gait_group(
    name: str,
    variables: np.ndarray,
    parameters: np.ndarray,
    matrix: np.ndarray,
    n: int,
    given: np.ndarray | float = 0.0,
) -> Group:
    """``variables - matrix p = given`` at every point, for variables ``(n_shape, n_point)`` that
    are linear in a gait's p.

    `variables` and `parameters` are index arrays; the matrix is ``(n_point, n_shape,
    n_parameter)``.
    """
    rows = sparse.csr_matrix(matrix.reshape(-1, matrix.shape[-1]))
    return equalities(
        name,
        selector(variables.ravel(order="F"), n) - rows @ selector(parameters[:, 0], n),
        given=given,
    )


def output_group(name: str, outputs: range, n_out: int, n_point: int, n: int) -> Group:
    """Outputs of the block "point" that have to vanish at every point."""
    columns = (np.arange(n_point)[:, None] * n_out + np.array(outputs)).ravel()
    return equalities(
        name, sparse.csr_matrix((columns.size, n)), {"point": selector(columns, n_out * n_point)}
    )


def quadrature_group(
    name: str, variable: np.ndarray, output: int, n_out: int, mesh: Mesh, n: int, unit: float
) -> Group:
    """A state kept at the edges grows by the integral of an output of the block "point", which is
    per `unit` of time."""
    state, rate = mesh.quadrature()
    pick = selector(np.arange(mesh.n_point) * n_out + output, n_out * mesh.n_point)
    return equalities(
        name, state @ selector(variable[0], n), {"point": (-unit * rate @ pick).tocsr()}
    )


def rotation_groups(sign: float | None, theta: np.ndarray, n: int, closes: bool) -> list[Group]:
    """The last of variables `theta` in order, and the first times a sign, add up to 0; no row if
    there is no sign or nothing has to close."""
    if sign is None or not closes:
        return []
    return [
        equalities(
            "rotation",
            sparse.csr_matrix(([1.0, sign], ([0, 0], [theta[-1], theta[0]])), shape=(1, n)),
        )
    ]


def total_group(name: str, variable: np.ndarray, mesh: Mesh, n: int, unit: float) -> Group:
    """A variable ``(1, 1)`` is the integral over the mesh of the output of the block `name`, which
    is per `unit` of time."""
    _, rate = mesh.quadrature()
    return equalities(
        name, selector(variable[0], n), {name: sparse.csr_matrix(-unit * rate.sum(axis=0))}
    )


def zero_total_group(name: str, mesh: Mesh, n: int) -> Group:
    """The integral over the mesh of the output of the block `name` vanishes."""
    _, rate = mesh.quadrature()
    return equalities(name, sparse.csr_matrix((1, n)), {name: sparse.csr_matrix(rate.sum(axis=0))})


def block_group(
    name: str,
    lower: np.ndarray | float,
    upper: np.ndarray | float,
    rows: int,
    n: int,
    block: str = "",
) -> Group:
    """Outputs of a block, by default of the same name, between bounds."""
    low, high = (np.full(rows, bound, dtype=float) for bound in (lower, upper))
    return Group(
        name,
        low,
        high,
        sparse.csr_matrix((rows, n)),
        {block or name: sparse.eye(rows, format="csr")},
    )
