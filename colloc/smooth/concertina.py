r"""Concertina crawlers: a straight body with one or two travelling bumps (paper, section VI).

On a bump of arc length ``w`` centred at ``c``, with ``x = 2 (s - c)/w`` in [-1, 1], the tangent
angle is ``Theta = a odd(x) + b even(x)``, zero elsewhere,

    odd = -k x (1 - x^2)^3,    k = 7^(7/2)/6^3 (so that max odd = 1),    even = (1 - x^2)^3.

The odd part shortens the body by ``w (1 - mean cos Theta)``, the even part shifts it sideways. A
bump that travels without changing keeps its chord, so both straight parts can rest.

One bump (figure 13A to D), in the region ``|s - 1/2| <= epsilon``: a grows from 0 to `amplitude` at
the rear end, the front half at rest; the bump travels to the front end; a falls to 0, the rear at
rest; then the mirror image, Theta(s, t + 1/2) = -Theta(s, t).

Two bumps (figure 13E), in regions around 1/4 and 3/4, Theta(1 - s) = -Theta(s): the body lies
across its path. ``(a, b) = A(phi) (sin phi, cos phi)`` with A(0) = `amplitude` and A(phi) such that
the chord along the body stays constant. phi goes from 0 to pi, bumps at the inner ends, the outer
parts at rest; the bumps travel outwards; phi returns, the middle at rest; the bumps travel back.

For epsilon -> 0 the efficiency is 1/mu_f (one bump; 1/mu_b backwards), or 1/mu_t (two bumps).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from colloc.smooth.motion import Motion
from colloc.smooth.prescribed_body import PrescribedBody
from colloc.system.arguments import check_finite, named_arguments
from colloc.system.errors import ProblemError

ODD_SCALE = 7**3.5 / 6**3
_CHORD_NODES, _CHORD_WEIGHTS = np.polynomial.legendre.leggauss(48)


def odd_profile(x: np.ndarray) -> np.ndarray:
    return -ODD_SCALE * x * np.clip(1 - x * x, 0.0, None) ** 3


def odd_slope(x: np.ndarray) -> np.ndarray:
    y = np.clip(1 - x * x, 0.0, None)
    return -ODD_SCALE * (y**3 - 6 * x * x * y**2)


def even_profile(x: np.ndarray) -> np.ndarray:
    return np.clip(1 - x * x, 0.0, None) ** 3


def even_slope(x: np.ndarray) -> np.ndarray:
    return -6 * x * np.clip(1 - x * x, 0.0, None) ** 2


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
        check_finite(epsilon=self.epsilon, share=self.share, amplitude=self.amplitude)
        widest = 0.5 / self.bumps
        if not 0 < self.epsilon < widest:
            raise ProblemError(
                f"epsilon must lie between 0 and {widest:g} for {self.bumps} bump(s), not "
                f"{self.epsilon!r}."
            )
        if not 0 < self.share < 1:
            raise ProblemError(f"share must lie between 0 and 1, not {self.share!r}.")
        if not 0 < self.amplitude < np.pi / 2:
            raise ProblemError(f"amplitude must lie between 0 and pi/2, not {self.amplitude!r}.")

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
        x, weight, amplitude = _CHORD_NODES, 0.5 * _CHORD_WEIGHTS, self.amplitude
        if self.bumps == 1:
            shortening = 1 - np.cos(amplitude * odd_profile(x))
        else:
            shortening = np.sin(amplitude * even_profile(x))
        return float(2 * self.width * np.sum(weight * shortening))

    def describe(self) -> str:
        bumps = "one bump" if self.bumps == 1 else "two bumps"
        return (
            f"smooth, {bumps} of width {self.width:g} and amplitude {self.amplitude:g} rad in "
            f"regions of {2 * self.epsilon:g}"
        )

    def prescribed(self) -> Motion:
        """Return the motion."""
        w, (low, high), one = self.width, self.regions[0], self.bumps == 1
        bump = self._one_bump if one else self._two_bumps

        def mirrored(s: np.ndarray, rear: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
            value = rear(np.minimum(s, 1 - s))
            return np.where(s > 0.5, -value, value)

        def angle(s: np.ndarray, t: np.ndarray) -> np.ndarray:
            a, b, centre, *_ = bump(t)

            def theta(s: np.ndarray) -> np.ndarray:
                x = 2 * (s - centre) / w
                return a * odd_profile(x) + b * even_profile(x)

            return theta(s) if one else mirrored(s, theta)

        def rate(s: np.ndarray, t: np.ndarray) -> np.ndarray:
            a, b, centre, a_rate, b_rate, centre_rate = bump(t)

            def turning(s: np.ndarray) -> np.ndarray:
                x = 2 * (s - centre) / w
                moving = (a * odd_slope(x) + b * even_slope(x)) * 2 * centre_rate / w
                return a_rate * odd_profile(x) + b_rate * even_profile(x) - moving

            return turning(s) if one else mirrored(s, turning)

        def breaks(t: np.ndarray) -> np.ndarray:
            rear, front = bump(t)[2] + np.array([[-w / 2], [w / 2]])
            quarters = [rear + (front - rear) * k / 4 for k in range(5)]
            ends = np.stack([np.full_like(t, low), *quarters, np.full_like(t, high)])
            return ends if one else np.concatenate([ends, 1 - ends])

        stages = (0.0, 1 / 6, 1 / 3, 0.5) if one else (0.0, 0.25, 0.5, 0.75, 1.0)
        return Motion(angle, rate, breaks, stages, antipodal=one)

    def _one_bump(self, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """Coefficients a, b and centre of the bump, and their rates, ``(n_time,)``."""
        travel = (2 * self.epsilon - self.width) * (-1 if self.backwards else 1)
        scale = np.where(t < 0.5, self.amplitude, -self.amplitude)
        t = np.where(t < 0.5, t, t - 0.5)
        (up, up_rate), (on, on_rate), (down, down_rate) = (
            _ramp(t, k / 6, (k + 1) / 6) for k in range(3)
        )
        none = np.zeros_like(t)
        centre, centre_rate = 0.5 + travel * (on - 0.5), travel * on_rate
        return scale * (up - down), none, centre, scale * (up_rate - down_rate), none, centre_rate

    def _two_bumps(self, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """Coefficients a, b and centre of the rear bump, and their rates, ``(n_time,)``."""
        travel = 2 * self.epsilon - self.width
        # a solver asks for the same phases panel by panel
        t, places = np.unique(t, return_inverse=True)
        legs = [_ramp(t % 1.0, k / 4, (k + 1) / 4) for k in range(4)]
        phi, phi_rate = (np.pi * (legs[0][i] - legs[2][i]) for i in range(2))
        centre = 0.25 + travel * (0.5 - legs[1][0] + legs[3][0])
        centre_rate = travel * (legs[3][1] - legs[1][1])
        A, dA = _constant_chord(self.amplitude, phi)
        a, b = A * np.sin(phi), A * np.cos(phi)
        a_rate = (dA * np.sin(phi) + A * np.cos(phi)) * phi_rate
        b_rate = (dA * np.cos(phi) - A * np.sin(phi)) * phi_rate
        return tuple(part[places] for part in (a, b, centre, a_rate, b_rate, centre_rate))


def _ramp(t: np.ndarray, start: float, stop: float) -> tuple[np.ndarray, np.ndarray]:
    """A ramp from 0 to 1 between start and stop, and its rate."""
    inside = (t >= start) & (t < stop)
    return np.clip((t - start) / (stop - start), 0.0, 1.0), inside / (stop - start)


def _constant_chord(amplitude: float, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A(phi) that keeps ``int cos(A (sin phi odd + cos phi even)) dx`` as at phi = 0, and
    dA/dphi."""
    x, weight = _CHORD_NODES[:, None], _CHORD_WEIGHTS[:, None]
    odd, even = odd_profile(x), even_profile(x)
    goal = np.sum(weight * np.cos(amplitude * even))
    shape, turned = np.sin(phi) * odd + np.cos(phi) * even, np.cos(phi) * odd - np.sin(phi) * even
    A = amplitude * np.sqrt(np.sum(weight * even**2) / np.sum(weight * shape**2, axis=0))
    for _ in range(20):
        sine = np.sin(A * shape)
        gradient = -np.sum(weight * sine * shape, axis=0)
        A = A - (np.sum(weight * np.cos(A * shape), axis=0) - goal) / gradient
    sine = np.sin(A * shape)
    return A, -A * np.sum(weight * sine * turned, axis=0) / np.sum(weight * sine * shape, axis=0)
