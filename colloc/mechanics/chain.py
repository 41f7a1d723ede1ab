"""The chain of straight links as a `colloc.mechanics.bodies.Body`: which module answers which
question."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from colloc.mechanics.balance import instant, net_force, total_power
from colloc.mechanics.balance_results import BalancedMotion, BalanceSolution, Sliding
from colloc.mechanics.bodies import ARROWS, Body, Pairs
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
from colloc.mechanics.feet import WHEEL
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.law import Law
from colloc.mechanics.links import Links
from colloc.mechanics.solution_branches import all_balanced_velocities
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import named_arguments

BALANCED = 1e-9
"""Body lengths by which the weights of feet may press beside the centre of mass and count as
beneath it."""


@named_arguments
class Chain(Links, Body):
    """A chain of straight links joined end to end; its shape coordinates are the joint angles.

    Parameters
    ----------
    lengths : tuple of float
        Link lengths from tail to head; they add up to the body length, 1.
    width : float
        Of every link [body lengths]: links do not overlap but neighbours about their joint
        (`colloc.mechanics.contact`). By default links are lines, which must not cross but may lie
        on each other. Friction is that of the lines either way.
    weights : tuple of float
        By which the links press on the floor, from tail to head, in parts of the body's weight, 1;
        by default in proportion to their lengths. What a law says of a length is multiplied by the
        weight per length there, so drag of a fluid goes with the default only.
    feet : int or tuple of Foot
        What it stands on: so many on each link, evenly spread (one: its middle), or a `Foot` or
        `Wheel` each. By default the links lie on the floor along their length.
    masses : tuple of float
        Of the links, in parts of the body's mass, 1; by default each is as heavy as it presses. A
        link that hangs on its neighbours, or leans on them, has another. The centre of mass follows
        from them, and inertia (`colloc.Problem.froude`).
    inertias : tuple of float
        Moments of inertia of the links about their midpoints [body mass x length^2]; by default
        those of uniform rods.

    Examples
    --------
    >>> from colloc import Chain
    >>> Chain((0.25, 0.5, 0.25), width=0.02).n_joint
    2
    """

    looks_for_all_velocities = True
    solve, motion, all_velocities = solve_balance, chain_motion, all_balanced_velocities
    crossing_depth, passing_depth = overlap, passing_depth

    @property
    def force_names(self) -> tuple[str, ...]:
        """Those of what touches the floor."""
        return self.contact.force_names

    def describe(self) -> str:
        wide = f", {self.width:.4g} wide" if self.width else ""
        heavy = (
            f", of weights {', '.join(f'{weight:.4g}' for weight in self.weights)}"
            if self.weights
            else ""
        )
        for words, parts in (("masses", self.masses), ("moments of inertia", self.inertias)):
            heavy += f", of {words} {', '.join(f'{part:.4g}' for part in parts)}" if parts else ""
        lengths = ", ".join(f"{length:.4g}" for length in self.lengths)
        stands = f", on {len(self.standing_on)} feet" if self.feet else ""
        if self.largest_imbalance > BALANCED:
            stands += (
                f" (whose weights press up to {self.largest_imbalance:.3g} beside the "
                f"centre "
                f"of mass)"
            )
        return f"links of lengths {lengths} from the tail{wide}{stands} [body lengths]{heavy}"

    def sliding(
        self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array
    ) -> Sliding:
        now = instant(self, friction, angles, rates, z, delta)
        centre = namespace(angles, z).stack(list(self.centre_velocity(now.posture, now.velocity)))
        return Sliding(
            net_force(now.posture, now.force), centre, total_power(now.velocity, now.force)
        )

    def forces(self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array) -> Array:
        return self.contact.forces(friction, self.velocity(self.posture(angles), rates, z), delta)

    def largest_forces(self, friction: Law) -> np.ndarray:
        return self.contact.largest_forces(friction)

    def slopes(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> np.ndarray:
        return chain_slopes(self, friction, angles, rates, delta, solved)[1]

    def replayed(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        start: np.ndarray | None,
    ) -> tuple[BalancedMotion, np.ndarray]:
        """By the solver itself: forces on links are integrals in closed form."""
        solved = solve_balance(self, friction, angles, rates, delta, start=start).require()
        return chain_motion(self, friction, angles, rates, delta, solved), solved.residual

    def slowness(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, z: np.ndarray
    ) -> np.ndarray:
        """Speed of the slowest point of each link, or of each foot; along it where directions
        differ; none where nothing is dry."""
        law, velocity = self.law(friction), self.velocity(self.posture(angles), rates, z)
        return self.contact.slowness(law, velocity) if law.regularised else velocity.vs[:0]

    def contacts(self, far: Sequence[tuple[int, int]] = ()) -> list[Contact]:
        """All links two apart, bending to either side, the pairs `far` of links farther apart, and
        what a width asks of all."""

        def crossing(side: int, i: int, angles: Array) -> tuple[Array, Array]:
            first, second = crossing_sums(self, angles, i)
            return side * first - np.pi, side * second - np.pi

        def lacking(end: int, link: int, angles: Array) -> tuple[Array, Array]:
            both = excess(self, angles, end, link)
            return both, both  # one condition alone is the smaller of two that are the same

        found = []
        for i in range(self.n_link - 2):
            for name, side in (("left", 1), ("right", -1)):
                found.append(
                    Contact(
                        f"links {i + 1} and {i + 3} ({name})", partial(crossing, side, i), SMOOTHING
                    )
                )
        for i, j in far:
            pair = partial(intrusions, self, first=i, second=j)
            found.append(Contact(f"links {i + 1} and {j + 1}", pair, CLEARANCE_SMOOTHING))
        for end, link in ends_and_links(self) if self.width else ():
            found.append(
                Contact(
                    f"end {end} and link {link + 1}",
                    partial(lacking, end, link),
                    CLEARANCE_SMOOTHING,
                )
            )
        return found

    @property
    def far_pairs(self) -> Pairs:
        return tuple(far_pairs(self))

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
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        z: np.ndarray,
        count: int = ARROWS,
    ) -> tuple[np.ndarray, np.ndarray]:
        posture = self.posture(angles)
        fs, fn = self.contact.at_points(friction, self.velocity(posture, rates, z), delta, count)
        links = np.array(self.contact.links)[self.contact.points(count)[0]]
        cos, sin = (row[links] for row in posture[:2])
        return self._points(angles, count), np.stack([fs * cos - fn * sin, fs * sin + fn * cos])

    def _points(self, angles: np.ndarray, count: int) -> np.ndarray:
        """Where it touches the floor, at about `count` points of a line, ``(2, n_point,
        n_time)``."""
        part, *at = self.contact.points(count)
        cos, sin, x, y = (row[np.array(self.contact.links)[part]] for row in self.posture(angles))
        along, offset = (row[:, None] for row in at)
        return np.stack([x + along * cos - offset * sin, y + along * sin + offset * cos])

    def speeds(
        self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray
    ) -> tuple[str, np.ndarray]:
        """Of the midpoints of the links, or of the feet and pads."""
        return self.contact.speeds(self.velocity(self.posture(angles), rates, z))

    def footprints(self, angles: np.ndarray, wheel: float = 0.0) -> np.ndarray:
        if not self.feet:
            return super().footprints(angles)
        feet, contact = self.standing_on, self.contact
        links = [foot.link for foot in feet]
        cos, sin, x, y = (part[links] for part in self.posture(angles))
        turned = np.exp(1j * np.array([foot.angle for foot in feet])) * [
            foot.kind == WHEEL for foot in feet
        ]
        rolling = (wheel * np.array(self.lengths)[links] * turned)[:, None]
        along, aside = contact.length + rolling.real, rolling.imag
        ends = [
            (contact.along + side * along, contact.offset + side * aside) for side in (-0.5, 0.5)
        ]
        return np.stack(
            [[x + a * cos - b * sin for a, b in ends], [y + a * sin + b * cos for a, b in ends]]
        )

    def imbalance(self, angles: np.ndarray) -> np.ndarray:
        if self.feet:
            weight, places = (
                np.array([foot.weight for foot in self.standing_on]),
                self.footprints(angles).mean(axis=1),
            )
        else:
            weight, places = self.weight_column()[:, 0], np.stack(self.posture(angles)[2:])
        return np.hypot(*(np.einsum("f,cft->ct", weight, places) - self.centre(angles)))

    @property
    def largest_imbalance(self) -> float:
        """`imbalance` at the worst shape, whatever the limits of the joints."""
        path, masses = self.weighted_path(None), self.mass_column()[:, 0]
        if not self.feet:
            return float(np.abs((self.weight_column()[:, 0] - masses) @ path).sum())
        arms = -(masses @ path).astype(complex)
        for foot in self.standing_on:
            weight = float(foot.weight or 0.0)
            arms += weight * path[foot.link]
            arms[foot.link] += weight * (
                (foot.place - 0.5) * self.lengths[foot.link] + 1j * foot.offset
            )
        return float(np.abs(arms).sum())

    def seen_from_head(
        self, angles: np.ndarray, rates: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        link = self.velocity(self.posture(angles), rates, z)
        half = 0.5 * self.lengths[-1]
        return np.stack([link.vs[-1], link.vn[-1] + half * link.w[-1], -link.w[-1]]), angles.sum(
            axis=0
        )

    def wave(self, waves: float) -> tuple[np.ndarray, np.ndarray]:
        """With joint j at s_j along the body: ``q_j = sin(2 pi t - 2 pi waves (s_j - 1/2))``."""
        phase = 2 * np.pi * waves * (np.cumsum(self.lengths)[:-1] - 0.5)
        return -np.sin(phase), np.cos(phase)

    def laid(self, lengths: np.ndarray) -> np.ndarray:
        """Every link gets the mean tangent angle of the part of the other chain it covers."""
        ends, own = (np.concatenate([[0.0], np.cumsum(b)]) for b in (lengths, self.lengths))
        overlap = np.minimum(own[1:, None], ends[1:]) - np.maximum(own[:-1, None], ends[:-1])
        means = np.maximum(overlap, 0.0) / self.length_column()
        return np.diff(means @ np.tril(np.ones((lengths.size, lengths.size - 1)), -1), axis=0)
