"""Smooth bodies whose motion is prescribed: their shape coordinates are the phase, as a point on a
circle (`colloc.gaits.prescribed`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.mechanics.bodies import Body, Defaults, Sliding
from colloc.mechanics.law import Law
from colloc.smooth.motion import Motion, sine_wave, standing_wave, tanh_wave
from colloc.smooth.smooth_body import SmoothBody
from colloc.system.arguments import check_positive, named_arguments
from colloc.system.errors import ProblemError

_TURN = 2 * np.pi


class PrescribedBody(SmoothBody):
    """A smooth body that runs through a `Motion`, always solved on panels that adapt: its shapes
    may be as sharp, and delta as small, as one likes."""

    n_joint = 2
    # nobody optimised the motion: a replay need not look at it ten times as closely as the mesh
    defaults = Defaults(
        coordinate="coordinate", quantity="phase coordinate",
        delta=1e-4, delta_start=1e-4, limit=0.5 * np.pi, largest_limit=np.pi,
        limit_name="tangent angle", excess=1e-9, delta_influence=2e-2, instants=96,
        instants_a_point=2,
    )  # fmt: skip

    def prescribed(self) -> Motion:
        """Return the motion."""
        raise NotImplementedError

    @property
    def symmetries(self) -> tuple[str, ...]:
        return ("antipodal",) if self.prescribed().antipodal else ("none",)

    def tangent(self, s: np.ndarray, angles: np.ndarray) -> np.ndarray:
        return self.prescribed().angle(s, _phase(angles))

    def turning(self, s: np.ndarray, angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
        pace = (angles[0] * rates[1] - angles[1] * rates[0]) / _TURN
        return self.prescribed().rate(s, _phase(angles)) * pace

    def breaks(self, angles: np.ndarray) -> np.ndarray:
        breaks = self.prescribed().breaks
        return super().breaks(angles) if breaks is None else breaks(_phase(angles))

    def sliding(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: np.ndarray
    ) -> Sliding:
        slid = self.on_panels(friction, angles, rates, float(np.max(delta)), slide=z)
        return Sliding(slid.force, slid.centre, slid.power[None])

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        return np.array([1.0, 0.0]), np.array([0.0, 1.0])


def schedule(body: Body) -> tuple[float, ...]:
    """Phases from 0 to the solved part of a period between which a prescribed motion is smooth in
    time; none for a body that is free to move."""
    return body.prescribed().stages if isinstance(body, PrescribedBody) else ()


def _phase(angles: np.ndarray) -> np.ndarray:
    return np.arctan2(angles[1], angles[0]) / _TURN % 1.0


@named_arguments
@dataclass(frozen=True)
class Wave(PrescribedBody):
    """A body that runs through one of the paper's waves (figures 5 and 6).

    Parameters
    ----------
    profile : {"sine", "tanh", "standing"}
        ``sin(2 pi (waves s + t))``, ``tanh(steepness sin(2 pi (waves s - t)))`` or ``sin(2 pi s)
        sin(2 pi t)``, times the amplitude.
    amplitude : float
        Largest tangent angle [rad].
    waves : float
        Number along the body; a standing wave has one.
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
        """Return the motion."""
        if self.profile == "sine":
            return sine_wave(self.amplitude, self.waves)
        if self.profile == "standing":
            return standing_wave(self.amplitude)
        return tanh_wave(self.amplitude, self.steepness, self.waves)

    def describe(self) -> str:
        return f"smooth, a {self.profile} wave of amplitude {self.amplitude:g} rad"
