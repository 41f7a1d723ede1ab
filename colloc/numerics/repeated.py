"""Nonlinear programs linear in small functions that are repeated over a mesh, with derivatives.

With y the outputs of all functions, rows and objective are ``R [x; y; 1]`` with constant sparse R.
Each function is differentiated once: CasADi's own Hessian of the whole takes three times as long.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse


@dataclass(frozen=True, eq=False)
class LocalFunction:
    """A function `out` of `local` variables, `given` numbers and `delta`, all columns; and of what
    is `solved` by `equations`, by the implicit function theorem."""

    local: ca.SX
    given: ca.SX
    delta: ca.SX
    out: ca.SX
    solved: ca.SX | None = None
    equations: ca.SX | None = None

    @property
    def n_out(self) -> int:
        return int(self.out.shape[0])

    @cached_property
    def derivatives(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Weights ``(n_out, 1)``, sparse Jacobian, upper triangle of the weighted sum's Hessian."""
        weight = ca.SX.sym("weight", self.n_out)
        total = ca.dot(weight, self.out)
        jacobian = ca.jacobian(self.out, self.local)
        if self.solved is None or self.equations is None:
            hessian = ca.hessian(total, self.local)[0]
            return weight, ca.sparsify(jacobian), ca.sparsify(ca.triu(hessian))
        # R(z, y) = 0: dz/dy = -R_z^-1 R_y; the Hessian of L is that of L + nu.R along (I, dz/dy),
        # nu = -R_z^-T L_z
        z, equations = self.solved, self.equations
        R_z, R_y = ca.jacobian(equations, z), ca.jacobian(equations, self.local)
        slope, nu = -ca.solve(R_z, ca.densify(R_y)), ca.SX.sym("nu", z.shape[0])
        by_row = ca.vertcat(*(ca.jacobian(row, z) for row in ca.vertsplit(self.out)))
        inner = ca.hessian(total + ca.dot(nu, equations), ca.vertcat(self.local, z))[0]
        at_nu = -ca.solve(R_z.T, ca.densify(ca.jacobian(total, z).T))
        frame = ca.vertcat(ca.SX.eye(self.local.shape[0]), slope)
        hessian = frame.T @ ca.substitute(inner, nu, at_nu) @ frame
        return weight, ca.sparsify(jacobian + by_row @ slope), ca.sparsify(ca.triu(hessian))

    @cached_property
    def functions(self) -> tuple[ca.Function, ca.Function, ca.Function]:
        """Outputs, nonzeros of the Jacobian, and of the Hessian for weights."""
        weight, jacobian, upper = self.derivatives
        symbols = [self.local, self.given, self.delta]
        symbols += [] if self.solved is None else [self.solved]
        nonzeros = [ca.densify(ca.vertcat(*part.nonzeros())) for part in (jacobian, upper)]
        return (
            ca.Function("local", symbols, [ca.densify(self.out)]),
            ca.Function("jacobian", symbols, nonzeros[:1]),
            ca.Function("hessian", [*symbols, weight], nonzeros[1:]),
        )


@dataclass(frozen=True, eq=False)
class Repeated:
    """A local function at instances; `gather` ``(n_local, n_instance)``: indices of the local
    variables among those of the program. `solve` takes local variables and delta, MX both, to what
    is solved."""

    function: LocalFunction
    gather: np.ndarray
    values: np.ndarray
    solve: Callable[[ca.MX, ca.MX], ca.MX] | None = None

    @property
    def n_instance(self) -> int:
        return self.gather.shape[1]

    @property
    def n_out(self) -> int:
        return self.function.n_out * self.n_instance


class Rows:
    """Rows of a program, by name, as sparse matrices over ``[x; y; 1]``."""

    def __init__(self, n: int) -> None:
        self.n, self.width = n, n
        self.repeated: list[Repeated] = []
        self.rows: list[sparse.csr_matrix] = []
        self.lower: list[np.ndarray] = []
        self.upper: list[np.ndarray] = []
        self.groups: dict[str, slice] = {}
        self._m = 0

    def repeat(
        self,
        local: ca.SX,
        out: ca.SX,
        gather: np.ndarray,
        given: ca.SX | None = None,
        values: np.ndarray | None = None,
        *,
        delta: ca.SX,
    ) -> np.ndarray:
        """Add a function at many instances; indices of its outputs ``(n_out, n_instance)``."""
        given = ca.SX(0, 1) if given is None else given
        values = np.empty((0, gather.shape[1])) if values is None else values
        return self.add_repeated(Repeated(LocalFunction(local, given, delta, out), gather, values))

    def add_repeated(self, repeated: Repeated) -> np.ndarray:
        self.repeated.append(repeated)
        places = self.width + np.arange(repeated.n_out).reshape(repeated.n_instance, -1).T
        self.width += repeated.n_out
        return places

    def close(self) -> None:
        """Add the column of constants: no function is added from here on."""
        self.width += 1

    def pick(self, places: np.ndarray) -> sparse.csr_matrix:
        """Rows that are variables or outputs."""
        places = np.asarray(places).ravel()
        entries = np.ones(places.size), (np.arange(places.size), places)
        return sparse.csr_matrix(entries, shape=(places.size, self.width))

    def constant(self, values: np.ndarray) -> sparse.csr_matrix:
        """Rows that are numbers ``(n_row,)``."""
        last = np.full(values.size, self.width - 1)
        entries = values, (np.arange(values.size), last)
        return sparse.csr_matrix(entries, shape=(values.size, self.width))

    def add(self, name: str, rows: sparse.spmatrix, lower: Any = 0.0, upper: Any = 0.0) -> None:
        """Add ``lower <= rows <= upper``; by default the rows vanish."""
        m = rows.shape[0]
        self.rows.append(sparse.csr_matrix(rows))
        self.lower.append(np.zeros(m) + lower)
        self.upper.append(np.zeros(m) + upper)
        self.groups[name] = slice(self._m, self._m + m)
        self._m += m


