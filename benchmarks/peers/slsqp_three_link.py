"""SciPy's SLSQP on the reduced functions: python -m benchmarks.peers.slsqp_three_link --starts 20 [--compiled]

The balance, the orientation, distance and work are eliminated by `collocation.reduced_space`, which gives minus the efficiency and its
exact gradient as functions of (A0, A1, B1) and the first orientation; the optimiser is SciPy's. Mesh, scheme and levels of
delta are those of the other tools; joint limits hold at the mesh's points, where they are linear. With --compiled the
derivatives are compiled first; the first start pays.
"""

from __future__ import annotations

import os
import tempfile

import numpy as np
from scipy.optimize import minimize

from benchmarks.peers.physics import DELTAS
from benchmarks.peers.runs import arguments, failed, found, run
from benchmarks.peers.settings import INTERVALS
from colloc import Harmonic, Problem, ellipse
from colloc.collocation.layout import RADIANS
from colloc.collocation.reduced_space import Condensed
from colloc.collocation.transcription import transcribe
from colloc.numerics.machine_code import FOLDER, OFF
from colloc.search.compiled_problem import compile_problem

TOLERANCE = 1e-9
STATED = Problem(
    "peer", ellipse(0.3, 1.0, 0.5), gait=Harmonic(1, "bilateral"), intervals=INTERVALS, scheme="radau-3", mesh_tolerance=0
)


class Reduced:
    """Minus the efficiency of a gait and its gradient, and the joint limits at the mesh's points."""

    def __init__(self) -> None:
        transcription = transcribe(STATED)
        self.condensed = Condensed(transcription)
        mesh = transcription.mesh
        angles = STATED.gait.angle_matrix(mesh.times, 2).reshape(-1, 3)
        angles = np.hstack([angles, np.zeros((len(angles), 1))])
        both = np.vstack([angles, -angles])
        self.limits = {"type": "ineq", "fun": lambda v: np.pi - both @ v, "jac": lambda v: -both}

    def minimised(self, v: np.ndarray, delta: float) -> tuple[bool, str, np.ndarray, float]:
        """Whether SLSQP says that it is done, its message, where it ended and minus the efficiency there."""
        ended = minimize(
            lambda v: self.condensed.values(v, delta / RADIANS)[0],
            v,
            jac=lambda v: self.condensed.gradients(v, delta / RADIANS)[0],
            method="SLSQP",
            constraints=self.limits,
            options={"ftol": TOLERANCE, "maxiter": 300},
        )
        return ended.success, ended.message, ended.x, ended.fun


def solve(reduced: Reduced, start: np.ndarray) -> dict:
    """Continuation in delta from one start; the gait and efficiency of the last level, or where it failed."""
    v = np.append(start, 0.0)
    for delta in DELTAS:
        good, message, v, value = reduced.minimised(v, delta)
        if not good:
            return failed(delta, message)
    return found(-value, v[:3])


def build(compiled: bool) -> Reduced:
    """The reduced functions, their derivatives compiled or not."""
    if compiled:
        compile_problem(STATED)
    return Reduced()


if __name__ == "__main__":
    chosen = arguments(__doc__, compiled="compile the derivatives first")
    with tempfile.TemporaryDirectory() as code:
        os.environ[FOLDER] = code if chosen.compiled else OFF
        run(chosen, lambda: build(chosen.compiled), solve)
