"""The balance of a chain under a load, point by point of what touches the floor; nothing of
colloc's mechanics is used."""

from typing import NamedTuple

import numpy as np


class Points(NamedTuple):
    """Points that touch: their links, places along them from 0 to 1 and beside, directions against
    the link, weights, friction sideways, forwards and backwards, ``(n,)`` each."""

    link: np.ndarray
    place: np.ndarray
    offset: np.ndarray
    angle: np.ndarray
    weight: np.ndarray
    mu: np.ndarray


def lying(weights, mu):
    """Links that lie on the floor, as Gauss's rule has them."""
    nodes, shares = np.polynomial.legendre.leggauss(80)
    n, none = len(weights), np.zeros(len(weights) * nodes.size)
    weight = np.outer(weights, shares / 2).ravel()
    return Points(
        np.repeat(np.arange(n), nodes.size),
        np.tile((nodes + 1) / 2, n),
        none,
        none,
        weight,
        np.outer(mu, none + 1),
    )


def standing(feet, mu):
    """Feet, each with its own Coulomb friction or the one given."""
    rows = [(f.link, f.place, f.offset, f.angle, f.weight) for f in feet]
    own = [
        mu if f.friction is None else (f.friction.mu_t, f.friction.mu_f, f.friction.mu_b)
        for f in feet
    ]
    link, *rest = map(np.array, zip(*rows, strict=True))
    return Points(link, *rest, np.transpose(own))


def left_over(z, lengths, masses, points, angles, rates, load, delta):
    """Force and torque about the tail on a chain whose links are pulled at their middles, at one
    instant."""
    heading, turning = (
        np.append(start, start + np.cumsum(joint))
        for start, joint in ((0.0, angles), (z[2], rates))
    )
    along = np.exp(1j * heading)
    vectors = np.array(lengths) * along
    place = np.append(0, np.cumsum(vectors))[:-1]
    speed = np.append(0, np.cumsum(1j * turning * vectors))[:-1] + complex(z[0], z[1])
    own = along[points.link]
    arm = (points.place * np.array(lengths)[points.link] + 1j * points.offset) * own
    ahead = own * np.exp(1j * points.angle)
    v = (speed[points.link] + 1j * turning[points.link] * arm) * np.conj(ahead)
    sideways, forwards, backwards = points.mu
    mu = np.where(v.real > 0, forwards, backwards)
    rubbing = (
        -points.weight
        * (mu * v.real + 1j * sideways * v.imag)
        / np.sqrt(abs(v) ** 2 + delta**2)
        * ahead
    )
    pulled, middle = np.array(masses) * complex(*load), place + 0.5 * vectors
    force = rubbing.sum() + pulled.sum()
    torque = (np.conj(place[points.link] + arm) * rubbing).imag.sum() + (
        np.conj(middle) * pulled
    ).imag.sum()
    return np.array([force.real, force.imag, torque])
