"""What the actuators of a body's shape coordinates do: moments, powers, and how these compare with
what real ones can do.

With forces on the body's parts, the power is bilinear in them and in the velocities, and these are
linear in the rates: so the moment of a shape coordinate is the power at its unit rate, all others
and the body at rest, less what an outside force does then, such as the weight's pull on a slope.
"""

from __future__ import annotations

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.feet import whole_links
from colloc.mechanics.law import Law
from colloc.mechanics.links import Links
from colloc.numerics.arrays import Array, namespace


def joint_moments(
    body: Body, friction: Law, angles: Array, forces: Array, delta: Array, load: Array | None = None
) -> Array:
    """Moment that every shape coordinate's actuator exerts, ``(n_joint, n_time)``, for a body with
    a full formulation, from angles ``(n_joint, n_time)``, forces ``(n_force, n_time)`` on its parts
    (`colloc.mechanics.bodies.Body.forces`), and an outside force ``(2, n_time)`` on its centre of
    mass, in its axes, if there is one."""
    still, moments = np.zeros((3, angles.shape[1])), []
    for joint in range(body.n_joint):
        unit = np.zeros(angles.shape)
        unit[joint] = 1.0
        alone = body.with_forces(friction, angles, unit, still, forces, delta)
        moments.append(
            alone.power
            if load is None
            else alone.power - namespace(load).sum_rows(load * alone.centre)
        )
    return namespace(angles, forces).stack(moments)


def largest_moments(chain: Links, friction: Law, grade: float = 0.0) -> np.ndarray:
    """What the moment of no joint exceeds in slow motion under dry friction, ``(n_joint,)``: on
    either side of it friction is at most the largest coefficient times the weight, and acts, as a
    slope's pull does, no farther away than on the stretched body."""
    lengths, ends = np.array(chain.lengths), np.concatenate([[0.0], np.cumsum(chain.lengths)])
    feet = chain.standing_on or whole_links(chain.weight_column()[:, 0])
    pressed = [
        (
            foot.link,
            foot.place,
            (foot.friction or friction).largest * (foot.weight or 0.0),
            foot.offset,
        )
        for foot in feet
    ]
    pulled = [(link, 0.5, grade * mass, 0.0) for link, mass in enumerate(chain.mass_column()[:, 0])]
    moments = np.zeros((2, chain.n_joint))
    for link, place, force, aside in (*pressed, *pulled):
        for joint in range(chain.n_joint):
            arm = abs(ends[link] + place * lengths[link] - ends[joint + 1]) + abs(aside)
            moments[int(link > joint), joint] += force * arm
    return moments.min(axis=0)
