"""Starts that do not turn the body: from any gait to a near one whose net rotation over a period vanishes.

Where reversing the rates reverses the motion, net rotation and displacement are both odd under reversal of the gait. So
every retraced (reciprocal) gait closes its rotation, goes nowhere, and, being surrounded by gaits that do not close, is
a critical point of the efficiency. A search that starts far from closure falls into them. Here the rotation is closed
first, at constant area enclosed in the plane of each pair of joints, which is what a retraced gait lacks.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import Fourier
from colloc.gaits.problem import Problem
from colloc.gaits.sampling import is_admissible, largest_amplitude
from colloc.gaits.symmetry import NONE
from colloc.reduced.motion import ReducedMotion
from colloc.reduced.program import SearchSpace
from colloc.reduced.spaces import space_near

_STEPS, _LONGEST_STEP = 30, 0.3
_CLOSED = 1e-4


def enclosed_area(gait: Fourier) -> float:
    """Area that the path encloses, ``integral of sum_(i<j) (q_i q_j' - q_j q_i') / 2``; 0 for a retraced path [rad^2]."""
    k = np.arange(1, gait.n_harmonic + 1)
    areas = np.pi * ((gait.cos * k) @ gait.sin.T - (gait.sin * k) @ gait.cos.T)
    return float(np.triu(areas, 1).sum())


def start_near(problem: Problem, gait: AnyGait, delta: float) -> tuple[SearchSpace, np.ndarray]:
    """The class on its first mesh, and the parameters of a member near a gait, closed where only the program would close it.

    Raises
    ------
    NotConvergedError
        If no path of the class is found near the gait.
    """
    space, v = space_near(problem, gait)
    return space, v if problem.has_path or problem.gait.symmetry != NONE else _closed(space, v, delta)


def _closed(space: SearchSpace, v: np.ndarray, delta: float) -> np.ndarray:
    """Shortest (Gauss-Newton) steps to zero rotation within the surface of constant area, halved until the rotation falls.

    Where that gets stuck, the best found so far is returned: a start need not be perfect.
    """
    problem = space.problem
    motion = ReducedMotion(problem.body, problem.friction, problem.gait.symmetry, space.mesh, space)

    def area(at: np.ndarray) -> float:
        return enclosed_area(problem.gait.fourier(at, problem.body.n_joint))

    for _ in range(_STEPS):
        rotation, slope = motion.values(v, delta)[1], motion.gradients(v, delta)[1]
        if abs(rotation) < _CLOSED:
            break
        # the area is a quadratic form of the parameters: central differences are exact
        normal = np.array([0.5 * (area(v + e) - area(v - e)) for e in np.eye(v.size)])
        if normal.any():
            slope = slope - normal * (normal @ slope) / (normal @ normal)
        if slope @ slope < 1e-12:
            break
        step = -rotation * slope / (slope @ slope)
        step *= min(1.0, _LONGEST_STEP / np.linalg.norm(step))
        trials = (_admissible(problem, v + 0.5**k * step) for k in range(6))
        better = next((trial for trial in trials if abs(motion.values(trial, delta)[1]) < 0.95 * abs(rotation)), None)
        if better is None:
            break
        v = better
    return v


def _admissible(problem: Problem, v: np.ndarray) -> np.ndarray:
    """The parameters, shrunk where necessary until the gait keeps its joint limits and its links apart."""
    gait = problem.gait.fourier(v, problem.body.n_joint)
    return v if is_admissible(problem, gait) else v * min(1.0, largest_amplitude(problem, gait))
