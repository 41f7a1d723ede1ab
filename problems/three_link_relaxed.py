"""The isotropic three-link crawler without a bound on how often it turns: relaxed gaits, symmetric both ways.

At each instant the joints move in a mixture of up to three directions of rates, each at its own shape of friction; the limit of
ever smaller loops. What is reported is a finite gait that repeats the directions: a polygon, certified like any other. A large
sweep from the antidiagonal of the two angles and small loops where the body turns back: 0.448, 0.68 body lengths a period.
delta is measured at unit shape speed.
"""

from colloc import Friction, Problem, Reference, Relaxed

PROBLEM = Problem(
    name="three_link_relaxed",
    friction=Friction(mu_t=1, mu_f=1, mu_b=1),
    gait=Relaxed(directions=3, symmetry="both"),
    delta=1e-5,
    joint_limit=2.5,
)

REFERENCE = Reference(0.449, 0.001, "a midpoint rule on 40 intervals, by other code: relaxed 0.4490 at delta 3e-5")
