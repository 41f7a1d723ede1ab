"""Random shapes, rates and loads of a chain."""

import numpy as np


def random_instants(count, seed=0, n_joint=2):
    """Angles over all of shape space, rates of order 1, each ``(n_joint, count)``."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-np.pi, np.pi, (n_joint, count)), rng.normal(size=(n_joint, count))


def random_loads(count, size, seed=3):
    """Forces ``(2, count)`` of one magnitude, in all directions."""
    angle = np.random.default_rng(seed).uniform(-np.pi, np.pi, count)
    return size * np.stack([np.cos(angle), np.sin(angle)])
