"""Nonlinear programs linear in small functions that are repeated over a mesh, with derivatives.

With y the outputs of all functions, rows and objective are ``R [x; y; 1]`` with constant sparse R.
Each function is differentiated once: CasADi's own Hessian of the whole takes three times as long.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

_REGULARISATION = 1e-10  # makes a matrix of multipliers regular where equations are redundant


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

    @cached_property
    def functions(self) -> tuple[ca.Function, ca.Function, ca.Function, ca.Sparsity, ca.Sparsity]:
        """Outputs, nonzeros of their Jacobian, those of the upper triangle of the Hessian of their
        sum with weights; the patterns of these."""
        weight = ca.SX.sym("weight", self.out.shape[0])
        total, symbols = ca.dot(weight, self.out), [self.local, self.given, self.delta]
        jacobian = ca.jacobian(self.out, self.local)
        if self.solved is None or self.equations is None:
            hessian = ca.hessian(total, self.local)[0]
        else:
            # R(z, y) = 0: dz/dy = -R_z^-1 R_y; the Hessian of L is that of L + nu.R along (I,
            # dz/dy), nu = -R_z^-T L_z
            z, equations = self.solved, self.equations
            symbols.append(z)
            R_z, R_y = ca.jacobian(equations, z), ca.jacobian(equations, self.local)
            slope, nu = -ca.solve(R_z, ca.densify(R_y)), ca.SX.sym("nu", z.shape[0])
            by_row = ca.vertcat(*(ca.jacobian(row, z) for row in ca.vertsplit(self.out)))
            inner = ca.hessian(total + ca.dot(nu, equations), ca.vertcat(self.local, z))[0]
            at_nu = -ca.solve(R_z.T, ca.densify(ca.jacobian(total, z).T))
            frame = ca.vertcat(ca.SX.eye(self.local.shape[0]), slope)
            hessian = frame.T @ ca.substitute(inner, nu, at_nu) @ frame
            jacobian += by_row @ slope
        jacobian, upper = ca.sparsify(jacobian), ca.sparsify(ca.triu(hessian))
        nonzeros = [ca.densify(ca.vertcat(*part.nonzeros())) for part in (jacobian, upper)]
        return (
            ca.Function("local", symbols, [ca.densify(self.out)]),
            ca.Function("jacobian", symbols, nonzeros[:1]),
            ca.Function("hessian", [*symbols, weight], nonzeros[1:]),
            jacobian.sparsity(),
            upper.sparsity(),
        )


class Repeated(NamedTuple):
    """A local function at instances; `gather` ``(n_local, n_instance)``: indices of the local
    variables among those of the program. `solve` takes local variables and delta, MX both, to what
    is solved."""

    function: LocalFunction
    gather: np.ndarray
    values: np.ndarray
    solve: Callable[[ca.MX, ca.MX], ca.MX] | None = None


class Nlp(NamedTuple):
    """A nonlinear program in x and the parameter delta: expressions x, p, f, g; functions grad_f,
    jac_g, hess_lag."""

    expressions: dict[str, ca.MX]
    functions: dict[str, ca.Function]


class Program:
    """Rows of a program in x ``(n,)``, by name: sparse matrices over ``[x; y; 1]``. All functions
    are repeated before the first row is made."""

    def __init__(self, n: int) -> None:
        self.n, self._n_y = n, 0
        self.delta = ca.SX.sym("delta")
        self.repeated: list[Repeated] = []
        self.rows: list[sparse.csr_matrix] = []
        self.groups: dict[str, slice] = {}
        self.row_lower, self.row_upper = np.empty(0), np.empty(0)
        self.objective: sparse.csr_matrix | None = None

    def repeat(
        self,
        function: Callable[..., ca.SX],
        variables: Sequence[np.ndarray],
        given: Sequence[np.ndarray] = (),
    ) -> np.ndarray:
        """Add a function at many instances; indices of its outputs ``(n_out, n_instance)``.

        Its arguments are, of each instance, variables, by their indices ``(n_instance,)`` or ``(k,
        n_instance)``, then numbers, given for so many successive instances each.
        """
        gather = np.vstack(variables)
        local = [ca.SX.sym("x", 1 if each.ndim == 1 else len(each)) for each in variables]
        numbers, symbols, values = [], [], []
        for column in map(np.ravel, given):
            if np.ptp(column) == 0.0:
                numbers.append(float(column[0]))
                continue
            symbols.append(ca.SX.sym("given"))
            numbers.append(symbols[-1])
            values.append(np.repeat(column, gather.shape[1] // column.size))
        out = function(*local, *numbers)
        columns = ca.vertcat(*local), ca.vertcat(ca.SX(0, 1), *symbols), self.delta, out
        numeric = np.reshape(values, (len(values), gather.shape[1]))
        return self.add_repeated(Repeated(LocalFunction(*columns), gather, numeric))

    def add_repeated(self, repeated: Repeated) -> np.ndarray:
        n_out, n_instance = repeated.function.out.shape[0], repeated.gather.shape[1]
        start, self._n_y = self.n + self._n_y, self._n_y + n_out * n_instance
        self.repeated.append(repeated)
        return start + np.arange(n_out * n_instance).reshape(n_instance, n_out).T

    def pick(self, places: np.ndarray) -> sparse.csr_matrix:
        """Rows that are variables or outputs."""
        places = np.ravel(places)
        entries = np.ones(places.size), (np.arange(places.size), places)
        return sparse.csr_matrix(entries, shape=(places.size, self.n + self._n_y + 1))

    def constant(self, values: np.ndarray) -> sparse.csr_matrix:
        """Rows that are numbers ``(n_row,)``."""
        return sparse.diags(values) @ self.pick(np.full(values.size, self.n + self._n_y))

    def add(self, name: str, rows: sparse.spmatrix, lower: Any = 0.0, upper: Any = 0.0) -> None:
        """Add ``lower <= rows <= upper``; by default the rows vanish."""
        m = rows.shape[0]
        self.groups[name] = slice(self.row_lower.size, self.row_lower.size + m)
        self.rows.append(sparse.csr_matrix(rows))
        self.row_lower = np.append(self.row_lower, np.zeros(m) + lower)
        self.row_upper = np.append(self.row_upper, np.zeros(m) + upper)

    @cached_property
    def nlp(self) -> Nlp:
        n, m = self.n, self.row_lower.size
        x, delta = ca.MX.sym("x", n), ca.MX.sym("delta")
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", m)
        every = sparse.csr_matrix(sparse.vstack([self.objective, *self.rows]))
        on_x, on_y, constant = (
            every[:, a:b] for a, b in ((0, n), (n, n + self._n_y), (n + self._n_y, None))
        )
        weights = _dm(on_y.T) @ ca.vertcat(lam_f, lam_g)
        outputs, slopes, curvatures = [], [], []
        jac_places, hess_places, start = [], [], 0
        for function, gather, values, solve in self.repeated:
            n_out, n_instance = function.out.shape[0], gather.shape[1]
            local = ca.reshape(x[gather.ravel(order="F").tolist()], *gather.shape)
            arguments = [local, ca.DM(values), ca.repmat(delta, 1, n_instance)]
            arguments += [] if solve is None else [solve(local, delta)]
            own = ca.reshape(weights[start : start + n_out * n_instance], n_out, n_instance)
            value, slope, curvature, jacobian, upper = function.functions
            outputs.append(ca.vec(value.map(n_instance)(*arguments)))
            slopes.append(ca.vec(slope.map(n_instance)(*arguments)))
            curvatures.append(ca.vec(curvature.map(n_instance)(*arguments, own)))
            row, column = (np.array(k, dtype=int) for k in jacobian.get_triplet())
            out = start + row[:, None] + n_out * np.arange(n_instance)
            jac_places.append((out, gather[column], np.ones(out.shape)))
            row, column = (np.array(k, dtype=int) for k in upper.get_triplet())
            a, b = gather[row], gather[column]
            # one variable in the place of two local ones has both of their mixed derivatives
            twice = np.where((a == b) & (row != column)[:, None], 2.0, 1.0)
            hess_places.append((np.minimum(a, b), np.maximum(a, b), twice))
            start += n_out * n_instance
        values = _dm(on_x) @ x + _dm(on_y) @ ca.vertcat(*outputs) + _dm(constant)
        slope_of_y = _matrix((start, n), jac_places, ca.vertcat(*slopes))
        whole = _dm(on_x) + _dm(on_y) @ slope_of_y
        hessian = _matrix((n, n), hess_places, ca.vertcat(*curvatures))
        f, g, gradient, jac_g = values[0], values[1:], ca.densify(whole[0, :].T), whole[1:, :]
        ins, multipliers = ["x", "p"], ["lam_f", "lam_g"]
        return Nlp(
            {"x": x, "p": delta, "f": f, "g": g},
            {
                "grad_f": ca.Function("grad_f", [x, delta], [f, gradient], ins, ["f", "grad_f_x"]),
                "jac_g": ca.Function("jac_g", [x, delta], [g, jac_g], ins, ["g", "jac_g_x"]),
                "hess_lag": ca.Function(
                    "hess_lag", [x, delta, lam_f, lam_g], [hessian], [*ins, *multipliers],
                    ["triu_hess_gamma_x_x"],
                ),
            },
        )  # fmt: skip


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


def quasi_definite_factors(jacobian: sparse.csr_matrix) -> SuperLU:
    """Factors of the matrix ``[[1, J'], [J, -eps]]`` for a Jacobian J ``(m, n)``.

    It is quasi-definite, so it has factors in any symmetric order without pivoting (Vanderbei,
    1995). Minimum degree keeps their fill linear in the mesh; pivoting makes it quadratic.
    """
    m, n = jacobian.shape
    system = sparse.bmat(
        [[sparse.eye(n), jacobian.T], [jacobian, -_REGULARISATION * sparse.eye(m)]], format="csc"
    )
    return splu(
        system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )


def least_squares_multipliers(jacobian: sparse.csr_matrix, gradient: np.ndarray) -> np.ndarray:
    """Multipliers ``(m,)`` that minimise ``|gradient + J' multipliers|``, J ``(m, n)``."""
    m, n = jacobian.shape
    factors = quasi_definite_factors(jacobian)
    x = factors.solve(np.concatenate([-gradient, np.zeros(m)]))
    # without pivoting some digits are lost; one refinement brings them back
    left = np.concatenate([-gradient - x[:n] - jacobian.T @ x[n:], -jacobian @ x[:n]])
    left[n:] += _REGULARISATION * x[n:]
    return (x + factors.solve(left))[n:]


def implicit_derivatives(
    equations: Callable[[ca.SX, ca.SX, ca.SX], tuple[list[ca.SX], ca.SX]], n_y: int, n_z: int
) -> Callable[[np.ndarray, np.ndarray, float], np.ndarray]:
    """A function of y ``(n_y, n_time)``, z ``(n_z, n_time)`` and a parameter: total derivatives
    ``(n_out, n_y, n_time)`` along y of outputs at the z that solve ``residual = 0``.

    equations: symbols y, z and the parameter to the outputs and the residual ``(n_z, 1)``.
    """
    y, z, parameter = ca.SX.sym("y", n_y), ca.SX.sym("z", n_z), ca.SX.sym("parameter")
    outputs, residual = equations(y, z, parameter)
    out = ca.vertcat(*outputs)
    adjoint = ca.solve(ca.jacobian(residual, z).T, ca.jacobian(out, z).T)
    slope = ca.jacobian(out, y).T - ca.jacobian(residual, y).T @ adjoint
    flat = ca.vec(ca.densify(slope))
    # sharing subexpressions makes it no faster, and takes seconds for a body of many panels
    function: Any = ca.Function("derivatives", [y, z, parameter], [flat])

    def evaluate(y: np.ndarray, z: np.ndarray, parameter: float) -> np.ndarray:
        return np.asarray(function(y, z, parameter).full()).reshape(-1, n_y, y.shape[1])

    return evaluate
