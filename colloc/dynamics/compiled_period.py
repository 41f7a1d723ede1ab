"""A period of slow motion on level ground in one call of the compiled kernel
(`colloc/mechanics/native/period.h`), with its adjoint: what `QuasiStatic.simulate`,
`colloc.dynamics.collocated` and `QuasiStatic.vjp` state for arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from colloc.dynamics.dynamics import PeriodTotals, QuasiStatic, Shapes, TotalGradient
from colloc.mechanics.balance import is_chain
from colloc.mechanics.native_kernel import addresses, chain_parameters, native_kernel
from colloc.numerics.mesh import Mesh

_DRY = 1e-6
"""Delta over the largest rate below which velocities are wanted to more digits at links that
rest."""
_TOLERANCE = 3e-14


class CompiledPeriod:
    """Motion along a mesh, and its adjoint."""

    def __init__(self, kind: QuasiStatic, mesh: Mesh) -> None:
        self._library, self._n_point = native_kernel(kind.body, kind.law), mesh.n_point
        scheme = mesh.scheme.A, mesh.scheme.b, mesh.h, mesh.points.astype(np.int64)
        chain = *chain_parameters(kind.body, kind.law), mesh.n_point, 0, mesh.n_point
        points = mesh.n, mesh.scheme.s, *scheme, kind.turn
        # addresses once: to look up one takes a microsecond
        self._memory, self._chain, self._mesh = (chain, points), addresses(chain), addresses(points)

    @classmethod
    def of(cls, kind: QuasiStatic, mesh: Mesh) -> Self | None:
        """None where NumPy has to do."""
        level = type(kind) is QuasiStatic and is_chain(kind.body)
        return cls(kind, mesh) if level and native_kernel(kind.body, kind.law) else None

    def covers(self, shapes: Shapes) -> bool:
        """True if delta is large enough."""
        return bool(shapes.delta >= _DRY * np.abs(shapes.rates).max(initial=1.0))

    def simulate(
        self, shapes: Shapes, start: np.ndarray, of: Shapes | None = None
    ) -> tuple[np.ndarray, np.ndarray, PeriodTotals] | None:
        """Tail velocities ``(3, n_point)``, from those of `start`, moved along their derivatives
        from the shapes `of` which they balance; (rotation rate, velocity of the centre, power) over
        the pace, ``(4, n_point)``; totals. None if some balance is not found."""
        z, out = np.empty((3, self._n_point)), np.empty((4, self._n_point))
        totals, lost = np.empty(4), np.empty(1, dtype=np.int64)
        begin = *(of or shapes)[:3], start, _TOLERANCE
        self._call("colloc_period", shapes, *begin, z, out, totals, lost)
        x, y, rotation, work = totals.tolist()
        return None if lost[0] else (z, out, PeriodTotals(complex(x, y), rotation, work))

    def vjp(
        self, shapes: Shapes, z: np.ndarray, out: np.ndarray, gradients: Sequence[TotalGradient]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of m numbers along angles and rates ``(m, n_point, 2 n_joint)`` and along the
        pace ``(m, n_point)``."""
        m, n_joint = len(gradients), len(shapes.angles)
        on = np.array([[g.side.real, g.side.imag, g.rotation, g.work] for g in gradients], float)
        on_shape = np.empty((m, self._n_point, 2 * n_joint))
        on_pace = np.empty((m, self._n_point))
        self._call("colloc_period_vjp", shapes, z, out, m, on, on_shape, on_pace)
        return on_shape, on_pace

    def _call(self, name: str, shapes: Shapes, *arguments: object) -> None:
        pace = np.full(self._n_point, shapes.pace, dtype=float)
        converted = [
            np.ascontiguousarray(each) if isinstance(each, np.ndarray) else each
            for each in (*shapes[:3], pace, *arguments)
        ]
        motion = *converted[:3], *self._mesh, *converted[3:]
        if getattr(self._library, name)(*self._chain, *motion):
            raise MemoryError("no memory for the links of a body.")
