"""What holds for every body, friction, shape and rate, on derandomised cases of hypothesis."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from colloc import Chain, Friction, solve_balance
from colloc.mechanics.balance import balance_jacobian, instant, total_power

tried = settings(derandomize=True, max_examples=60, deadline=None, database=None)
PI = np.pi
special = st.sampled_from([0.0, PI, -PI, PI / 2, -PI / 2, 2 * PI / 3, 1e-9, -1e-9])
angle = st.one_of(st.floats(-PI, PI, allow_subnormal=False), special)
rate = st.one_of(
    st.floats(-1.0, 1.0, allow_subnormal=False), st.sampled_from([0.0, 1.0, -1.0, 1e-9, -1e-12])
)
log_delta = st.floats(-12, 0)
coefficient = st.floats(-1, 1).map(lambda e: 10.0**e)
friction = st.one_of(
    st.just(Friction()), st.builds(Friction, mu_t=coefficient, mu_f=coefficient, mu_b=coefficient)
)


@st.composite
def instants(draw, n_joint=None):
    """A body of 2 to 5 links with angles and rates ``(n_joint, 1)``; the largest rate is 1."""
    n = draw(st.integers(1, 4)) if n_joint is None else n_joint
    weights = np.array(draw(st.lists(st.floats(0.1, 1.0), min_size=n + 1, max_size=n + 1)))
    lengths = weights / weights.sum()
    lengths[-1] = 1 - lengths[:-1].sum()
    angles, rates = (
        np.array(draw(st.lists(kind, min_size=n, max_size=n)))[:, None] for kind in (angle, rate)
    )
    largest = np.abs(rates).max()
    assume(largest > 1e-3)
    return Chain(tuple(lengths)), angles, rates / largest


def solved(body, law, angles, rates, delta):
    return solve_balance(body, law, angles, rates, delta).require().z


def allowed(body, law, angles, rates, delta):
    """How far two solutions with residuals below 1e-11 may lie apart, by the inverse of the
    balance's derivative: far where two links turn oppositely about a common end, as there any
    split of the rate between them balances."""
    z = solved(body, law, angles, rates, delta)
    now = instant(body, law, angles, rates, z, delta)
    slope = balance_jacobian(body, law, now.posture, now.velocity, np.array([[delta]]))[0]
    return 1e-9 + 1e-10 * law.largest * np.linalg.norm(np.linalg.inv(slope), 2)


@tried
@given(instants(), friction, log_delta)
def test_a_link_cut_by_a_frozen_joint_moves_as_before(case, law, exponent):
    body, angles, rates = case
    first, *rest = body.lengths
    cut = Chain((0.3 * first, first - 0.3 * first, *rest))
    still = np.zeros((1, 1))
    one = solved(body, law, angles, rates, 10.0**exponent)
    longer = (np.concatenate([still, each]) for each in (angles, rates))
    other = solved(cut, law, *longer, 10.0**exponent)
    np.testing.assert_allclose(other, one, atol=allowed(body, law, angles, rates, 10.0**exponent))


@tried
@given(instants(), friction, log_delta)
def test_dissipation_is_at_least_the_smallest_coefficient_times_the_speed(case, law, exponent):
    """v^2/r >= |v| - delta at every point; the mean |v| is at least the centre of mass' speed."""
    body, angles, rates = case
    delta = 10.0**exponent
    z = solved(body, law, angles, rates, delta)
    assert np.abs(z).max() < 10  # the body follows its joints: nothing outruns unit rates by much
    now = instant(body, law, angles, rates, z, delta)
    speed = np.hypot(*body.centre_velocity(now.posture, now.velocity)).item()
    power = total_power(now.velocity, now.force).item()
    assert power >= law.smallest * (speed - delta) - 1e-9 * law.largest
    assert power >= 0
