"""Concertina crawler whose bump is free: the paper's, in a region of half-width 0.1, with the best
place and profile.

The paper's crawler (figure 13A to D, problems/concertina.py) lets a bump of one profile grow at the
rear, travel and flatten at the front. Here the profile has four amplitudes, and the half period is
a polygon of six sides in them and the bump's place. A part at rest that begins to slip costs much
of the distance at once, so the search begins at the last delta, at that crawler.
"""

from colloc import Corners, CrawlerBody, Friction, Polygon, Problem

BODY = CrawlerBody(epsilon=0.1, modes=4)
PROBLEM = Problem(
    name="crawler",
    guess=Corners(BODY.concertina(amplitude=1.49, sides=6, way=(0.9, 0.4)), "antipodal"),
    body=BODY,
    friction=Friction(mu_t=1.0, mu_f=1.0, mu_b=1.0),
    gait=Polygon(corners=12, symmetry="antipodal"),
    delta=5e-5,
    delta_start=5e-5,
)
STARTS = 1  # the optimum that this guess leads to
