"""Motion in balance and its derivatives: against central differences, and compiled against
NumPy."""

import numpy as np
import pytest
from shared.instants import random_instants
from shared.kernels import by_both

from colloc import Chain, Friction, solve_balance
from colloc.mechanics.balance import instant, total_power
from colloc.mechanics.chain_motion import chain_motion, motion_derivatives
from colloc.mechanics.native_kernel import native_kernel

BODIES = [Chain((0.4, 0.6)), Chain(), Chain((0.3, 0.2, 0.15, 0.35))]
LAWS = [Friction(), Friction(mu_t=1.7, mu_f=1, mu_b=1.3), Friction(mu_t=0.5, mu_f=1, mu_b=5)]


def rows(motion):
    return np.vstack([motion.z, motion.centre, motion.power])


@pytest.mark.parametrize("law", LAWS, ids=str)
@pytest.mark.parametrize("body", BODIES, ids=lambda b: b.n_link)
def test_the_motion_is_that_of_the_tail_and_joints_do_the_work_of_friction(body, law):
    angles, rates = random_instants(40, n_joint=body.n_joint)
    solved = solve_balance(body, law, angles, rates, 1e-4)
    motion = chain_motion(body, law, angles, rates, 1e-4, solved)
    now = instant(body, law, angles, rates, solved.z, 1e-4)
    np.testing.assert_allclose(motion.z, solved.z, atol=1e-13)
    np.testing.assert_allclose(
        motion.centre, np.vstack(body.centre_velocity(now.posture, now.velocity)), atol=1e-13
    )
    np.testing.assert_allclose(motion.power, total_power(now.velocity, now.force)[0], atol=1e-11)
    np.testing.assert_allclose(motion.actuator_power, motion.power, atol=1e-9)


@pytest.mark.parametrize("law", LAWS, ids=str)
@pytest.mark.parametrize("body", BODIES, ids=lambda b: b.n_link)
def test_slopes_are_the_limit_of_differences(body, law):
    delta, step = 0.05, 1e-5
    angles, rates = random_instants(40, n_joint=body.n_joint)
    solved = solve_balance(body, law, angles, rates, delta, tolerance=1e-13)
    slopes = motion_derivatives(body, law, angles, rates, delta, solved)
    y = np.concatenate([angles, rates])
    # where a link changes its sense of sliding within the step, a directional law has no derivative
    vs = instant(body, law, angles, rates, solved.z, delta).velocity.vs
    smooth = (np.abs(vs) > 1e-3).all(axis=0)
    assert smooth.mean() > 0.7
    for k in range(len(y)):
        ends = []
        for moved in (step, -step):
            a, r = np.split(y + moved * np.eye(len(y))[:, k : k + 1], 2)
            ends.append(
                rows(
                    chain_motion(
                        body,
                        law,
                        a,
                        r,
                        delta,
                        solve_balance(body, law, a, r, delta, start=solved.z, tolerance=1e-13),
                    )
                )
            )
        np.testing.assert_allclose(
            slopes[:, k, smooth], ((ends[0] - ends[1]) / (2 * step))[:, smooth], atol=1e-6
        )


@pytest.mark.skipif(native_kernel() is None, reason="no C compiler")
@pytest.mark.parametrize("delta", [1.0, 1e-4, 1e-12])
@pytest.mark.parametrize("body", BODIES, ids=lambda b: b.n_link)
def test_compiled_slopes_are_those_of_numpy(body, delta):
    angles, rates = random_instants(200, n_joint=body.n_joint)
    for law in LAWS:
        (_, motion, slopes), (_, known, reference) = by_both(body, law, angles, rates, delta)
        np.testing.assert_allclose(rows(motion), rows(known), rtol=0, atol=1e-12)
        np.testing.assert_allclose(slopes, reference, rtol=0, atol=1e-9)
