"""A straight body with one travelling bump whose place and profile are free: concertina crawlers to
be optimised.

On an arc of length ``w = 2 epsilon share``, centred at ``1/2 + w C``, the tangent angle is

    Theta = sum_m b_m phi_m(x),    phi_m = (1 - x^2)^3 T_m(x),    x = 2 (s - 1/2)/w - 2 C in [-1, 1],

and zero elsewhere; phi_1 is scaled to be `colloc.smooth.concertina.odd_profile`. The bump's place
is a point on a circle, ``C = reach cos(pi p / LAP)``: it stays in its region whatever p is, at the
rear end for p = LAP and -LAP, at the front end for p = 0. So a crawler is a closed path of ``(p,
b_0, b_1, ...)`` whose second half mirrors the first, ``q(t + 1/2) = -q(t)``: a bump grows at the
rear (p = LAP), travels (p falls to 0) and is flattened at the front; while the body is straight, p
falls to -LAP, at no cost; there the mirrored bump begins.
"""  # noqa: E501

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from colloc.numerics.arrays import Array, namespace
from colloc.smooth.concertina import ODD_SCALE
from colloc.smooth.curve import PanelGrid
from colloc.smooth.panel_body import PanelBody
from colloc.system.arguments import check_finite, is_number, is_whole, named_arguments
from colloc.system.errors import ProblemError

LAP = 1.3
"""What the way through the region counts, against radians of amplitude, in the length of a path."""
_PLACES = 95
"""Along the bump, at which its tangent angle is bounded: modes of low degree exceed the bound
little in between."""