@dataclass(frozen=True, eq=False)
class Nlp:
    """A nonlinear program in x and the parameter delta: expressions x, p, f, g; functions grad_f,
    jac_g, hess_lag."""

    expressions: dict[str, ca.MX]
    functions: dict[str, ca.Function]


def nonlinear_program(
    n: int, repeated: Sequence[Repeated], rows: sparse.spmatrix, objective: sparse.spmatrix
) -> Nlp:
    x, delta = ca.MX.sym("x", n), ca.MX.sym("delta")
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", rows.shape[0])
    every = sparse.csr_matrix(sparse.vstack([objective, rows]))
    on_x, on_y, constant = (
        every[:, a:b] for a, b in ((0, n), (n, every.shape[1] - 1), (every.shape[1] - 1, None))
    )
    weights = _dm(on_y.T) @ ca.vertcat(lam_f, lam_g)
    outputs, slopes, curvatures = [], [], []
    jac_places, hess_places, start = [], [], 0
    for part in repeated:
        n_out, n_instance = part.function.n_out, part.n_instance
        local = ca.reshape(x[part.gather.ravel(order="F").tolist()], *part.gather.shape)
        arguments = [local, ca.DM(part.values), ca.repmat(delta, 1, n_instance)]
        arguments += [] if part.solve is None else [part.solve(local, delta)]
        own = ca.reshape(weights[start : start + part.n_out], n_out, n_instance)
        value, slope, curvature = part.function.functions
        outputs.append(ca.vec(value.map(n_instance)(*arguments)))
        slopes.append(ca.vec(slope.map(n_instance)(*arguments)))
        curvatures.append(ca.vec(curvature.map(n_instance)(*arguments, own)))
        _, jacobian, upper = part.function.derivatives
        row, column = (np.array(k, dtype=int) for k in jacobian.sparsity().get_triplet())
        out = start + row[:, None] + n_out * np.arange(n_instance)
        jac_places.append((out, part.gather[column], np.ones(out.shape)))
        row, column = (np.array(k, dtype=int) for k in upper.sparsity().get_triplet())
        a, b = part.gather[row], part.gather[column]
        # one variable in the place of two local ones has both of their mixed derivatives
        twice = np.where((a == b) & (row != column)[:, None], 2.0, 1.0)
        hess_places.append((np.minimum(a, b), np.maximum(a, b), twice))
        start += part.n_out
    y = ca.vertcat(*outputs)
    values = _dm(on_x) @ x + _dm(on_y) @ y + _dm(constant)
    whole = _dm(on_x) + _dm(on_y) @ _matrix((start, n), jac_places, ca.vertcat(*slopes))
    hessian = _matrix((n, n), hess_places, ca.vertcat(*curvatures))
    f, g = values[0], values[1:]
    gradient, jac_g = ca.densify(whole[0, :].T), whole[1:, :]
    ins = ["x", "p"]
    return Nlp(
        {"x": x, "p": delta, "f": f, "g": g},
        {
            "grad_f": ca.Function("nlp_grad_f", [x, delta], [f, gradient], ins, ["f", "grad_f_x"]),
            "jac_g": ca.Function("nlp_jac_g", [x, delta], [g, jac_g], ins, ["g", "jac_g_x"]),
            "hess_lag": ca.Function(
                "nlp_hess_l",
                [x, delta, lam_f, lam_g],
                [hessian],
                [*ins, "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
        },
    )


def as_sparse(matrix: ca.DM) -> sparse.csr_matrix:
    parts = matrix.nonzeros(), matrix.row(), matrix.colind()
    return sparse.csc_matrix(parts, shape=matrix.shape).tocsr()


def _matrix(shape: tuple[int, int], places: list, values: ca.MX) -> ca.MX:
    """Sparse matrix with entries at places (row, column, factor), each ``(n_entry,
    n_instance)``."""
    row, column, factor = (
        np.concatenate([part[k].ravel(order="F") for part in places]) for k in range(3)
    )
    key, place = np.unique(column.astype(np.int64) * shape[0] + row, return_inverse=True)
    sums = sparse.csr_matrix((factor, (place, np.arange(row.size))), shape=(key.size, row.size))
    rows, columns = (key % shape[0]).tolist(), (key // shape[0]).tolist()
    return ca.MX(ca.Sparsity.triplet(*shape, rows, columns), _dm(sums) @ values)


def _dm(matrix: sparse.spmatrix) -> ca.DM:
    csc = sparse.csc_matrix(matrix)
    csc.sort_indices()
    pattern = ca.Sparsity(*csc.shape, csc.indptr.tolist(), csc.indices.tolist())
    return ca.DM(pattern, csc.data.tolist())
