"""Concertina crawlers on anisotropic friction (paper, section VI and figure 13E).

Each crawls where its smallest coefficient applies: forwards, backwards, or sideways with two bumps. The bump is drawn
along and rubs with the largest coefficient, while the resting part holds on by a margin that is only the difference of
two lengths; so `share`, the bump's part of its region, is smaller than the paper's 1/2 where friction is very unequal.

    python -m scripts.continue_epsilon problems/concertina_anisotropic.py
"""

from colloc.mechanics.friction import Friction
from colloc.smooth.concertina import Concertina

PROBLEMS = (
    Concertina("forwards-1.7-1-1.3", amplitude=1.3, friction=Friction(1.7, 1.0, 1.3)),
    Concertina("backwards-1.7-1.3-1", amplitude=1.3, friction=Friction(1.7, 1.3, 1.0), backwards=True),
    Concertina("forwards-10-1-1", amplitude=1.3, share=0.15, friction=Friction(10.0, 1.0, 1.0)),
    Concertina("sideways-1-3-3", amplitude=1.2, share=0.3, bumps=2, friction=Friction(1.0, 3.0, 3.0)),
)
PROBLEM = PROBLEMS[-1]
EPSILONS = (0.05, 0.02, 0.01, 0.005, 0.002)
