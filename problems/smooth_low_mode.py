"""Smooth body with six bending modes, friction much larger sideways than along (paper, figure 5B): which gait is best?

The paper's wave, Theta = sin(2 pi (s + t)), is the guess; it reaches 0.737.
Solve it with python -m scripts.optimise_smooth problems/smooth_low_mode.py
"""

from colloc.gaits.harmonic import Harmonic
from colloc.mechanics.friction import Friction
from colloc.smooth.modal_body import ModalBody
from colloc.smooth.modal_problem import ModalProblem

BODY = ModalBody(modes=6, basis="legendre")
PROBLEM = ModalProblem(
    name="smooth_low_mode",
    guess=BODY.wave(1.0),
    body=BODY,
    friction=Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0),
    gait=Harmonic(1, "antipodal"),
)
