"""What no motor of a joint can be asked for: statics, against moments of random instants."""

import numpy as np
import pytest

from colloc import Chain, Elliptic, Foot, Friction, Pad, Wheel, solve_balance
from colloc.mechanics.balance import joint_moments, largest_moments

FEET = (
    Foot(0),
    Wheel(1, rolling=0.3, sideways=2.0),
    Pad(2, 0.2, 0.6),
    Foot(2, 0.8, 0.05, 0.04),
    Foot(2, 0.8, 0.05, -0.04),
)
BODIES = [
    Chain(), Chain((0.5, 0.5)), Chain((0.3, 0.15, 0.1, 0.25, 0.2), weights=(0.1, 0.3, 0.2, 0.3,
    0.1)), Chain(feet=FEET),
    Chain(masses=(0.6, 0.2, 0.2)),
]  # fmt: skip


@pytest.mark.parametrize("grade", [0.0, 0.2])
@pytest.mark.parametrize(
    "law",
    [Friction(), Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5), Elliptic(mu_t=2.0, mu_f=1.0, mu_b=1.5)],
)
@pytest.mark.parametrize("body", BODIES, ids=range(len(BODIES)))
def test_moments_of_joints_stay_below_what_friction_and_weight_can_do(body, law, grade):
    rng, n = np.random.default_rng(1), 400
    angles, rates = rng.uniform(-2.5, 2.5, (body.n_joint, n)), rng.normal(size=(body.n_joint, n))
    angles[:, ::2] *= 0.01
    heading = rng.uniform(0, 2 * np.pi, n)
    load = -grade * np.stack([np.cos(heading), -np.sin(heading)])
    friction = body.law(law)
    z = solve_balance(body, friction, angles, rates, 1e-4, load=load if grade else None).require().z
    forces = body.forces(friction, angles, rates, z, 1e-4)
    moments = np.abs(joint_moments(body, angles, forces, load))
    most = largest_moments(body, law, grade)
    assert (moments <= most[:, None] * (1 + 1e-9)).all()
    assert (moments.max(axis=1) > 0.2 * most).all(), "the bound says something"
