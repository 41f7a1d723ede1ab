r"""Nonlinear programs assembled from small functions that repeat over a mesh.

Every constraint vector of colloc has the form

    c(x) = C x + sum over blocks of B_b vec( F_b( x[G_b], P_b, delta ) ),      lower <= c(x) <= upper

where F_b is a small function of local variables, evaluated at every instance (mesh point), G_b
gathers its local variables, and C and B_b are constant sparse matrices that hold the scheme's
coefficients. The objective is one more block with a single output. F_b is differentiated once, for
one instance, whatever the size of the mesh; Jacobian and Hessian of the whole are constant sparse
matrices times the stacked local nonzeros.
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy import sparse


@dataclass(frozen=True, eq=False)
class LocalFunction:
    """F(locals, instance parameters, delta) with its first and weighted second derivatives, for one
    instance.

    ``jacobian`` returns the nonzeros listed by (jac_row, jac_col); ``hessian`` takes output weights
    as a fourth argument and returns the nonzeros of the upper triangle listed by (hess_row,
    hess_col).
    """

    n_local: int
    n_out: int
    n_parameter: int
    value: ca.Function
    jacobian: ca.Function
    hessian: ca.Function
    jac_row: np.ndarray
    jac_col: np.ndarray
    hess_row: np.ndarray
    hess_col: np.ndarray


def local_function(
    name: str, local: ca.SX, parameter: ca.SX, delta: ca.SX, out: ca.SX
) -> LocalFunction:
    """Differentiate the expression `out` for one instance."""
    weight = ca.SX.sym("weight", out.shape[0])
    hessian = ca.hessian(ca.dot(weight, out), local)[0]
    return _differentiated(
        name, local, parameter, delta, out, ca.jacobian(out, local), hessian, weight
    )


def _differentiated(
    name: str,
    local: ca.SX,
    parameter: ca.SX,
    delta: ca.SX,
    out: ca.SX,
    jacobian: ca.SX,
    hessian: ca.SX,
    weight: ca.SX,
) -> LocalFunction:
    """A local function with its derivatives."""
    jacobian, upper = ca.sparsify(jacobian), ca.sparsify(ca.triu(hessian))
    jac_row, jac_col = (np.array(a, dtype=int) for a in jacobian.sparsity().get_triplet())
    hess_row, hess_col = (np.array(a, dtype=int) for a in upper.sparsity().get_triplet())
    arguments, sizes = [local, parameter, delta], (local.shape[0], out.shape[0], parameter.shape[0])
    value = ca.Function(name, arguments, [ca.densify(out)])
    jac = ca.Function(f"{name}_jac", arguments, [ca.densify(ca.vertcat(*jacobian.nonzeros()))])
    hess = ca.Function(
        f"{name}_hess", [*arguments, weight], [ca.densify(ca.vertcat(*upper.nonzeros()))]
    )
    return LocalFunction(*sizes, value, jac, hess, jac_row, jac_col, hess_row, hess_col)


def implicit_function(
    name: str, local: ca.SX, given: ca.SX, solved: ca.SX, delta: ca.SX, equations: ca.SX, out: ca.SX
) -> LocalFunction:
    """Outputs as functions of the locals alone, where `solved` solves ``equations(solved, local) =
    0`` (see `Block.implicit`).

    With R the equations, z what they are solved for, y the locals and L the weighted outputs: dz/dy
    = -R_z^-1 R_y, and the total Hessian is that of L + nu.R pulled back along (I, dz/dy), with nu =
    -R_z^-T L_z.
    """
    n = solved.shape[0]
    R_z, R_y = ca.jacobian(equations, solved), ca.jacobian(equations, local)
    slope = -ca.solve(R_z, ca.densify(R_y))
    # backwards, which is a tenth shorter
    on_solved = ca.vertcat(*(ca.jacobian(row, solved) for row in ca.vertsplit(out)))
    jacobian = ca.jacobian(out, local) + on_solved @ slope
    weight, nu = ca.SX.sym("weight", out.shape[0]), ca.SX.sym("nu", n)
    total = ca.dot(weight, out)
    inner = ca.hessian(total + ca.dot(nu, equations), ca.vertcat(local, solved))[0]
    inner = ca.substitute(inner, nu, -ca.solve(R_z.T, ca.densify(ca.jacobian(total, solved).T)))
    frame = ca.vertcat(ca.SX.eye(local.shape[0]), slope)
    hessian = frame.T @ inner @ frame
    return _differentiated(
        name, local, ca.vertcat(given, solved), delta, out, jacobian, hessian, weight
    )


@dataclass(frozen=True, eq=False)
class Block:
    """A local function repeated over instances."""

    function: LocalFunction
    gather: np.ndarray
    """Which variables are the locals of each instance, ``(n_local, n_instance)`` int."""
    scatter: sparse.csr_matrix
    """sparse ``(n_constraint, n_out * n_instance)``: what each output contributes to each
    constraint; outputs are ordered instance by instance."""
    parameters: np.ndarray
    """``(n_given, n_instance)``: initial instance parameters; they may change between solves."""
    implicit: Callable[[ca.MX, ca.MX], ca.MX] | None = None
    """From the local variables ``(n_local, n_instance)`` and delta to more instance parameters,
    appended to the given ones. The function's derivatives have to be total ones."""

    @property
    def n_instance(self) -> int:
        return self.gather.shape[1]


