"""The velocity map: features, symmetries, scaling, and convergence to direct solves."""

import numpy as np
import pytest

from colloc import Chain, Friction, solve_balance
from scripts.models.velocity_map import STENCILS, VelocityMap, map_error, velocity_map

DELTA = 1e-3


@pytest.fixture(scope="module")
def isotropic() -> VelocityMap:
    return velocity_map(Chain(), Friction(), DELTA, n_angle=16, n_ratio=17)


@pytest.fixture(scope="module")
def directional() -> VelocityMap:
    return velocity_map(
        Chain((0.25, 0.45, 0.3)),
        Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3),
        DELTA,
        n_angle=12,
        n_ratio=13,
    )


@pytest.mark.parametrize("method", STENCILS)
@pytest.mark.parametrize("which", ["isotropic", "directional"])
def test_nodes_are_reproduced_on_every_face(which, method, request):
    made = request.getfixturevalue(which)
    rng = np.random.default_rng(3)
    i, j = rng.integers(made.n_angle, size=(2, 60))
    k = rng.integers(made.n_ratio, size=60)
    angles = np.stack([made.angles[i], made.angles[j]])
    ratio = made.ratios[k]
    for leading, sign in ((0, 1), (1, 1), (0, -1), (1, -1)):
        rates = np.empty_like(angles)
        rates[leading], rates[1 - leading] = sign, sign * ratio
        direct = solve_balance(made.body, made.friction, angles, rates, DELTA).z
        # at |ratio| = 1 either face may serve; both hold the same solution
        np.testing.assert_allclose(
            made.tail_velocity(angles, rates, method=method), direct, atol=1e-7
        )


def test_map_is_homogeneous_and_periodic(isotropic):
    rng = np.random.default_rng(4)
    angles, rates = rng.uniform(-np.pi, np.pi, (2, 200)), rng.normal(size=(2, 200))
    z = isotropic.tail_velocity(angles, rates)
    np.testing.assert_allclose(
        isotropic.tail_velocity(angles, 7.3 * rates), 7.3 * z, rtol=1e-12, atol=1e-13
    )
    np.testing.assert_allclose(isotropic.tail_velocity(angles, -rates), -z, rtol=0, atol=1e-14)
    np.testing.assert_allclose(isotropic.tail_velocity(angles + 2 * np.pi, rates), z, atol=1e-11)


@pytest.mark.parametrize(("method", "order"), [("linear", 1.5), ("cubic", 2.5)])
def test_median_error_falls_with_resolution(method, order, isotropic):
    """Away from kinks the stencils show their orders (2 and 4, less the kinks)."""
    finer = velocity_map(Chain(), Friction(), DELTA, n_angle=32, n_ratio=33)
    coarse, fine = (map_error(m, method=method, samples=4000, seed=8) for m in (isotropic, finer))
    assert np.log2(coarse.median / fine.median) > order
    assert np.log2(coarse.rms / fine.rms) > 1.2  # kinks dominate
    assert fine.largest < 0.03


def test_four_faces_if_backward_friction_differs(directional):
    assert directional.values.shape[0] == 4
    angles = np.array([[0.7], [-0.9]])
    rates = np.array([[1.0], [0.4]])
    forth, back = (
        directional.tail_velocity(angles, rates),
        directional.tail_velocity(angles, -rates),
    )
    assert np.abs(forth + back).max() > 1e-3  # not simply reversed
    assert map_error(directional, samples=2000).rms < 5e-3


def test_kink_where_a_joint_rests():
    """A joint at rest, the other bent sharply: two links rest, and the velocity has a kink on ratio
    = 0, kept on nodes."""
    angles = np.array([[0.75 * np.pi], [0.0]])

    def omega(ratio: float) -> float:
        rates = np.array([[1.0], [ratio]])
        return float(solve_balance(Chain(), Friction(), angles, rates, 1e-8).require().z[2, 0])

    assert abs(omega(0.0) + 1) < 1e-6  # the tail link alone turns, against joint 1
    jumps = [(omega(h) - omega(0.0)) / h - (omega(0.0) - omega(-h)) / h for h in (1e-2, 1e-3, 1e-4)]
    assert abs(jumps[2]) > 0.05
    assert jumps[1] == pytest.approx(jumps[2], rel=0.1)  # a smooth function's would fall with h
    assert 0.0 in velocity_map(Chain(), Friction(), DELTA, n_angle=4, n_ratio=5).ratios
