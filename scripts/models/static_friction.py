"""Where static friction carries a link of the three-link body, and why kinetic friction alone has
no solution there.

A link is *held* when the largest speed on it falls below a threshold (the paper's figure 9: 1e-3 at
unit larger rate and delta = 1e-4). With kinetic friction only, forces per unit length of a held
link could be 0 or mu in a body that is symmetric, but not in between; so a small force or couple
from the other links cannot be balanced. Delta supplies the values in between at velocities of order
delta.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from colloc.mechanics.balance import Instant, instant, net_force
from colloc.mechanics.chain import Chain
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction, LinkVelocity

SLOW = 1e-3
"""Speed below which the paper counts a link as held (its figure 9)."""
MIDDLE = 1


def link_speeds(body: Chain, velocity: LinkVelocity) -> np.ndarray:
    """Largest speed on each link, ``(n_link, n_time)``: it is reached at an end."""
    half = 0.5 * body.length_column() * np.abs(velocity.w)
    return np.hypot(velocity.vs, np.abs(velocity.vn) + half)


def slowest_link(
    body: Chain,
    friction: Friction,
    angles: np.ndarray,
    rates: np.ndarray,
    z: np.ndarray,
    delta: float,
) -> tuple[np.ndarray, np.ndarray]:
    """The largest speed on the slowest link, and which link it is, ``(n_time,)`` each, for tail
    velocities z."""
    speeds = link_speeds(body, instant(body, friction, angles, rates, z, delta).velocity)
    return speeds.min(axis=0), speeds.argmin(axis=0)


@dataclass(frozen=True)
class Case:
    """A shape and its rates at which a link is held."""

    name: str
    angles: tuple[float, float]
    rates: tuple[float, float]
    what: str


WORKED_CASES = (
    Case(
        "C",
        (1.45, 1.68),
        (1.0, 0.5),
        "both angles near pi/2: the outer links nearly balance each other",
    ),
    Case("D", (2.4, 0.4), (1.0, 0.0), "one joint at rest, the other bent beyond pi/2 and moving"),
    Case("E", (-2.88, -0.785), (1.0, 0.1), "one joint nearly at rest"),
    Case("F", (2.9, -2.8), (1.0, -0.5), "angles near pi and -pi"),
)
"""The paper describes figure 9 C-F in words; these shapes and rates lie in the regions it
describes."""

SYMMETRIC_CASES = (
    Case(
        "A",
        (1.4, 1.4),
        (1.0, 1.0),
        "outer links splayed, mirror images of each other: a small force on the middle link",
    ),
    Case(
        "B",
        (1.75, 1.75),
        (1.0, 1.0),
        "outer links leaning inwards: a small force of the other sign",
    ),
    Case(
        "C",
        (2.85, -2.85),
        (1.0, -1.0),
        "symmetric about the centre: a small couple on the middle link",
    ),
)
"""Figure 10 A-C: symmetric shapes and rates, so that one velocity of the middle link remains
unknown."""


class Held(NamedTuple):
    """What a case gives as delta falls; arrays over delta."""

    delta: np.ndarray
    link: int
    speed: np.ndarray
    density: np.ndarray
    couple: np.ndarray


def at_rates(
    body: Chain, friction: Friction, case: Case, delta: float
) -> tuple[np.ndarray, Instant]:
    """Tail velocity ``(3, 1)`` and instant of a case at one delta."""
    angles, rates = np.array(case.angles)[:, None], np.array(case.rates)[:, None]
    solved = solve_balance(body, friction, angles, rates, delta).require()
    # seen from the held link, whose speed the tail velocity cannot resolve
    anchor = int(solved.anchor[0])
    return solved.z, instant(body, friction, angles, rates, solved.anchor_velocity, delta, anchor)


def held_link(
    body: Chain,
    friction: Friction,
    case: Case,
    deltas: tuple[float, ...] = (1e-4, 1e-6, 1e-8, 1e-10),
) -> Held:
    """The slowest link of a case as delta falls: if it is held, its speed falls like delta and its
    force stays."""
    rows = []
    for delta in deltas:
        _, now = at_rates(body, friction, case, delta)
        speeds = link_speeds(body, now.velocity)[:, 0]
        link = int(np.argmin(speeds))
        length = body.lengths[link]
        force = np.hypot(now.force.tangential[link, 0], now.force.normal[link, 0])
        rows.append(
            (
                link,
                speeds[link],
                force / length,
                abs(now.force.couple[link, 0]) / (0.25 * length**2),
            )
        )
    links, speed, density, couple = zip(*rows, strict=True)
    return Held(np.array(deltas), links[-1], np.array(speed), np.array(density), np.array(couple))


def symmetric_balance(
    body: Chain, friction: Friction, case: Case, unknown: np.ndarray, delta: float
) -> np.ndarray:
    """What a symmetric case leaves unbalanced when the middle link moves with the one velocity
    symmetry allows.

    For equal angles and rates (mirror symmetry) that is the link's normal velocity, and the normal
    net force is returned; for opposite ones (point symmetry) its rotation rate, and the net torque
    about the centre. It falls as `unknown` grows. The other two components vanish."""
    unknown = np.asarray(unknown, dtype=float)
    angles, rates = (
        np.repeat(np.array(pair)[:, None], unknown.size, axis=1)
        for pair in (case.angles, case.rates)
    )
    direction = np.zeros((3, 1))
    if case.angles[0] == case.angles[1]:
        direction[:2, 0] = -np.sin(case.angles[0]), np.cos(case.angles[0])
    else:
        direction[2] = 1.0
    # the rates turn the outer links against the middle one, whose own velocity is the unknown
    now = instant(body, friction, angles, rates, direction * unknown, delta, MIDDLE)
    return (direction * net_force(now.posture, now.force)).sum(axis=0)


class KineticGap(NamedTuple):
    """Unbalanced force (or torque) of a one-velocity scene under kinetic friction: just below rest,
    at rest, just above.

    It falls with the velocity, so that no velocity balances it if the first two are positive and
    the last is negative, or the first is positive and the last two are negative.
    """

    below: float
    at_rest: float
    above: float

    @property
    def no_solution(self) -> bool:
        return self.below > 0 > self.above and self.at_rest != 0

    @property
    def fraction(self) -> float:
        """The part of the held link's largest friction that balance needs."""
        return 2 * self.at_rest / (self.below - self.above)


def kinetic_gap(body: Chain, friction: Friction, case: Case) -> KineticGap:
    """The gap of a symmetric case: velocities of 1e-9 with delta = 1e-18, and rest, where the
    kinetic force is zero."""
    below, rest, above = symmetric_balance(
        body, friction, case, np.array([-1e-9, 0.0, 1e-9]), 1e-18
    )
    return KineticGap(float(below), float(rest), float(above))
