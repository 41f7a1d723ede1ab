"""Cells of shapes and rates that have nothing to do with a lattice."""

import numpy as np

from research.guarantee.enclosure import CORNERS, Cells, ReferencePoint, corner_motions


def all_cells(low, sizes):
    """Cells that share no corners."""
    points = (low[:, :, None] + sizes[:, :, None] * CORNERS.T[:, None, :]).reshape(3, -1)
    return Cells(low, sizes, points, np.arange(points.shape[1]).reshape(-1, 8))


def random_cells(body, friction, size, seed, thin=False, count=8):
    """Cells for any body, motions at their corners and a reference point that has nothing to do
    with a potential."""
    rng = np.random.default_rng(seed)
    low, sizes = (
        rng.uniform(-1, 1, (3, count)) * [[2.5], [2.5], [0.9]],
        size * rng.uniform(0.7, 1.3, (3, count)),
    )
    if thin:
        low[2] = 10.0 ** rng.uniform(-9, -3, count)
        sizes[2] = low[2] * 3.0
    at, centre = rng.normal(size=(2, 8 * count)), rng.normal(size=(2, count))
    reference = ReferencePoint(
        at[0] + 1j * at[1], centre[0] + 1j * centre[1], *rng.uniform(0.1, 1, (3, count))
    )
    cells = all_cells(low, sizes)
    return cells, corner_motions(body, friction, cells), reference
