"""The guarantee's own C: within its arrays, and no part of what the library compiles."""

import pytest
from shared.address_sanitizer import stays_within_its_arrays

from colloc.mechanics.native_kernel import native_kernel

pytestmark = pytest.mark.skipif(native_kernel() is None, reason="no C compiler")

WITHIN_ITS_ARRAYS = """
import numpy as np
from colloc import Chain, Friction
from research.guarantee import kernel
from research.guarantee.enclosure import CORNERS, Cells, ReferencePoint, by_convexity, corner_motions
from research.guarantee.loaded_balance import loaded_balance

kernel.FLAGS += ("-O1", "-fsanitize=address")
rng = np.random.default_rng(0)
for lengths in ((0.4, 0.6), (0.3, 0.2, 0.15, 0.35)):
    body, n = Chain(lengths), len(lengths) - 1
    at = rng.uniform(-3, 3, (n, 20)), rng.normal(size=(n, 20))
    loaded_balance(body, Friction(), *at, 0.1 * rng.normal(size=(3, 20)), np.zeros((3, 20)), 1e-4)
size = np.full((3, 20), 0.01)
low = rng.uniform(-1, 1, (3, 20))
points = (low[:, :, None] + size[:, :, None] * CORNERS.T[:, None]).reshape(3, -1)
cells = Cells(low, size, points, np.arange(160).reshape(20, 8))
point = ReferencePoint(np.zeros(160), *np.zeros((4, 20)))
by_convexity(Chain(), Friction(), cells, corner_motions(Chain(), Friction(), cells), point)
"""


@pytest.mark.slow
def test_it_reads_and_writes_nothing_beyond_its_arrays():
    stays_within_its_arrays(WITHIN_ITS_ARRAYS)
