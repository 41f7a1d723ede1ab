"""The best one-harmonic gait of three equal links at every pace: from slow motion to periods in
which inertia is all.

Cells are solved from slow to fast, and starts travel between neighbours (`docs/howto/pace.md`).
"""

import numpy as np

from colloc import Axis, Harmonic, Problem, Study, ellipse


def problem(froude):
    return Problem(
        name="froude",
        gait=Harmonic(harmonics=1, symmetry="antipodal"),
        guess=ellipse(A0=0.0, A1=2.86, B1=1.3),
        froude=float(froude),
        delta=1e-3,
        mesh_tolerance=1e-4,
    )


STUDY = Study(
    name="froude",
    axes=(Axis("froude", np.geomspace(1e-3, 1.0, 10).round(6), "Froude number L/(g T²)"),),
    problem=problem,
)
