"""What a solve for a relaxed gait leaves behind: the relaxed gait with its certificate, and finite gaits that come near it.

The relaxed value is the limit of ever smaller loops, which no gait attains. So the answer is the best of the finite gaits that
repeat its directions so and so often (`colloc.gaits.mixture.Mixture.realised`), each certified like any other gait.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from colloc.gaits.guesses import largest_factor, under_one_limit
from colloc.gaits.mixture import Mixture, corners_of
from colloc.gaits.paths import Corners
from colloc.gaits.problem import Problem
from colloc.results.certificate import VIOLATION, gait_certificate
from colloc.results.checks import Certificate, Check
from colloc.results.solution import CERTIFICATE_FAILED, SOLVED, SampledMotion, versions
from colloc.system.errors import NotConvergedError
from colloc.system.late_binding import bound

STATIONARY = 1e-3
"""Largest slope of the Lagrangian of the reduced program at a relaxed optimum: the efficiency is off by about its square."""
_NEAR, _MOST_CORNERS = 5e-3, 10_000
"""Relative loss of a finite gait that is near enough, and corners over a period, at most, of one."""
_GRID = 2000
"""Instants of a motion to draw, besides the corners, where the rates jump."""


@dataclass(frozen=True, eq=False)
class Realised:
    """A finite gait that repeats the directions of a relaxed one.

    Attributes
    ----------
    repeats, sense : int
        See `colloc.gaits.mixture.Mixture.realised`.
    gait : Corners
    certificate : Certificate
    """

    repeats: int
    sense: int
    gait: Corners
    certificate: Certificate

    @property
    def corners(self) -> int:
        """Over the whole period."""
        return corners_of(self.gait)


@dataclass(frozen=True, eq=False)
class Optimality:
    """What the search says of a relaxed gait.

    Attributes
    ----------
    efficiency : float
        As collocated.
    kkt_error, violation : float
        Of the program in the gait's parameters.
    price : float
        The smallest slope of -d/W in the time spent in any direction, on any piece that has not used all directions that the
        class allows: none should be negative.
    iterations : int
    """

    efficiency: float
    kkt_error: float
    violation: float
    price: float
    iterations: int

    def checks(self) -> tuple[Check, ...]:
        """Lines of a certificate."""
        return (
            Check("KKT error", self.kkt_error, STATIONARY, "gradient of the Lagrangian of the relaxed program"),
            Check("constraint violation", self.violation, VIOLATION, "largest violated equation or bound"),
            Check(
                "other directions", min(self.price, 0.0), STATIONARY, "most that time in any other direction gains, per radian"
            ),
        )


@dataclass(eq=False)
class RelaxedSolution:
    """A relaxed gait and what comes near it.

    Attributes
    ----------
    problem : Problem
    relaxed : Mixture
    optimality : Optimality
    certificate : Certificate
        Of the relaxed gait: its replay is an integral over the mixture.
    realised : tuple of Realised
        By number of repeats.
    seconds : float
    source : str
    starts : int
    others : tuple of (efficiency, extent)
        Of the other relaxed gaits that were met; extent is the largest range of a mean joint angle [rad].
    versions : dict
    """

    problem: Problem
    relaxed: Mixture
    optimality: Optimality
    certificate: Certificate
    realised: tuple[Realised, ...]
    seconds: float = 0.0
    source: str = ""
    starts: int = 1
    others: tuple[tuple[float, float], ...] = ()
    versions: dict[str, str] = field(default_factory=lambda: versions())

    def __repr__(self) -> str:
        return (
            f"<RelaxedSolution {self.problem.name}, {self.status}, d/W = {self.measured.efficiency:.6g} with "
            f"{self.best.corners} corners, relaxed {self.certificate.efficiency:.6g}>"
        )

    @property
    def best(self) -> Realised:
        """The finite gait of largest efficiency whose certificate holds, or, if none does, of all."""
        held = [r for r in self.realised if r.certificate.passed] or self.realised
        return max(held, key=lambda r: r.certificate.efficiency)

    @property
    def message(self) -> str:
        """What is not as it should be with the relaxed gait; empty if it is a local optimum and its replay confirms it."""
        failed = ", ".join(check.name for check in self.certificate.failures)
        return f"the relaxed gait is not certified ({failed}): the best may be better." if failed else ""

    @property
    def gait(self) -> Corners:
        return self.best.gait

    @property
    def measured(self) -> Certificate:
        """Of the best finite gait."""
        return self.best.certificate

    @property
    def status(self) -> str:
        """One of "solved", "certificate failed": of the finite gait, which is the answer whatever its relaxed one is worth."""
        return SOLVED if self.measured.passed else CERTIFICATE_FAILED

    @property
    def success(self) -> bool:
        """Whether the best finite gait is certified."""
        return self.status == SOLVED

    @property
    def efficiency(self) -> float:
        """Of the best finite gait; what it tends to is ``certificate.efficiency``."""
        return self.measured.efficiency

    @property
    def delta_per_period(self) -> float:
        """Regularisation speed of the best finite gait in body lengths per period."""
        return self.problem.delta * self.gait.delta_unit

    @cached_property
    def _poses(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Edges of a grid of phases ``(n + 1,)``; tail velocities in its cells; orientation and centre at its edges."""
        problem, gait, body = self.problem, self.gait, self.problem.body
        edges = np.union1d(np.linspace(0.0, 1.0, _GRID + 1), gait.corner_phases)
        edges = edges[np.append(True, np.diff(edges) > 1e-12)]
        middle, h = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
        at = problem.friction, gait.angles(middle), gait.rates(middle), self.delta_per_period
        motion, _ = body.replayed(*at, None)
        theta = np.concatenate([[0.0], np.cumsum(h * motion.z[2])])
        steps = h * np.exp(0.5j * (theta[1:] + theta[:-1])) * (motion.centre[0] + 1j * motion.centre[1])
        centre = np.concatenate([[0.0], np.cumsum(steps)])
        ahead = np.conj(centre[-1]) / max(abs(centre[-1]), 1e-300)
        return edges, motion.z, theta + np.angle(ahead), centre * ahead

    def sample(self, t: np.ndarray | float) -> SampledMotion:
        """The motion of the best finite gait at phases t, good enough to draw; whole periods add up."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        period, phase = np.divmod(t, 1.0)
        edges, velocity, theta, centre = self._poses
        z = velocity[:, np.clip(np.searchsorted(edges, phase, side="right") - 1, 0, edges.size - 2)]
        place = np.interp(phase, edges, centre.real) + 1j * np.interp(phase, edges, centre.imag) + period * centre[-1]
        theta_at = np.interp(phase, edges, theta) + period * (theta[-1] - theta[0])
        angles, body = self.gait.angles(phase), self.problem.body
        cx, cy = body.centre(angles)
        tail = place - np.exp(1j * theta_at) * (cx + 1j * cy)
        lab = np.stack([place.real, place.imag])
        return SampledMotion(t, angles, self.gait.rates(phase), z, theta_at, lab, np.stack([tail.real, tail.imag]))

    def plot(self) -> Any:
        """The figure of `colloc solve`, as a matplotlib Figure."""
        return bound("plot relaxed")(self)

    def animate(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write the motion of the best finite gait as GIF or MP4; options as for `colloc.pictures.movie.write_movie`."""
        return bound("animate")(self, Path(path), **options)

    def power(self, motion: SampledMotion) -> np.ndarray:
        """Power against friction at the instants of a motion, ``(n_time,)``."""
        problem = self.problem
        delta = np.full((1, motion.t.size), self.delta_per_period)
        return problem.body.sliding(problem.friction, motion.angles, motion.rates, motion.z, delta).power[0]

    def recertified(self, instants: int, tolerance: float = 1e-6) -> RelaxedSolution:
        """The same with all certificates made anew, on so many instants to begin with."""
        relaxed = relaxed_certificate(self.problem, self.relaxed, self.optimality, instants, tolerance)
        realised = tuple(
            replace(r, certificate=finite_certificate(self.problem, r.gait, instants, tolerance)) for r in self.realised
        )
        return replace(self, certificate=relaxed, realised=realised)


