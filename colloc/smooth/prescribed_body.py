"""Smooth bodies whose motion is prescribed, as bodies of a problem: what they achieve is asked for,
nothing is free.

Their shape coordinates are the phase, as a point on a circle (`colloc.gaits.prescribed`).
Everything is solved on panels that adapt, since prescribed shapes may be as sharp, and delta as
small, as one likes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.mechanics.balance_results import BalancedMotion, BalanceSolution, Sliding
from colloc.mechanics.bodies import Usual
from colloc.mechanics.law import Law
from colloc.smooth.motion import Motion, sine_wave, standing_wave, tanh_wave
from colloc.smooth.smooth_body import SmoothBody
from colloc.system.arguments import check_positive, named_arguments
from colloc.system.errors import ProblemError

_TURN = 2 * np.pi


class PrescribedBody(SmoothBody):
    """A smooth body that runs through a `colloc.smooth.motion.Motion`."""

    n_joint = 2
    coordinate, quantity = "coordinate", "phase coordinate"
    usual = Usual(
        delta=1e-4, delta_start=1e-4, limit=0.5 * np.pi, largest_limit=np.pi,
        limit_name="tangent angle", excess=1e-9,
        delta_influence=2e-2, instants=96, instants_a_point=2,
    )  # fmt: skip
    """Nobody optimised the motion, so a replay need not look at it ten times as closely as the
    mesh; it adapts anyway."""
    limited = np.empty((0, 2))
    bending = np.empty((0, 2))

    def prescribed(self) -> Motion:
        """The motion."""
        raise NotImplementedError

    @property
    def symmetries(self) -> tuple[str, ...]:
        return ("antipodal",) if self.prescribed().antipodal else ("none",)

    @property
    def schedule(self) -> tuple[float, ...]:
        return self.prescribed().stages

    def tangent(self, s: np.ndarray, angles: np.ndarray) -> np.ndarray:
        return self.prescribed().angle(s, _phase(angles))

    def turning(self, s: np.ndarray, angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
        pace = (angles[0] * rates[1] - angles[1] * rates[0]) / _TURN
        return self.prescribed().rate(s, _phase(angles)) * pace

    def breaks(self, angles: np.ndarray) -> np.ndarray:
        found = self.prescribed().breaks
        return super().breaks(angles) if found is None else found(_phase(angles))

    def sliding(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: np.ndarray
    ) -> Sliding:
        slid = self.on_adaptive_panels(friction, angles, rates, float(np.max(delta)), slide=z)
        return Sliding(slid.force, slid.centre, slid.power[None])

    def solve(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, *,
        start: np.ndarray | None = None,
        tolerance: float = 1e-11,
    ) -> BalanceSolution:  # fmt: skip
        s = self.on_adaptive_panels(friction, angles, rates, delta, tolerance=tolerance)
        return BalanceSolution(
            s.z,
            s.residual,
            s.iterations,
            s.residual <= tolerance,
            np.zeros(s.t.size, dtype=int),
            s.z,
        )

    def motion(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> BalancedMotion:
        slid = self.on_adaptive_panels(friction, angles, rates, delta, slide=solved.z)
        return BalancedMotion(solved.z, slid.centre, slid.power, slid.bending_power)

    def slopes(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> np.ndarray:
        raise NotImplementedError("a prescribed motion has nothing to differentiate by.")

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        return np.array([1.0, 0.0]), np.array([0.0, 1.0])


def _phase(angles: np.ndarray) -> np.ndarray:
    return np.arctan2(angles[1], angles[0]) / _TURN % 1.0


@named_arguments
@dataclass(frozen=True)
class Wave(PrescribedBody):
    """A body that runs through one of the paper's waves (figures 5 and 6).

    Parameters
    ----------
    profile : {"sine", "tanh", "standing"}
        See `colloc.smooth.motion`: ``sin(2 pi (waves s + t))``, ``tanh(steepness sin(2 pi (waves s
        - t)))`` and ``sin(2 pi s) sin(2 pi t)``, times the amplitude.
    amplitude : float
        Largest tangent angle [rad].
    waves : float
        Along the body; a standing wave has one.
    steepness : float
        Of "tanh" only.

    Examples
    --------
    >>> from colloc import Friction, Problem, Wave
    >>> problem = Problem("wave", body=Wave("sine", amplitude=1.0), friction=Friction(mu_t=100))
    >>> problem.gait.describe()
    'a prescribed motion, symmetry antipodal'
    """

    profile: str = "sine"
    amplitude: float = 1.0
    waves: float = 1.0
    steepness: float = 20.0

    def __post_init__(self) -> None:
        if self.profile not in ("sine", "tanh", "standing"):
            raise ProblemError(
                f"profile must be 'sine', 'tanh' or 'standing', not {self.profile!r}."
            )
        check_positive(self, "amplitude", "waves", "steepness")

    def prescribed(self) -> Motion:
        if self.profile == "sine":
            return sine_wave(self.amplitude, self.waves)
        if self.profile == "standing":
            return standing_wave(self.amplitude)
        return tanh_wave(self.amplitude, self.steepness, self.waves)

    def describe(self) -> str:
        return f"smooth, a {self.profile} wave of amplitude {self.amplitude:g} rad"
