"""Mesh refinement: where a collocated gait loses efficiency accuracy, and a mesh that does not.

The scheme integrates rotation, distance and work with its own nodes. On every interval that is compared with a composite
Gauss rule on the same gait, solved anew by the NumPy solver, which sees the stick-slip kinks between the nodes; the
interval's share of the efficiency error follows. Intervals with too large a share are split.
"""

from __future__ import annotations

import numpy as np

from colloc.balance import instant, total_power
from colloc.fixed_point import solve_balance
from colloc.gait_fields import AnyGait
from colloc.mesh import Mesh
from colloc.problem import Problem

_PANELS, _NODES = 4, 4
_SPLIT_SHARE = 0.3
_MOST_INTERVALS = 4000


def interval_errors(problem: Problem, mesh: Mesh, gait: AnyGait, delta: float) -> np.ndarray:
    """Each interval's contribution to the relative efficiency error of collocating `gait` on `mesh`, signed, ``(n,)``.

    Parameters
    ----------
    problem : Problem
    mesh : Mesh
    gait : AnyGait
    delta : float
        Regularisation speed, in the units of the problem's class of gaits.
    """
    n, s = mesh.n, mesh.scheme.s
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    panel_nodes = (np.arange(_PANELS)[:, None] + 0.5 * (nodes + 1)).ravel() / _PANELS
    panel_weights = np.tile(0.5 * weights / _PANELS, _PANELS)
    # the body at the fine nodes and at the scheme's nodes, interval by interval
    tau = np.concatenate([mesh.scheme.c, panel_nodes])
    t = (mesh.edges[:-1, None] + mesh.h[:, None] * tau).ravel()
    angles, rates = gait.angles(t), gait.rates(t)
    slow = delta * gait.delta_unit
    solved = solve_balance(problem.body, problem.friction, angles, rates, slow)
    now = instant(problem.body, problem.friction, angles, rates, solved.z, slow)
    cx, cy = problem.body.centre_velocity(now.posture, now.velocity)
    power = total_power(now.velocity, now.force)
    omega, cx, cy, power = (a.reshape(n, tau.size) for a in (solved.z[2], cx[0], cy[0], power[0]))

    def states(rows: slice, within: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Complex displacement in the interval's own initial frame, work and rotation of every interval."""
        turn = np.exp(1j * mesh.h[:, None] * (omega[:, rows] @ within.T))
        move = (turn * (cx[:, rows] + 1j * cy[:, rows])) @ weight * mesh.h
        return move, power[:, rows] @ weight * mesh.h, omega[:, rows] @ weight * mesh.h

    coarse = states(slice(0, s), mesh.scheme.A, mesh.scheme.b)
    fine = states(slice(s, None), _panel_integrals(nodes), panel_weights)
    heading = np.concatenate([[0.0], np.cumsum(fine[2])[:-1]])
    path = np.concatenate([[0.0], np.cumsum(np.exp(1j * heading) * fine[0])])
    # an error of rotation turns everything after it
    later = path[-1] - path[1:]
    error = np.exp(1j * heading) * (coarse[0] - fine[0]) + 1j * (coarse[2] - fine[2]) * later
    direction = _direction(problem, path[-1], heading[-1] + fine[2][-1])
    distance = float((path[-1] * np.conj(direction)).real)
    return (error * np.conj(direction)).real / distance - (coarse[1] - fine[1]) / fine[1].sum()


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


def refined_edges(problem: Problem, mesh: Mesh, gait: AnyGait, delta: float, tolerance: float) -> np.ndarray | None:
    """Edges of a mesh on which collocating `gait` is wrong by less than `tolerance`; None if `mesh` is good already.

    Intervals are halved, largest errors first and several times in one call, since the gait can be tried on any mesh.
    The estimate is the sum of the intervals' magnitudes: errors of opposite sign are not allowed to cancel.
    """
    edges, current = mesh.edges, mesh
    while True:
        errors = np.abs(interval_errors(problem, current, gait, delta))
        if errors.sum() <= tolerance or edges.size > _MOST_INTERVALS:
            return None if current is mesh else edges
        order = np.argsort(errors)[::-1]
        # split those that hold the excess over the tolerance
        excess = np.cumsum(errors[order]) < errors.sum() - _SPLIT_SHARE * tolerance
        chosen = order[: max(1, int(excess.sum()) // 2)]
        edges = np.sort(np.concatenate([edges, 0.5 * (edges[chosen] + edges[chosen + 1])]))
        current = Mesh(mesh.scheme, edges)
