"""Feet, speeds and friction of a body, as pictures show them, in its axes.

Of chains from their contacts; of other bodies from their outline.
"""

from __future__ import annotations

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.floor_contact import FOOT
from colloc.mechanics.law import Law

ARROWS = 12
_PARTS, _STEP = 5, 1e-6
"""Parts whose speeds are drawn, and the time over which their motion in the body's axes is
differenced."""


def hinges(body: Body) -> slice:
    """Points of the outline that are joints."""
    return slice(1, -1) if isinstance(body, Chain) else slice(0, 0)


def footprints(body: Body, angles: np.ndarray, wheel: float = 0.0) -> np.ndarray:
    """Ends of feet and pads, and of wheels drawn `wheel` of their link long, ``(2, 2, n_foot,
    n_time)``; none for a body that lies on the floor."""
    if isinstance(body, Chain) and body.feet:
        return body.footprints(angles, wheel)
    return np.zeros((2, 2, 0, angles.shape[1]))


def part_speeds(
    body: Body, angles: np.ndarray, rates: np.ndarray, z: np.ndarray
) -> tuple[str, np.ndarray]:
    """What parts are called, and their speeds ``(n_part, n_time)``: of the midpoints of links, of
    feet, and of pads where they are fastest."""
    if not isinstance(body, Chain):
        return "part", np.hypot(*_parts(body, angles, rates, z, _PARTS)[2])
    contact = body.contact
    parts = contact.velocities(body.velocity(body.posture(angles), rates, z))
    vs, vn, w = map(np.abs, parts)
    turns = 0.5 * contact.length * w if contact.called == FOOT else 0.0
    return contact.called, np.hypot(vs, vn + turns)


def friction_arrows(
    body: Body,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    z: np.ndarray,
    count: int = ARROWS,
) -> tuple[np.ndarray, np.ndarray]:
    """About `count` points along the body and the force per length there, ``(2, n_point, n_time)``
    each; every foot has one, with all of its force, and pads beside feet have theirs as if all of
    them moved alike."""
    if not isinstance(body, Chain):
        (x, y), (dx, dy), (vx, vy) = _parts(body, angles, rates, z, count)
        fs, fn = friction.density(vx * dx + vy * dy, vy * dx - vx * dy, delta)
        return np.stack([x, y]), np.stack([fs * dx - fn * dy, fs * dy + fn * dx])
    contact, laws = body.contact, body.contact.laws(friction)
    many = max(2, count // max(len(contact.pads), 1))
    share = np.repeat((np.arange(many) + 0.5) / many - 0.5, len(contact.pads))
    feet = [k for k in range(len(contact.parts)) if k not in contact.pads]
    part = np.array([*feet, *np.tile(contact.pads, many).astype(int)])
    along = np.concatenate([np.zeros(len(feet)), share])[:, None] * contact.length[part]
    vs, vn, w = contact.velocities(body.velocity(body.posture(angles), rates, z))
    vs, vn = vs[part], vn[part] + along * w[part]
    forces = [laws[k].density(vs[[i]], vn[[i]], delta) for i, k in enumerate(part)]
    fs, fn = (np.concatenate([force[side] for force in forces]) for side in (0, 1))
    pressed = (contact.weight if contact.called == FOOT else contact.pressure)[part]
    # from the axes of the part to those of its link, and of the body
    cos, sin, x, y = (row[np.array(contact.links)[part]] for row in body.posture(angles))
    turn = pressed * (contact.cos + 1j * contact.sin)[part] * (cos + 1j * sin)
    force = turn * (fs + 1j * fn)
    place = (
        x + 1j * y + (contact.along[part] + along + 1j * contact.offset[part]) * (cos + 1j * sin)
    )
    return np.stack([place.real, place.imag]), np.stack([force.real, force.imag])


def _parts(
    body: Body, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, count: int
) -> tuple[np.ndarray, ...]:
    """Middles of about `count` parts of the outline, their directions and velocities, ``(2, n_part,
    n_time)`` each."""
    ahead, now, behind = (
        np.stack(body.outline(angles + step * rates)) for step in (_STEP, 0.0, -_STEP)
    )
    moved = (ahead - behind) / (2 * _STEP) + z[:2, None] + z[2] * np.stack([-now[1], now[0]])
    n = now.shape[1] - 1
    parts = ((np.arange(min(count, n)) + 0.5) * n / min(count, n)).astype(int)
    place, velocity = (0.5 * (a[:, 1:] + a[:, :-1])[:, parts] for a in (now, moved))
    along = np.diff(now, axis=1)[:, parts]
    return place, along / np.hypot(*along), velocity
