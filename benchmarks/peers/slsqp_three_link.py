"""SciPy's SLSQP on the reduced functions: python -m benchmarks.peers.slsqp_three_link --starts 20

`colloc.reduced` gives minus the efficiency and its exact gradient as functions of (A0, A1, B1); the
optimiser is SciPy's. Mesh, scheme and levels of delta are those of the other tools; joint limits
hold at the mesh's points, where they are linear.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from benchmarks.peers.physics import DELTAS
from benchmarks.peers.runs import arguments, failed, found, run
from colloc import Harmonic, Problem, ellipse
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import space_near
from colloc.transcription.layout import RADIANS

TOLERANCE = 1e-9


class Reduced:
    """Minus the efficiency of a gait and its gradient, and the joint limits at the mesh's
    points."""

    def __init__(self, intervals: int) -> None:
        stated = Problem(
            "peer",
            ellipse(0.3, 1.0, 0.5),
            gait=Harmonic(1, "bilateral"),
            intervals=intervals,
            scheme="radau-3",
            mesh_tolerance=0,
        )
        space, _ = space_near(stated, stated.guess)
        self.program = ReducedProgram(space, DELTAS[0] / RADIANS)
        angles = stated.gait.angle_matrix(space.mesh.times, 2).reshape(-1, 3)
        both = np.vstack([angles, -angles])
        self.limits = {"type": "ineq", "fun": lambda v: np.pi - both @ v, "jac": lambda v: -both}

    def minimised(self, v: np.ndarray, delta: float) -> tuple[bool, str, np.ndarray, float]:
        """Whether SLSQP says that it is done, its message, where it ended and minus the efficiency
        there."""
        self.program.delta = delta / RADIANS
        ended = minimize(
            self.program.objective,
            v,
            jac=self.program.gradient,
            method="SLSQP",
            constraints=self.limits,
            options={"ftol": TOLERANCE, "maxiter": 300},
        )
        return ended.success, ended.message, ended.x, ended.fun


def solve(reduced: Reduced, start: np.ndarray) -> dict:
    """Continuation in delta from one start; the gait and efficiency of the last level, or where it
    failed."""
    v = start
    for delta in DELTAS:
        good, message, v, value = reduced.minimised(v, delta)
        if not good:
            return failed(delta, message)
    return found(-value, v)


if __name__ == "__main__":
    chosen = arguments(__doc__)
    run(chosen, lambda: Reduced(chosen.intervals), solve)
