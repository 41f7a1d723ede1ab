"""Tiny gaits, self-contact, meshes too coarse for delta: certified, or refused in words."""

import numpy as np
import pytest

from colloc import Chain, Friction, Harmonic, Problem, ellipse, replay
from colloc.results.solution import CERTIFICATE_FAILED, SOLVED
from colloc.search.solve import solve
from tests.shared.mechanics import coulomb

BODY = Chain()
BILATERAL = Harmonic(1, "bilateral")
SLOW = (
    pytest.param(law, marks=pytest.mark.slow)
    for law in ((0.01, 1, 1), (1, 0.01, 100), (0.01, 100, 1))
)


def replayed(gait, delta, **settings):
    return replay(BODY, Friction(), gait, delta, **settings)


def test_small_gaits_scale_down_to_amplitude_1e_8():
    """About a shape, distance falls with the amplitude squared, work with the amplitude."""
    sizes = np.array([1e-3, 1e-4, 1e-6, 1e-8])
    runs = [replayed(ellipse(1.0, a, 0.7 * a), 1e-4 * a) for a in sizes]
    np.testing.assert_allclose(
        [r.distance for r in runs] / sizes**2, runs[-1].distance / sizes[-1] ** 2, rtol=2e-3
    )
    np.testing.assert_allclose([r.work for r in runs] / sizes, runs[-1].work / sizes[-1], rtol=2e-3)
    for run in runs:
        assert run.residual < 1e-11
        assert run.actuator_work == pytest.approx(run.work, rel=1e-9)


def test_gaits_slower_than_delta_are_viscous_and_go_nowhere():
    """Linear drag, alike in all directions, sums to the centre of mass' velocity, which is 0."""
    runs = [
        replayed(ellipse(1.0, a, 0.7 * a), 1e-4, instants=200, most_instants=200)
        for a in (1e-6, 1e-7, 1e-8)
    ]
    assert runs[1].work / runs[2].work == pytest.approx(100, rel=1e-4)
    dry = replayed(ellipse(1.0, 1e-6, 0.7e-6), 1e-10)
    # 0.035 amplitude^2, from amplitudes of 1e-2 and 1e-4 too
    assert dry.distance == pytest.approx(3.503e-14, rel=1e-3)
    for run, size in zip(runs, (1e-6, 1e-7, 1e-8), strict=True):
        assert run.distance < 1e-3 * dry.distance * (size / 1e-6) ** 2


@pytest.mark.parametrize(("intervals", "delta"), [(2, 1e-4), (3, 1e-6), (5, 1e-8), (10, 1e-10)])
def test_a_mesh_that_does_not_resolve_delta_fails_its_certificate(intervals, delta):
    """By the replay a wrong efficiency is never called solved, and the message says why."""
    at = {"intervals": intervals, "delta": delta, "mesh_tolerance": 0}
    problem = Problem("coarse", ellipse(0.0, 2.8, 1.3), gait=BILATERAL, **at)
    solution = solve(problem, 1)
    if delta < 1e-9:
        # gradients then carry rounding of 1e-16 / delta: first-order conditions may not be reached
        # to 1e-6
        assert solution.status != SOLVED
        assert solution.message
        return
    assert solution.status == CERTIFICATE_FAILED
    assert "replay gap" in solution.message
    error = abs(solution.answer.efficiency / solution.certificate.efficiency - 1)
    assert error > 1e-4
    # what the certificate itself reports is right: an independent, finer replay agrees with it
    again = replayed(solution.gait, delta, instants=4800, tolerance=1e-7)
    assert again.efficiency == pytest.approx(solution.certificate.efficiency, rel=1e-5)


@pytest.mark.parametrize("law", [(100, 1, 1), (1, 1 + 1e-15, 1), (1, 100, 0.01), *SLOW], ids=str)
def test_extreme_coefficients_are_solved_or_refused(law):
    friction = coulomb(*law)
    at = {"friction": friction, "gait": BILATERAL, "intervals": 12, "delta": 1e-3}
    problem = Problem("extreme", ellipse(0.2, 1.0, 0.6), **at)
    solution = solve(problem, 1)
    if solution.status == SOLVED:
        assert solution.certificate.efficiency <= 1 / friction.smallest
        delta = solution.answer.delta  # lowered where the gait is slow for it
        again = replay(BODY, friction, solution.gait, delta, tolerance=1e-7)
        assert again.efficiency == pytest.approx(solution.efficiency, rel=2e-4)
    else:
        assert len(solution.message) > 30
