"""The best gait for the pace at hand: three equal links, one metre long on a floor of mu = 0.5, two
seconds a period.

    python -m colloc.solve problems/three_link_fast.py

The slow gait of `three_link.py`, of efficiency 0.26, has 0.157 at this pace.
"""

from colloc import Harmonic, Problem

LENGTH, PERIOD, MU, GRAVITY = 1.0, 2.0, 0.5, 9.81
"""[m], [s], the friction of the floor where the problem says 1, and [m/s^2]."""

PROBLEM = Problem(
    name="three_link_fast", gait=Harmonic(1), froude=LENGTH / (GRAVITY * PERIOD**2) / MU
)
