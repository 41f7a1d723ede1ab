r"""Periodic states along the intervals of a collocation scheme: ``s' = r(t, s)`` for any number of
them, with an adjoint.

At the stages i of the intervals k of length h the scheme (A, b) says

    s_ki = s_0 + sum_(l<k) h_l sum_j b_j r_lj + h_k sum_j A_ij r_kj,

in short ``s = s_0 + H r(s)``. A state either starts where it is told to, or is *free*: then it ends
a period, or the part of one that is solved, where a symmetry sends its start, ``s_end = M s_0``.
Newton's method, and derivatives of what follows from the states, need solutions with ``I - H R``, R
being the derivatives of the rates with respect to the states. Interval by interval that is a small
system in the stages; the states at its begin are handed on.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

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
        self,
        mesh: Mesh,
        free: np.ndarray,
        image: np.ndarray | None = None,
        unit: float = 1.0,
    ) -> None:
        self._shape = mesh.n, mesh.scheme.s
        self._a = unit * mesh.h[:, None, None] * mesh.scheme.A
        self._b = unit * mesh.h[:, None] * mesh.scheme.b
        self._free = np.flatnonzero(free)
        self._image = np.eye(len(free)) if image is None else image

    @property
    def scheme(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """h A ``(n, s, s)``, h b ``(n, s)`` and the image."""
        return self._a, self._b, self._image

    def integrals(self, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """``H r`` at the points, ``(n_state, n_point)``, and over all, ``(n_state,)``."""
        stages = rates.reshape(len(rates), *self._shape)
        gained = np.cumsum((self._b * stages).sum(axis=2), axis=1)
        before = np.concatenate([np.zeros((len(rates), 1)), gained[:, :-1]], axis=1)
        return (before[:, :, None] + self._within(stages)).reshape(rates.shape), gained[:, -1]

    def solve(
        self,
        rates: Callable[[np.ndarray], Rates],
        start: np.ndarray,
        near: np.ndarray | None = None,
        *,
        monotone: bool = False,
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        """States ``(n_state, n_point)``, start and convergence of Newton's method, damped as in
        NLEQ-ERR (Deuflhard, *Newton Methods for Nonlinear Problems*, 3.3): a step is accepted if
        the next one, with the same derivatives, is shorter, as residuals of momenta may grow on the
        way under steep friction; or, `monotone`, if residuals fall, where rates are not known
        everywhere, as on slopes. `start` ``(n_state,)`` is the begin (of free states a guess),
        `near` a guess of the states."""
        start = np.array(start, dtype=float)
        if near is None:
            near = np.repeat(start[:, None], np.prod(self._shape), axis=1)
        x = np.column_stack([near, start])
        now, residual, off = self._residual(rates, x)
        next_step, trusted, astray = np.zeros_like(x), np.inf, 0
        for _ in range(_STEPS):
            if off < _CLOSED or not now.known:
                break
            newton = self._newton(now.on_states)
            step = newton(residual)
            size = float(np.linalg.norm(step))
            if not np.isfinite(size):
                break
            if np.abs(step).max() < _ROUNDED:
                off = 0.0
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

    def solve_intervals(
        self, rates: Callable[[np.ndarray], Rates], begins: np.ndarray, near: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """States of every interval by itself from begins ``(n_state, n)``; its ends ``(n_state,
        n)``; convergence ``(n,)``."""
        n, s = self._shape
        begin, share = np.repeat(begins, s, axis=1), np.ones(n)

        def by_interval(values: np.ndarray) -> np.ndarray:
            """Largest magnitude, ``(n,)``."""
            largest: np.ndarray = np.abs(values).reshape(-1, n, s).max(axis=(0, 2))
            return largest

        def residual(states: np.ndarray) -> tuple[Rates, np.ndarray, np.ndarray]:
            now = rates(states)
            gained = self._within(now.value.reshape(-1, n, s)).reshape(states.shape)
            left_over = states - begin - gained
            return now, left_over, by_interval(left_over)

        (now, left_over, off), states = residual(near), near
        for _ in range(_MOST_ITERATIONS):
            if (off < _CLOSED).all():
                break
            linear = _Linear(self._a, self._b, now.on_states)
            newton = linear.by_point(linear.stages(left_over))
            step = np.repeat(share, s) * newton
            trial = states - step
            *_, off_then = residual(trial)
            nearer = (off_then < off) | (by_interval(step) < _ROUNDED)
            states = np.where(np.repeat(nearer, s), trial, states)
            share = np.where(nearer, np.minimum(2.0 * share, 1.0), 0.25 * share)
            now, left_over, off = residual(states)
        found = now.value.reshape(-1, n, s)
        return states, begins + (self._b * found).sum(axis=2), off < _FOUND

    def _within(self, stages: np.ndarray) -> np.ndarray:
        return np.einsum("nij,anj->ani", self._a, stages)

    def _residual(
        self, rates: Callable[[np.ndarray], Rates], x: np.ndarray
    ) -> tuple[Rates, np.ndarray, float]:
        """Rates, residuals at the points and (of free states) at the end, and the largest."""
        states, start = x[:, :-1], x[:, -1]
        now = rates(states)
        gained, whole = self.integrals(now.value)
        closing = whole + (start - self._image @ start)
        residual = np.column_stack([states - start[:, None] - gained, closing])
        off = max(np.abs(residual[:, :-1]).max(), np.abs(residual[self._free, -1]).max(initial=0.0))
        return now, residual, float(off) if now.known else np.inf

    @_FAR
    def _newton(self, on_states: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """Map from residuals to Newton steps."""
        within, free = _Linear(self._a, self._b, on_states), self._free

        @_FAR
        def step(residual: np.ndarray) -> np.ndarray:
            own, through, gained = within.condense(residual[:, :-1])
            start = np.zeros(len(residual))
            if free.size:
                off = residual[free, -1] - gained[-1, free]
                start[free] = np.linalg.solve(self._open(through[-1]), off)
            begins = through[:-1] @ start + gained[:-1]
            return np.column_stack([within.at_points(own, begins), start])

        return step

    def _open(self, through: np.ndarray) -> np.ndarray:
        """``d s_end / d s_0 - M`` of the free states."""
        return (through - self._image)[np.ix_(self._free, self._free)]

    def vjp(
        self, on_states: np.ndarray, of_states: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Adjoint: derivatives of m numbers along the start ``(m, n_state)``, the rates ``(m,
        n_state, n_point)`` and the states at the ends of intervals ``(m, n_state, n)``, from
        `of_states` ``(m, n_state, n_point)`` and the rates' derivatives `on_states` ``(n_state,
        n_state, n_point)``."""
        within = _Linear(self._a, self._b, on_states)
        on_start, on_rates, on_ends = within.vjp(of_states)
        if self._free.size:
            free, k = self._free, on_start.shape[1]
            through, *_ = within.vjp(np.zeros((k, *of_states.shape[1:])), np.eye(k))
            closing = np.zeros_like(on_start)
            closing[:, free] = -np.linalg.solve(self._open(through).T, on_start[:, free].T).T
            on_start, on_rates, on_ends = within.vjp(of_states, closing)
            on_start -= closing @ self._image
        return on_start, on_rates, on_ends


