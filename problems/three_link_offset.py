"""The paper's second optimum of the isotropic three-link crawler: 0.207 at A0 = 1.1 (section V,
figure 12 F)."""

from colloc import Friction, Harmonic, Problem, Reference, ellipse

PROBLEM = Problem(
    name="three_link_offset",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=1, symmetry="bilateral"),
    guess=ellipse(A0=0.8, A1=0.5, B1=0.8),
    delta=1e-4,
    intervals=24,
)

REFERENCE = Reference(0.207, 0.0015, "S. Alben (2019), section V: 'A0 = 1.1, has efficiency 0.207'")

STARTS = (
    1  # the optimum that this guess leads to: the best gait of the class is that of three_link.py
)
