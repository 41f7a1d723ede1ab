"""The isotropic three-link crawler on a free path of bounded curvature, symmetric about angle 1 =
-angle 2.

The path in the plane of the two joint angles is a state of the problem: q' = (cos psi, sin psi) and
psi' = kappa in its own arc length, |kappa| <= 8 per rad, closed up to the symmetry, of any length.
delta is measured at unit shape speed. The guess is the paper's best ellipse, of efficiency 0.260;
paths that may bend more do far better (docs/gait_classes.md).
"""

from colloc import FreePath, Friction, Problem, Reference, ellipse

PROBLEM = Problem(
    name="three_link_free_path",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=FreePath(curvature=8, symmetry="bilateral"),
    guess=ellipse(A0=0, A1=2.8, B1=1.3),
    delta=1e-4,
    intervals=60,
)

REFERENCE = Reference(
    0.380, 0.01, "design notes, section 5: 0.380 on a coarse mesh; a finer one gives a little more"
)
