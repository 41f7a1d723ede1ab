"""The paper's third optimum of the isotropic three-link crawler: 0.094 at A0 = 2.5 (section V, not
shown there).

It lies where joint 1 just reaches its limit pi, A0 + sqrt(A1^2 + B1^2) = pi, a corner that a grid
meets only by luck: converged, the maximum is 0.103 at A0 = 2.59, A1 = 0.35, B1 = 0.43. Speeds are
low there, so the continuation has to start at a smaller delta than elsewhere: at delta = 0.01 this
optimum does not exist yet.
"""

from colloc import Friction, Harmonic, Problem, Reference, ellipse

PROBLEM = Problem(
    name="three_link_folded",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
    guess=ellipse(A0=2.4, A1=0.3, B1=0.5),
    delta=1e-4,
    delta_start=1e-3,
    intervals=24,
)

REFERENCE = Reference(
    0.094,
    0.01,
    "S. Alben (2019), section V: 'the third local optimum has A0 = 2.5, efficiency 0.094'",
)

STARTS = (
    1  # the optimum that this guess leads to: the best gait of the class is that of three_link.py
)
