r"""Smooth bodies whose motion is prescribed, always solved on panels that adapt. Their shape
coordinates are the phase, as a point on a circle (`colloc.gaits.prescribed`).

A concertina crawler (paper, section VI) is straight but for one or two travelling bumps. On a bump
of arc length ``w`` centred at ``c``, with ``x = 2 (s - c)/w`` in [-1, 1], the tangent angle is
``Theta = a odd(x) + b even(x)``, zero elsewhere,

    odd = -k x (1 - x^2)^3,    k = 7^(7/2)/6^3 (so that max odd = 1),    even = (1 - x^2)^3.

One bump (figure 13A to D), in the region ``|s - 1/2| <= epsilon``: a grows from 0 to `amplitude` at
the rear end, the front half at rest; the bump travels to the front end; a falls to 0, the rear at
rest; then the mirror image, Theta(s, t + 1/2) = -Theta(s, t).

Two bumps (figure 13E), in regions around 1/4 and 3/4, Theta(1 - s) = -Theta(s): the body lies
across its path. ``(a, b) = A(phi) (sin phi, cos phi)`` with A(0) = `amplitude` and A(phi) such that
the chord along the body stays constant. phi goes from 0 to pi, bumps at the inner ends, the outer
parts at rest; the bumps travel outwards; phi returns, the middle at rest; the bumps travel back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.mechanics.bodies import Body, Defaults
from colloc.smooth.balance import Motion
from colloc.smooth.smooth_body import SmoothBody
from colloc.system.arguments import check_positive, named_arguments
from colloc.system.errors import ProblemError

_TURN = 2 * np.pi
ODD_SCALE = 7**3.5 / 6**3
_CHORD_NODES, _CHORD_WEIGHTS = np.polynomial.legendre.leggauss(48)


class PrescribedBody(SmoothBody):
    """A smooth body that runs through a `Motion`."""

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
        a, steepness = self.amplitude, self.steepness

        def sine(s: np.ndarray, t: np.ndarray, rate: bool = False) -> np.ndarray:
            phase = _TURN * (self.waves * s + t)
            return _TURN * (a * np.cos(phase)) if rate else a * np.sin(phase)

        def tanh(s: np.ndarray, t: np.ndarray, rate: bool = False) -> np.ndarray:
            phase = _TURN * (self.waves * s - t)
            inner = steepness * np.sin(phase)
            if not rate:
                return a * np.tanh(inner)
            slope = a * steepness * np.cos(phase) / np.cosh(np.clip(inner, -300, 300)) ** 2
            return -_TURN * slope

        def standing(s: np.ndarray, t: np.ndarray, rate: bool = False) -> np.ndarray:
            in_time = _TURN * np.cos(_TURN * t) if rate else np.sin(_TURN * t)
            return a * np.sin(_TURN * s) * in_time

        theta = {"sine": sine, "tanh": tanh, "standing": standing}[self.profile]
        stages = (0.0, 0.25, 0.5) if self.profile == "standing" else (0.0, 0.5)
        return Motion(theta, lambda s, t: theta(s, t, rate=True), stages=stages, antipodal=True)

    def describe(self) -> str:
        return f"smooth, a {self.profile} wave of amplitude {self.amplitude:g} rad"


def bump(x: np.ndarray, a: np.ndarray, b: np.ndarray, *, slope: bool = False) -> np.ndarray:
    """``a odd(x) + b even(x)``, or its derivative."""
    y = np.clip(1 - x * x, 0.0, None)
    if slope:
        return -ODD_SCALE * a * (y**3 - 6 * x * x * y**2) - 6 * b * x * y**2
    return (b - ODD_SCALE * a * x) * y**3


@named_arguments
@dataclass(frozen=True)
class Concertina(PrescribedBody):
    """A concertina crawler.

    Parameters
    ----------
    epsilon : float
        Half-width of each bump region [body lengths].
    amplitude : float
        Largest tangent angle of the bump [rad].
    share : float
        Arc length of a bump over that of its region, 2 epsilon; the paper's is 1/2. The rest is the
        margin by which the resting part is longer than the sliding one.
    bumps : {1, 2}
        Number of bumps.
    backwards : bool
        One bump: run from head to tail (for mu_b < mu_f).

    Examples
    --------
    >>> from colloc import Concertina, Problem
    >>> Problem("crawler", body=Concertina(epsilon=0.05)).gait.describe()
    'a prescribed motion, symmetry antipodal'
    """

    epsilon: float = 0.1
    amplitude: float = 1.0
    share: float = 0.5
    bumps: int = 1
    backwards: bool = False

    def __post_init__(self) -> None:
        if self.bumps not in (1, 2):
            raise ProblemError(f"bumps must be 1 or 2, not {self.bumps!r}.")
        widest = 0.5 / self.bumps
        ends = {"epsilon": (widest, f"{widest:g} for {self.bumps} bump(s)"), "share": (1, "1")}
        for name, (most, words) in (ends | {"amplitude": (np.pi / 2, "pi/2")}).items():
            if not 0 < getattr(self, name) < most:
                raise ProblemError(
                    f"{name} must lie between 0 and {words}, not {getattr(self, name)!r}."
                )

    @property
    def width(self) -> float:
        """Arc length of a bump."""
        return 2 * self.epsilon * self.share

    @property
    def regions(self) -> tuple[tuple[float, float], ...]:
        """Arcs within which bumps form and travel."""
        centres = (0.5,) if self.bumps == 1 else (0.25, 0.75)
        return tuple((c - self.epsilon, c + self.epsilon) for c in centres)

    @property
    def stroke(self) -> float:
        """Distance per period if nothing slips that should rest."""
        odd, even = bump(_CHORD_NODES, *(self.amplitude * np.eye(2)[:, :, None]))
        shortening = 1 - np.cos(odd) if self.bumps == 1 else np.sin(even)
        return float(2 * self.width * np.sum(0.5 * _CHORD_WEIGHTS * shortening))

    def describe(self) -> str:
        bumps = "one bump" if self.bumps == 1 else "two bumps"
        return (
            f"smooth, {bumps} of width {self.width:g} and amplitude {self.amplitude:g} rad in "
            f"regions of {2 * self.epsilon:g}"
        )

    def prescribed(self) -> Motion:
        """Return the motion."""
        w, (low, high), one = self.width, self.regions[0], self.bumps == 1
        rear_bump = self._one_bump if one else self._two_bumps

        def theta(s: np.ndarray, t: np.ndarray, rate: bool = False) -> np.ndarray:
            (a, b, centre), (a_rate, b_rate, centre_rate) = rear_bump(t)
            x = 2 * ((s if one else np.minimum(s, 1 - s)) - centre) / w
            if rate:
                moving = bump(x, a, b, slope=True) * 2 * centre_rate / w
                value = bump(x, a_rate, b_rate) - moving
            else:
                value = bump(x, a, b)
            return value if one else np.where(s > 0.5, -value, value)

        def breaks(t: np.ndarray) -> np.ndarray:
            inner = rear_bump(t)[0][2] + w * np.linspace(-0.5, 0.5, 5)[:, None]
            ends = np.stack([np.full_like(t, low), *inner, np.full_like(t, high)])
            return ends if one else np.concatenate([ends, 1 - ends])

        stages = (0.0, 1 / 6, 1 / 3, 0.5) if one else (0.0, 0.25, 0.5, 0.75, 1.0)
        return Motion(theta, lambda s, t: theta(s, t, rate=True), breaks, stages, antipodal=one)

    def _one_bump(self, t: np.ndarray) -> np.ndarray:
        """Coefficients a, b and centre of the bump, and their rates, ``(2, 3, n_time)``."""
        travel = (2 * self.epsilon - self.width) * (-1 if self.backwards else 1)
        scale = np.where(t < 0.5, self.amplitude, -self.amplitude)
        grows, travels, falls = _ramps(np.where(t < 0.5, t, t - 0.5), 1 / 6, 3)
        parts = np.stack([scale * (grows - falls), 0.0 * grows, travel * travels], axis=1)
        parts[0, 2] += 0.5 - 0.5 * travel
        return parts

    def _two_bumps(self, t: np.ndarray) -> np.ndarray:
        """The same of the rear bump."""
        travel = 2 * self.epsilon - self.width
        # a solver asks for the same phases panel by panel
        t, places = np.unique(t, return_inverse=True)
        turns, out, returns, back = _ramps(t % 1.0, 1 / 4, 4)
        phi, phi_rate = np.pi * (turns - returns)
        sine, cosine = np.sin(phi), np.cos(phi)
        # A(phi) that keeps the chord, int cos(A (sin phi odd + cos phi even)) dx
        weight = _CHORD_WEIGHTS[:, None]
        odd, even = bump(_CHORD_NODES, *np.eye(2)[:, :, None])[:, :, None]
        goal = np.sum(weight * np.cos(self.amplitude * even))
        shape, turned = sine * odd + cosine * even, cosine * odd - sine * even
        A = self.amplitude * np.sqrt(np.sum(weight * even**2) / np.sum(weight * shape**2, axis=0))
        for _ in range(20):
            slope = -np.sum(weight * np.sin(A * shape) * shape, axis=0)
            A = A - (np.sum(weight * np.cos(A * shape), axis=0) - goal) / slope
        pull = weight * np.sin(A * shape)
        dA = -A * np.sum(pull * turned, axis=0) / np.sum(pull * shape, axis=0)
        a_rate, b_rate = dA * sine + A * cosine, dA * cosine - A * sine
        centre, centre_rate = travel * (back - out)
        rates = a_rate * phi_rate, b_rate * phi_rate, centre_rate
        return np.array([(A * sine, A * cosine, 0.25 + 0.5 * travel + centre), rates])[..., places]


def _ramps(t: np.ndarray, step: float, count: int) -> np.ndarray:
    """Ramps from 0 to 1, one after the other, and their rates, ``(count, 2, n_time)``."""
    starts = step * np.arange(count)[:, None]
    since = (t - starts) / step
    return np.stack([np.clip(since, 0.0, 1.0), ((since >= 0) & (since < 1)) / step], axis=1)
