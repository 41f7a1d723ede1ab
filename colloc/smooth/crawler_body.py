r"""A straight body with one travelling bump whose place and profile are free.

On an arc of length ``w = 2 epsilon share``, centred at ``1/2 + w C``, the tangent angle is

    Theta = sum_m b_m phi_m(x),  phi_m = (1 - x^2)^3 T_m(x),  x = 2 (s - 1/2)/w - 2 C in [-1, 1],

and zero elsewhere; phi_1 is scaled to be the odd profile of `colloc.smooth.prescribed_body`. The
place is a point on a circle, ``C = reach cos(pi p / LAP)``: at the rear end for p = LAP and -LAP,
at the front end for p = 0. A crawler is a closed path of ``(p, b_0, b_1, ...)`` with ``q(t + 1/2) =
-q(t)``: a bump grows at the rear (p = LAP), travels (p falls to 0) and is flattened at the front;
while the body is straight p falls to -LAP, at no cost; there the mirrored bump begins.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from colloc.mechanics.bodies import BoundedAngles
from colloc.numerics.arrays import Array, namespace
from colloc.smooth.balance import PanelGrid
from colloc.smooth.prescribed_body import ODD_SCALE
from colloc.smooth.smooth_body import SmoothBody
from colloc.system.arguments import check_count, check_finite, is_number, is_whole, named_arguments
from colloc.system.errors import ProblemError

LAP = 1.3
"""Weight of the way through the region against radians of amplitude in the length of a path."""
_PLACES, _FINE = np.linspace(-1.0, 1.0, 97)[1:-1], np.linspace(-1.0, 1.0, 401)
"""Places along the bump where its tangent angle is bounded; modes of low degree exceed it little in
between."""


@named_arguments
@dataclass(frozen=True)
class CrawlerBody(SmoothBody):
    """A straight body with one travelling bump; its shape coordinates are the bump's place and the
    profile's amplitudes.

    Parameters
    ----------
    epsilon : float
        Half-width of the region that the bump stays in [body lengths].
    share : float
        The bump's width over that of the region, 2 epsilon.
    modes : int
        Of the profile.
    panels, order : int
        Gauss panels of the region, and half as many on each straight part; nodes on each.

    Examples
    --------
    >>> from colloc import Corners, CrawlerBody, Polygon, Problem
    >>> body = CrawlerBody(epsilon=0.1)
    >>> guess = Corners(body.concertina(amplitude=1.3), "antipodal")
    >>> problem = Problem("crawler", guess, body=body, gait=Polygon(8, "antipodal"))
    """

    epsilon: float = 0.1
    share: float = 0.5
    modes: int = 4
    panels: int = 8
    order: int = 6

    # a part at rest that slips is expensive: a large delta is another landscape; the replay adapts
    defaults = SmoothBody.defaults._replace(
        coordinate="coordinate", quantity="bump coordinate",
        delta=5e-5, delta_start=5e-5, instants_a_point=2,
    )  # fmt: skip

    def __post_init__(self) -> None:
        for name, high in (("epsilon", 0.5), ("share", 1)):
            if not 0 < getattr(self, name) < high:
                raise ProblemError(
                    f"{name} must lie between 0 and {high}, not {getattr(self, name)!r}."
                )
        check_count(12, least=2, modes=self.modes)

    @property
    def width(self) -> float:
        """Arc length of the bump."""
        return 2 * self.epsilon * self.share

    @property
    def n_joint(self) -> int:
        return 1 + self.modes

    @property
    def grid(self) -> PanelGrid:
        low, high, straight = 0.5 - self.epsilon, 0.5 + self.epsilon, max(2, self.panels // 4)
        parts = ((0.0, low, straight), (low, high, self.panels), (high, 1.0, straight))
        edges = [np.linspace(a, b, n + 1)[:-1] for a, b, n in parts]
        return PanelGrid(np.append(np.concatenate(edges), 1.0)[:, None], self.order)

    def describe(self) -> str:
        return (
            f"smooth, one bump of width {self.width:g} and {self.modes} modes in a region of "
            f"{2 * self.epsilon:g}"
        )

    def _centre(self, p: Array) -> tuple[Array, Array]:
        """C [bump widths], of which the largest magnitude keeps the bump in its region, and its
        derivative."""
        xp, k, reach = namespace(p), np.pi / LAP, 0.5 * (1 / self.share - 1)
        return reach * xp.cos(k * p), -reach * k * xp.sin(k * p)

    @cached_property
    def _powers(self) -> np.ndarray:
        """Coefficients of x^k, along the rows, in the polynomials times (1 - x^2)^3."""
        powers = np.zeros((self.modes, self.modes))
        for m, unit in enumerate(np.eye(self.modes)):
            powers[: m + 1, m] = np.polynomial.chebyshev.cheb2poly(unit[: m + 1])
        powers[:, 1] *= -ODD_SCALE
        return powers

    def _profile(self, x: Array, b: Array, *, slope: bool = False) -> Array:
        """``sum b_m phi_m(x)``, or its derivative, b ``(modes, n_time)``."""

        def polynomial(powers: np.ndarray) -> Array:
            coefficients, value = namespace(b).matmul(powers, b), 0.0 * x
            for k in reversed(range(len(powers))):
                value = value * x + coefficients[k : k + 1, :]
            return value

        y = namespace(x, b).where(x * x < 1, 1 - x * x, 0.0 * x)
        p = polynomial(self._powers)
        if not slope:
            return y**3 * p
        derivative = np.polynomial.polynomial.polyder(self._powers)
        return y**3 * polynomial(derivative) - 6 * x * y**2 * p

    def _x(self, s: np.ndarray, centre: Array) -> Array:
        places: Array = s if isinstance(centre, np.ndarray) else type(centre)(s)
        return 2 * (places - 0.5) / self.width - 2 * centre

    def tangent(self, s: np.ndarray, angles: Array) -> Array:
        return self._profile(self._x(s, self._centre(angles[0:1, :])[0]), angles[1:, :])

    def turning(self, s: np.ndarray, angles: Array, rates: Array) -> Array:
        centre, pace = self._centre(angles[0:1, :])
        x, b = self._x(s, centre), angles[1:, :]
        travel = 2 * pace * rates[0:1, :] * self._profile(x, b, slope=True)
        return self._profile(x, rates[1:, :]) - travel

    def breaks(self, angles: np.ndarray) -> np.ndarray:
        ends = 0.5 + self.width * (self._centre(angles[0])[0] + np.linspace(-0.5, 0.5, 5)[:, None])
        low, high = (np.full_like(angles[:1], 0.5 + sign * self.epsilon) for sign in (-1, 1))
        return np.concatenate([low, ends, high])

    def _modes_at(self, x: np.ndarray) -> np.ndarray:
        """Profiles at places ``(n,)`` across the bump, -1 to 1, ``(n, modes)``."""
        return np.asarray(self._profile(x[:, None], np.eye(self.modes)))

    @property
    def bounded_angles(self) -> BoundedAngles:
        rows = np.concatenate([np.zeros((_PLACES.size, 1)), self._modes_at(_PLACES)], axis=1)
        names = tuple(f"tangent at {x:.2f} of the bump" for x in _PLACES)
        return BoundedAngles(rows, names, fine=lambda angles: self._modes_at(_FINE) @ angles[1:])

    def concertina(
        self, amplitude: float, sides: int = 4, way: tuple[float, float] = (LAP, 0.0)
    ) -> np.ndarray:
        """Return the paper's crawler, whose bump of one profile grows, travels and is flattened.

        Parameters
        ----------
        amplitude : float
            Largest tangent angle [rad].
        sides : int
            Sides in half the period; corners beyond the four that it needs lie on its longest
            sides.
        way : (float, float)
            Place p where the bump grows, and where it is flattened.

        Returns
        -------
        (n_joint, sides + 1) array
            Corners of the antipodal polygon.
        """
        check_finite(amplitude=amplitude)
        if not is_whole(sides, 4) or np.shape(way) != (2,) or not all(map(is_number, way)):
            raise ProblemError(
                f"sides must be at least 4 and way two places, not {sides!r} and {way!r}."
            )
        corners, (rear, front) = np.zeros((self.n_joint, 5)), way
        corners[0], corners[2, 1:3] = (rear, rear, front, front, -rear), amplitude
        parts = np.ones(4)
        for _ in range(sides - 4):
            # the return costs nothing, however long it is
            parts[np.argmax(np.array([amplitude, rear - front, amplitude, 0.0]) / parts)] += 1
        at = np.concatenate([k + np.arange(n) / n for k, n in enumerate(parts)] + [[4.0]])
        return np.stack([np.interp(at, np.arange(5), row) for row in corners])

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        """A bump that travels as often as it grows, the even profile a quarter period later."""
        cos, sin = np.zeros((2, self.n_joint))
        cos[0], sin[1], cos[2] = LAP, np.sign(waves), 1.0
        return cos, sin

    def from_chain(self, lengths: np.ndarray) -> np.ndarray:
        """A chain's bends pressed into the bump at the front end of the region."""
        ends, n = np.append(0.0, np.cumsum(lengths)) / np.sum(lengths), len(lengths)
        link = np.clip(np.searchsorted(ends, 0.5 * (_PLACES + 1)) - 1, 0, n - 1)
        stairs = np.tril(np.ones((n, n - 1)), -1)[link]
        fit = np.linalg.lstsq(self._modes_at(_PLACES), stairs - stairs.mean(axis=0), rcond=None)
        return np.concatenate([np.zeros((1, n - 1)), fit[0]])
