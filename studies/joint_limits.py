"""What a limit on the joint angles costs the isotropic three-link crawler, from joints that turn
freely to 30 degrees.

Starts travel from wide limits to narrow ones: a gait that fits is kept, one that does not is
projected and then solved.
"""

import numpy as np

from colloc import Axis, Harmonic, Problem, Study, ellipse


def problem(symmetry, joint_limit):
    return Problem(
        name="joint_limits",
        gait=Harmonic(harmonics=1, symmetry=symmetry),
        guess=ellipse(A0=0.0, A1=0.35, B1=0.15),
        joint_limit=joint_limit,
        delta=1e-3,
        intervals=16 if symmetry == "bilateral" else 28,
        mesh_tolerance=1e-4,
    )


STUDY = Study(
    name="joint_limits",
    axes=(
        Axis("symmetry", ("bilateral", "none"), "class of gaits that was searched"),
        Axis("joint_limit", np.linspace(np.pi, np.pi / 6, 16), "largest joint angle", "rad"),
    ),
    problem=problem,
)
