"""Mesh refinement: where a collocated gait loses efficiency accuracy, and a mesh that does not.

The scheme integrates rotation, distance and work with its own nodes. On every interval that is compared with a composite
Gauss rule on the same gait, solved anew by the NumPy solver, which sees the stick-slip kinks between the nodes; the
interval's share of the efficiency error follows. Intervals with too large a share are split.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.balance import instant, total_power
from colloc.fixed_point import solve_balance
from colloc.gait import Fourier
from colloc.mesh import Mesh
from colloc.problem import Problem

_PANELS, _NODES = 4, 4
_SPLIT_SHARE = 0.3
_MARGIN = 0.3
"""A mesh that has to be refined is refined to this share of the tolerance, so that the gait found on it is good too."""
_MOST_INTERVALS = 4000
_TOLERANCE = 1e-8
"""Residual of the balance here: far below the mesh errors that are measured."""


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Complex displacement in an interval's own initial frame, work and rotation, each ``(n,)``: by the scheme, by panels."""

    coarse: np.ndarray
    fine: np.ndarray

    def merged(self, other: _Pieces, order: np.ndarray) -> _Pieces:
        """These intervals and other ones, in the given order."""
        both = (np.concatenate([getattr(self, k), getattr(other, k)], axis=1)[:, order] for k in ("coarse", "fine"))
        return _Pieces(*both)

    def __getitem__(self, chosen: np.ndarray) -> _Pieces:
        return _Pieces(self.coarse[:, chosen], self.fine[:, chosen])


def _pieces(problem: Problem, mesh: Mesh, gait: Fourier, delta: float, left: np.ndarray, h: np.ndarray) -> _Pieces:
    """The motion over the intervals that begin at `left` and last `h`, solved anew at all their nodes."""
    n, s = left.size, mesh.scheme.s
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    panel_nodes = (np.arange(_PANELS)[:, None] + 0.5 * (nodes + 1)).ravel() / _PANELS
    panel_weights = np.tile(0.5 * weights / _PANELS, _PANELS)
    # the body at the fine nodes and at the scheme's nodes, interval by interval
    tau = np.concatenate([mesh.scheme.c, panel_nodes])
    t = (left[:, None] + h[:, None] * tau).ravel()
    angles, rates = gait.angles(t), gait.rates(t)
    solved = solve_balance(problem.body, problem.friction, angles, rates, delta, tolerance=_TOLERANCE)
    now = instant(problem.body, problem.friction, angles, rates, solved.z, delta)
    cx, cy = problem.body.centre_velocity(now.posture, now.velocity)
    power = total_power(now.velocity, now.force)
    omega, cx, cy, power = (a.reshape(n, tau.size) for a in (solved.z[2], cx[0], cy[0], power[0]))

    def states(rows: slice, within: np.ndarray, weight: np.ndarray) -> np.ndarray:
        turn = np.exp(1j * h[:, None] * (omega[:, rows] @ within.T))
        move = (turn * (cx[:, rows] + 1j * cy[:, rows])) @ weight * h
        return np.stack([move, power[:, rows] @ weight * h, omega[:, rows] @ weight * h])

    return _Pieces(
        states(slice(0, s), mesh.scheme.A, mesh.scheme.b), states(slice(s, None), _panel_integrals(nodes), panel_weights)
    )


def _errors(problem: Problem, pieces: _Pieces) -> np.ndarray:
    """Each interval's contribution to the relative efficiency error, signed, ``(n,)``."""
    coarse, fine = pieces.coarse, pieces.fine
    heading = np.concatenate([[0.0], np.cumsum(fine[2].real)[:-1]])
    path = np.concatenate([[0.0], np.cumsum(np.exp(1j * heading) * fine[0])])
    # an error of rotation turns everything after it
    later = path[-1] - path[1:]
    error = np.exp(1j * heading) * (coarse[0] - fine[0]) + 1j * (coarse[2] - fine[2]).real * later
    direction = _direction(problem, path[-1], heading[-1] + fine[2, -1].real)
    distance = float((path[-1] * np.conj(direction)).real)
    return (error * np.conj(direction)).real / distance - (coarse[1] - fine[1]).real / fine[1].real.sum()


def interval_errors(problem: Problem, mesh: Mesh, gait: Fourier, delta: float) -> np.ndarray:
    """Each interval's contribution to the relative efficiency error of collocating `gait` on `mesh`, signed, ``(n,)``.

    Parameters
    ----------
    problem : Problem
    mesh : Mesh
    gait : Fourier
    delta : float
        Regularisation speed, per period.
    """
    return _errors(problem, _pieces(problem, mesh, gait, delta, mesh.edges[:-1], mesh.h))


def _direction(problem: Problem, end: complex, rotation: float) -> complex:
    """Unit vector along which the solved part's displacement counts."""
    if problem.gait.symmetry == "antipodal":
        return np.exp(0.5j * rotation) * (1 if (end * np.exp(-0.5j * rotation)).real > 0 else -1)
    return end / abs(end)


def _panel_integrals(nodes: np.ndarray) -> np.ndarray:
    """Integrals of a panel-wise polynomial from 0 to each panel node, ``(panels * nodes, panels * nodes)``."""
    c = 0.5 * (nodes + 1)
    powers = np.vander(c, increasing=True)
    degree = np.arange(1, c.size + 1)
    inside = np.linalg.solve(powers.T, (c[:, None] ** degree / degree).T).T
    whole = np.linalg.solve(powers.T, 1.0 / degree)
    result = np.zeros((_PANELS * c.size, _PANELS * c.size))
    for panel in range(_PANELS):
        rows = slice(panel * c.size, (panel + 1) * c.size)
        result[rows, : panel * c.size] = np.tile(whole, panel)
        result[rows, rows] = inside
    return result / _PANELS


def refined_edges(problem: Problem, mesh: Mesh, gait: Fourier, delta: float, tolerance: float) -> np.ndarray | None:
    """Edges of a mesh on which collocating `gait` is wrong by less than `tolerance`; None if `mesh` is good already.

    Intervals are halved, largest errors first and several times in one call, since the gait can be tried on any mesh.
    The estimate is the sum of the intervals' magnitudes: errors of opposite sign are not allowed to cancel.
    """
    edges = mesh.edges
    target = tolerance
    pieces = _pieces(problem, mesh, gait, delta, edges[:-1], mesh.h)
    while True:
        errors = np.abs(_errors(problem, pieces))
        if errors.sum() <= target or edges.size > _MOST_INTERVALS:
            return None if edges is mesh.edges else edges
        target = _MARGIN * tolerance
        order = np.argsort(errors)[::-1]
        # split those that hold the excess over the tolerance
        excess = np.cumsum(errors[order]) < errors.sum() - _SPLIT_SHARE * target
        chosen = np.zeros(errors.size, dtype=bool)
        chosen[order[: max(1, int(excess.sum()) // 2)]] = True
        middle = 0.5 * (edges[:-1] + edges[1:])[chosen]
        left = np.concatenate([edges[:-1][chosen], middle])
        halves = _pieces(problem, mesh, gait, delta, left, np.concatenate([middle, edges[1:][chosen]]) - left)
        order = np.argsort(np.concatenate([edges[:-1][~chosen], left]))
        pieces = pieces[~chosen].merged(halves, order)
        edges = np.sort(np.concatenate([edges, middle]))
