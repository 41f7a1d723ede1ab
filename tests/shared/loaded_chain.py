"""The balance of a chain under a load by quadrature along its links; nothing of colloc is used."""

import numpy as np


def left_over(z, lengths, weights, mu, angles, rates, load, delta):
    """Force and torque about the tail on a chain of points that weigh what Gauss's rule says, at one instant."""
    nodes, shares = np.polynomial.legendre.leggauss(80)
    place, speed, heading, turning = 0j, complex(z[0], z[1]), 0.0, z[2]
    force, torque = 0j, 0.0
    for i, (length, weight) in enumerate(zip(lengths, weights, strict=True)):
        if i:
            heading, turning = heading + angles[i - 1], turning + rates[i - 1]
        along = np.exp(1j * heading)
        s = length * (nodes + 1) / 2
        v = (speed + 1j * turning * along * s) * np.conj(along)
        r = np.sqrt(abs(v) ** 2 + delta**2)
        mu_s = np.where(v.real > 0, mu[1], mu[2])
        on = weight * shares / 2 * (-(mu_s * v.real + 1j * mu[0] * v.imag) / r * along + complex(*load))
        force += on.sum()
        torque += (np.conj(place + along * s) * on).imag.sum()
        place, speed = place + along * length, speed + 1j * turning * along * length
    return np.array([force.real, force.imag, torque])
