"""The chain of straight links as a `colloc.mechanics.bodies.Body`: which module answers which question."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Self

import numpy as np

from colloc.mechanics.balance import instant, net_force, total_power
from colloc.mechanics.balance_results import BalancedMotion, BalanceSolution, Branches, Lifted, Sliding
from colloc.mechanics.bodies import ARROWS, FULL, IMPLICIT, Pairs, Stretch, Usual
from colloc.mechanics.chain_motion import chain_motion, chain_slopes
from colloc.mechanics.contact import (
    CLEARANCE_SMOOTHING,
    SMOOTHING,
    Contact,
    crossing_sums,
    ends_and_links,
    excess,
    far_pairs,
    intrusions,
    overlap,
    passing_depth,
)
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.law import Law
from colloc.mechanics.link_friction import LinkForce
from colloc.mechanics.links import Links
from colloc.mechanics.solution_branches import all_balanced_velocities
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import named_arguments


@named_arguments
class Chain(Links):
    """A chain of straight links joined end to end; its shape coordinates are the joint angles.

    Parameters
    ----------
    lengths : tuple of float
        Link lengths from tail to head; they add up to the body length, 1.
    width : float
        Of every link [body lengths]: links do not overlap but neighbours about their joint (`colloc.mechanics.contact`). By
        default links are lines, which must not cross but may lie on each other. Friction is that of the lines either way.
    weights : tuple of float
        Of the links from tail to head, in parts of the body's weight, 1; by default in proportion to their lengths. What a
        law says of a length is multiplied by the weight per length there, so drag of a fluid goes with the default only.

    Examples
    --------
    >>> from colloc import Chain
    >>> Chain((0.25, 0.5, 0.25), width=0.02).n_joint
    2
    """

    formulations = (FULL, IMPLICIT)
    coordinate, quantity = "joint", "joint angle"
    schedule: tuple[float, ...] = ()
    stretches: tuple[Stretch, ...] = ()
    panels = 0
    looks_for_all_velocities = True
    usual = Usual(
        delta=1e-4, delta_start=0.1, limit=float(np.pi), largest_limit=float(np.pi), limit_name="joint limits", excess=1e-6,
        delta_influence=1e-2,
    )  # fmt: skip
    """The influence of delta that is allowed is the paper's own claim: less than 1 % below delta = 1e-4."""

    @property
    def n_force(self) -> int:
        """Tangential and normal force and couple of every link."""
        return 3 * self.n_link

    @property
    def symmetries(self) -> tuple[str, ...]:
        return ("none", "bilateral", "antipodal") if self.symmetric else ("none", "antipodal")

    def swapped(self, shape: np.ndarray) -> np.ndarray:
        return -shape[::-1]

    def on_panels(self, panels: int) -> Self:
        return self

    def describe(self) -> str:
        wide = f", {self.width:.4g} wide" if self.width else ""
        heavy = f", of weights {', '.join(f'{weight:.4g}' for weight in self.weights)}" if self.weights else ""
        lengths = ", ".join(f"{length:.4g}" for length in self.lengths)
        return f"links of lengths {lengths} from the tail{wide} [body lengths]{heavy}"

    def sliding(self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array) -> Sliding:
        now = instant(self, friction, angles, rates, z, delta)
        centre = namespace(angles, z).stack(list(self.centre_velocity(now.posture, now.velocity)))
        return Sliding(net_force(now.posture, now.force), centre, total_power(now.velocity, now.force))

    def with_forces(self, friction: Law, angles: Array, rates: Array, z: Array, forces: Array, delta: Array) -> Lifted:
        """Laws of the links, scaled like velocities (see `colloc.mechanics.law.Law.scaled_laws`)."""
        n, posture, length, pressure = self.n_link, self.posture(angles), self.length_column(), self.pressure_column()
        velocity = self.velocity(posture, rates, z)
        force = LinkForce(forces[:n, :], forces[n : 2 * n, :], forces[2 * n :, :])
        laws = friction.scaled_laws(*velocity, length, delta, LinkForce(*(part / pressure for part in force)))
        stack = namespace(angles, z, forces).stack
        centre = stack(list(self.centre_velocity(posture, velocity)))
        return Lifted(stack(laws), net_force(posture, force), centre, total_power(velocity, force))

    def forces(self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array) -> Array:
        return namespace(angles, rates, z).stack(list(instant(self, friction, angles, rates, z, delta).force))

    def largest_forces(self, friction: Law) -> np.ndarray:
        return friction.largest_link_forces(self.length_column()) * np.tile(self.pressure_column(), (3, 1))

    def solve(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, *, start: np.ndarray | None = None,
        tolerance: float = 1e-11,
    ) -> BalanceSolution:  # fmt: skip
        return solve_balance(self, friction, angles, rates, delta, start=start, tolerance=tolerance)

    def motion(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, solved: BalanceSolution
    ) -> BalancedMotion:
        return chain_motion(self, friction, angles, rates, delta, solved)

    def slopes(self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, solved: BalanceSolution) -> np.ndarray:
        return chain_slopes(self, friction, angles, rates, delta, solved)[1]

    def replayed(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, start: np.ndarray | None
    ) -> tuple[BalancedMotion, np.ndarray]:
        """By the solver itself: forces on links are integrals in closed form."""
        solved = solve_balance(self, friction, angles, rates, delta, start=start).require()
        return chain_motion(self, friction, angles, rates, delta, solved), solved.residual

    def all_velocities(self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float) -> Branches:
        return all_balanced_velocities(self, friction, angles, rates, delta)

    def slowness(self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, z: np.ndarray) -> np.ndarray:
        """Speed of the slowest point of each link, or tangential speed where directions differ; none where nothing is dry."""
        velocity = self.velocity(self.posture(angles), rates, z)
        if not friction.regularised:
            return velocity.vs[:0]
        if not friction.reversible:
            return np.abs(velocity.vs)
        beyond = np.maximum(np.abs(velocity.vn) - 0.5 * self.length_column() * np.abs(velocity.w), 0.0)
        return np.hypot(velocity.vs, beyond)

    @property
    def limited(self) -> np.ndarray:
        return np.eye(self.n_joint)

    @property
    def limit_names(self) -> tuple[str, ...]:
        return tuple(f"joint {j + 1}" for j in range(self.n_joint))

    def largest_angles(self, angles: np.ndarray) -> np.ndarray:
        return np.abs(angles).max(axis=0)

    def contacts(self, far: Sequence[tuple[int, int]] = ()) -> list[Contact]:
        """All links two apart, bending to either side, the pairs `far` of links farther apart, and what a width asks of all."""

        def crossing(side: int, i: int, angles: Array) -> tuple[Array, Array]:
            first, second = crossing_sums(self, angles, i)
            return side * first - np.pi, side * second - np.pi

        def lacking(end: int, link: int, angles: Array) -> tuple[Array, Array]:
            both = excess(self, angles, end, link)
            return both, both  # one condition alone is the smaller of two that are the same

        found = []
        for i in range(self.n_link - 2):
            for name, side in (("left", 1), ("right", -1)):
                found.append(Contact(f"links {i + 1} and {i + 3} ({name})", partial(crossing, side, i), SMOOTHING))
        for i, j in far:
            pair = partial(intrusions, self, first=i, second=j)
            found.append(Contact(f"links {i + 1} and {j + 1}", pair, CLEARANCE_SMOOTHING))
        for end, link in ends_and_links(self) if self.width else ():
            found.append(Contact(f"end {end} and link {link + 1}", partial(lacking, end, link), CLEARANCE_SMOOTHING))
        return found

    @property
    def far_pairs(self) -> Pairs:
        return tuple(far_pairs(self))

    def crossing_depth(self, angles: np.ndarray, pairs: Sequence[tuple[int, int]] | None = None) -> np.ndarray:
        return overlap(self, angles, pairs)

    def passing_depth(self, angles: np.ndarray, pairs: Sequence[tuple[int, int]] | None = None) -> float:
        return passing_depth(self, angles, pairs)

    def outline(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.joints(angles)

    @property
    def hinges(self) -> slice:
        return slice(1, -1)

    @property
    def drawn_width(self) -> float:
        return self.width

    def centre(self, angles: np.ndarray) -> np.ndarray:
        return np.concatenate(self.centre_of_mass(self.posture(angles)))

    def rubbing(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, z: np.ndarray, count: int = ARROWS
    ) -> tuple[np.ndarray, np.ndarray]:
        posture = self.posture(angles)
        velocity, many = self.velocity(posture, rates, z), max(2, count // self.n_link)
        places, forces = [], []
        for share in (np.arange(many) + 0.5) / many - 0.5:
            along = share * self.length_column()
            own = friction.density(velocity.vs, velocity.vn + along * velocity.w, delta)
            fs, fn = (self.pressure_column() * part for part in own)
            places.append([posture.x + along * posture.cos, posture.y + along * posture.sin])
            forces.append([fs * posture.cos - fn * posture.sin, fs * posture.sin + fn * posture.cos])
        return np.concatenate(places, axis=1), np.concatenate(forces, axis=1)

    def speeds(self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray) -> tuple[str, np.ndarray]:
        """Of the midpoints of the links."""
        velocity = self.velocity(self.posture(angles), rates, z)
        return "link", np.hypot(velocity.vs, velocity.vn)

    def seen_from_head(self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        link = self.velocity(self.posture(angles), rates, z)
        half = 0.5 * self.lengths[-1]
        return np.stack([link.vs[-1], link.vn[-1] + half * link.w[-1], -link.w[-1]]), angles.sum(axis=0)

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        """With joint j at s_j along the body: ``q_j = sin(2 pi t - 2 pi waves (s_j - 1/2))``."""
        phase = 2 * np.pi * waves * (np.cumsum(self.lengths)[:-1] - 0.5)
        return -np.sin(phase), np.cos(phase)

    @property
    def bending(self) -> np.ndarray:
        return np.eye(self.n_joint)

    def laid(self, lengths: np.ndarray) -> np.ndarray:
        """Every link gets the mean tangent angle of the part of the other chain it covers."""
        ends, own = (np.concatenate([[0.0], np.cumsum(b)]) for b in (lengths, self.lengths))
        overlap = np.minimum(own[1:, None], ends[1:]) - np.maximum(own[:-1, None], ends[:-1])
        means = np.maximum(overlap, 0.0) / self.length_column()
        return np.diff(means @ np.tril(np.ones((lengths.size, lengths.size - 1)), -1), axis=0)