@dataclass(frozen=True, eq=False)
class Assembly:
    """An objective block and constraint blocks over n variables, with the linear part C of the
    constraints."""

    n: int
    objective: Block
    blocks: tuple[Block, ...]
    linear: sparse.csr_matrix

    @property
    def m(self) -> int:
        return self.linear.shape[0]


def _matrix(terms: Terms, shape: tuple[int, int], sources: ca.MX) -> ca.MX:
    """The sparse matrix whose entries are sums of terms."""
    key = terms.column.astype(np.int64) * shape[0] + terms.row
    unique, accumulate = summed(key, terms.source, terms.weight, terms.n_source)
    pattern = ca.Sparsity.triplet(
        shape[0], shape[1], (unique % shape[0]).tolist(), (unique // shape[0]).tolist()
    )
    return ca.MX(pattern, _dm(accumulate) @ sources)


def _dm(matrix: sparse.spmatrix) -> ca.DM:
    coo = sparse.csc_matrix(matrix)
    coo.sort_indices()
    pattern = ca.Sparsity(coo.shape[0], coo.shape[1], coo.indptr.tolist(), coo.indices.tolist())
    return ca.DM(pattern, coo.data.tolist())


def as_sparse(matrix: ca.DM) -> sparse.csr_matrix:
    """A CasADi matrix as a SciPy one."""
    return sparse.csc_matrix(
        (matrix.nonzeros(), matrix.row(), matrix.colind()), shape=matrix.shape
    ).tocsr()


@dataclass(frozen=True, eq=False)
class Oracles:
    """CasADi functions of a nonlinear program: nlp, gradient, Jacobian and Hessian in the form
    nlpsol takes."""

    nlp: dict[str, ca.MX]
    options: dict[str, ca.Function]

    def parameter_vector(self, delta: float, parameters: list[np.ndarray]) -> np.ndarray:
        """The vector of delta and all instance parameters, in the order of the blocks."""
        return np.concatenate(
            [[delta], *(np.asarray(p, dtype=float).ravel(order="F") for p in parameters)]
        )


Mapped = Callable[..., ca.MX]
"""A local function of the block of a number, at all its instances, in one column."""


def oracles(assembly: Assembly) -> Oracles:
    """CasADi functions for the objective and constraints of `assembly`; cost to build does not grow
    with derivatives."""
    blocks = (assembly.objective, *assembly.blocks)
    shapes = [b.parameters.shape for b in blocks]
    x = ca.MX.sym("x", assembly.n)
    p = ca.MX.sym("p", 1 + sum(a * b for a, b in shapes))
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", assembly.m)
    offsets = np.cumsum([1] + [a * b for a, b in shapes])

    @cache
    def arguments(index: int) -> list[ca.MX]:
        block = blocks[index]
        local = ca.reshape(x[block.gather.ravel(order="F").tolist()], block.gather.shape)
        own = ca.reshape(p[int(offsets[index]) : int(offsets[index + 1])], shapes[index])
        if block.implicit is not None:
            own = ca.vertcat(own, block.implicit(local, p[0]))
        return [local, own, ca.repmat(p[0], 1, block.n_instance)]

    def mapped(function: ca.Function, index: int, *more: ca.MX) -> ca.MX:
        return ca.vec(function.map(blocks[index].n_instance)(*arguments(index), *more))

    value = mapped(blocks[0].function.value, 0)
    constraints = _dm(assembly.linear) @ x
    for index, block in enumerate(blocks[1:], 1):
        constraints += _dm(block.scatter) @ mapped(block.function.value, index)

    # gradient of the objective
    f, size = blocks[0].function, blocks[0].function.jac_col.size
    terms = Terms(
        blocks[0].gather[f.jac_col, 0], np.zeros(size, int), np.arange(size), np.ones(size), size
    )
    gradient = ca.densify(_matrix(terms, (assembly.n, 1), mapped(f.jacobian, 0)))
    jacobian = _jacobian(assembly, blocks, mapped)
    hessian = _hessian(assembly, blocks, mapped, lam_f, lam_g)
    return Oracles(
        {"x": x, "p": p, "f": value, "g": constraints},
        {
            "grad_f": ca.Function(
                "nlp_grad_f", [x, p], [value, gradient], ["x", "p"], ["f", "grad_f_x"]
            ),
            "jac_g": ca.Function(
                "nlp_jac_g", [x, p], [constraints, jacobian], ["x", "p"], ["g", "jac_g_x"]
            ),
            "hess_lag": ca.Function(
                "nlp_hess_l",
                [x, p, lam_f, lam_g],
                [hessian],
                ["x", "p", "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
        },
    )


class Terms(NamedTuple):
    """Entries of a matrix as sums of terms: row and column of each, and a weight times one of
    n_source sources."""

    row: np.ndarray
    column: np.ndarray
    source: np.ndarray
    weight: np.ndarray
    n_source: int


def jacobian_terms(linear: sparse.spmatrix, blocks: Sequence[Block]) -> Terms:
    """Those of the Jacobian of ``linear @ x`` and the blocks' contributions; the sources are 1,
    then the nonzeros of the blocks' Jacobians, block by block and instance by instance."""
    constant = sparse.coo_matrix(linear)
    rows, columns = [constant.row], [constant.col]
    sources, weights = [np.zeros(constant.nnz, int)], [constant.data]
    offset = 1
    for block in blocks:
        f, scatter = block.function, sparse.coo_matrix(block.scatter)
        n_nonzero = f.jac_row.size
        out, instance = scatter.col % f.n_out, scatter.col // f.n_out
        # every nonzero of the scatter matrix meets every Jacobian entry of its output row
        order = np.argsort(f.jac_row, kind="stable")
        counts = np.bincount(f.jac_row, minlength=f.n_out)
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        repeat = counts[out]
        which = np.repeat(np.arange(scatter.nnz), repeat)
        within = np.arange(which.size) - np.repeat(np.cumsum(repeat) - repeat, repeat)
        entry = order[starts[out[which]] + within]
        rows.append(scatter.row[which])
        columns.append(block.gather[f.jac_col[entry], instance[which]])
        sources.append(offset + entry + n_nonzero * instance[which])
        weights.append(scatter.data[which])
        offset += n_nonzero * block.n_instance
    row, column, source, weight = (
        np.concatenate(part) for part in (rows, columns, sources, weights)
    )
    return Terms(row, column, source, weight, offset)


def summed(
    key: np.ndarray, source: np.ndarray, weight: np.ndarray, n_source: int
) -> tuple[np.ndarray, sparse.csr_matrix]:
    """The different keys of terms, and the matrix that sums weights times sources for each of
    them."""
    unique, inverse = np.unique(key, return_inverse=True)
    return unique, sparse.csr_matrix((weight, (inverse, source)), shape=(unique.size, n_source))


def _jacobian(assembly: Assembly, blocks: Sequence[Block], mapped: Mapped) -> ca.MX:
    nonzeros = [
        mapped(block.function.jacobian, index)
        for index, block in enumerate(blocks[1:], 1)
        if block.function.jac_row.size
    ]
    return _matrix(
        jacobian_terms(assembly.linear, blocks[1:]),
        (assembly.m, assembly.n),
        ca.vertcat(1, *nonzeros),
    )


def _hessian(
    assembly: Assembly, blocks: Sequence[Block], mapped: Mapped, lam_f: ca.MX, lam_g: ca.MX
) -> ca.MX:
    rows, cols, sources, values, stacked, offset = [], [], [], [], [], 0
    for index, block in enumerate(blocks):
        f = block.function
        n_nonzero = f.hess_row.size
        if n_nonzero == 0:
            continue
        weights = lam_f if index == 0 else _dm(sparse.csr_matrix(block.scatter.T)) @ lam_g
        weights = ca.reshape(weights, f.n_out, block.n_instance)
        a, b = block.gather[f.hess_row], block.gather[f.hess_col]
        rows.append(np.minimum(a, b).ravel(order="F"))
        cols.append(np.maximum(a, b).ravel(order="F"))
        sources.append(offset + np.arange(n_nonzero * block.n_instance))
        aliased = (a == b) & (f.hess_row != f.hess_col)[:, None]
        values.append(np.where(aliased, 2.0, 1.0).ravel(order="F"))
        stacked.append(mapped(f.hessian, index, weights))
        offset += n_nonzero * block.n_instance
    row, col, source, value = (np.concatenate(part) for part in (rows, cols, sources, values))
    return _matrix(
        Terms(row, col, source, value, offset), (assembly.n, assembly.n), ca.vertcat(*stacked)
    )
