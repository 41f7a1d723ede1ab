r"""Totals of a period, each with its errors.

A period that turns the body by alpha turns everything about one point of the floor. The
displacement of the centre of mass x then depends on the phase at which the period begins. The chord
of the circle's arc does not; it is the distance of a gait that is asked to turn,

    chord = (2 sin(alpha/2) / alpha) |integral of e^(-i alpha t) x'(t) dt|,

the way as seen from *axes that turn evenly*; for alpha = 0 it is the displacement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from colloc.gaits.objective import Objective


def chord_per_way(turn: float) -> float:
    """Chord of an arc that turns by an angle [rad], over the way in axes that turn evenly."""
    return float(abs(np.sinc(turn / (2 * np.pi))))


@dataclass(frozen=True)
class Period:
    """Quantities of a period, by the names of `colloc.gaits.objective.QUANTITIES`; what nobody
    measured is left out.

    errors: how much each may be wrong by, of unknown sign. others: how much each could change at
    most if the body took any other of its balanced motions; empty where there is one.
    """

    values: Mapping[str, float] = field(hash=False)
    errors: Mapping[str, float] = field(hash=False)
    others: Mapping[str, float] = field(hash=False)

    @property
    def distance(self) -> float:
        """Displacement of the centre of mass, or the chord of the arc [body lengths]."""
        return self.values["distance"]

    @property
    def work(self) -> float:
        """Work of the joints [weight x body length]."""
        return self.values["work"]

    @property
    def rotation(self) -> float:
        """Net rotation, counter-clockwise [rad]."""
        return self.values["rotation"]

    @property
    def length(self) -> float:
        """Length of the path in shape space [rad]."""
        return self.values["length"]

    @property
    def efficiency(self) -> float:
        return self.distance / self.work

    def error_of(self, objective: Objective) -> float:
        """Relative error of an objective."""
        return float(objective.relative_error(self.values, self.errors))

    def ambiguity_of(self, objective: Objective) -> float:
        """Relative change of an objective by other balanced motions."""
        return float(objective.relative_error(self.values, self.others))
