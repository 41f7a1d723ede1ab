"""The time grid of a collocation scheme: *points* are the stages, which neighbours share where the
first is the left end of an interval; *sites* are every edge and every interior stage."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from colloc.numerics.schemes import Scheme


@dataclass(frozen=True, eq=False)
class Mesh:
    """A scheme on the intervals between `edges` (n + 1 ascending phases)."""

    scheme: Scheme
    edges: np.ndarray

    @property
    def n(self) -> int:
        return len(self.edges) - 1

    @cached_property
    def h(self) -> np.ndarray:
        return np.diff(self.edges)

    @cached_property
    def points(self) -> np.ndarray:
        """Index of each interval's stages among the points, ``(n, s)``."""
        stride = self.scheme.s - self.scheme.left
        return np.arange(self.n)[:, None] * stride + np.arange(self.scheme.s)

    @cached_property
    def n_point(self) -> int:
        return int(self.points[-1, -1]) + 1

    @cached_property
    def times(self) -> np.ndarray:
        """Phases of the points, ``(n_point,)``."""
        times = np.empty(self.n_point)
        times[self.points] = self.edges[:-1, None] + self.h[:, None] * self.scheme.c
        return times

    def locate(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Intervals of phases, and fractions of them."""
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, self.n - 1)
        return k, (t - self.edges[k]) / self.h[k]

    @property
    def sites(self) -> np.ndarray:
        """Index of each interval's stages among the sites, ``(n, s)``."""
        first = self.edge_sites[:-1, None] + (not self.scheme.left)
        return first + np.arange(self.scheme.s)

    @property
    def edge_sites(self) -> np.ndarray:
        """Index of the edges among the sites, ``(n + 1,)``."""
        return np.arange(self.n + 1) * (1 + self.scheme.s - self.scheme.left - self.scheme.right)

    @property
    def n_site(self) -> int:
        return int(self.edge_sites[-1]) + 1

    def integration(self) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """Matrices (L, Q) of the equations ``L X - Q X' = 0`` of a state at the sites, from its
        rate at the points: one row per stage that is not a left end, and per right edge that is not
        a stage."""
        s = self.scheme
        targets = [(self.sites[:, i], s.A[i]) for i in range(s.s) if not (s.left and i == 0)]
        if not s.right:
            targets.append((self.edge_sites[1:], s.b))
        return self._defects(targets, self.edge_sites, self.n_site)

    def quadrature(self) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """(L, Q) of a state at the edges alone: ``X_(k+1) - X_k - h sum_j b_j X'_j``."""
        edges = np.arange(self.n + 1)
        return self._defects([(edges[1:], self.scheme.b)], edges, self.n + 1)

    def _defects(
        self, targets: list[tuple[np.ndarray, np.ndarray]], left: np.ndarray, n_state: int
    ) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """Rows ``X_target - X_left - h weights . X'``, from targets (states, weights)."""
        row = np.arange(self.n)[:, None] * len(targets) + np.arange(len(targets))
        to = np.stack([target for target, _ in targets], axis=1)
        weights = self.h[:, None, None] * np.stack([weight for _, weight in targets])
        start, one = np.broadcast_to(left[: self.n, None], to.shape), np.ones(to.size)
        states = np.tile(row.ravel(), 2), np.concatenate([to.ravel(), start.ravel()])
        points = np.broadcast_to(self.points[:, None], weights.shape)
        rates = np.repeat(row.ravel(), self.scheme.s), points.ravel()
        return (
            sparse.csr_matrix((np.append(one, -one), states), shape=(row.size, n_state)),
            sparse.csr_matrix((weights.ravel(), rates), shape=(row.size, self.n_point)),
        )