class _Linear:
    """``I - H R``, condensed to the begins of the intervals."""

    def __init__(self, a: np.ndarray, b: np.ndarray, on_states: np.ndarray) -> None:
        (n, s), k = b.shape, len(on_states)
        self._a, self._b, self._shape = a, b, (n, s, k)
        # of an interval in order of stage, state
        slopes = on_states.reshape(k, k, n, s).transpose(2, 3, 0, 1)
        matrix = np.eye(s * k) - np.einsum("nij,njab->niajb", a, slopes).reshape(n, s * k, s * k)
        self._inverse = np.linalg.inv(matrix)
        self._gain = np.einsum("nj,njab->najb", b, slopes).reshape(n, k, s * k)
        self._response = self._inverse.reshape(n, s * k, s, k).sum(axis=2)
        self._through = np.eye(k) + self._gain @ self._response

    def _by_interval(self, at_points: np.ndarray) -> np.ndarray:
        n, s, k = self._shape
        return np.moveaxis(at_points.reshape(*at_points.shape[:-2], k, n, s), -3, -1).reshape(
            *at_points.shape[:-2], n, s * k
        )

    def by_point(self, by_interval: np.ndarray) -> np.ndarray:
        n, s, k = self._shape
        return np.moveaxis(by_interval.reshape(*by_interval.shape[:-2], n, s, k), -1, -3).reshape(
            *by_interval.shape[:-2], k, n * s
        )

    def stages(self, right: np.ndarray) -> np.ndarray:
        """Stages for a right side ``(k, n_point)`` with zero begins, ``(n, s k)``."""
        return (self._inverse @ self._by_interval(right)[:, :, None])[:, :, 0]

    def condense(self, right: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stages of a right side with zero begins, and states at the edges as ``through @ begin +
        gained``."""
        own, k = self.stages(right), len(right)
        more = self._gain @ own[:, :, None]
        through, gained = _prefix_products(
            self._through.transpose(0, 2, 1), more.transpose(0, 2, 1)
        )
        begin = np.eye(k, k + 1)[None]
        edges = np.concatenate(
            [begin, np.concatenate([through, gained], axis=1).transpose(0, 2, 1)]
        )
        return own, edges[:, :, :-1], edges[:, :, -1]

    def at_points(self, own: np.ndarray, begins: np.ndarray) -> np.ndarray:
        """States ``(k, n_point)`` from those at the begins of the intervals, ``(n, k)``."""
        return self.by_point(own + (self._response @ begins[:, :, None])[:, :, 0])

    def vjp(
        self, of_states: np.ndarray, of_end: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Adjoint: along the begin ``(m, k)``, the rates, ``H'(I - H R)'^-1``, ``(m, k, n_point)``,
        and the states at the ends of intervals ``(m, k, n)``."""
        (n, s, k), given = self._shape, self._by_interval(of_states)
        through = np.einsum("mni,nia->mna", given, self._response)
        end = np.zeros((len(given), k)) if of_end is None else of_end
        back, gained = _prefix_products(self._through[::-1], through.transpose(1, 0, 2)[::-1])
        before = end @ back + gained
        later = np.concatenate([end[None], before[:-1]])[::-1].transpose(1, 0, 2)
        mu = np.einsum(
            "mni,nij->mnj", given + np.einsum("mna,nai->mni", later, self._gain), self._inverse
        )
        stages = mu.reshape(-1, n, s, k)
        on_rates = (
            np.einsum("mnia,nij->mnja", stages, self._a) + self._b[:, :, None] * later[:, :, None]
        )
        return before[-1], self.by_point(on_rates.reshape(-1, n, s * k)), later.transpose(0, 2, 1)


def _prefix_products(t: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Prefix products of affine maps ``x -> x t + c`` in log2 n steps."""
    t, c, reach = t.copy(), c.copy(), 1
    while reach < len(t):
        c[reach:] += c[:-reach] @ t[reach:]
        t[reach:] = t[:-reach] @ t[reach:]
        reach *= 2
    return t, c
