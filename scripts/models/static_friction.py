"""Where static friction carries a link of the three-link body, and why kinetic friction alone has
no solution there; the paper's flap body.

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

from colloc.mechanics.balance import instant, net_force
from colloc.mechanics.chain import Chain
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction, LinkVelocity

SLOW = 1e-3
"""Speed below which the paper counts a link as held (its figure 9)."""
BODY, ISOTROPIC = Chain(), Friction()
_MIDDLE, _PARENT_OF_FLAPS = 1, 0
_AROUND_REST = np.array([-1e-9, 0.0, 1e-9])


def link_speeds(body: Chain, velocity: LinkVelocity) -> np.ndarray:
    """Largest speed on each link, ``(n_link, n_time)``: it is reached at an end."""
    half = 0.5 * body.length_column() * np.abs(velocity.w)
    return np.hypot(velocity.vs, np.abs(velocity.vn) + half)


def slowest_link(
    angles: np.ndarray, rates: np.ndarray, delta: float
) -> tuple[np.ndarray, np.ndarray]:
    """The largest speed on the slowest link, and which link it is, ``(n_time,)`` each."""
    z = solve_balance(BODY, ISOTROPIC, angles, rates, delta).require().z
    speeds = link_speeds(BODY, instant(BODY, ISOTROPIC, angles, rates, z, delta).velocity)
    return speeds.min(axis=0), speeds.argmin(axis=0)


class Case(NamedTuple):
    """A shape and its rates at which a link is held."""

    name: str
    angles: tuple[float, float]
    rates: tuple[float, float]


WORKED_CASES = (
    Case("C", (1.45, 1.68), (1.0, 0.5)),  # near pi/2: the outer links nearly balance each other
    Case("D", (2.4, 0.4), (1.0, 0.0)),  # a joint at rest, the other bent beyond pi/2 and moving
    Case("E", (-2.88, -0.785), (1.0, 0.1)),  # a joint nearly at rest
    Case("F", (2.9, -2.8), (1.0, -0.5)),  # near pi and -pi
)
"""The paper describes figure 9 C-F in words; these shapes and rates lie in the regions it
describes."""

SYMMETRIC_CASES = (
    Case("A", (1.4, 1.4), (1.0, 1.0)),  # outer links splayed: a small force on the middle link
    Case("B", (1.75, 1.75), (1.0, 1.0)),  # leaning inwards: a small force of the other sign
    Case("C", (2.85, -2.85), (1.0, -1.0)),  # symmetric about the centre: a small couple
)
"""Figure 10 A-C: symmetric shapes and rates, so that one velocity of the middle link remains
unknown."""


class Held(NamedTuple):
    """What a case gives as delta falls; arrays over delta."""

    z: np.ndarray  # tail velocities (n, 3)
    delta: np.ndarray
    link: int
    speed: np.ndarray
    density: np.ndarray
    couple: np.ndarray


def held_link(case: Case, deltas: tuple[float, ...] = (1e-4, 1e-6, 1e-8, 1e-10)) -> Held:
    """The slowest link of a case as delta falls: if it is held, its speed falls like delta and its
    force stays."""
    angles, rates, rows = np.array(case.angles)[:, None], np.array(case.rates)[:, None], []
    for delta in deltas:
        solved = solve_balance(BODY, ISOTROPIC, angles, rates, delta).require()
        # seen from the held link, whose speed the tail velocity cannot resolve
        anchor, velocity = int(solved.anchor[0]), solved.anchor_velocity
        now = instant(BODY, ISOTROPIC, angles, rates, velocity, delta, anchor)
        speeds = link_speeds(BODY, now.velocity)[:, 0]
        link = int(np.argmin(speeds))
        length, force = BODY.lengths[link], [part[link, 0] for part in now.force]
        couple = abs(force[2]) / (0.25 * length**2)
        rows.append((link, speeds[link], np.hypot(*force[:2]) / length, couple, solved.z[:, 0]))
    links, speed, density, couple, z = map(np.array, zip(*rows, strict=True))
    return Held(z, np.array(deltas), int(links[-1]), speed, density, couple)


def symmetric_balance(case: Case, unknown: np.ndarray, delta: float) -> np.ndarray:
    """What a symmetric case leaves unbalanced when the middle link moves with the one velocity
    symmetry allows.

    For equal angles and rates (mirror symmetry) that is the link's normal velocity, and the normal
    net force is returned; for opposite ones (point symmetry) its rotation rate, and the net torque
    about the centre. It falls as `unknown` grows. The other two components vanish."""
    angles, rates = (np.tile(np.array([pair]).T, unknown.size) for pair in case[1:])
    direction = np.zeros((3, 1))
    if case.angles[0] == case.angles[1]:
        direction[:2, 0] = -np.sin(case.angles[0]), np.cos(case.angles[0])
    else:
        direction[2] = 1.0
    # the rates turn the outer links against the middle one, whose own velocity is the unknown
    now = instant(BODY, ISOTROPIC, angles, rates, direction * unknown, delta, _MIDDLE)
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


def kinetic_gap(case: Case) -> KineticGap:
    """The gap of a symmetric case: velocities of 1e-9 with delta = 1e-18, and rest, where the
    kinetic force is zero."""
    return KineticGap(*map(float, symmetric_balance(case, _AROUND_REST, 1e-18)))


@dataclass(frozen=True)
class FlapBody(Chain):
    """The paper's figure 4: a straight body, link 0, with flaps 1 and 2 hinged at its tail that
    open and close like a pair of wings; "joint angles" are the flaps' angles from it.

    The flaps turn in opposite directions, so the net force is along the body and it can only slide
    along itself. Its friction is then +-mu per unit length or none, and a shorter pair of flaps
    cannot balance any of these: kinetic friction has no solution. For one velocity V of the body,
    with flap force f along it at V = 0 and body length l, the delta-regularised balance
    ``l V/sqrt(V^2 + delta^2) = f`` gives ``V/delta -> f/sqrt(l^2 - f^2)`` as delta -> 0.

    It is a tree, not a chain. Everything a `Chain` computes follows from which joints turn a link
    and which links lead to its midpoint, so only these two tables differ.
    """

    lengths: tuple[float, ...] = (0.8, 0.1, 0.1)

    in_series = False

    def _joint_sum(self, reference: int | None) -> np.ndarray:
        full = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        return full if reference is None else full - full[reference]

    def weighted_path(self, reference: int | None) -> np.ndarray:
        full = 0.5 * np.eye(3)
        return (full if reference is None else full - full[reference]) * self.lengths


def flap_motion(opening: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles and rates ``(2, n_time)`` of mirror-image flaps opened by `opening` [rad]."""
    return np.stack([opening, -opening]), np.stack([1 + 0 * opening, -1 + 0 * opening])


def axial_force(body: FlapBody, opening: float, V: np.ndarray, delta: float) -> np.ndarray:
    """Net friction along the body, ``(n,)``, when it slides along itself with velocities V; the
    others vanish."""
    z = np.stack([V, 0 * V, 0 * V])
    angles, rates = flap_motion(np.full(V.size, opening))
    now = instant(body, ISOTROPIC, angles, rates, z, delta, _PARENT_OF_FLAPS)
    return net_force(now.posture, now.force)[0]


def flap_gap(body: FlapBody, opening: float) -> KineticGap:
    """Unbalanced axial force under kinetic friction just below rest, at rest and just above."""
    return KineticGap(*map(float, axial_force(body, opening, _AROUND_REST, 1e-18)))
