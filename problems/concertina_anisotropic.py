"""Concertina crawlers on anisotropic friction (paper, section VI and figure 13E); their motions are
prescribed.

Each crawls where its smallest coefficient applies: forwards, backwards, or sideways with two bumps.
The bump is drawn along and rubs with the largest coefficient, while the resting part holds on by a
margin that is only the difference of two lengths; so `share`, the bump's part of its region, is
smaller than the paper's 1/2 where friction is very unequal. `colloc solve` takes the last of them,
`python -m scripts.continue_epsilon problems/concertina_anisotropic.py` all.
"""

from colloc import Concertina, Friction, Problem

PROBLEMS = tuple(
    Problem(name, body=body, friction=friction, delta=1e-4)
    for name, body, friction in (
        ("forwards-1.7-1-1.3", Concertina(amplitude=1.3), Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)),
        (
            "backwards-1.7-1.3-1",
            Concertina(amplitude=1.3, backwards=True),
            Friction(mu_t=1.7, mu_f=1.3, mu_b=1.0),
        ),
        (
            "forwards-10-1-1",
            Concertina(amplitude=1.3, share=0.15),
            Friction(mu_t=10.0, mu_f=1.0, mu_b=1.0),
        ),
        (
            "concertina_anisotropic",
            Concertina(amplitude=1.2, share=0.3, bumps=2),
            Friction(mu_t=1.0, mu_f=3.0, mu_b=3.0),
        ),
    )
)
PROBLEM = PROBLEMS[-1]
EPSILONS = (0.05, 0.02, 0.01, 0.005, 0.002)
