"""Self-contact of links that are more than two apart: which pairs an optimisation has to constrain.

A chain of n links has (n - 2)(n - 3)/2 such pairs and few of them ever come near each other. So a problem is solved
without them, the gait found is checked between the nodes against every pair, the pairs that cross are constrained from
then on, and the problem is solved again (a cutting-plane method). It ends after at most as many rounds as there are pairs.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.mechanics.bodies import Pairs

PHASES = 1000
"""Phases of the solved part of the period at which all pairs are checked; the certificate checks 20000 a period."""
TOUCHING = 1e-8
"""Penetration [body lengths] that counts as contact, not as crossing."""


class Members(Protocol):
    """A class of gaits by parameters."""

    @property
    def problem(self) -> Problem: ...

    def member(self, parameters: np.ndarray) -> AnyGait:
        """The gait of a parameter vector."""


_FRACTIONS = np.linspace(1.0, 0.0, 21)


def crossing_pairs(program: Members, parameters: np.ndarray) -> Pairs:
    """Pairs of links more than two apart that cross, or pass through each other, in a gait.

    Judged by plain intersection: the smooth `mechanics.contact.clearance` keeps a small distance, and constraining pairs that
    only touch makes problems harder for nothing (a folded chain of equal links has such contacts).
    """
    body, t = program.problem.body, np.linspace(0.0, program.problem.gait.fraction, PHASES)
    angles = program.member(parameters).angles(t)
    return tuple(
        pair
        for pair in body.far_pairs
        if max(body.crossing_depth(angles, [pair]).max(), body.passing_depth(angles, [pair])) > TOUCHING
    )


def last_free(program: Members, free: np.ndarray, crossing: np.ndarray) -> np.ndarray:
    """Gait parameters on the way from those of a free gait to those of one with crossing links, as far as links stay apart."""
    for fraction in _FRACTIONS:
        between = free + fraction * (crossing - free)
        if not crossing_pairs(program, between):
            return between
    return free