@named_arguments
@dataclass(frozen=True)
class CrawlerBody(PanelBody):
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

    coordinate, quantity = "coordinate", "bump coordinate"
    usual = PanelBody.usual._replace(delta=5e-5, delta_start=5e-5, instants_a_point=2)
    """A part at rest that slips costs a cliff, which a large delta turns into another landscape.
    The replay adapts anyway."""

    def __post_init__(self) -> None:
        for name, low, high in (("epsilon", 0, 0.5), ("share", 0, 1)):
            if not is_number(getattr(self, name)) or not low < getattr(self, name) < high:
                raise ProblemError(
                    f"{name} must lie between {low} and {high}, not {getattr(self, name)!r}."
                )
        if not is_whole(self.modes, 2, 12):
            raise ProblemError(f"modes must lie between 2 and 12, not {self.modes!r}.")

    @property
    def width(self) -> float:
        """Arc length of the bump."""
        return 2 * self.epsilon * self.share

    @property
    def reach(self) -> float:
        """Largest |C| [bump widths]: the bump stays in its region."""
        return 0.5 * (1 / self.share - 1)

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

    # the tangent angle
    def _place(self, p: Array) -> tuple[Array, Array, Array]:
        """The bump's centre C, and its first two derivatives."""
        xp, k = namespace(p), np.pi / LAP
        c, s = xp.cos(k * p), xp.sin(k * p)
        return self.reach * c, -self.reach * k * s, -self.reach * k * k * c

    @cached_property
    def _powers(self) -> np.ndarray:
        """Coefficients of x^k in the polynomials that (1 - x^2)^3 is multiplied by, ``(modes,
        modes)``, k along the rows."""
        polynomials = np.zeros((self.modes, self.modes))
        for m in range(self.modes):
            polynomials[: m + 1, m] = np.polynomial.chebyshev.cheb2poly(np.eye(m + 1)[m])
        polynomials[:, 1] *= -ODD_SCALE
        return polynomials

    def _profile(self, x: Array, b: Array, order: int = 0) -> Array:
        """``sum b_m phi_m(x)``, or its first or second derivative, b ``(modes, n_time)``; all three
        vanish at the ends."""
        xp = namespace(x, b)
        y = xp.where(x * x < 1, 1 - x * x, 0.0 * x)
        p, *slopes = (
            _polynomial(np.polynomial.polynomial.polyder(self._powers, k), b, x)
            for k in range(order + 1)
        )
        if order == 0:
            return y**3 * p
        if order == 1:
            return y**3 * slopes[0] - 6 * x * y**2 * p
        return y**3 * slopes[1] - 12 * x * y**2 * slopes[0] + (24 * x * x * y - 6 * y**2) * p

    def _x(self, s: np.ndarray, centre: Array) -> Array:
        places: Array = s if isinstance(centre, np.ndarray) else type(centre)(s)
        return 2 * (places - 0.5) / self.width - 2 * centre

    def tangent(self, s: np.ndarray, angles: Array) -> Array:
        return self._profile(self._x(s, self._place(angles[0:1, :])[0]), angles[1:, :])

    def turning(self, s: np.ndarray, angles: Array, rates: Array) -> Array:
        centre, pace, _ = self._place(angles[0:1, :])
        x = self._x(s, centre)
        return self._profile(x, rates[1:, :]) - 2 * pace * rates[0:1, :] * self._profile(
            x, angles[1:, :], 1
        )

    def angle_slopes(
        self, s: np.ndarray, q: np.ndarray, rates: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        centre, pace, bent = self._place(q[0:1])
        x, dp = self._x(s, centre), rates[0:1]
        slope, curvature = (self._profile(x, q[1:], order) for order in (1, 2))
        turned = self._profile(x, rates[1:], 1)
        one = np.eye(self.modes)[:, :, None]
        phi, dphi = (
            np.stack([self._profile(x, unit, order) for unit in one], axis=1) for order in (0, 1)
        )
        angle = np.concatenate([-2 * (pace * slope)[:, None], phi], axis=1)
        place = -2 * pace * turned - 2 * bent * dp * slope + 4 * pace**2 * dp * curvature
        rate = np.concatenate([place[:, None], -2 * (pace * dp) * dphi], axis=1)
        return np.concatenate([angle, np.zeros_like(angle)], axis=1), np.concatenate(
            [rate, angle], axis=1
        )

    def breaks(self, angles: np.ndarray) -> np.ndarray:
        ends = 0.5 + self.width * (self._place(angles[0])[0] + np.linspace(-0.5, 0.5, 5)[:, None])
        low, high = (np.full_like(angles[:1], 0.5 + sign * self.epsilon) for sign in (-1, 1))
        return np.concatenate([low, ends, high])

    # shapes
    def modes_at(self, x: np.ndarray) -> np.ndarray:
        """Profiles at places ``(n,)`` across the bump, -1 to 1, ``(n, modes)``."""
        return np.concatenate(
            [self._profile(x[:, None], unit[:, None]) for unit in np.eye(self.modes)], axis=1
        )

    @property
    def _places(self) -> np.ndarray:
        return np.linspace(-1.0, 1.0, _PLACES + 2)[1:-1]

    @property
    def limited(self) -> np.ndarray:
        return np.concatenate([np.zeros((_PLACES, 1)), self.modes_at(self._places)], axis=1)

    @property
    def limit_names(self) -> tuple[str, ...]:
        return tuple(f"tangent at {x:.2f} of the bump" for x in self._places)

    def largest_angles(self, angles: np.ndarray) -> np.ndarray:
        return np.abs(self.modes_at(np.linspace(-1.0, 1.0, 401)) @ angles[1:]).max(axis=0)

    # gaits
    def concertina(
        self, amplitude: float, sides: int = 4, way: tuple[float, float] = (LAP, 0.0)
    ) -> np.ndarray:
        """The paper's crawler (`colloc.smooth.concertina`): a bump of one profile that grows,
        travels and is flattened.

        Corners ``(n_joint, sides + 1)`` of the antipodal polygon.

        Parameters
        ----------
        amplitude : float
            Largest tangent angle [rad].
        sides : int
            Of half the period: corners beyond the four that it needs lie on its longest sides.
        way : (float, float)
            Where the bump grows and where it is flattened: its place p there.
        """
        check_finite(amplitude=amplitude)
        if not is_whole(sides, 4) or np.shape(way) != (2,) or not all(map(is_number, way)):
            raise ProblemError(
                f"sides must be at least 4 and way two places, not {sides!r} and {way!r}."
            )
        corners = np.zeros((self.n_joint, 5))
        corners[0], corners[2] = (
            (way[0], way[0], way[1], way[1], -way[0]),
            (0.0, amplitude, amplitude, 0.0, 0.0),
        )
        parts = np.ones(4)
        for _ in range(sides - 4):
            # the return costs nothing, however long it is
            parts[np.argmax(np.array([amplitude, way[0] - way[1], amplitude, 0.0]) / parts)] += 1
        at = np.concatenate([k + np.arange(n) / n for k, n in enumerate(parts)] + [[4.0]])
        return np.stack([np.interp(at, np.arange(5), row) for row in corners])

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        """A bump that travels as often to and fro as it grows, the even profile a quarter of a
        period after the odd one."""
        cos, sin = np.zeros((2, self.n_joint))
        cos[0], sin[1], cos[2] = LAP, np.sign(waves), 1.0
        return cos, sin

    def laid(self, lengths: np.ndarray) -> np.ndarray:
        """A chain's bends pressed into the bump, as nearly as its profiles can, at the front end of
        the region."""
        ends = np.append(0.0, np.cumsum(lengths)) / np.sum(lengths)
        x = self._places
        link = np.clip(np.searchsorted(ends, 0.5 * (x + 1)) - 1, 0, len(lengths) - 1)
        stairs = np.tril(np.ones((len(lengths), len(lengths) - 1)), -1)[link]
        profile = np.linalg.lstsq(self.modes_at(x), stairs - stairs.mean(axis=0), rcond=None)[0]
        return np.concatenate([np.zeros((1, len(lengths) - 1)), profile])


def _polynomial(powers: np.ndarray, b: Array, x: Array) -> Array:
    """``sum_k (powers b)_k x^k`` by Horner's rule, b ``(modes, n_time)``."""
    coefficients = namespace(b).matmul(powers, b)
    value = 0.0 * x
    for k in reversed(range(len(powers))):
        value = value * x + coefficients[k : k + 1, :]
    return value
