"""Smooth body with six bending modes, friction much larger sideways than along (paper, figure 5B):
which gait is best?

The paper's wave, Theta = sin(2 pi (s + t)), reaches 0.737. The usual guess is that wave, a little
smaller.
"""

from colloc import Friction, Harmonic, ModalBody, Problem

PROBLEM = Problem(
    name="smooth_low_mode",
    body=ModalBody(modes=6, basis="legendre"),
    friction=Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0),
    gait=Harmonic(1, "antipodal"),
)
