"""Chains that lie or stand, against points, differences, NumPy and CasADi."""

import numpy as np
import pytest

import colloc
from colloc import Axle, Chain, Elliptic, Foot, Friction, OwnLaw, Pad, Viscous, Wheel, solve_balance
from colloc.mechanics.balance import balance_jacobian, instant, joint_moments, largest_moments
from colloc.mechanics.densities import Instants
from colloc.mechanics.fixed_point import chain_motion, motion_and_derivatives
from colloc.mechanics.native_kernel import native_kernel
from colloc.results.motion import friction_arrows
from tests.shared.mechanics import numpy_instead, random_instants, random_loads, wrench

LENGTHS, SKEW = (0.3, 0.45, 0.25), Friction(mu_t=0.5, mu_f=1, mu_b=2)
ELLIPTIC, AXLE = Elliptic(mu_t=2, mu_f=1, mu_b=1.5), Axle(rolling=0.3, sideways=1.5)
PAIR = (Foot(0, 0.2), Foot(1, 0.3, offset=0.05), Foot(1, 0.3, offset=-0.05), Foot(2, 1.0))
STANDS = {
    "middles": 1,
    "three": 3,
    "offset": PAIR,
    "wheels": tuple(Wheel(link, 0.4, rolling=0.1) for link in range(3)),
    "axles": (Wheel(0, 0.4, axle=True), Foot(1, friction=AXLE), Pad(2, 0.1, 0.6, friction=AXLE)),
    "own laws": (Foot(0), Wheel(1, 0.7, rolling=0.2), Foot(2, 0.1, friction=ELLIPTIC)),
    "pads": (Pad(0, 0.1, 0.6), Pad(1, 0.2, 0.5, offset=0.05), Pad(1, 0.2, 0.5, offset=-0.05), Pad(2)),
    "own pads": (Pad(0, 0.1, 0.6, friction=ELLIPTIC), Pad(1), Pad(2, 0.4, 0.5, friction=SKEW)),
    "mixed": (Foot(0), Pad(1, 0.3, 0.9), Wheel(1, 0.1, rolling=0.2), Pad(2, 0.0, 0.2, friction=SKEW)),
}  # fmt: skip
BODIES = {
    "two links": Chain((0.4, 0.6)),
    "three links": Chain(),
    "four links": Chain((0.3, 0.2, 0.15, 0.35)),
    "weights": Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3)),
    "masses": Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3), masses=(0.1, 0.3, 0.6)),
    **{name: Chain(LENGTHS, feet=feet) for name, feet in STANDS.items()},
    "heavy on feet": Chain(
        (0.2, 0.5, 0.3), masses=(0.3, 0.3, 0.4),
        feet=(Wheel(0, 0.2, rolling=0.5, weight=0.3), Foot(1, 0.6, 0.1, 0.05),
              Foot(1, 0.6, 0.1, -0.05), Foot(2, 0.9, 0.5)),
    ),
}  # fmt: skip
DRY = [Friction(), Friction(mu_t=1.7, mu_f=1, mu_b=1.3), ELLIPTIC]
LAWS = [*DRY, Viscous(), colloc.PowerLaw(0.5), OwnLaw("-vs/speed", "-2*vn/speed"), AXLE]
each_body = pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
each_law = pytest.mark.parametrize("law", LAWS, ids=lambda law: law.label)
each_dry_law = pytest.mark.parametrize("law", [*DRY, AXLE], ids=lambda law: law.label)


def rows(motion):
    return np.vstack([motion.z, motion.centre, motion.power])


@each_body
@each_law
def test_friction_is_the_sum_over_the_points_that_touch(law, body):
    angles, rates = random_instants(4, n_joint=body.n_joint)
    z = np.random.default_rng(2).normal(size=(3, 4))
    said = body.sliding(law, angles, rates, z, 0.05)
    for k in range(4):
        net, power, centre = wrench(body, law, angles[:, k], rates[:, k], z[:, k], 0.05)
        np.testing.assert_allclose(said.force[:, k], net, atol=3e-7 * law.largest)
        assert said.power[0, k] == pytest.approx(power, rel=1e-6)
        assert complex(*said.centre[:, k]) == pytest.approx(centre)
    if body.standing_on and not body.contact.pads:  # as pictures show it
        (x, y), (fx, fy) = friction_arrows(body, law, angles, rates, 0.05, z)
        net = [fx.sum(axis=0), fy.sum(axis=0), (x * fy - y * fx).sum(axis=0)]
        np.testing.assert_allclose(net, said.force, atol=1e-12 * law.largest)


