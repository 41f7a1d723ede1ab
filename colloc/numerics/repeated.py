"""Nonlinear programs linear in small functions that are repeated over a mesh, with derivatives.

With y the outputs of all functions, rows and objective are ``R [x; y; 1]`` with constant sparse R.
Each function is differentiated once: CasADi's own Hessian of the whole takes three times as long.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from colloc.numerics.sqp import keep_last

_REGULARISATION = 1e-10  # makes a matrix of multipliers regular where equations are redundant


Derived = tuple[ca.Function, ca.Function, ca.Function, ca.Sparsity, ca.Sparsity]
"""Outputs, nonzeros of their Jacobian, those of the upper triangle of the Hessian of their sum with
weights; the patterns of these."""
_VALUES, _SLOPES, _CURVATURES = range(3)


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
    def functions(self) -> Derived:
        inputs, outputs = [self.local, self.given, self.delta], [self.out]
        if self.solved is not None and self.equations is not None:
            inputs, outputs = [*inputs, self.solved], [*outputs, self.equations]
        return _derived(ca.Function("local", inputs, outputs).serialize())


@lru_cache(maxsize=64)
def _derived(serialized: str) -> Derived:
    """Of the function of a `LocalFunction`; programs of one kind share them."""
    function = ca.Function.deserialize(serialized)
    symbols = function.sx_in()
    (local, *_), outputs = symbols, function.call(symbols)
    out = outputs[0]
    weight = ca.SX.sym("weight", out.shape[0])
    total, jacobian = ca.dot(weight, out), ca.jacobian(out, local)
    if len(outputs) == 1:
        hessian = ca.hessian(total, local)[0]
    else:
        # R(z, y) = 0: dz/dy = -R_z^-1 R_y; the Hessian of L is that of L + nu.R along (I, dz/dy),
        # nu = -R_z^-T L_z
        z, equations = symbols[3], outputs[1]
        R_z, R_y = ca.jacobian(equations, z), ca.jacobian(equations, local)
        slope, nu = -ca.solve(R_z, ca.densify(R_y)), ca.SX.sym("nu", z.shape[0])
        by_row = ca.vertcat(*(ca.jacobian(row, z) for row in ca.vertsplit(out)))
        inner = ca.hessian(total + ca.dot(nu, equations), ca.vertcat(local, z))[0]
        at_nu = -ca.solve(R_z.T, ca.densify(ca.jacobian(total, z).T))
        frame = ca.vertcat(ca.SX.eye(local.shape[0]), slope)
        hessian = frame.T @ ca.substitute(inner, nu, at_nu) @ frame
        jacobian += by_row @ slope
    jacobian, upper = ca.sparsify(jacobian), ca.sparsify(ca.triu(hessian))
    nonzeros = [ca.densify(ca.vertcat(*part.nonzeros())) for part in (jacobian, upper)]
    return (
        ca.Function("local", symbols, [ca.densify(out)]),
        ca.Function("jacobian", symbols, nonzeros[:1]),
        ca.Function("hessian", [*symbols, weight], nonzeros[1:]),
        jacobian.sparsity(),
        upper.sparsity(),
    )


class Repeated(NamedTuple):
    """A local function at instances; `gather` ``(n_local, n_instance)``: indices of the local
    variables among those of the program. `solve` takes local variables ``(n_local, n_instance)``
    and delta to what is solved."""

    function: LocalFunction
    gather: np.ndarray
    values: np.ndarray
    solve: Callable[[np.ndarray, float], np.ndarray] | None = None

    def columns(self, x: np.ndarray, delta: float) -> list[np.ndarray]:
        """Arguments of the function, of all instances ``(k, n_instance)``."""
        local = x[self.gather]
        solved = [] if self.solve is None else [self.solve(local, delta)]
        return [local, self.values, np.full((1, local.shape[1]), delta), *solved]


Output = tuple[ca.Sparsity, Callable[..., Any]]


class NumPyFunction(ca.Callback):
    """A function as CasADi calls it, whose outputs are functions by NumPy, of dense columns to
    nonzeros. CasADi does not keep it alive."""

    def __init__(self, name: str, inputs: Sequence[int], *outputs: Output) -> None:
        ca.Callback.__init__(self)
        self._inputs, self._outputs = inputs, outputs
        self.construct(name)

    def get_n_in(self) -> int:
        return len(self._inputs)

    def get_n_out(self) -> int:
        return len(self._outputs)

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self._inputs[index])

    def get_sparsity_out(self, index: int) -> ca.Sparsity:
        return self._outputs[index][0]

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, inputs: Sequence[Any], outputs: Sequence[Any]) -> int:
        columns = [np.frombuffer(each) for each in inputs if each is not None]
        for room, (_, function) in zip(outputs, self._outputs, strict=True):
            if room is not None:
                np.frombuffer(room)[:] = function(*columns)
        return 0


class Nlp:
    """A nonlinear program in x and the parameter delta: expressions x, p, f, g; functions grad_f,
    jac_g, hess_lag. What is known of the last point is kept."""

    def __init__(self, program: Program) -> None:
        self._repeated, n, m = program.repeated, program.n, program.row_lower.size
        self._every = every = sparse.csr_matrix(sparse.vstack([program.objective, *program.rows]))
        self._on_y = on_y = sparse.csr_matrix(every[:, n:-1].T)
        out, along, places, start = [], [], [], 0
        for function, gather, *_ in self._repeated:
            *_, jacobian, upper = function.functions
            n_out, instances = function.out.shape[0], np.arange(gather.shape[1])[:, None]
            row, column = (np.array(k, dtype=int) for k in jacobian.get_triplet())
            out.append((start + row + n_out * instances).ravel())
            along.append(gather.T[:, column].ravel())
            row, column = (np.array(k, dtype=int) for k in upper.get_triplet())
            a, b = gather.T[:, row], gather.T[:, column]
            # one variable in the place of two local ones has both of their mixed derivatives
            twice = np.where((a == b) & (row != column), 2.0, 1.0)
            places.append([k.ravel() for k in (np.minimum(a, b), np.maximum(a, b), twice)])
            start += n_out * instances.size
        # a slope of an output counts in every row of the output
        outs, column = np.concatenate(out), np.concatenate(along)
        first, count = on_y.indptr[outs], np.diff(on_y.indptr)[outs]
        number = np.repeat(np.arange(outs.size), count)
        at = np.arange(number.size) + (first + count - np.cumsum(count))[number]
        linear = every[:, :n].tocoo()  # and a 1 after the slopes in what is linear
        row = np.concatenate([on_y.indices[at], linear.row])
        column = np.concatenate([column[number], linear.col])
        factor = np.concatenate([on_y.data[at], linear.data])
        number = np.concatenate([number, np.full(linear.nnz, outs.size)])
        shape, places_of_all = every[:, :n].shape, (row, column)
        self._whole, self._on_slopes = _sums(shape, outs.size + 1, factor, places_of_all, number)
        row, column, factor = map(np.concatenate, zip(*places, strict=True))
        every_number = np.arange(row.size)
        hessian, self._on_curvatures = _sums((n, n), row.size, factor, (row, column), every_number)
        self._columns = keep_last(self._columns_at)
        self.values, self.slopes = keep_last(self._values_at), keep_last(self._slopes_at)

        at, dense, join = (n, 1), ca.Sparsity.dense, np.concatenate
        f = dense(1), lambda *at: self.values(join(at))[:1]
        g = dense(m), lambda *at: self.values(join(at))[1:]
        gradient = dense(n), lambda *at: self.slopes(join(at))[0]
        jacobian = _pattern(self._whole[1:]), lambda *at: self.slopes(join(at))[1].data
        self.functions = {
            "grad_f": NumPyFunction("grad_f", at, f, gradient),
            "jac_g": NumPyFunction("jac_g", at, g, jacobian),
            "hess_lag": NumPyFunction("hess_lag", (*at, 1, m), (_pattern(hessian), self._hess_lag)),
        }
        x, p = ca.MX.sym("x", n), ca.MX.sym("p")
        f_and_g = {name[-1]: self.functions[name](x, p)[0] for name in ("grad_f", "jac_g")}
        self.expressions = {"x": x, "p": p, **f_and_g}

    def _columns_at(self, at: np.ndarray) -> list[list[np.ndarray]]:
        return [each.columns(at[:-1], float(at[-1])) for each in self._repeated]

    def _of_instances(self, kind: int, columns: list[list[np.ndarray]]) -> list[np.ndarray]:
        functions = (each.function.functions[kind] for each in self._repeated)
        return [at_instances(*both) for both in zip(functions, columns, strict=True)]

    def _values_at(self, at: np.ndarray) -> np.ndarray:
        outputs = self._of_instances(_VALUES, self._columns(at))
        return self._every @ np.concatenate([at[:-1], *outputs, [1.0]])

    def _slopes_at(self, at: np.ndarray) -> tuple[np.ndarray, sparse.csc_matrix]:
        slopes = np.concatenate([*self._of_instances(_SLOPES, self._columns(at)), [1.0]])
        parts = self._on_slopes @ slopes, self._whole.indices, self._whole.indptr
        whole = sparse.csc_matrix(parts, shape=self._whole.shape)
        return whole[:1].toarray().ravel(), whole[1:]

    def _hess_lag(
        self, x: np.ndarray, delta: np.ndarray, on_f: np.ndarray, on_g: np.ndarray
    ) -> np.ndarray:
        weights, columns, start = self._on_y @ np.append(on_f, on_g), [], 0
        for each, given in zip(self._repeated, self._columns(np.append(x, delta)), strict=True):
            shape = each.gather.shape[1], each.function.out.shape[0]
            end = start + shape[0] * shape[1]
            columns.append([*given, weights[start:end].reshape(shape).T])
            start = end
        curvatures = self._of_instances(_CURVATURES, columns)
        return self._on_curvatures @ np.concatenate(curvatures)


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
        return self._one_each(np.ones(np.size(places)), np.ravel(places))

    def constant(self, values: np.ndarray) -> sparse.csr_matrix:
        """Rows that are numbers ``(n_row,)``."""
        return self._one_each(values, np.full(values.size, self.n + self._n_y))

    def _one_each(self, values: np.ndarray, places: np.ndarray) -> sparse.csr_matrix:
        ends = np.arange(values.size + 1, dtype=np.int32)  # as SciPy keeps indices
        shape = values.size, self.n + self._n_y + 1
        return sparse.csr_matrix((values, places.astype(np.int32), ends), shape=shape)

    def add(self, name: str, rows: sparse.csr_matrix, lower: Any = 0.0, upper: Any = 0.0) -> None:
        """Add ``lower <= rows <= upper``; by default the rows vanish."""
        m = rows.shape[0]
        self.groups[name] = slice(self.row_lower.size, self.row_lower.size + m)
        self.rows.append(rows)
        self.row_lower = np.append(self.row_lower, np.zeros(m) + lower)
        self.row_upper = np.append(self.row_upper, np.zeros(m) + upper)

    @cached_property
    def nlp(self) -> Nlp:
        return Nlp(self)


def _sums(
    shape: tuple[int, int],
    n_number: int,
    factor: np.ndarray,
    places: tuple[np.ndarray, np.ndarray],
    number: np.ndarray,
) -> tuple[sparse.csc_matrix, sparse.csr_matrix]:
    """The pattern of a matrix to which numbers, times factors, are added at places (row, column);
    and the matrix from the numbers to its nonzeros."""
    row, column = places
    key, place = np.unique(column.astype(np.int64) * shape[0] + row, return_inverse=True)
    rows, ends = key % shape[0], np.searchsorted(key, shape[0] * np.arange(shape[1] + 1))
    pattern = sparse.csc_matrix((np.ones(key.size), rows, ends), shape=shape)
    return pattern, sparse.csr_matrix((factor, (place, number)), shape=(key.size, n_number))


def _pattern(matrix: sparse.csc_matrix) -> ca.Sparsity:
    return ca.Sparsity(*matrix.shape, matrix.indptr.tolist(), matrix.indices.tolist())


@lru_cache(maxsize=64)
def _mapped(function: ca.Function, n: int) -> ca.Function:
    return function.map(n)


def at_instances(function: ca.Function, columns: list[np.ndarray]) -> np.ndarray:
    """Values of a function of columns, one instance after the other."""
    n_instance = columns[0].shape[1]
    values = np.empty(function.nnz_out(0) * n_instance)
    if values.size:
        buffer, evaluate = _mapped(function, n_instance).buffer()
        arguments = [each.ravel(order="F") for each in columns]  # held till the end
        for k, each in enumerate(arguments):
            if each.size:
                buffer.set_arg(k, memoryview(each))  # type: ignore[arg-type]
        buffer.set_res(0, memoryview(values))  # type: ignore[arg-type]
        evaluate()
    return values


def quasi_definite_factors(jacobian: sparse.csr_matrix) -> SuperLU:
    """Factors of the matrix ``[[1, J'], [J, -eps]]`` for a Jacobian J ``(m, n)``.

    It is quasi-definite, so it has factors in any symmetric order without pivoting (Vanderbei,
    1995). Minimum degree keeps their fill linear in the mesh; pivoting makes it quadratic.
    """
    m, n = jacobian.shape
    system = sparse.bmat(
        [[sparse.eye(n), jacobian.T], [jacobian, -_REGULARISATION * sparse.eye(m)]], format="csc"
    )
    # supernodes of one column, as dense blocks are not worth their zeros here: a third quicker
    how: Any = {"permc_spec": "MMD_AT_PLUS_A", "relax": 1, "panel_size": 1}
    return splu(system, diag_pivot_thresh=0.0, options={"SymmetricMode": True}, **how)


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
    equations: Callable[..., tuple[list[ca.SX], ca.SX]], n_y: int, n_z: int, *, shared: bool = False
) -> Callable[[np.ndarray, np.ndarray, float], np.ndarray]:
    """A function of y ``(n_y, n_time)``, z ``(n_z, n_time)`` and a parameter: total derivatives
    ``(n_out, n_y, n_time)`` along y of outputs at the z that solve ``residual = 0``.

    equations: symbols y, z and the parameter to the outputs and the residual ``(n_z, 1)``. shared:
    share subexpressions, which takes seconds for a body of many panels.
    """
    y, z, parameter = ca.SX.sym("y", n_y), ca.SX.sym("z", n_z), ca.SX.sym("parameter")
    outputs, residual = equations(y, z, parameter)
    out = ca.vertcat(*outputs)
    adjoint = ca.solve(ca.jacobian(residual, z).T, ca.jacobian(out, z).T)
    slope = ca.jacobian(out, y).T - ca.jacobian(residual, y).T @ adjoint
    flat = ca.vec(ca.densify(slope))
    function: Any = ca.Function("derivatives", [y, z, parameter], [flat], {"cse": shared})
    return lambda y, *more: function(y, *more).full().reshape(-1, n_y, y.shape[1])
