"""The fastest gait of a three-link crawler on sideways wheels: distance per path in shape space.

A robot whose joints turn at a bounded rate goes fastest by the gait of most distance per path.
Friction across the links is ten times that along them. The most efficient gait of the class goes
0.0482 body lengths per radian, and saves 4 % of work; `colloc pareto` finds gaits between,
with `--objectives speed efficiency`.
"""

from colloc import Friction, Harmonic, Problem

PROBLEM = Problem(
    name="three_link_wheels",
    friction=Friction(mu_t=10, mu_f=1, mu_b=1),
    gait=Harmonic(harmonics=2, symmetry="bilateral"),
    objective="speed",
)
