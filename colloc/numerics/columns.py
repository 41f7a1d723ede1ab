"""CasADi functions of columns, evaluated at many columns straight from and into NumPy's memory.

A search asks for the same small functions some ten thousand times. CasADi's own arrays go there and
back through lists, which takes longer than the functions themselves.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.numerics.blocks import Block, jacobian_terms, summed


class ColumnFunction:
    """A function of dense columns with one dense output, for one thread.

    Examples
    --------
    >>> x = ca.SX.sym("x", 2)
    >>> ColumnFunction(ca.Function("f", [x], [ca.sumsqr(x)]))(np.array([[3.0, 1.0], [4.0, 0.0]]))
    array([[25.,  1.]])
    """

    def __init__(self, function: ca.Function) -> None:
        self._function = function
        self._rows = [function.size1_in(k) for k in range(function.n_in())]
        self._n = -1

    def __call__(self, *arguments: np.ndarray) -> np.ndarray:
        """The outputs ``(n_out, n)`` at arguments of n columns each; the array is overwritten by
        the next call."""
        n = arguments[0].shape[1]
        if n != self._n:
            self._make_room(n)
        for room, argument in zip(self._inputs, arguments, strict=True):
            room[:] = argument.T
        self._evaluate()
        return self._output.T

    def _make_room(self, n: int) -> None:
        self._n, self._inputs = n, [np.empty((n, rows)) for rows in self._rows]
        self._output = np.empty((n, self._function.size1_out(0)))
        self._buffer, self._evaluate = self._function.map(n).buffer()
        for k, room in enumerate(self._inputs):
            self._buffer.set_arg(k, room.reshape(-1).data)
        self._buffer.set_res(0, self._output.reshape(-1).data)


class ChosenRows:
    """The rows `kept` of a linear part and of blocks, none implicit, with the instance parameters
    ``(n_given, n_instance)`` of every block as they are now."""

    def __init__(
        self,
        linear: sparse.csr_matrix,
        of_blocks: Sequence[Block],
        kept: np.ndarray,
        parameters: Sequence[np.ndarray],
    ) -> None:
        self._linear, blocks = linear[kept], []
        for block, given in zip(of_blocks, parameters, strict=True):
            if not np.diff(block.scatter.indptr)[kept].any():
                continue
            scatter, n_out = block.scatter[kept], block.function.n_out
            used = np.unique(scatter.indices // n_out)
            columns = (used[:, None] * n_out + np.arange(n_out)).ravel()
            blocks.append(
                Block(block.function, block.gather[:, used], scatter[:, columns], given[:, used])
            )
        terms = jacobian_terms(self._linear, blocks)
        key = terms.row.astype(int) * linear.shape[1] + terms.column
        self._places, self._weights = summed(key, terms.source, terms.weight, terms.n_source)
        self._parts = [_Part(block) for block in blocks]

    def values(self, x: np.ndarray) -> np.ndarray:
        """``(n_row,)`` at the variables x."""
        return self._linear @ x + sum(part.values(x) for part in self._parts)

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """Derivatives ``(n_row, n_variable)``."""
        found = np.zeros(self._linear.shape)
        found.ravel()[self._places] = self._weights @ np.concatenate(
            [[1.0], *(part.nonzeros(x) for part in self._parts)]
        )
        return found


class _Part:
    """What the instances of a block that are asked for contribute to the rows."""

    def __init__(self, block: Block) -> None:
        self._block, self._no_delta = block, np.zeros((1, block.n_instance))
        self._value, self._jacobian = (
            ColumnFunction(block.function.value),
            ColumnFunction(block.function.jacobian),
        )

    def _arguments(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return x[self._block.gather], self._block.parameters, self._no_delta

    def values(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(self._block.scatter @ self._value(*self._arguments(x)).ravel(order="F"))

    def nonzeros(self, x: np.ndarray) -> np.ndarray:
        """Of the Jacobians, instance by instance."""
        return self._jacobian(*self._arguments(x)).ravel(order="F")
