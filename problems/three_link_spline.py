"""The isotropic three-link crawler on splines of 24 knots, symmetric about angle 1 = -angle 2.

Each coefficient changes a sixth of the cycle alone, so a path may bend sharply where that pays.
The guess is the paper's best ellipse, of efficiency 0.260; classes of more freedom do far better
(docs/gait_classes.md).
"""

from colloc import BSpline, Friction, Problem, Reference, ellipse

PROBLEM = Problem(
    name="three_link_spline",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=BSpline(knots=24, symmetry="bilateral"),
    guess=ellipse(A0=0, A1=2.8, B1=1.3),
    delta=1e-4,
)

STARTS = 64  # of 32 none leads to the best gait
REFERENCE = Reference(0.4205, 0.0005, "docs/known.md")
