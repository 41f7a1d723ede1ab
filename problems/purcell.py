"""Purcell's three-link swimmer: the most efficient stroke of one harmonic under viscous drag."""

from colloc import Harmonic, Problem, Viscous, ellipse

PROBLEM = Problem(
    name="purcell",
    # equal links; drag across a thin filament is twice that along it
    friction=Viscous(normal=2.0, tangential=1.0),
    gait=Harmonic(harmonics=1, symmetry="none"),
    guess=ellipse(A0=0, A1=0.7, B1=0.7),
    objective="towing",
)
