"""The best one-harmonic gait of the three-link body over the plane of friction coefficients.

The idea of the paper's figure 1 (left): across (mu_t/mu_f, mu_b/mu_f), which kind of gait is best,
and how efficient is it? There for a smooth body with 45 modes; here for three equal links with one
harmonic, every gait certified. Coefficients are given relative to mu_f = 1; exchanging head and
tail exchanges mu_f and mu_b, so mu_b >= mu_f is all there is.
"""

import numpy as np

from colloc import Axis, Friction, Harmonic, Problem, Study, ellipse


def problem(mu_t, mu_b, symmetry):
    return Problem(
        name="friction_plane",
        friction=Friction(mu_t=mu_t, mu_f=1.0, mu_b=mu_b),
        gait=Harmonic(harmonics=1, symmetry=symmetry),
        guess=ellipse(A0=0.0 if symmetry == "antipodal" else 0.3, A1=1.0, B1=0.5),
        delta=1e-3,
        intervals=24 if symmetry == "none" else 14,
        mesh_tolerance=1e-4,
    )


STUDY = Study(
    name="friction_plane",
    axes=(
        Axis("mu_t", np.geomspace(0.1, 10.0, 15), "mu_t / mu_f"),
        Axis("mu_b", np.geomspace(1.0, 10.0, 15), "mu_b / mu_f"),
        Axis("symmetry", ("bilateral", "none"), "class of gaits that was searched"),
    ),
    problem=problem,
    cold_starts=1,
    warm_starts=1,
    chunk=2,
    time_limit=60.0,
)
