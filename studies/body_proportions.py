"""How the lengths of the links of a symmetric three-link body decide its efficiency, for three laws
of friction.

``outer`` is the length of the first and of the last link; the middle one has the rest. One
harmonic, bilateral.
"""

import numpy as np

from colloc import Axis, Chain, Friction, Harmonic, Problem, Study, ellipse

LAWS = {
    "isotropic": Friction(1, 1, 1),
    "backward 3": Friction(mu_t=1, mu_f=1, mu_b=3),
    "transverse 10": Friction(mu_t=10, mu_f=1, mu_b=1),
}


def problem(law, outer):
    outer = round(float(outer), 6)
    return Problem(
        name="body_proportions",
        body=Chain((outer, 1.0 - 2 * outer, outer)),
        friction=LAWS[law],
        gait=Harmonic(harmonics=1, symmetry="bilateral"),
        guess=ellipse(A0=0.3, A1=1.0, B1=0.5),
        delta=1e-3,
        intervals=16,
        mesh_tolerance=1e-4,
    )


STUDY = Study(
    name="body_proportions",
    axes=(
        Axis("law", tuple(LAWS), "law of friction", travels=False),
        Axis("outer", np.linspace(0.15, 0.45, 13), "length of the outer links", "body length"),
    ),
    problem=problem,
)
