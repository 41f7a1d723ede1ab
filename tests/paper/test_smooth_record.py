"""Snapshots of smooth bodies in the lab frame."""

import numpy as np
import pytest

from colloc.mechanics.friction import Friction
from colloc.smooth.prescribed_body import Wave
from scripts.models.period import period, snapshots

ALONG_EASY = Friction(mu_t=20.0, mu_f=1.0, mu_b=1.0)


def test_snapshots_are_inextensible_and_advance_by_the_distance():
    motion = Wave().prescribed()
    made = snapshots(motion, ALONG_EASY, 1e-3, count=2, panels=40)
    steps = np.hypot(np.diff(made.x, axis=0), np.diff(made.y, axis=0))
    np.testing.assert_allclose(steps.sum(axis=0), steps.sum(axis=0)[0], rtol=1e-4)
    # first and last node lie within the body
    assert steps.sum(axis=0)[0] == pytest.approx(1.0, abs=2e-3)
    moved = made.x[:, -1] - made.x[:, 0]
    np.testing.assert_allclose(moved, period(motion, ALONG_EASY, 1e-3, intervals=2).d, rtol=1e-4)
    np.testing.assert_allclose(made.y[:, -1], made.y[:, 0], atol=1e-6)
