"""Travelling sine wave with large transverse friction (paper, figure 5B): Theta = sin(2 pi (s +
t)), mu_t = 100.

The motion is prescribed: nothing is optimised. The paper prints an efficiency of 0.76; with its
printed parameters the computation converges to 0.737066 (and to 0.7623 for mu_t = 1000).
"""

from colloc import Friction, Problem, Reference, Wave

PROBLEM = Problem(
    name="wave_sine",
    body=Wave("sine", amplitude=1.0, waves=1.0),
    friction=Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0),
    delta=1e-4,
)
REFERENCE = Reference(0.737066, 1e-6, "by composite Gauss panels")
