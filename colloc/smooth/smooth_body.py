"""Smooth bodies by their tangent angle alone, as `colloc.mechanics.bodies.Body`."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from colloc.mechanics.bodies import (
    BalancedMotion,
    BalanceSolution,
    Body,
    BoundedAngles,
    Defaults,
    Sliding,
    Stretch,
)
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.smooth.balance import (
    TAIL,
    Curve,
    Motion,
    PanelGrid,
    SmoothSolution,
    curve,
    node_velocity,
    resultant,
    solve_smooth,
)
from colloc.system.arguments import (
    check_count,
    check_finite,
    check_positive,
    is_number,
    is_whole,
    named_arguments,
)
from colloc.system.errors import ProblemError

_OUTLINE = PanelGrid(np.linspace(0.0, 1.0, 97)[:, None], 3)
_FINE = np.linspace(0.0, 1.0, 401)[:, None]
_REPLAY_TOLERANCE = 1e-8
"""Largest difference of a panel's force, torque or power from its halves in a replay."""


class SmoothBody(Body):
    """A curve of unit length. Below pi/2 it cannot cross itself. A point rests at nearly all times,
    and moves along it: no kinks, but panels of a search, which are the same at all times, have to
    resolve delta over the rotation rate, and the influence of delta is of first order."""

    defaults = Defaults(
        coordinate="mode", quantity="mode",
        delta=1e-2, delta_start=0.3, limit=1.5, largest_limit=0.5 * np.pi,
        limit_name="tangent angle", excess=1e-3, delta_influence=2e-2, instants=400,
    )  # fmt: skip

    @property
    def grid(self) -> PanelGrid | None:
        """Fixed panels of a search; None where they adapt."""
        return None

    def tangent(self, s: np.ndarray, angles: Array) -> Array:
        """Theta ``(n_node, n_time)`` at arc lengths s ``(n_node, 1 or n_time)``; for CasADi, too,
        where there is a `grid`."""
        raise NotImplementedError

    def turning(self, s: np.ndarray, angles: Array, rates: Array) -> Array:
        """Rate of Theta; here of one that is linear in the shape coordinates."""
        return self.tangent(s, rates)

    def breaks(self, angles: np.ndarray) -> np.ndarray:
        """Arc lengths ``(n_break, n_time)`` at which Theta is not smooth."""
        return np.empty((0, angles.shape[1]))

    @property
    def bounded_angles(self) -> BoundedAngles:
        none = np.empty((0, self.n_joint))
        return BoundedAngles(none, (), fine=lambda angles: self.tangent(_FINE, angles))

    def on_panels(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, **settings: Any
    ) -> SmoothSolution:
        """The balance on panels; those adapt, unless settings of `solve_smooth` have a grid."""

        def at(t):  # the phase counts the shapes
            return t.astype(int)

        motion = Motion(
            lambda s, t: self.tangent(s, angles[:, at(t)]),
            lambda s, t: self.turning(s, angles[:, at(t)], rates[:, at(t)]),
            lambda t: self.breaks(angles[:, at(t)]),
        )
        t = np.arange(angles.shape[1])
        settings = {"quadrature_tolerance": _REPLAY_TOLERANCE} | settings
        return solve_smooth(motion, friction, t, delta, **settings)

    def sliding(
        self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array
    ) -> Sliding:
        if self.grid is None:
            slid = self.on_panels(friction, angles, rates, float(np.max(delta)), slide=z)
            return Sliding(slid.force, slid.centre, slid.power[None])
        nodes = self.grid.nodes
        theta, rate = self.tangent(nodes, angles), self.turning(nodes, angles, rates)
        now = curve(self.grid, theta, rate, TAIL, np.zeros((1, 1)))
        vs, vn = node_velocity(now, z)
        fs, fn = friction.density(vs, vn, delta)
        power = -namespace(angles, rates, z).sum_rows(now.weight * (fs * vs + fn * vn))
        return Sliding(resultant(now, fs, fn), resultant(now, vs, vn)[:2, :], power)

    def solve(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        *,
        start: np.ndarray | None = None,
        tolerance: float = 1e-11,
    ) -> BalanceSolution:
        how: Any = {"grid": self.grid, "start": None if self.grid is None else start}
        slid = self.on_panels(friction, angles, rates, delta, tolerance=tolerance, **how)
        converged, tail = slid.residual <= tolerance, np.zeros(slid.t.size, dtype=int)
        return BalanceSolution(slid.z, slid.residual, slid.iterations, converged, tail, slid.z)

    def motion(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> BalancedMotion:
        slid = self.on_panels(friction, angles, rates, delta, slide=solved.z, grid=self.grid)
        return BalancedMotion(solved.z, slid.centre, slid.power, slid.bending_power)

    def _curve(self, angles: np.ndarray) -> Curve:
        zero = np.zeros((1, 1))
        return curve(_OUTLINE, self.tangent(_OUTLINE.nodes, angles), zero, TAIL, zero)

    def outline(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        now, width = self._curve(angles), _OUTLINE.widths
        return _OUTLINE.to_edges(width * now.cos, TAIL), _OUTLINE.to_edges(width * now.sin, TAIL)

    def centre(self, angles: np.ndarray) -> np.ndarray:
        now = self._curve(angles)
        x, y = now.arm_s * now.sin + now.arm_n * now.cos, now.arm_n * now.sin - now.arm_s * now.cos
        return np.stack([(now.weight * axis).sum(axis=0) for axis in (x, y)])


def panels_of(body: Body) -> int:
    """Panels of its quadrature, which a search doubles; 0 where there is none to refine."""
    return getattr(body, "panels", 0)


def on_panels(body: Body, panels: int) -> Body:
    return dataclasses.replace(body, panels=panels) if panels_of(body) else body  # type: ignore[type-var]


def accurate_motion(
    body: Body,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    start: np.ndarray | None,
) -> tuple[BalancedMotion, np.ndarray]:
    """The motion for a certificate, of smooth bodies on panels that adapt, and its residual."""
    if isinstance(body, SmoothBody):
        slid = body.on_panels(friction, angles, rates, delta).require()
        motion = BalancedMotion(slid.z, slid.centre, slid.power, slid.bending_power)
        return motion, slid.residual
    solved = body.solve(friction, angles, rates, delta, start=start).require()
    return body.motion(friction, angles, rates, delta, solved), solved.residual


LEGENDRE, FOURIER = "legendre", "fourier"
_MODE_GRID = PanelGrid(np.linspace(0.0, 1.0, 41)[:, None], 8)
_PLACES_A_MODE = 4
"""Chebyshev places a mode where |Theta| is bounded, with all that is nearer to each than to others:
polynomials change fast towards the ends."""


@named_arguments
@dataclass(frozen=True)
class ModalBody(SmoothBody):
    """A smooth body of unit length with a few bending modes; its shape coordinates q are their
    amplitudes [rad].

    ``Theta(s, t) = sum_m q_m(t) phi_m(s)``, s from 0 to 1. Modes have zero mean, so that Theta is
    measured from the mean direction of the body.

    Parameters
    ----------
    modes : int
        Number of modes.
    basis : {"legendre", "fourier"}
        Legendre polynomials of degree 1, 2, ... on the body (the curvature is a polynomial), or
        sin(2 pi s), cos(2 pi s), sin(4 pi s), ...: an even number of them.
    panels, order : int
        Gauss panels on the body and nodes on each, for the optimisation; certificates use panels
        that adapt.

    Examples
    --------
    >>> from colloc import Friction, Harmonic, ModalBody, Problem
    >>> body = ModalBody(modes=6)
    >>> Problem("low-modes", body=body, friction=Friction(mu_t=100), gait=Harmonic(1,
    ...     "antipodal")).formulation
    'implicit velocity'
    """

    modes: int = 4
    basis: str = LEGENDRE
    panels: int = 8
    order: int = 6

    def __post_init__(self) -> None:
        if self.basis not in (LEGENDRE, FOURIER):
            raise ProblemError(f"basis must be {LEGENDRE!r} or {FOURIER!r}, not {self.basis!r}.")
        check_count(20, modes=self.modes)
        check_count(200, panels=self.panels)
        check_count(12, least=2, order=self.order)
        if self.basis == FOURIER and self.modes % 2:
            raise ProblemError(
                f"fourier modes come in pairs (sine and cosine); {self.modes} is odd."
            )

    @property
    def n_joint(self) -> int:
        return self.modes

    @property
    def grid(self) -> PanelGrid:
        return PanelGrid(np.linspace(0.0, 1.0, self.panels + 1)[:, None], self.order)

    def modes_at(self, s: np.ndarray) -> np.ndarray:
        """Modes at arc lengths s, ``(*s.shape, modes)``."""
        if self.basis == LEGENDRE:
            x = 2 * s - 1
            modes = [np.ones_like(x), x]
            for k in range(1, self.modes):
                modes.append(((2 * k + 1) * x * modes[k] - k * modes[k - 1]) / (k + 1))
            return np.stack(modes[1:], axis=-1)
        waves = [2 * np.pi * k * s for k in range(1, self.modes // 2 + 1)]
        return np.stack([wave(x) for x in waves for wave in (np.sin, np.cos)], axis=-1)

    @property
    def reversal(self) -> np.ndarray:
        """Theta(1 - s), in axes turned by half a turn: odd modes change their sign."""
        return np.diag(np.resize([-1.0, 1.0], self.modes))

    def describe(self) -> str:
        return f"smooth, {self.modes} {self.basis} modes of its tangent angle, {self.panels} panels"

    def tangent(self, s: np.ndarray, angles: Array) -> Array:
        if s.shape[1] == 1:
            return namespace(angles).matmul(self.modes_at(s[:, 0]), angles)
        return np.einsum("itm,mt->it", self.modes_at(s), angles)

    @property
    def bounded_angles(self) -> BoundedAngles:
        count = _PLACES_A_MODE * self.modes

        def chebyshev(k):
            return 0.5 - 0.5 * np.cos(np.clip(k * np.pi / count, 0.0, np.pi))

        places, ends = chebyshev(np.arange(count + 1.0)), chebyshev(np.arange(count + 2) - 0.5)
        return BoundedAngles(
            self.modes_at(places),
            tuple(f"tangent at {s:.3f}" for s in places),
            tuple(Stretch(*each, self.modes_at) for each in pairwise(ends.tolist())),
            super().bounded_angles.fine,
        )

    def _project(self, moments: np.ndarray) -> np.ndarray:
        """Amplitudes nearest in the mean square, from inner products with the modes."""
        values = self.modes_at(_MODE_GRID.nodes[:, 0])
        return np.linalg.solve(values.T @ (_MODE_GRID.weights * values), moments)

    def from_chain(self, lengths: np.ndarray) -> np.ndarray:
        """Nearest in the mean square to the chain's staircase of a tangent angle, whose mean
        direction, a rigid rotation, is left out."""
        n, ends = len(lengths), np.append(0.0, np.cumsum(lengths)) / np.sum(lengths)
        edges = np.interp(np.linspace(0, n, 4 * n + 1), np.arange(n + 1), ends)
        grid = PanelGrid(edges[:, None], 12)
        stairs = np.repeat(np.tril(np.ones((n, n - 1)), -1), 4 * grid.order, axis=0)
        return self._project((grid.weights * self.modes_at(grid.nodes[:, 0])).T @ stairs)

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        """``sin(2 pi t - 2 pi waves (s - 1/2))`` as nearly as the modes can."""
        s = _MODE_GRID.nodes[:, 0]
        project = self._project((_MODE_GRID.weights * self.modes_at(s)).T)
        phase = 2 * np.pi * waves * (s - 0.5)
        return -project @ np.sin(phase), project @ np.cos(phase)


def _check_below(most: float, words: str, **numbers: float) -> None:
    for name, value in numbers.items():
        if not 0 < value < most:
            raise ProblemError(f"{name} must lie between 0 and {words}, not {value!r}.")


_TURN = 2 * np.pi
ODD_SCALE = 7**3.5 / 6**3
_CHORD_NODES, _CHORD_WEIGHTS = np.polynomial.legendre.leggauss(48)


class PrescribedBody(SmoothBody):
    """A smooth body that runs through a `Motion`, always solved on panels that adapt. Its shape
    coordinates are the phase, as a point on a circle (`colloc.gaits.harmonic`)."""

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
        a, k, sign = self.amplitude, self.steepness, -1.0 if self.profile == "tanh" else 1.0

        def phase(s, t):
            return _TURN * (self.waves * s + sign * t)

        def tanh_rate(s, t):
            cosh = np.cosh(np.clip(k * np.sin(phase(s, t)), -300, 300))
            return -_TURN * (a * k * np.cos(phase(s, t)) / cosh**2)

        stages = (0.0, 0.25, 0.5) if self.profile == "standing" else (0.0, 0.5)
        angle, rate = {
            "sine": (
                lambda s, t: a * np.sin(phase(s, t)),
                lambda s, t: _TURN * (a * np.cos(phase(s, t))),
            ),
            "tanh": (lambda s, t: a * np.tanh(k * np.sin(phase(s, t))), tanh_rate),
            "standing": (
                lambda s, t: a * np.sin(_TURN * s) * np.sin(_TURN * t),
                lambda s, t: a * np.sin(_TURN * s) * (_TURN * np.cos(_TURN * t)),
            ),
        }[self.profile]
        return Motion(angle, rate, stages=stages, antipodal=True)

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
    """A concertina crawler (paper, section VI): straight but for one or two travelling bumps.

    On a bump of arc length ``w`` centred at ``c``, with ``x = 2 (s - c)/w`` in [-1, 1], the tangent
    angle is ``Theta = a odd(x) + b even(x)``, zero elsewhere, ``odd = -k x (1 - x^2)^3`` with
    ``k = 7^(7/2)/6^3`` (so that max odd = 1) and ``even = (1 - x^2)^3``.

    One bump (figure 13A to D), in the region ``|s - 1/2| <= epsilon``: a grows from 0 to
    `amplitude` at the rear end, the front half at rest; the bump travels to the front end; a falls
    to 0, the rear at rest; then the mirror image, Theta(s, t + 1/2) = -Theta(s, t).

    Two bumps (figure 13E), in regions around 1/4 and 3/4, Theta(1 - s) = -Theta(s): the body lies
    across its path. ``(a, b) = A(phi) (sin phi, cos phi)`` with A(0) = `amplitude` and A(phi) such
    that the chord along the body stays constant. phi goes from 0 to pi, bumps at the inner ends,
    the outer parts at rest; the bumps travel outwards; phi returns, the middle at rest; the bumps
    travel back.

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
        _check_below(widest, f"{widest:g} for {self.bumps} bump(s)", epsilon=self.epsilon)
        _check_below(1, "1", share=self.share)
        _check_below(np.pi / 2, "pi/2", amplitude=self.amplitude)

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

        def theta(s, t, rate=False):
            (a, b, centre), (a_rate, b_rate, centre_rate) = rear_bump(t)
            x = 2 * ((s if one else np.minimum(s, 1 - s)) - centre) / w
            if rate:
                moving = bump(x, a, b, slope=True) * 2 * centre_rate / w
                value = bump(x, a_rate, b_rate) - moving
            else:
                value = bump(x, a, b)
            return value if one else np.where(s > 0.5, -value, value)

        def breaks(t):
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


LAP = 1.3
"""Weight of the way through the region against radians of amplitude in the length of a path."""
_PLACES, _ACROSS = np.linspace(-1.0, 1.0, 97)[1:-1], np.linspace(-1.0, 1.0, 401)
"""Places along the bump where its tangent angle is bounded; modes of low degree exceed it little in
between."""


@named_arguments
@dataclass(frozen=True)
class CrawlerBody(SmoothBody):
    """A straight body with one travelling bump; its shape coordinates are the bump's place p and
    the profile's amplitudes b.

    On an arc of length ``w = 2 epsilon share``, centred at ``1/2 + w C``, the tangent angle is
    ``Theta = sum_m b_m phi_m(x)``, ``phi_m = (1 - x^2)^3 T_m(x)``, ``x = 2 (s - 1/2)/w - 2 C`` in
    [-1, 1], and zero elsewhere; phi_1 is scaled to be the odd profile of a `Concertina`. The place
    is a point on a circle, ``C = reach cos(pi p / LAP)``: at the rear end for p = LAP and -LAP, at
    the front end for p = 0. A crawler is a closed path with ``q(t + 1/2) = -q(t)``: a bump grows at
    the rear, travels (p falls to 0) and is flattened at the front; while the body is straight p
    falls to -LAP, at no cost; there the mirrored bump begins.

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
        _check_below(0.5, "0.5", epsilon=self.epsilon)
        _check_below(1, "1", share=self.share)
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

        def polynomial(powers):
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
        return self._profile(x[:, None], np.eye(self.modes))

    @property
    def bounded_angles(self) -> BoundedAngles:
        rows = np.concatenate([np.zeros((_PLACES.size, 1)), self._modes_at(_PLACES)], axis=1)
        names = tuple(f"tangent at {x:.2f} of the bump" for x in _PLACES)
        return BoundedAngles(rows, names, fine=lambda angles: self._modes_at(_ACROSS) @ angles[1:])

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
