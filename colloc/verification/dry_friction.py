"""A cycle of a gait at delta = 0: distance, work and efficiency between bounds.

An associated law (equal coefficients, or the elliptic one) is minus the gradient of its dissipation
D, a norm of the velocity at each point. At delta = 0 the balance is a cone program over the three
rigid velocities z, whose dual asks for forces inside of the friction cones that balance:

    P = min over z of the integral of D(v(z)) over the body.

- Above, P <= D(z) for any z.
- Below, friction f at any velocity y and any delta > 0 lies inside of the cones. With G minus its
  net force (none in balance), D(z) >= -f . v(z) = -f . v(y) + G . (z - y) for all z.

So every y states a half space with all minimisers in it: velocities are known between bounds too.
Cuts are made with G along the three velocities of the centre of mass, both ways. What a y lacks of
its goal makes a cut weaker, never wrong. Where several motions are balanced at delta = 0, as on
feet, the bounds hold them all.

A replay at a small delta is corrected, instant by instant, for how far dry friction is from it.
Between two instants the worse of them counts, and the error of the replay's quadrature is added:
these two are estimates, all else is bounds.
"""

from typing import NamedTuple

import numpy as np

from colloc.mechanics.balance import balance_jacobian, instant, net_force, total_power
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.law import Law, rate_independent
from colloc.system.errors import ProblemError
from colloc.verification.adaptive_motion import Path
from colloc.verification.replay import replay

_DRY = 1e-6  # delta of the replay that is corrected, over the largest mean rate
_OPEN = 1e-2  # velocities known less well than this, over the largest rate, count as open
_SMOOTHED, _LEAST = 1e-8, 1e-17
"""Delta of the friction, and of the dissipation, over the largest rate."""
_ROUNDING = 64 * float(np.finfo(float).eps)  # relative: closed forms are known to a few units
_NEWTON, _ROUNDS = 6, 4  # steps to a cut; rounds of all cuts, each with what the last one knew
_CAP = 0.02  # the largest gradient, in units of the friction
_TOO_FAR = 0.1  # part of its goal that a gradient may miss; else the next goal is a tenth of it


class Between(NamedTuple):
    least: float
    most: float


class DryFriction(NamedTuple):
    distance: Between
    work: Between
    open: float
    """Part of the cycle at which velocities are not known to 1 % of the largest rate."""
    instants: int

    @property
    def efficiency(self) -> Between:
        return Between(self.distance.least / self.work.most, self.distance.most / self.work.least)

    def __str__(self) -> str:
        least, most = self.efficiency
        several = (
            f"; the motion is open at {100 * self.open:.2g} % of the cycle" if self.open else ""
        )
        return f"d/W between {least:.8f} and {most:.8f}, at {self.instants} time points{several}"

    def facts(self) -> dict:
        intervals = {name: list(getattr(self, name)) for name in ("efficiency", "distance", "work")}
        return {**intervals, "open": self.open, "instants": self.instants}


class DryBalance(NamedTuple):
    least: np.ndarray  # bounds of the power, (n_time,)
    most: np.ndarray
    z: np.ndarray  # a tail velocity that dissipates no more than `most`, (3, n_time)
    apart: np.ndarray
    """How far from it any balanced motion is at most: velocity of the centre of mass in the body's
    axes, and rotation rate ``(3, n_time)``; infinite where nothing bounds it."""


class _Tangent(NamedTuple):
    """A lower bound of the dissipation, linear about velocities y ``(3, n_time)`` of the centre of
    mass."""

    y: np.ndarray
    power: np.ndarray
    gradient: np.ndarray
    slope: np.ndarray

    def least(self, apart: np.ndarray) -> np.ndarray:
        """The dissipation is no less wherever no velocity exceeds `apart`."""
        along = self.gradient * self.y
        rounding = _ROUNDING * np.abs(along).sum(axis=0)
        return self.power - along.sum(axis=0) - _sums(self.gradient, apart) - rounding


