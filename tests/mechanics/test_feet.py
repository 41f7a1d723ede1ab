"""Feet and wheels: friction at points of the links, held against programs of its own, identities
and limits."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import root
from shared.instants import random_instants
from shared.kernels import by_both

from colloc import (
    Chain,
    Elliptic,
    Foot,
    Friction,
    OwnLaw,
    Pad,
    PowerLaw,
    Problem,
    ProblemError,
    Viscous,
    Wheel,
    solve_balance,
)
from colloc.mechanics.actuators import joint_moments
from colloc.mechanics.balance import net_force, total_power
from colloc.mechanics.chain_motion import motion_derivatives
from colloc.mechanics.native_kernel import native_kernel, numpy_instead

LENGTHS = (0.3, 0.45, 0.25)
PAIR = (Foot(0, 0.2), Foot(1, 0.3, offset=0.05), Foot(1, 0.3, offset=-0.05), Foot(2, 1.0))
WHEELS = tuple(Wheel(link, 0.4, rolling=0.1) for link in range(3))
MIXED = (
    Foot(0),
    Wheel(1, 0.7, rolling=0.2, sideways=2.0),
    Foot(2, 0.1, friction=Elliptic(mu_t=2, mu_f=1, mu_b=1.5)),
)
STANDS = {"middles": 1, "three": 3, "offset": PAIR, "wheels": WHEELS, "mixed": MIXED}
PADDED = {
    "pads": tuple(Pad(link, 0.25, 0.75) for link in range(3)),
    "pads and a wheel": (Pad(0, 0.2, 0.8), Pad(1, 0, 1), Wheel(2, 0.5)),
}
LAWS = [
    Friction(),
    Friction(mu_t=1.7, mu_f=1, mu_b=1.3),
    Elliptic(mu_t=2, mu_f=1, mu_b=1.5),
    Viscous(),
    PowerLaw(0.5),
    OwnLaw("-vs/speed", "-2*vn/speed"),
]


def feet_in_the_lab(body, angles, rates, z):
    """Of one instant, by complex numbers: positions from the tail, velocities, and directions of
    the feet."""
    phi, w = np.cumsum([0.0, *angles]), z[2] + np.cumsum([0.0, *rates])
    step = np.array(body.lengths) * np.exp(1j * phi)
    starts = np.concatenate([[0.0], np.cumsum(step)[:-1]])
    moves = z[0] + 1j * z[1] + np.concatenate([[0.0], np.cumsum(1j * w * step)[:-1]])
    links = [foot.link for foot in body.feet]
    arm = np.array(
        [step[f.link] * f.place + 1j * f.offset * np.exp(1j * phi[f.link]) for f in body.feet]
    )
    turn = np.exp(1j * (phi[links] + [f.angle for f in body.feet]))
    return starts[links] + arm, moves[links] + 1j * w[links] * arm, turn


def wrench(body, law, angles, rates, z, delta):
    """Net force and torque about the tail of the friction at the feet, and its power."""
    at, velocity, turn = feet_in_the_lab(body, angles, rates, z)
    own = velocity / turn
    force = np.empty(len(at), dtype=complex)
    for i, foot in enumerate(body.feet):
        fs, fn = (foot.friction or law).density(
            *(np.array([[part]]) for part in (own[i].real, own[i].imag, delta))
        )
        force[i] = foot.weight * (fs.item() + 1j * fn.item()) * turn[i]
    total, torque = force.sum(), (at.conj() * force).imag.sum()
    return np.array([total.real, total.imag, torque]), -(force * velocity.conj()).real.sum()


@pytest.mark.parametrize("feet", STANDS.values(), ids=STANDS)
def test_the_balance_is_that_of_a_program_of_its_own(feet):
    body, law, (angles, rates) = (
        Chain(LENGTHS, feet=feet),
        Friction(mu_t=1.7, mu_f=1, mu_b=1.3),
        random_instants(8),
    )
    solved = solve_balance(body, law, angles, rates, 1e-2).require()
    power = body.motion(law, angles, rates, 1e-2, solved).power
    for k in range(8):
        net, spent = wrench(body, law, angles[:, k], rates[:, k], solved.z[:, k], 1e-2)
        np.testing.assert_allclose(net, 0.0, atol=1e-10)
        assert spent == pytest.approx(power[k])
    own = root(
        lambda z: wrench(body, law, angles[:, 0], rates[:, 0], z, 1.0)[0], np.zeros(3), tol=1e-13
    )
    np.testing.assert_allclose(
        solve_balance(body, law, angles[:, :1], rates[:, :1], 1.0).z[:, 0], own.x, atol=1e-8
    )


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__ + str(law.associated))
def test_many_feet_are_a_line_to_second_order_in_their_distance(law):
    angles, rates = random_instants(20)
    z = np.random.default_rng(1).normal(size=(3, 20))
    line = Chain(LENGTHS).sliding(law, angles, rates, z, 0.3)
    errors = [
        np.abs(Chain(LENGTHS, feet=n).sliding(law, angles, rates, z, 0.3).force - line.force).max()
        for n in (5, 10, 20)
    ]
    assert errors[1] < 0.3 * errors[0]
    assert errors[2] < 0.3 * errors[1] < 1e-3 * law.largest


@pytest.mark.parametrize("feet", {**STANDS, **PADDED}.values(), ids={**STANDS, **PADDED})
@pytest.mark.parametrize("law", LAWS[:3], ids=["isotropic", "unequal", "elliptic"])
def test_joints_do_the_work_that_friction_takes(law, feet):
    body, (angles, rates) = Chain(LENGTHS, feet=feet), random_instants(30)
    solved = solve_balance(body, law, angles, rates, 1e-3).require()
    motion = body.motion(law, angles, rates, 1e-3, solved)
    np.testing.assert_allclose(motion.actuator_power, motion.power, rtol=1e-9, atol=1e-10)
    forces = body.forces(law, angles, rates, solved.z, 1e-3)
    posture = body.posture(angles)
    on_links = body.contact.on_links(forces)
    power = total_power(body.velocity(posture, rates, solved.z), on_links)
    np.testing.assert_allclose(power[0], motion.power, rtol=1e-10)
    np.testing.assert_allclose(net_force(posture, on_links), 0.0, atol=1e-10)
    assert (np.abs(forces) <= body.contact.largest_forces(law) * (1 + 1e-12)).all()


def test_the_stiffness_of_an_associated_law_is_symmetric():
    """Reciprocity: a push here moves there as one there moves here."""
    from colloc.mechanics.balance import balance_jacobian, dissipation_potential, instant

    body, law, (angles, rates) = (
        Chain(LENGTHS, feet=PAIR),
        Elliptic(mu_t=2, mu_f=1, mu_b=1.5),
        random_instants(20),
    )
    z, delta = np.random.default_rng(1).normal(size=(3, 20)), np.full((1, 20), 0.1)
    now = instant(body, law, angles, rates, z, delta)
    matrix = balance_jacobian(body, law, now.posture, now.velocity, delta)
    np.testing.assert_allclose(matrix, np.transpose(matrix, (0, 2, 1)), atol=1e-12)
    assert (np.linalg.eigvalsh(matrix) > 0).all()
    # and the gradient of the dissipation is minus the net force
    for row, unit in enumerate(np.eye(3)):
        values = [
            dissipation_potential(
                body,
                law,
                instant(body, law, angles, rates, z + s * unit[:, None], delta).velocity,
                delta,
            )
            for s in (1e-5, -1e-5)
        ]
        slope = (values[0] - values[1]) / 2e-5
        np.testing.assert_allclose(
            slope, -body.sliding(law, angles, rates, z, delta).force[row], atol=1e-8
        )


@pytest.mark.parametrize("feet", STANDS.values(), ids=STANDS)
def test_mirror_image_other_end_and_reversal_move_alike(feet):
    law, (angles, rates) = Friction(mu_t=2.0, mu_f=1.0, mu_b=1.0), random_instants(30)
    body = Chain(LENGTHS, feet=feet)
    turned = Chain(LENGTHS[::-1], feet=tuple(foot.from_head(3) for foot in body.feet))

    def power(body, q, r):
        return body.motion(law, q, r, 1e-3, solve_balance(body, law, q, r, 1e-3).require())

    known = power(body, angles, rates)
    np.testing.assert_allclose(
        power(body, -angles, -rates).z * [[1], [-1], [-1]], known.z, atol=1e-7
    )
    np.testing.assert_allclose(
        power(turned, -angles[::-1], rates[::-1]).power, known.power, rtol=1e-6
    )
    if body.law(law).reversible:
        np.testing.assert_allclose(-power(body, angles, -rates).z, known.z, atol=1e-7)
        np.testing.assert_allclose(
            power(turned, -angles[::-1], -rates[::-1]).power, known.power, rtol=1e-6
        )


@pytest.mark.parametrize("feet", STANDS.values(), ids=STANDS)
def test_slopes_are_differences(feet):
    body, law, (angles, rates) = (
        Chain(LENGTHS, feet=feet),
        Friction(mu_t=2.0, mu_f=1.0, mu_b=1.0),
        random_instants(5),
    )

    def values(q, r):
        motion = body.motion(law, q, r, 1e-2, solve_balance(body, law, q, r, 1e-2, tolerance=1e-13))
        return np.concatenate([motion.z, motion.centre, motion.power[None]])

    slopes = motion_derivatives(
        body, law, angles, rates, 1e-2, solve_balance(body, law, angles, rates, 1e-2)
    )
    for column, unit in enumerate(np.eye(4)):
        q, r = 1e-6 * unit[:2, None], 1e-6 * unit[2:, None]
        difference = (values(angles + q, rates + r) - values(angles - q, rates - r)) / 2e-6
        np.testing.assert_allclose(slopes[:, column], difference, atol=1e-6 * np.abs(slopes).max())


@pytest.mark.parametrize("feet", STANDS.values(), ids=STANDS)
def test_casadi_says_the_same(feet):
    body, law, (angles, rates) = (
        Chain(LENGTHS, feet=feet),
        Friction(mu_t=1.7, mu_f=1, mu_b=1.3),
        random_instants(1),
    )
    rng = np.random.default_rng(3)
    given = (
        angles,
        rates,
        rng.normal(size=(3, 1)),
        rng.normal(size=(len(body.contact.force_names), 1)),
        np.array([[0.01]]),
    )
    symbols = [ca.SX.sym("x", len(part)) for part in given]

    def said(q, r, z, f, delta):
        return [
            joint_moments(body, q, f),
            *body.sliding(law, q, r, z, delta),
            body.forces(law, q, r, z, delta),
        ]

    for own, theirs in zip(
        ca.Function("f", symbols, said(*symbols))(*given), said(*given), strict=True
    ):
        np.testing.assert_allclose(np.array(own), theirs, rtol=1e-12, atol=1e-14)


def wheels_that_do_not_slip(body, angles, rates):
    """Tail velocity of one instant: no wheel moves across its rolling direction."""

    def across(z):
        _, velocity, turn = feet_in_the_lab(body, angles, rates, z)
        return (velocity / turn).imag

    rest = across(np.zeros(3))
    return np.linalg.solve(np.transpose([across(unit) - rest for unit in np.eye(3)]), -rest)


def test_a_wheeled_snake_tends_to_its_nonholonomic_kinematics_like_rolling_over_sideways_friction():
    angles, rates = (
        np.array([[0.9, -0.4, 0.3], [0.2, -1.1, 1.4]]),
        np.array([[1.0, -0.5, 0.8], [-0.6, 1.2, 0.4]]),
    )
    errors = []
    for sideways in (1e2, 1e3, 1e4):
        body = Chain(
            feet=tuple(Wheel(link, rolling=0.02, sideways=0.02 * sideways) for link in range(3))
        )
        z = solve_balance(body, Friction(), angles, rates, 1e-9).require().z
        known = np.transpose(
            [wheels_that_do_not_slip(body, q, r) for q, r in zip(angles.T, rates.T, strict=True)]
        )
        errors.append(np.abs(z - known).max())
    orders = np.log10(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 1.0, atol=0.1)
    assert errors[-1] < 2e-3


def test_a_wheel_turned_by_a_right_angle_swaps_its_coefficients():
    angles, rates = random_instants(20)
    one, other = (
        solve_balance(
            Chain(feet=tuple(Wheel(i, **how) for i in range(3))), Friction(), angles, rates, 1e-3
        )
        .require()
        .z
        for how in (
            {"rolling": 0.1, "sideways": 1.0},
            {"rolling": 1.0, "sideways": 0.1, "angle": np.pi / 2},
        )
    )
    np.testing.assert_allclose(one, other, atol=1e-8)


def test_a_body_on_feet_at_both_ends_of_one_stiff_link_keeps_that_link_where_it_is():
    """A carried link is swung freely."""
    angles, rates = random_instants(10)
    body = Chain(feet=(Foot(0, 0.0, 0.5), Foot(0, 1.0, 0.5)))
    np.testing.assert_allclose(
        solve_balance(body, Friction(), angles, rates, 1e-6).require().z, 0.0, atol=1e-12
    )


@pytest.mark.parametrize(
    ("feet", "sentence"),
    [
        ((Foot(0), Foot(3)), "numbered 0 to 2"),
        ((Foot(0, weight=0.5), Foot(2, weight=0.4)), "add up to 1, not 0.9"),
        ((Foot(0, 1.0, 0.5), Foot(1, 0.0, 0.5)), "at two points at least"),
        ((Foot(0), Foot(2)), "no foot is on link 1"),
        ((Foot(0, weight=1.0),), "two points"),
        ((Foot(0), Foot(1, offset=0.1), Foot(2)), "left and right"),
        ((Foot(0), Wheel(1, angle=0.3), Foot(2)), "left and right"),
        ((Foot(0, 0.2, 1 / 3), Foot(0), Foot(1), Foot(2)), "bear all that it weighs"),
        (-1, "0 \\(a line\\) to"),
        ("many", "sequence of Foot"),
        (0.5, "sequence of Foot"),
    ],
    ids=str,
)
def test_feet_that_no_body_can_have_are_refused_in_a_sentence(feet, sentence):
    with pytest.raises(ProblemError, match=sentence):
        Chain(feet=feet)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"link": 0, "place": 1.2}, "must lie on its link"),
        ({"link": 0, "place": float("nan")}, "must lie on its link"),
        ({"link": 0.5}, "whole number"),
        ({"link": 0, "weight": 0.0}, "positive part"),
        ({"link": 0, "offset": float("inf")}, "offset of a foot"),
        ({"link": 0, "friction": "oil"}, "law of friction"),
        ({"link": 0, "plaze": 0.5}, "did you mean place"),
    ],
    ids=str,
)
def test_a_foot_that_cannot_be_is_refused_in_a_sentence(arguments, sentence):
    with pytest.raises(ProblemError, match=sentence):
        Foot(**arguments)


def test_no_feet_is_the_line():
    assert Chain(feet=0) == Chain()
    assert len(Chain(feet=()).contact.force_names) == 9


@pytest.mark.parametrize("feet", STANDS.values(), ids=STANDS)
def test_files_hold_feet(feet):
    problem = Problem("stands", body=Chain(LENGTHS, feet=feet))
    again = Problem.from_dict(problem.to_dict())
    assert again.body == problem.body
    assert again.hash == problem.hash
    assert again.law == problem.law


def test_symmetries_need_symmetric_feet():
    assert "bilateral" in Chain(feet=2).symmetries
    assert "bilateral" in Chain(feet=(Foot(0, 0.1), Foot(1), Foot(2, 0.9))).symmetries
    assert "bilateral" not in Chain(feet=(Foot(0, 0.1), Foot(1), Foot(2, 0.1))).symmetries
    assert "bilateral" not in Chain(feet=(Wheel(0), Foot(1), Foot(2))).symmetries


@pytest.mark.skipif(native_kernel() is None, reason="no C compiler")
@pytest.mark.parametrize("feet", STANDS.values(), ids=STANDS)
@pytest.mark.parametrize("law", LAWS[:3], ids=["isotropic", "unequal", "elliptic"])
def test_compiled_balances_and_slopes_are_those_of_numpy(law, feet):
    body, (angles, rates) = Chain(LENGTHS, feet=feet), random_instants(60)
    assert native_kernel(body, body.law(law)) is not None
    (z, motion, slopes), (same_z, known, reference) = by_both(body, law, angles, rates, 1e-3)
    np.testing.assert_allclose(same_z, z, atol=1e-8)
    np.testing.assert_allclose(motion.centre, known.centre, atol=1e-11)
    np.testing.assert_allclose(motion.actuator_power, motion.power, atol=1e-9)
    np.testing.assert_allclose(slopes, reference, atol=1e-8)


def test_feet_nearly_on_a_line_are_balanced_where_the_residual_must_rise_before_it_falls():
    bend = np.geomspace(1e-6, 0.1, 400)
    at = (
        Chain((0.5, 0.5), feet=2),
        Friction(mu_t=1, mu_f=1, mu_b=3),
        np.stack([[*bend, *-bend]]),
        np.ones((1, 800)),
        5e-6,
    )
    solved = solve_balance(*at).require()
    net = [
        wrench(*at[:2], at[2][:, k], at[3][:, k], solved.z[:, k], 5e-6)[0]
        for k in range(0, 800, 40)
    ]
    np.testing.assert_allclose(net, 0.0, atol=3e-9)  # rounding of velocities, over delta
    assert (solve_balance(*at, method="direct").residual > 1e-9).any()
    with numpy_instead():
        solve_balance(*at[:2], *(a[:, ::20] for a in at[2:4]), 5e-6).require()


def test_laws_that_the_kernel_does_not_know_at_points_are_left_to_numpy():
    for body, law in (
        (Chain(feet=1), Viscous()),
        (Chain(feet=(*WHEELS[:2], Foot(2, 0.4))), PowerLaw(0.5)),
    ):
        assert native_kernel(body, body.law(law)) is None
