"""An eight-link serpenoid snake: the gait of most snake robots, one wave with an amplitude and a
lag.

Friction across the links is ten times that along them, as of passive wheels or scales. The class
has two parameters, whatever the number of joints.
"""

from colloc import Chain, Friction, Problem, Serpenoid

PROBLEM = Problem(
    name="serpenoid_snake",
    body=Chain((1 / 8,) * 8),
    friction=Friction(mu_t=10, mu_f=1, mu_b=1),
    gait=Serpenoid(symmetry="antipodal"),
)
