"""Joint angles over time: what a limit on the joint speeds does to the period, at an even pace and
at any."""

import numpy as np
import pytest

from colloc import Fourier
from colloc.verification.trajectory import plan_trajectory

GAIT = Fourier([0.3, -0.2], [[1.2], [0.3]], [[0.2], [1.0]])


@pytest.mark.parametrize("limits", [2.0, (2.0, 1.5)])
def test_at_the_gait_s_own_pace_the_fastest_instant_decides_and_the_clock_is_even(limits):
    even, free = (
        plan_trajectory(GAIT, 400.0, limits=limits, keep_pace=keep) for keep in (True, False)
    )
    most = np.broadcast_to(limits, 2)
    fastest = (np.abs(GAIT.rates(np.linspace(0, 1, 4001))).max(axis=1) / most).max()
    assert even.period == pytest.approx(fastest, abs=1 / 400)
    np.testing.assert_allclose(even.phase, even.time / even.period, atol=1e-9)
    assert free.period < 0.95 * even.period
    for found in (even, free):
        steps = np.diff(found.angles, axis=1, append=found.angles[:, :1]) * 400.0
        assert (np.abs(steps).max(axis=1) <= most * (1 + 1e-6)).all()


def test_at_the_gait_s_own_pace_speeds_are_its_own():
    found = plan_trajectory(GAIT, 400.0, limits=2.0, keep_pace=True)
    np.testing.assert_allclose(found.speeds, GAIT.rates(found.phase) / found.period, atol=1e-6)
