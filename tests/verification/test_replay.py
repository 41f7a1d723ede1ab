"""The replay against motions whose distance and work are known exactly."""

import numpy as np
import pytest

from colloc.gaits.harmonic import ellipse
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.verification.replay import replay


def test_reciprocal_gaits_go_nowhere():
    gait = ellipse(0.0, 0.0, 1.2)
    result = replay(Chain(), Friction(), lambda t: (gait.angles(t), gait.rates(t)), 1e-4, instants=400)
    assert result.distance < 1e-10
    assert result.work > 0.1


def test_a_scallop_with_directional_friction_crawls_and_obeys_the_bound():
    # two links, one joint: mu_b > mu_f makes even a reciprocal motion advance
    body, friction = Chain((0.5, 0.5)), Friction(1.0, 1.0, 5.0)

    def path(t):
        angle = 1.2 + 0.8 * np.cos(2 * np.pi * t)
        return angle[None], (-1.6 * np.pi * np.sin(2 * np.pi * t))[None]

    result = replay(body, friction, path, 1e-4, instants=400)
    assert 0.01 < result.efficiency < 1.0
    assert abs(result.actuator_work / result.work - 1) < 1e-9


def test_error_estimate_covers_the_true_error_and_shrinks_with_the_grid():
    gait = ellipse(0.0, 2.8, 1.3)
    path = lambda t: (gait.angles(t), gait.rates(t))  # noqa: E731
    exact = replay(Chain(), Friction(), path, 1e-4, instants=25600, most_instants=25600).efficiency
    coarse, fine = (replay(Chain(), Friction(), path, 1e-4, instants=n, most_instants=n) for n in (800, 3200))
    for result in (coarse, fine):
        assert abs(result.efficiency / exact - 1) < 20 * result.error + 1e-8
    assert fine.error < 0.3 * coarse.error < 3e-4


def triangle(c, e):
    """Joint one moves, then joint two, then both go back together, at unit rates per leg (a polygon in shape space)."""
    corners = np.array([[c + e, -c], [c, -c], [c, -c - e], [c + e, -c]])

    def path(t):
        leg = np.minimum((3 * t).astype(int), 2)
        step = corners[leg + 1] - corners[leg]
        return (corners[leg] + step * (3 * t - leg)[:, None]).T, 3 * step.T

    return path


@pytest.mark.slow
def test_the_triangle_that_moves_one_joint_at_a_time_reaches_two_fifths():
    values = []
    for e in (0.2, 0.1, 0.05):
        # corners of the polygon must be grid points: 3 divides the number of intervals
        result = replay(Chain(), Friction(), triangle(2.2, e), 1e-9, instants=4800, most_instants=4800, tolerance=1e-9)
        values.append((result.efficiency, result.distance / e, result.work / e))
    efficiency, distance, work = np.array(values[-1])
    assert abs(efficiency - 0.4) < 2e-3
    assert abs(distance - 1 / 12) < 1e-3
    assert abs(work - 5 / 24) < 2e-3
