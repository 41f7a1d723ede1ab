"""Moments at the joints of a chain, by virtual power.

With forces on the links the power is bilinear in them and in the velocities: the moment of a joint
is the power against friction at its unit rate, all others and the tail at rest, less that of an
outside force, such as the weight's pull on a slope.
"""

from __future__ import annotations

import numpy as np

from colloc.mechanics.balance import total_power
from colloc.mechanics.floor_contact import whole_links
from colloc.mechanics.friction import LinkForce
from colloc.mechanics.law import Law
from colloc.mechanics.links import Links
from colloc.numerics.arrays import Array, namespace


def joint_moments(body: Links, angles: Array, forces: Array, load: Array | None = None) -> Array:
    """Moments of the joints' actuators, ``(n_joint, n_time)``, from contact forces ``(n_force,
    n_time)`` (`FloorContact.forces`) and an outside force ``(2, n_time)`` on the centre of mass, in
    the body's axes."""
    return moments_of_links(body, angles, body.contact.on_links(forces), load)


def moments_of_links(
    body: Links, angles: Array, force: LinkForce, load: Array | None = None
) -> Array:
    xp, posture = namespace(angles, force.normal), body.posture(angles)
    still, moments = np.zeros((3, angles.shape[1])), []
    for joint in range(body.n_joint):
        unit = np.zeros(angles.shape)
        unit[joint] = 1.0
        velocity = body.velocity(posture, unit, still)
        power = total_power(velocity, force)
        if load is not None:
            centre = xp.stack(list(body.centre_velocity(posture, velocity)))
            power = power - xp.sum_rows(load * centre)
        moments.append(power)
    return xp.stack(moments)


def largest_moments(chain: Links, friction: Law, grade: float = 0.0) -> np.ndarray:
    """Upper bounds on the joints' moments in slow motion under dry friction, ``(n_joint,)``: on
    either side friction is at most the largest coefficient times the weight, and acts, as a slope's
    pull does, no farther away than on the stretched body."""
    lengths, ends = np.array(chain.lengths), np.concatenate([[0.0], np.cumsum(chain.lengths)])
    feet = chain.standing_on or whole_links(chain.weight_column()[:, 0])
    loads = [
        (f.link, f.place, (f.friction or friction).largest * (f.weight or 0.0), f.offset)
        for f in feet
    ]
    loads += [(link, 0.5, grade * mass, 0.0) for link, mass in enumerate(chain.mass_column()[:, 0])]
    moments = np.zeros((2, chain.n_joint))
    for link, place, force, offset in loads:
        for joint in range(chain.n_joint):
            arm = abs(ends[link] + place * lengths[link] - ends[joint + 1]) + abs(offset)
            moments[int(link > joint), joint] += force * arm
    return moments.min(axis=0)