def _sums(gradient: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """Sum of the magnitudes of products; 0 times infinity is 0."""
    size = np.abs(gradient)
    return np.multiply(size, apart, where=size > 0, out=np.zeros_like(size)).sum(axis=0)


def dry_balance(body: Chain, friction: Law, angles: np.ndarray, rates: np.ndarray) -> DryBalance:
    """Bounds at delta = 0 for joint angles and rates ``(n_joint, n_time)``; rounding counts as some
    units of each sum. `ProblemError` for a law that is not associated or depends on the speed."""
    law, largest = body.law(friction), np.abs(rates).max(axis=0)
    if not (law.associated and rate_independent(law)):
        raise ProblemError(
            f"{law.label} has no bounds for delta = 0: its balance is not the least of a "
            f"dissipation. Equal coefficients, the elliptic law and axles have them."
        )
    # in units of the largest rate; velocities y of the centre of mass, beyond those of the tail, z
    rates = rates / np.where(largest > 0, largest, 1.0)
    posture, contact = body.posture(angles), body.contact
    gx, gy = (row[0] for row in body.centre_of_mass(posture))
    to_tail = np.tile(np.eye(3), (largest.size, 1, 1))
    to_tail[:, 0, 2], to_tail[:, 1, 2] = gy, -gx

    def tangent(y):
        moved = z + np.einsum("tij,jt->it", to_tail, y)
        now = instant(body, law, angles, rates, moved, _SMOOTHED)
        gradient = -np.einsum("tji,jt->it", to_tail, net_force(now.posture, now.force))
        slope = balance_jacobian(body, law, now.posture, now.velocity, _SMOOTHED)
        power = total_power(now.velocity, now.force)[0] * (1 - _ROUNDING)
        return _Tangent(y, power, gradient, to_tail.transpose(0, 2, 1) @ slope @ to_tail)

    def cut_along(goal):
        """A tangent whose gradient is near a goal ``(3, n_time)``, by damped Newton steps, and what
        it misses of it."""
        best, damping = centre, np.ones(largest.size)
        missed = np.abs(best.gradient - goal).sum(axis=0)
        for _ in range(_NEWTON):
            lift = 1e-14 * np.trace(best.slope, axis1=1, axis2=2)[:, None, None] * np.eye(3)
            right = (goal - best.gradient).T[..., None]
            trial = tangent(best.y + damping * np.linalg.solve(best.slope + lift, right)[..., 0].T)
            off = np.abs(trial.gradient - goal).sum(axis=0)
            better = off < missed
            masks = better, better, better, better.reshape(-1, 1, 1)
            rows = zip(masks, trial, best, strict=True)
            best = _Tangent(*(np.where(mask, new, old) for mask, new, old in rows))
            missed, damping = np.where(better, off, missed), np.where(better, 1.0, 0.25 * damping)
        return best, missed

    twice = body.solve(law, angles, rates, 2 * _SMOOTHED).z
    once = body.solve(law, angles, rates, _SMOOTHED, start=twice).z
    # parts that stick move at speeds of order delta, which the second one has none of
    both = np.stack([once, 2 * once - twice])
    velocities = [body.velocity(posture, rates, each) for each in both]
    values = np.array([contact.potential(law, v, _LEAST).sum(axis=0) for v in velocities])
    z, most = np.where(values[0] < values[1], *both), values.min(axis=0) * (1 + _ROUNDING)
    centre = tangent(np.einsum("tij,jt->it", np.linalg.inv(to_tail), once - z))
    # two motions that dissipate no more than `most` each differ by a rigid motion of mean speed b
    # <= 2 most / mu: so is the speed of the centre of pressure, and the spin times the mean square
    # distance from there over the largest
    cos, sin, x, y = (of_links[contact.links] for of_links in posture)
    place = x + 1j * y + (contact.along + 1j * contact.offset) * (cos + 1j * sin)
    pressed = (contact.weight * place).sum(axis=0)  # weights add up to 1
    arm, mean_speed = np.abs(place - pressed), 2 * most / law.smallest
    square = (contact.weight * (arm**2 + contact.length**2 / 12)).sum(axis=0)
    widest = (arm + contact.length / 2).max(axis=0)
    with np.errstate(divide="ignore"):
        spin = np.where(square > _ROUNDING, mean_speed * widest / square, np.inf)
    lever = np.abs(pressed - (gx + 1j * gy))
    speed = mean_speed + np.multiply(lever, spin, where=lever > 0, out=np.zeros_like(lever))
    apart = (1 + _ROUNDING) * np.stack([speed, speed, spin])
    least, tiny = np.maximum(centre.least(apart), 0.0), np.finfo(float).tiny
    nearer = np.ones((3, 2, most.size))
    for _ in range(_ROUNDS):
        gap = np.maximum(most - least, _ROUNDING * most + tiny)
        inverse = np.linalg.pinv(centre.slope, hermitian=True)
        ease = np.abs(inverse.diagonal(axis1=1, axis2=2)).T + tiny
        for k in range(3):
            widths = []
            for side, sign in enumerate((1.0, -1.0)):
                size = np.minimum(np.sqrt(2 * gap / ease[k]), _CAP * law.smallest) * nearer[k, side]
                goal = sign * size * np.eye(3)[:, [k]]
                cut, missed = cut_along(goal)
                rest = _sums(cut.gradient - goal, apart)
                widths.append((most - cut.least(np.zeros((3, 1))) + rest) / size)
                least = np.maximum(least, cut.least(apart))
                nearer[k, side] *= np.where(missed > _TOO_FAR * size, 0.1, 1.0)
            apart[k] = np.minimum(apart[k], np.maximum(*widths))
        least = np.maximum(least, centre.least(apart))
    still = largest == 0  # joints that rest: so does the body, and nothing else is balanced
    least, most, apart, z = (np.where(still, 0.0, a) for a in (least, most, apart, z))
    return DryBalance(least * largest, most * largest, z * largest, apart * largest)


def dry_friction(
    body: Body,
    friction: Law,
    path: Path,
    *,
    breaks: np.ndarray | tuple[float, ...] = (),
    tolerance: float = 1e-6,
    turn: float = 0.0,
) -> DryFriction:
    """Distance of the centre of mass and work over a cycle at delta = 0, with the arguments of
    `colloc.replay`. `ProblemError` for bodies that are no chains, and laws that have no bounds."""
    if not isinstance(body, Chain):
        raise ProblemError(
            f"bounds for delta = 0 are there for a Chain, not for a {type(body).__name__}."
        )
    law = body.law(friction)
    mean_rate = float(np.abs(path(np.linspace(0.0, 1.0, 101))[1]).max(axis=0).mean())
    delta = _DRY * (mean_rate or 1.0)
    # says first if there are no bounds
    dry_balance(body, friction, *(a[:, :1] for a in path(np.array([0.0]))))
    replayed = replay(body, friction, path, delta, breaks=breaks, tolerance=tolerance, turn=turn)
    t, z = replayed.tail
    angles, rates = path(t)
    dry, posture = dry_balance(body, friction, angles, rates), body.posture(angles)

    def centre_velocity(z):
        x, y = body.centre_velocity(posture, body.velocity(posture, rates, z))
        return (x + 1j * y)[0]

    smooth = instant(body, law, angles, rates, z, delta)
    power, moved = total_power(smooth.velocity, smooth.force)[0], centre_velocity(z)
    off = np.abs(centre_velocity(dry.z) - moved) + np.hypot(*dry.apart[:2])
    spin = np.abs(dry.z[2] - z[2]) + dry.apart[2]
    step = np.diff(t, append=t[0] + 1.0)

    def integral(values):
        """Upper bound, by the worse of neighbours."""
        return float(step @ np.maximum(values, np.roll(values, -1)))

    turned = integral(np.abs(moved)) * integral(spin)
    way, off_way = replayed.distance, replayed.errors["distance"] + integral(off) + turned
    work, error = replayed.work, replayed.errors["work"]
    low, high = integral(power - dry.least), integral(dry.most - power)
    largest = np.abs(rates).max(axis=0)
    return DryFriction(
        distance=Between(max(way - off_way, 0.0), way + off_way),
        work=Between(work - error - low, work + error + high),
        open=float(step @ (dry.apart.max(axis=0) > _OPEN * largest)),
        instants=t.size,
    )
