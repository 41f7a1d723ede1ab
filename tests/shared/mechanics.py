"""Random instants of a chain, its laws, and its balance by other means than the kernel."""

from contextlib import contextmanager
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from colloc import Friction
from colloc.gaits.regime import LEVEL
from colloc.mechanics import native_kernel
from colloc.verification.replay import replayer


def coulomb(mu_t, mu_f, mu_b):
    return Friction(mu_t=mu_t, mu_f=mu_f, mu_b=mu_b)


def random_instants(count, seed=0, n_joint=2):
    """Angles over all of shape space, rates of order 1, each ``(n_joint, count)``."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-np.pi, np.pi, (n_joint, count)), rng.normal(size=(n_joint, count))


def random_loads(count, size, seed=3):
    """Forces ``(2, count)`` of one magnitude, in all directions."""
    angle = np.random.default_rng(seed).uniform(-np.pi, np.pi, count)
    return size * np.stack([np.cos(angle), np.sin(angle)])


def wrench(body, law, angles, rates, z, delta, load=(0.0, 0.0), count=4000):
    """Net force and torque about the tail, power and velocity of the centre of mass at one instant,
    from `count` points on each line, walked through in the lab by complex numbers."""
    phi, w = np.cumsum([0.0, *angles]), z[2] + np.cumsum([0.0, *rates])
    step = np.array(body.lengths) * np.exp(1j * phi)
    starts = np.concatenate([[0.0], np.cumsum(step)[:-1]])
    moves = z[0] + 1j * z[1] + np.concatenate([[0.0], np.cumsum(1j * w * step)[:-1]])
    mass, pull = body.mass_column()[:, 0], complex(*load)
    middles, speeds = starts + 0.5 * step, moves + 0.5j * w * step
    net, torque, power = pull, ((mass @ middles).conj() * pull).imag, 0.0
    for part in body.contact.parts:
        many, k = count if part.extent else 1, part.link
        place = part.place + part.extent * ((np.arange(many) + 0.5) / many - 0.5)
        arm = step[k] * place + 1j * part.offset * np.exp(1j * phi[k])
        velocity, turn = moves[k] + 1j * w[k] * arm, np.exp(1j * (phi[k] + part.angle))
        own = velocity / turn
        fs, fn = (part.friction or law).density(own.real[None], own.imag[None], np.array([[delta]]))
        force = part.weight / many * (fs[0] + 1j * fn[0]) * turn
        net, torque = net + force.sum(), torque + ((starts[k] + arm).conj() * force).imag.sum()
        power -= (force * velocity.conj()).real.sum()
    return np.array([net.real, net.imag, torque]), power, mass @ speeds


@contextmanager
def numpy_instead():
    """A context in which NumPy does everything, on all threads."""
    with patch.object(native_kernel, "library", lambda: None):
        yield


def with_inertia(body, friction, gait, delta, froude, *, regime=LEVEL, tolerance=1e-5, **asked):
    """A period with inertia, all of which are alike."""
    at = replayer(replace(regime, froude=froude, free=None))
    return at(body, friction, gait, delta, tolerance=tolerance, **asked)
