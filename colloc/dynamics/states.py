r"""Periodic states along the intervals of a collocation scheme: ``s' = r(t, s)`` for any number of
them, with an adjoint.

At the stages i of the intervals k of length h the scheme (A, b) says

    s_ki = s_0 + sum_(l<k) h_l sum_j b_j r_lj + h_k sum_j A_ij r_kj,

in short ``s = s_0 + H r(s)``. A state either starts where it is told to, or is *free*: then it ends
a period, or the part of one that is solved, where a symmetry sends its start, ``s_end = M s_0``.
Newton's method, and derivatives of what follows from the states, need solutions with ``I - H R``, R
being the derivatives of the rates with respect to the states. Interval by interval that is a small
system in the stages, which leaves a sparse one in the states at the edges.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from colloc.numerics.mesh import Mesh

_CLOSED, _STEPS = 1e-12, 200
_ROUNDED = 1e-11
"""Newton step that counts as none where steep rates leave rounding."""
_SHARES, _ASTRAY = 0.5 ** np.arange(7), 5
"""Damping factors where the residual has to fall; steps in a row that may miss that."""
_LEAST_SHARE = 1 / 16
"""Give up if the damping factor falls below this."""
_FAR = np.errstate(over="ignore", invalid="ignore")
"""Far from any motion states overflow."""
_MOST_ITERATIONS, _FOUND = 60, 1e-9


class Rates(NamedTuple):
    value: np.ndarray
    on_states: np.ndarray
    """``(n_state, n_state, n_point)``."""
    known: bool = True


class CollocatedStates:
    """Equations of states on a mesh whose neighbours share no stage.

    free: which states ``(n_state,)`` close a period; the others start where they are told to.
    image: map ``(n_state, n_state)`` from their start to their end; identity by default. unit:
    rates are per time over this.
    """

    def __init__(
        self, mesh: Mesh, free: np.ndarray, image: np.ndarray | None = None, unit: float = 1.0
    ) -> None:
        self._a = unit * mesh.h[:, None, None] * mesh.scheme.A
        self._b = unit * mesh.h[:, None] * mesh.scheme.b
        self._free, self._image = free, np.eye(len(free)) if image is None else image
        self._last: tuple[np.ndarray, _Linear] | None = None

    @property
    def scheme(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """h A ``(n, s, s)``, h b ``(n, s)`` and the image."""
        return self._a, self._b, self._image

    def integrals(self, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """``H r`` at the points, ``(n_state, n_point)``, and at the edges, ``(n_state, n + 1)``."""
        stages = rates.reshape(len(rates), *self._b.shape)
        edges = np.zeros((len(rates), len(self._b) + 1))
        np.cumsum((self._b * stages).sum(axis=2), axis=1, out=edges[:, 1:])
        return (edges[:, :-1, None] + self._within(stages)).reshape(rates.shape), edges

    def solve(
        self,
        rates: Callable[[np.ndarray], Rates],
        start: np.ndarray,
        guess: np.ndarray | None = None,
        *,
        monotone: bool = False,
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        """States ``(n_state, n_point)``, start and convergence of Newton's method, damped as in
        NLEQ-ERR (Deuflhard, *Newton Methods for Nonlinear Problems*, 3.3): a step is accepted if
        the next one, with the same derivatives, is shorter, as residuals of momenta may grow on the
        way under steep friction; or, `monotone`, if residuals fall, where rates are not known
        everywhere, as on slopes. `start` ``(n_state,)`` is the begin (of free states a guess),
        `guess` one of the states."""
        start = np.array(start, dtype=float)
        if guess is None:
            guess = np.repeat(start[:, None], self._b.size, axis=1)
        x = np.column_stack([guess, start])
        now, residual, off = self._residual(rates, x)
        next_step, trusted, astray = np.zeros_like(x), np.inf, 0
        for _ in range(_STEPS):
            if off < _CLOSED or not now.known:
                break
            newton = self._linear(now.on_states).solve
            step = newton(residual)
            size = float(np.linalg.norm(step))
            if not np.isfinite(size):
                break
            if np.abs(step).max() < _ROUNDED:
                x, off = x - step, 0.0
                now, *_ = self._residual(rates, x)
                break
            if monotone:
                before = off
                for share in _SHARES:
                    trial = x - share * step
                    now, residual, off = self._residual(rates, trial)
                    if off < before:
                        break
                x, astray = trial, 0 if off < before else astray + 1
                if astray > _ASTRAY:
                    break
                continue
            # derivatives are good for steps in proportion to how well they told this one
            missed = float(np.linalg.norm(next_step - step)) * size
            share = 1.0 if missed <= trusted else max(_LEAST_SHARE, trusted / missed)
            while True:
                trial = x - share * step
                now, residual, off = self._residual(rates, trial)
                if off < _CLOSED:
                    break
                closer = 0.25 * share
                if now.known:
                    next_step = newton(residual)
                    next_size = float(np.linalg.norm(next_step))
                    trusted = share * size * next_size
                    if next_size < size:
                        break
                    curved = float(np.linalg.norm(next_step - (1.0 - share) * step))
                    closer = 0.5 * share**2 * size / curved
                if share <= _LEAST_SHARE:
                    return trial[:, :-1], trial[:, -1], False
                share = max(_LEAST_SHARE, min(closer, 0.5 * share))
            x = trial
        return x[:, :-1], x[:, -1], bool(now.known and off < _CLOSED)

    def first_order_change(self, on_states: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Change of the states ``(n_state, n_point)`` where their rates change by so much, from the
        rates' derivatives `on_states` ``(n_state, n_state, n_point)``."""
        increments, edges = self.integrals(rates)
        return -self._linear(on_states).solve(np.column_stack([-increments, edges[:, -1]]))[:, :-1]

    def solve_intervals(
        self,
        rates: Callable[[np.ndarray, np.ndarray], Rates],
        begins: np.ndarray,
        guess: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """States of every interval by itself from begins ``(n_state, n)``; its ends ``(n_state,
        n)``; convergence ``(n,)``. `rates` are those of states at points of such indices."""
        (n, s), k = self._b.shape, len(begins)

        def residual(
            states: np.ndarray, of: np.ndarray
        ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
            now = rates(states.reshape(k, -1), (s * of[:, None] + np.arange(s)).ravel())
            value = now.value.reshape(k, -1, s)
            increments = np.einsum("nij,anj->ani", self._a[of], value)
            left_over = states - begins[:, of, None] - increments
            off = np.abs(left_over).max(axis=(0, 2))
            return value, left_over, now.on_states.reshape(k, k, -1, s), off

        states, share, open_ = guess.reshape(k, n, s).copy(), np.ones(n), np.arange(n)
        value, left_over, slopes, off = residual(states, open_)
        for _ in range(_MOST_ITERATIONS):
            open_ = open_[off[open_] >= _CLOSED]
            if not open_.size:
                break
            matrix = _stage_matrices(self._a[open_], slopes[:, :, open_])
            right = left_over[:, open_].transpose(1, 2, 0).reshape(-1, s * k, 1)
            step = np.linalg.solve(matrix, right).reshape(-1, s, k).transpose(2, 0, 1)
            step *= share[open_, None]
            trial = residual(states[:, open_] - step, open_)
            is_rounding = np.abs(step).max(axis=(0, 2)) < _ROUNDED
            nearer = (trial[-1] < off[open_]) | is_rounding
            of = open_[nearer]
            states[:, of] -= step[:, nearer]
            value[:, of], left_over[:, of] = trial[0][:, nearer], trial[1][:, nearer]
            slopes[:, :, of], off[of] = trial[2][:, :, nearer], trial[3][nearer]
            share[open_] = np.where(
                nearer, np.minimum(2.0 * share[open_], 1.0), 0.25 * share[open_]
            )
            open_ = open_[~is_rounding]
        return states.reshape(k, -1), begins + (self._b * value).sum(axis=2), off < _FOUND

    def _within(self, stages: np.ndarray) -> np.ndarray:
        return np.einsum("nij,anj->ani", self._a, stages)

    def _residual(
        self, rates: Callable[[np.ndarray], Rates], x: np.ndarray
    ) -> tuple[Rates, np.ndarray, float]:
        """Rates, residuals at the points and (of free states) at the end, and the largest."""
        states, start = x[:, :-1], x[:, -1]
        now = rates(states)
        increments, edges = self.integrals(now.value)
        closing = edges[:, -1] + (start - self._image @ start)
        residual = np.column_stack([states - start[:, None] - increments, closing])
        off = max(
            np.abs(residual[:, :-1]).max(), np.abs(residual[:, -1][self._free]).max(initial=0.0)
        )
        return now, residual, float(off) if now.known else np.inf

    def vjp(
        self, on_states: np.ndarray, of_states: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Adjoint: derivatives of m numbers along the start ``(m, n_state)``, the rates ``(m,
        n_state, n_point)`` and the states at the ends of intervals ``(m, n_state, n)``, from
        `of_states` ``(m, n_state, n_point)`` and the rates' derivatives `on_states` ``(n_state,
        n_state, n_point)``."""
        return self._linear(on_states).vjp(of_states)

    def _linear(self, on_states: np.ndarray) -> _Linear:
        last = self._last
        if last is None or not np.array_equal(last[0], on_states):
            last = self._last = on_states.copy(), _Linear(*self.scheme, self._free, on_states)
        return last[1]


def _stage_matrices(a: np.ndarray, on_states: np.ndarray) -> np.ndarray:
    """``I - H R`` of intervals by themselves, ``(n, s k, s k)`` in order of stage, state, from
    ``(k, k, n, s)``."""
    k, _, n, s = on_states.shape
    stages = np.einsum("nij,abnj->niajb", a, on_states).reshape(n, s * k, s * k)
    return np.asarray(np.eye(s * k) - stages)


class _Linear:
    """``I - H R``, condensed to the states at the edges: rows that close or begin a period, and for
    every interval ``end - through begin``."""

    @_FAR
    def __init__(
        self,
        a: np.ndarray,
        b: np.ndarray,
        image: np.ndarray,
        free: np.ndarray,
        on_states: np.ndarray,
    ) -> None:
        (n, s), k, one = b.shape, len(free), np.eye(len(free))
        self._a, self._b, self._free, self._shape = a, b, free, (n, s, k)
        slopes = on_states.reshape(k, k, n, s).transpose(2, 3, 0, 1)
        self._inverse = np.linalg.inv(_stage_matrices(a, on_states.reshape(k, k, n, s)))
        self._gain = np.einsum("nj,njab->najb", b, slopes).reshape(n, k, s * k)
        self._response = self._inverse.reshape(n, s * k, s, k).sum(axis=2)
        # the two blocks of each column, of the begin of an interval and of its end before
        first, second = np.tile(one, (2, n + 1, 1, 1))
        first[0], first[-1] = np.where(free[:, None], -image, one), np.diag(free)
        second[:-1] += self._gain @ self._response
        second[:-1] *= -1.0
        rows = np.arange(n + 1)[:, None] + [0, 1]
        rows[-1] = 0, n
        # slopes that are no numbers stay in the stages
        columns = np.nan_to_num(np.concatenate([first, second], axis=1)).transpose(0, 2, 1)
        places = np.repeat((k * rows[:, :, None] + np.arange(k)).reshape(n + 1, 1, -1), k, axis=1)
        ends = 2 * k * np.arange(k * (n + 1) + 1)
        self._edges = splu(sparse.csc_matrix((columns.ravel(), places.ravel(), ends)))

    def _by_interval(self, at_points: np.ndarray) -> np.ndarray:
        n, s, k = self._shape
        return at_points.reshape(-1, k, n, s).transpose(0, 2, 3, 1).reshape(-1, n, s * k)

    def _by_point(self, by_interval: np.ndarray) -> np.ndarray:
        n, s, k = self._shape
        return by_interval.reshape(-1, n, s, k).transpose(0, 3, 1, 2).reshape(-1, k, n * s)

    def _within(self, right: np.ndarray) -> np.ndarray:
        """Solution ``(k, n_point)`` of every interval by itself, from a begin of 0."""
        return self._by_point(np.einsum("nij,mnj->mni", self._inverse, self._by_interval(right)))[0]

    @_FAR
    def solve(self, residual: np.ndarray) -> np.ndarray:
        """Solution at the points and at the begin, ``(k, n_point + 1)``."""
        apart, k = self._within(residual[:, :-1]), len(residual)
        ends = np.einsum("nai,mni->na", self._gain, self._by_interval(apart))
        right = np.append(np.where(self._free, residual[:, -1], 0.0), ends)
        edges = self._edges.solve(right).reshape(-1, k)
        more = self._by_point(np.einsum("nia,na->ni", self._response, edges[:-1]))[0]
        return np.column_stack([apart + more, edges[0]])

    def vjp(self, of_states: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`CollocatedStates.vjp`: along the rates it is ``H'(I - H R)'^-1``."""
        (n, s, k), by_interval = self._shape, self._by_interval(of_states)
        right = np.zeros((len(by_interval), n + 1, k))
        right[:, :-1] = np.einsum("mni,nia->mna", by_interval, self._response)
        edges = self._edges.solve(right.reshape(-1, (n + 1) * k).T, "T").T.reshape(right.shape)
        later = edges[:, 1:]
        at_stages = by_interval + np.einsum("mna,nai->mni", later, self._gain)
        stages = np.einsum("mni,nij->mnj", at_stages, self._inverse).reshape(-1, n, s, k)
        on_rates = np.einsum("mnia,nij->mnja", stages, self._a)
        on_rates += self._b[:, :, None] * later[:, :, None]
        on_start = np.where(self._free, 0.0, edges[:, 0])
        return on_start, self._by_point(on_rates), later.transpose(0, 2, 1)
