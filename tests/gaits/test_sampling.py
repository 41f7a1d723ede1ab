"""Starts of a search: a Latin hypercube that depends on the seed alone."""

import numpy as np
from numpy.testing import assert_array_equal

from colloc.gaits.starts import latin_hypercube


def test_every_part_of_every_coordinate_has_one_point():
    points = latin_hypercube(7, 4, np.random.default_rng(3))
    assert_array_equal(
        np.sort(np.floor(7 * points), axis=0), np.repeat(np.arange(7)[:, None], 4, axis=1)
    )


def test_a_start_depends_on_the_seed_alone_and_no_number_comes_twice():
    rng = [np.random.default_rng(3) for _ in range(2)]
    first, second = (latin_hypercube(7, 4, r) for r in rng)
    assert_array_equal(first, second)
    assert len(np.unique(first)) == first.size
