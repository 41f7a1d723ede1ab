"""The balance at delta = 0, between bounds: power and velocities of a body under dry friction.

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
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.balance import balance_jacobian, instant, net_force, total_power
from colloc.mechanics.chain import Chain
from colloc.mechanics.law import Law, rate_independent
from colloc.system.errors import ProblemError

_SMOOTHED, _LEAST = 1e-8, 1e-17
"""Delta of the friction, and of the dissipation, over the largest rate."""
_ROUNDING = 64 * float(np.finfo(float).eps)  # relative: closed forms are known to a few units
_NEWTON, _ROUNDS = 6, 4  # steps to a cut; rounds of all cuts, each with what the last one knew
_CAP = 0.02  # the largest gradient, in units of the friction
_TOO_FAR = 0.1  # part of its goal that a gradient may miss; else the next goal is a tenth of it


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

    def where(self, better: np.ndarray, other: _Tangent) -> _Tangent:
        masks = (better, better, better, better.reshape(-1, 1, 1))
        return _Tangent(*(np.where(m, b, a) for m, a, b in zip(masks, self, other, strict=True)))

    def missed(self, goal: np.ndarray) -> np.ndarray:
        return np.abs(self.gradient - goal).sum(axis=0)


def _sums(gradient: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """Sum of the magnitudes of products; 0 times infinity is 0."""
    size = np.abs(gradient)
    return np.multiply(size, apart, where=size > 0, out=np.zeros_like(size)).sum(axis=0)


class _Body:
    """Instants in units of their largest rate; velocities about the centre of mass, as seen from
    those of the tail `z`."""

    def __init__(self, body: Chain, law: Law, angles: np.ndarray, rates: np.ndarray) -> None:
        self.body, self.law, self.angles, self.rates = body, law, angles, rates
        self.posture = body.posture(angles)
        x, y = body.centre_of_mass(self.posture)
        self.to_tail = np.tile(np.eye(3), (angles.shape[1], 1, 1))
        self.to_tail[:, 0, 2], self.to_tail[:, 1, 2] = y[0], -x[0]

    def about_centre(self, z: np.ndarray) -> np.ndarray:
        return np.einsum("tij,jt->it", np.linalg.inv(self.to_tail), z)

    def dissipation(self, z: np.ndarray) -> np.ndarray:
        """No less than D, ``(n_time,)``."""
        velocity = self.body.velocity(self.posture, self.rates, z)
        return self.body.contact.potential(self.law, velocity, _LEAST).sum(axis=0) * (1 + _ROUNDING)

    def tangent(self, z: np.ndarray, y: np.ndarray) -> _Tangent:
        moved = z + np.einsum("tij,jt->it", self.to_tail, y)
        now = instant(self.body, self.law, self.angles, self.rates, moved, _SMOOTHED)
        gradient = -np.einsum("tji,jt->it", self.to_tail, net_force(now.posture, now.force))
        slope = balance_jacobian(self.body, self.law, now.posture, now.velocity, _SMOOTHED)
        power = total_power(now.velocity, now.force)[0] * (1 - _ROUNDING)
        return _Tangent(y, power, gradient, self.to_tail.transpose(0, 2, 1) @ slope @ self.to_tail)

    def spread(self, most: np.ndarray) -> np.ndarray:
        """How far apart two motions are that dissipate no more than `most` each, ``(3, n_time)``.

        Their difference is a rigid motion of mean speed b <= 2 most / mu: so is the speed of the
        centre of pressure, and the spin times the mean square distance from there over the largest.
        """
        contact = self.body.contact
        cos, sin, x, y = (of_links[contact.links] for of_links in self.posture)
        place = x + 1j * y + (contact.along + 1j * contact.offset) * (cos + 1j * sin)
        pressed = (contact.weight * place).sum(axis=0)  # weights add up to 1
        arm = np.abs(place - pressed)
        square = (contact.weight * (arm**2 + contact.length**2 / 12)).sum(axis=0)
        widest = (arm + contact.length / 2).max(axis=0)
        mean_speed = 2 * most / self.law.smallest
        with np.errstate(divide="ignore"):
            spin = np.where(square > _ROUNDING, mean_speed * widest / square, np.inf)
        lever = np.abs(pressed - (-self.to_tail[:, 1, 2] + 1j * self.to_tail[:, 0, 2]))
        speed = mean_speed + np.multiply(lever, spin, where=lever > 0, out=np.zeros_like(lever))
        return (1 + _ROUNDING) * np.stack([speed, speed, spin])

    def cut(self, z: np.ndarray, best: _Tangent, goal: np.ndarray) -> _Tangent:
        """A tangent whose gradient is near a goal ``(3, n_time)``, by damped Newton steps."""
        damping = np.ones(goal.shape[1])
        for _ in range(_NEWTON):
            lift = 1e-14 * np.trace(best.slope, axis1=1, axis2=2)[:, None, None] * np.eye(3)
            right = (goal - best.gradient).T[..., None]
            step = np.linalg.solve(best.slope + lift, right)[..., 0].T
            trial = self.tangent(z, best.y + damping * step)
            better = trial.missed(goal) < best.missed(goal)
            best, damping = best.where(better, trial), np.where(better, 1.0, 0.25 * damping)
        return best


def dry_balance(body: Chain, friction: Law, angles: np.ndarray, rates: np.ndarray) -> DryBalance:
    """Bounds at delta = 0 for joint angles and rates ``(n_joint, n_time)``; rounding counts as some
    units of each sum. `ProblemError` for a law that is not associated or depends on the speed."""
    law, largest = body.law(friction), np.abs(rates).max(axis=0)
    if not (law.associated and rate_independent(law)):
        raise ProblemError(
            f"{law.label} has no bounds for delta = 0: its balance is not the least of a "
            f"dissipation. Equal coefficients and the elliptic law have them."
        )
    speed = np.where(largest > 0, largest, 1.0)
    at = _Body(body, law, angles, rates / speed)
    twice = body.solve(law, angles, at.rates, 2 * _SMOOTHED).z
    once = body.solve(law, angles, at.rates, _SMOOTHED, start=twice).z
    # parts that stick move at speeds of order delta, which the second one has none of
    both = np.stack([once, 2 * once - twice])
    values = np.stack([at.dissipation(z) for z in both])
    z, most = np.where(values[0] < values[1], both[0], both[1]), values.min(axis=0)
    centre = at.tangent(z, at.about_centre(once - z))
    apart = at.spread(most)
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
                goal = np.zeros((3, most.size))
                goal[k] = sign * size
                cut = at.cut(z, centre, goal)
                rest = _sums(cut.gradient - goal, apart)
                widths.append((most - cut.least(np.zeros((3, 1))) + rest) / size)
                least = np.maximum(least, cut.least(apart))
                nearer[k, side] *= np.where(cut.missed(goal) > _TOO_FAR * size, 0.1, 1.0)
            apart[k] = np.minimum(apart[k], np.maximum(*widths))
        least = np.maximum(least, centre.least(apart))
    still = largest == 0  # joints that rest: so does the body, and nothing else is balanced
    least, most, apart, z = (np.where(still, 0.0, a) for a in (least, most, apart, z))
    return DryBalance(least * largest, most * largest, z * largest, apart * largest)