@pytest.mark.parametrize("size", [0.0, 0.3])
@each_body
@each_dry_law
def test_in_balance_no_force_is_left_and_joints_do_what_the_load_does_not(law, body, size):
    angles, rates = random_instants(20, n_joint=body.n_joint)
    held = size * body.law(law).smallest
    load, at = held * random_loads(20, 1.0), (body, law, angles, rates, 1e-3)
    solved = solve_balance(*at, load=load if size else None).require()
    motion = chain_motion(*at, solved, load if size else None)
    for k in range(0, 20, 5):
        moving = angles[:, k], rates[:, k], solved.z[:, k]
        net, power, centre = wrench(body, law, *moving, 1e-3, load[:, k])
        np.testing.assert_allclose(
            net, 0.0, atol=3e-4 if any(p.extent for p in body.contact.parts) else 1e-9
        )
        assert motion.power[k] == pytest.approx(power, rel=1e-3)
        assert complex(*motion.centre[:, k]) == pytest.approx(centre, abs=1e-12)
    np.testing.assert_allclose(motion.z, solved.z, atol=1e-13)
    spent = motion.power - (load * motion.centre).sum(axis=0)
    np.testing.assert_allclose(motion.actuator_power, spent, atol=1e-9)
    now = Instants(*at, z=motion.z, load=load)
    np.testing.assert_allclose(now.power.sum(axis=0), motion.actuator_power, atol=1e-9)
    forces, most = body.forces(law, angles, rates, solved.z, 1e-3), body.contact.largest_forces(law)
    assert (np.abs(forces) <= most * (1 + 1e-12)).all()


NAMES = "two links", "three links", "four links", "weights", "offset", "own pads", "heavy on feet"
DIFFERENTIATED = [(name, law, size) for name in NAMES for law in DRY for size in (0.0, 0.25)]


@pytest.mark.parametrize(
    ("name", "law", "size"), [*DIFFERENTIATED, *(("three links", law, 0.0) for law in LAWS[3:])]
)
def test_derivatives_along_shapes_rates_and_load_are_the_limit_of_differences(name, law, size):
    body, delta, step = BODIES[name], 0.05, 1e-5
    n, at = body.n_joint, random_instants(30, n_joint=body.n_joint)
    y = np.concatenate([*at, random_loads(30, size)] if size else at)

    def moved(y):
        q, r, load = y[:n], y[n : 2 * n], y[2 * n :] if size else None
        solved = solve_balance(body, law, q, r, delta, load=load, tolerance=1e-13)
        at = body, law, q, r, delta, solved, load
        return motion_and_derivatives(*at)

    motion, slopes = moved(y)
    # where a part changes its sense of sliding within the step, a directional law has no derivative
    parts = body.contact.velocities(body.velocity(body.posture(at[0]), at[1], motion.z))
    smooth = (np.abs(parts.vs) > 1e-3).all(axis=0)
    assert smooth.mean() > 0.7
    assert slopes.shape == (6, len(y), 30)
    for k, unit in enumerate(np.eye(len(y))):
        there, back = (rows(moved(y + side * step * unit[:, None])[0]) for side in (1, -1))
        difference = (there - back) / (2 * step)
        np.testing.assert_allclose(slopes[:, k, smooth], difference[:, smooth], atol=2e-6)


