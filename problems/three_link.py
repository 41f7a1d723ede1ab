"""The isotropic three-link crawler, one harmonic, symmetric about angle 1 = -angle 2: the paper's
best gait.

    angle 1 =  A0 + A1 cos(2 pi t) + B1 sin(2 pi t)
    angle 2 = -A0 - A1 cos(2 pi t) + B1 sin(2 pi t)

Maximise d/W. The paper finds 0.259 at A0 = 0 (section V, figure 12 D). The guess is deliberately
poor: it does a third of that, with an offset that the optimum does not have.
"""

from colloc import Friction, Harmonic, Problem, Reference, ellipse

PROBLEM = Problem(
    name="three_link",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
    guess=ellipse(A0=0.3, A1=1.0, B1=0.5),
    delta=1e-4,
    intervals=24,
)

REFERENCE = Reference(
    0.259,
    0.0015,
    "S. Alben (2019), section V: 'the global maximum is found at A0 = 0, has efficiency 0.259'",
)
