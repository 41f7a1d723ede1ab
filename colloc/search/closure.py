"""Gaits that do not turn the body: from any gait to a near one whose net rotation over a period vanishes.

Where reversing the rates reverses the motion, net rotation and displacement are both odd under reversal of the gait. So
every retraced (reciprocal) gait closes its rotation, goes nowhere, and, being surrounded by gaits that do not close, is
a critical point of the efficiency. A solver that starts far from closure falls into them. Here the rotation is closed
first, at constant area enclosed in the plane of each pair of joints, which is what a retraced gait lacks.
"""

from __future__ import annotations

import numpy as np

from colloc.collocation.newton_balance import balanced_near
from colloc.gaits.harmonic import Fourier
from colloc.gaits.problem import Problem
from colloc.gaits.sampling import is_admissible, largest_amplitude

_INSTANTS = 60
_STEPS = 30
_DIFFERENCE = 1e-5
_LONGEST_STEP = 0.3
_CLOSED = 1e-4
_TOLERANCE = 1e-9
_WIDER, _WIDE = 5.0, 0.3


def enclosed_area(gait: Fourier) -> float:
    """Area that the path encloses, ``integral of sum_(i<j) (q_i q_j' - q_j q_i') / 2``; 0 for a retraced path [rad^2]."""
    k = np.arange(1, gait.n_harmonic + 1)
    areas = np.pi * ((gait.cos * k) @ gait.sin.T - (gait.sin * k) @ gait.cos.T)
    return float(np.triu(areas, 1).sum())


def net_rotations(
    problem: Problem, parameters: np.ndarray, delta: float, near: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Rotation over a period [rad] of gaits with the given parameters ``(n_gait, n_parameter)``, ``(n_gait,)``.

    By the trapezoidal rule on a coarse uniform grid, which is enough for a start. `near`: tail velocities ``(3, n_time)`` of a
    gait near all of them, to save steps; those of the first gait are returned too.
    """
    t = np.arange(_INSTANTS) / _INSTANTS
    n_joint = problem.body.n_joint
    angles = np.einsum("tjp,gp->jgt", problem.gait.angle_matrix(t, n_joint), parameters)
    rates = np.einsum("tjp,gp->jgt", problem.gait.rate_matrix(t, n_joint), parameters)
    start = None if near is None else np.tile(near, (1, len(parameters)))
    z, _ = balanced_near(
        problem.body, problem.friction, angles.reshape(n_joint, -1), rates.reshape(n_joint, -1), delta, start, _TOLERANCE
    )
    return z[2].reshape(len(parameters), _INSTANTS).mean(axis=1), z[:, :_INSTANTS]


def closed_parameters(problem: Problem, parameters: np.ndarray, delta: float) -> np.ndarray:
    """Parameters near the given ones ``(n_parameter,)`` of a gait that closes its rotation and encloses the same area.

    Shortest (Gauss-Newton) steps to zero rotation within the surface of constant area, halved until the rotation falls.
    Where that gets stuck, the best found so far is returned: a start need not be perfect.
    """
    n_joint, n = problem.body.n_joint, parameters.size
    probes = np.vstack([np.zeros(n), _DIFFERENCE * np.eye(n)])

    def area(p: np.ndarray) -> float:
        return enclosed_area(problem.gait.fourier(p, n_joint))

    near = None
    for _ in range(_STEPS):
        if near is None:
            _, near = net_rotations(problem, parameters[None], delta)
        rotations, near = net_rotations(problem, parameters + probes, delta, near)
        rotation, slope = rotations[0], (rotations[1:] - rotations[0]) / _DIFFERENCE
        if abs(rotation) < _CLOSED:
            break
        normal = np.array([area(parameters + e) - area(parameters - e) for e in probes[1:]])
        if normal @ normal > 0:
            slope = slope - normal * (normal @ slope) / (normal @ normal)
        if slope @ slope < 1e-12:
            break
        step = -rotation * slope / (slope @ slope)
        step *= min(1.0, _LONGEST_STEP / np.linalg.norm(step))
        fractions = 0.5 ** np.arange(6)
        trials = np.array([_admissible(problem, parameters + f * step) for f in fractions])
        reached = np.abs(net_rotations(problem, trials, delta, near)[0])
        best = int(np.argmax(reached < (1 - 0.1 * fractions) * abs(rotation)))
        if reached[best] >= abs(rotation):
            break
        parameters = trials[best]
    return parameters


def opened_parameters(problem: Problem, parameters: np.ndarray, delta: float) -> np.ndarray:
    """Parameters of a gait near the given one that encloses several times the area, and closes its rotation.

    A nearly retraced gait lies between the retraced ones, which go nowhere, and searches that begin at it end there.
    """
    n_joint, n = problem.body.n_joint, parameters.size

    def area(p: np.ndarray) -> float:
        return enclosed_area(problem.gait.fourier(p, n_joint))

    target = max(_WIDER * abs(area(parameters)), _WIDE)
    for _ in range(_STEPS):
        now = area(parameters)
        # the area is a quadratic form of the parameters: central differences are exact
        slope = np.array([0.5 * (area(parameters + e) - area(parameters - e)) for e in np.eye(n)])
        if abs(now) >= target or not slope.any():
            break
        outward = (slope if now >= 0 else -slope) / np.linalg.norm(slope)
        parameters = _admissible(problem, parameters + _LONGEST_STEP * outward)
    if problem.gait.symmetry == "none":
        parameters = closed_parameters(problem, parameters, delta)
    return parameters


def _admissible(problem: Problem, parameters: np.ndarray) -> np.ndarray:
    """The parameters, shrunk where necessary until the gait keeps its joint limits and its links apart."""
    gait = problem.gait.fourier(parameters, problem.body.n_joint)
    return parameters if is_admissible(problem, gait) else parameters * min(1.0, largest_amplitude(problem, gait))