@pytest.mark.skipif(native_kernel() is None, reason="no C compiler")
@pytest.mark.parametrize(
    ("delta", "size"), [(1.0, 0.0), (1e-3, 0.3), (1e-4, 0.0), (1e-8, 0.3), (1e-12, 0.0)]
)
@each_body
@each_dry_law
def test_the_kernel_says_what_numpy_and_casadi_say(law, body, delta, size):
    assert native_kernel(body, body.law(law)) is not None
    if delta < 1e-4 and (body.feet or law == AXLE):
        delta = 1e-4  # what two feet or directions hold is known to rounding over delta
    angles, rates = random_instants(20, n_joint=body.n_joint)
    load = random_loads(20, size * body.law(law).smallest) if size else None
    solved = solve_balance(body, law, angles, rates, delta, load=load)
    at = body, law, angles, rates, delta, solved, load
    motion, slopes = motion_and_derivatives(*at)
    with numpy_instead():
        same = solve_balance(body, law, angles, rates, delta, load=load, start=solved.z)
        known, reference = motion_and_derivatives(*at)
    np.testing.assert_allclose(same.z, solved.z, atol=1e-8)
    np.testing.assert_allclose(rows(motion), rows(known), rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion.actuator_power, known.actuator_power, atol=1e-9)
    scale = np.abs(reference).max(axis=(0, 1))
    np.testing.assert_allclose(slopes / scale, reference / scale, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", ["weights", "offset"])
def test_an_associated_law_has_a_symmetric_stiffness_and_the_force_as_gradient(name):
    """Reciprocity: a push here moves there as one there moves here."""
    body, law, (angles, rates) = BODIES[name], ELLIPTIC, random_instants(20)
    z, delta = np.random.default_rng(1).normal(size=(3, 20)), np.full((1, 20), 0.1)
    now = instant(body, law, angles, rates, z, delta)
    matrix = balance_jacobian(body, law, now.posture, now.velocity, delta)
    np.testing.assert_allclose(matrix, np.transpose(matrix, (0, 2, 1)), atol=1e-12)
    assert (np.linalg.eigvalsh(matrix) > 0).all()

    def dissipation(z):
        velocity = instant(body, law, angles, rates, z, delta).velocity
        return body.contact.potential(law, velocity, delta).sum(axis=0)

    force = body.sliding(law, angles, rates, z, delta).force
    for row, unit in enumerate(1e-5 * np.eye(3)):
        slope = (dissipation(z + unit[:, None]) - dissipation(z - unit[:, None])) / 2e-5
        np.testing.assert_allclose(slope, -force[row], atol=1e-8)


@pytest.mark.parametrize(
    "law", [Friction(mu_t=2.0), Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5)], ids=str
)
@each_body
def test_mirror_image_other_end_backward_in_time_and_reversal_move_alike(body, law):
    """From the other end offsets change sides, and backward in time forwards stays forwards."""
    n, (angles, rates) = body.n_link, random_instants(20, n_joint=body.n_joint)
    turned = Chain(
        body.lengths[::-1], weights=body.weights[::-1], masses=body.masses[::-1],
        feet=tuple(foot.from_head(n) for foot in body.standing_on),
    )  # fmt: skip

    def motion(body, q, r):
        return body.motion(law, q, r, 1e-3, solve_balance(body, law, q, r, 1e-3).require())

    known = motion(body, angles, rates)
    mirrored = motion(body, -angles, -rates).z * [[1], [-1], [-1]]
    np.testing.assert_allclose(mirrored, known.z, atol=1e-7)
    other = motion(turned, -angles[::-1], rates[::-1]).power
    np.testing.assert_allclose(other, known.power, rtol=1e-6)
    if body.law(law).reversible:
        np.testing.assert_allclose(-motion(body, angles, -rates).z, known.z, atol=1e-7)


@pytest.mark.parametrize("grade", [0.0, 0.2])
@pytest.mark.parametrize("name", ["three links", "two links", "masses", "offset", "own pads"])
@each_dry_law
def test_moments_of_joints_stay_below_what_friction_and_weight_can_do(law, name, grade):
    body, n = BODIES[name], 400
    friction, (angles, rates) = body.law(law), random_instants(n, n_joint=body.n_joint)
    angles[:, ::2] *= 0.01
    load = random_loads(n, grade) if grade else None
    z = solve_balance(body, friction, angles, rates, 1e-4, load=load).require().z
    moments = joint_moments(body, angles, body.forces(friction, angles, rates, z, 1e-4), load)
    most = largest_moments(body, law, grade)[:, None]
    assert (np.abs(moments) <= most * (1 + 1e-9)).all()
    assert (np.abs(moments).max(axis=1) > 0.2 * most[:, 0]).all(), "the bound says something"
