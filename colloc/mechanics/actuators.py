"""What the actuators of a body's shape coordinates do: moments, powers, and how these compare with
what real ones can do.

With forces on the body's parts, the power is bilinear in them and in the velocities, and these are
linear in the rates: so the moment of a shape coordinate is the power at its unit rate, all others
and the body at rest, less what an outside force does then, such as the weight's pull on a slope.
"""

from __future__ import annotations

import numpy as np

from colloc.mechanics.balance import total_power
from colloc.mechanics.feet import whole_links
from colloc.mechanics.law import Law
from colloc.mechanics.links import Links
from colloc.numerics.arrays import Array, namespace


def joint_moments(body: Links, angles: Array, forces: Array, load: Array | None = None) -> Array:
    """Moment that every joint's actuator exerts, ``(n_joint, n_time)``, from angles ``(n_joint,
    n_time)``, friction ``(n_force, n_time)`` (`colloc.mechanics.bodies.Body.forces`), and an
    outside force ``(2, n_time)`` on the centre of mass, in the body's axes, if there is one."""
    xp, posture = namespace(angles, forces), body.posture(angles)
    friction = body.contact.on_links(forces)
    still, moments = np.zeros((3, angles.shape[1])), []
    for joint in range(body.n_joint):
        unit = np.zeros(angles.shape)
        unit[joint] = 1.0
        velocity = body.velocity(posture, unit, still)
        power = total_power(velocity, friction)
        if load is not None:
            centre = xp.stack(list(body.centre_velocity(posture, velocity)))
            power = power - xp.sum_rows(load * centre)
        moments.append(power)
    return xp.stack(moments)


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