def relaxed_certificate(
    problem: Problem, gait: Mixture, optimality: Optimality, instants: int = 1600, tolerance: float = 1e-6
) -> Certificate:
    """The certificate of a relaxed gait."""

    def path(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return gait.angles(t), *gait.mixed_rates(t)

    return gait_certificate(
        problem, path, problem.delta * gait.delta_unit, gait.breaks, instants, tolerance,
        claimed=optimality.efficiency, before=optimality.checks(),
    )  # fmt: skip


def finite_certificate(problem: Problem, gait: Corners, instants: int = 1600, tolerance: float = 1e-6) -> Certificate:
    """The certificate of a polygon that need not be optimal."""

    def path(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return gait.angles(t), gait.rates(t)

    return gait_certificate(problem, path, problem.delta * gait.delta_unit, gait.corner_phases, instants, tolerance)


def kept_inside(problem: Problem, gait: Corners) -> Corners:
    """A polygon about admissible shapes, shrunk towards the straight body by as much as its loops reach beyond them."""
    body, angles = problem.body, gait.angles(np.union1d(np.linspace(0.0, 1.0, _GRID + 1), gait.corner_phases))
    stretched, limit = under_one_limit(angles, problem.joint_limit)
    beyond = max(float(body.largest_angles(stretched).max()) - limit, float(body.crossing_depth(angles).max()))
    if beyond <= body.usual.excess:
        return gait
    return Corners(largest_factor(body, problem.joint_limit, angles) * gait.corners, gait.symmetry)


def realised_gaits(
    problem: Problem,
    gait: Mixture,
    repeats: tuple[int, ...],
    tends_to: float = 0.0,
    report: Callable[[str], None] = lambda _: None,
) -> tuple[Realised, ...]:
    """Finite gaits for several numbers of repeats, of either sense of their loops the better one.

    Where none of them comes near the relaxed efficiency `tends_to`, since loops are large, the last number is doubled until
    one does, or has too many corners to be of use.

    Raises
    ------
    NotConvergedError
        If there are to be none.
    """
    found: list[Realised] = []
    wanted = list(repeats)
    while wanted:
        m = wanted.pop(0)
        report(f"certifying {m} repeats")
        both = []
        for sense in (1, -1):
            corners = kept_inside(problem, gait.realised(m, sense))
            both.append(Realised(m, sense, corners, finite_certificate(problem, corners)))
        found.append(max(both, key=lambda r: (r.certificate.passed, r.certificate.efficiency)))
        far = max(r.certificate.efficiency for r in found) < (1 - _NEAR) * tends_to
        if not wanted and far and 2 * found[-1].corners < _MOST_CORNERS:
            wanted.append(2 * m)
    if not found:
        raise NotConvergedError("a relaxed gait was to be realised by no repeats at all.")
    return tuple(found)
