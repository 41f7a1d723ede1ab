"""What joints have to do and can do: idling, braking, torques of either sign."""

import numpy as np
import pytest
from shared.instants import random_instants

from colloc import Chain, Foot, Fourier, Friction, Harmonic, PowerLaw, Problem, Viscous, replay
from colloc.mechanics.balance import joint_moments, largest_moments
from colloc.mechanics.densities import DRIVEN_WORK, Instants, PathLimits, torque_and_power
from colloc.transcription.full_program import ACTUATORS
from tests.shared.stages import program_of

ONE = PathLimits(torque_and_power((1.0, 1.0), (1.0, 1.0)))
BODY, LAW = Chain((0.2, 0.5, 0.3), weights=(0.3, 0.3, 0.4)), Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)


@pytest.mark.parametrize(
    "law",
    [LAW, PowerLaw(0.5, mu_t=2.0, mu_f=1.0, mu_b=1.0), Viscous(normal=2, tangential=1)],
    ids=str,
)
def test_a_joint_that_idles_counts_as_driven_by_half_of_what_delta_hides(law):
    """So the driven power is smooth there: half of any power is gained, whichever way."""
    (angles, rates), delta = random_instants(20), 1e-2
    idle = law.largest * delta ** (1 + law.degree)
    forces = BODY.forces(law, angles, rates, np.zeros((3, 20)), delta)
    moments = joint_moments(BODY, angles, forces)

    def driven(share):
        return DRIVEN_WORK.at(Instants(BODY, law, angles, share * rates, delta, moments=moments))[0]

    np.testing.assert_allclose(driven(0.0), 2 * 0.5 * idle, rtol=1e-12)
    h = 1e-5 * idle
    slope = (driven(h) - driven(-h)) / (2 * h)
    power = Instants(BODY, law, angles, rates, delta, moments=moments).power.sum(axis=0)
    np.testing.assert_allclose(slope, 0.5 * power, rtol=1e-6)


def test_a_joint_holds_no_more_than_friction_and_a_slope_pull_on_its_lighter_side():
    """Both across a straight body: at the middles of its links, or at its feet."""
    bound = largest_moments(Chain(masses=(0.2, 0.3, 0.5)), Friction(mu_t=2.0), 0.3)
    assert bound == pytest.approx([(2.0 / 3 + 0.3 * mass) / 6 for mass in (0.2, 0.5)])
    aside = [Foot(0, 0.8, offset=side * 0.2) for side in (1, -1)]
    bound = largest_moments(Chain((0.5, 0.5), feet=[*aside, Foot(1, 0.9)]), Friction(), 0.3)
    assert bound == pytest.approx([0.5 * (0.1 + 0.2) + 0.3 * 0.5 * 0.25])


def test_torques_are_limited_both_ways_and_powers_one_way():
    """In the program's bounds and in a replay: a gait in a mirror needs the same torques."""
    np.testing.assert_array_equal(ONE.least, [-1.0, -1.0, -np.inf, -np.inf])
    limits = {"torque_limit": 0.1, "power_limit": 0.5}
    program = program_of(Problem("limited", gait=Harmonic(1), intervals=6, **limits))
    rows = program.groups[ACTUATORS]
    assert set(program.row_upper[rows]) == {1.0}
    assert sorted(set(program.row_lower[rows])) == [-np.inf, -1.0]
    assert np.mean(program.row_lower[rows] == -1.0) == 0.5
    gait = Fourier([0.5, 0.2], [[1.2], [0.3]], [[0.2], [1.0]])
    mirrored = Fourier(-gait.mean, -gait.cos, -gait.sin)
    t = np.arange(400) / 400
    at = LAW, gait.angles(t), gait.rates(t)
    signed = joint_moments(BODY, at[1], BODY.forces(*at, BODY.solve(*at, 1e-2).z, 1e-2))
    # which is what makes a difference here
    assert np.abs(signed.max(axis=1) + signed.min(axis=1)).max() > 0.01
    found, other = (
        replay(BODY, LAW, each, 1e-2, instants=400, limits=ONE, tolerance=1e-4).shares
        for each in (gait, mirrored)
    )
    np.testing.assert_allclose(found, other, rtol=1e-9)
    np.testing.assert_allclose(found[:2], np.abs(signed).max(axis=1), rtol=1e-2)
