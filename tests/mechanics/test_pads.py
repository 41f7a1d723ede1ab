"""Pads: even pressure between two places of a link, held against many points, the line that it
generalises, and identities."""

import casadi as ca
import numpy as np
import pytest
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
from colloc.mechanics.native_kernel import native_kernel
from colloc.results.body_marks import footprints

LENGTHS = (0.3, 0.45, 0.25)
WEIGHTS = (0.2, 0.5, 0.3)
PADS = (
    Pad(0, 0.1, 0.6),
    Pad(1, 0.2, 0.5, offset=0.05),
    Pad(1, 0.2, 0.5, offset=-0.05),
    Pad(2, 0.0, 1.0),
)
OWN = (
    Pad(0, 0.1, 0.6, friction=Elliptic(mu_t=2, mu_f=1, mu_b=1.5)),
    Pad(1),
    Pad(2, 0.4, 0.5, friction=Friction(mu_t=0.5, mu_f=1, mu_b=2)),
)
MIXED = (
    Foot(0),
    Pad(1, 0.3, 0.9),
    Wheel(1, 0.1, rolling=0.2),
    Pad(2, 0.0, 0.2, friction=Friction(mu_t=0.5, mu_f=1, mu_b=2)),
)
STANDS = {"pads": PADS, "own": OWN, "mixed": MIXED}
LAWS = [
    Friction(),
    Friction(mu_t=1.7, mu_f=1, mu_b=1.3),
    Elliptic(mu_t=2, mu_f=1, mu_b=1.5),
    Viscous(),
    PowerLaw(0.5),
    OwnLaw("-vs/speed", "-2*vn/speed"),
]
names = {"ids": lambda law: type(law).__name__ + str(law.associated)}


def dense_wrench(body, law, angles, rates, z, delta, count=4000):
    """Net force and torque about the tail, and power: sums over points in the lab, by complex
    numbers."""
    phi, w = np.cumsum([0.0, *angles]), z[2] + np.cumsum([0.0, *rates])
    step = np.array(body.lengths) * np.exp(1j * phi)
    starts = np.concatenate([[0.0], np.cumsum(step)[:-1]])
    moves = z[0] + 1j * z[1] + np.concatenate([[0.0], np.cumsum(1j * w * step)[:-1]])
    net, torque, power = 0.0, 0.0, 0.0
    for part in body.feet:
        many = count if part.extent else 1
        place = part.place + part.extent * ((np.arange(many) + 0.5) / many - 0.5)
        arm = step[part.link] * place + 1j * part.offset * np.exp(1j * phi[part.link])
        velocity, turn = (
            moves[part.link] + 1j * w[part.link] * arm,
            np.exp(1j * (phi[part.link] + part.angle)),
        )
        own = velocity / turn
        fs, fn = (part.friction or law).density(own.real[None], own.imag[None], np.array([[delta]]))
        force = part.weight / many * (fs[0] + 1j * fn[0]) * turn
        net, torque = (
            net + force.sum(),
            torque + ((starts[part.link] + arm).conj() * force).imag.sum(),
        )
        power -= (force * velocity.conj()).real.sum()
    return np.array([net.real, net.imag, torque]), power


@pytest.mark.parametrize("feet", STANDS.values(), ids=STANDS)
@pytest.mark.parametrize("law", LAWS, **names)
def test_a_pad_is_many_points(law, feet):
    body, (angles, rates) = Chain(LENGTHS, feet=feet), random_instants(6)
    z = np.random.default_rng(2).normal(size=(3, 6))
    said = body.sliding(law, angles, rates, z, 0.05)
    for k in range(6):
        net, power = dense_wrench(body, law, angles[:, k], rates[:, k], z[:, k], 0.05)
        np.testing.assert_allclose(said.force[:, k], net, atol=3e-7 * law.largest)
        assert said.power[0, k] == pytest.approx(power, rel=1e-6)


@pytest.mark.parametrize("feet", STANDS.values(), ids=STANDS)
def test_the_balance_on_pads_is_one_for_many_points(feet):
    body, law, (angles, rates) = (
        Chain(LENGTHS, feet=feet),
        Friction(mu_t=1.7, mu_f=1, mu_b=1.3),
        random_instants(8),
    )
    z = solve_balance(body, law, angles, rates, 1e-2).require().z
    for k in range(8):
        net, _ = dense_wrench(body, law, angles[:, k], rates[:, k], z[:, k], 1e-2)
        np.testing.assert_allclose(net, 0.0, atol=1e-5)


@pytest.mark.parametrize("weights", [(), WEIGHTS], ids=["even", "weights"])
@pytest.mark.parametrize("law", LAWS, **names)
def test_pads_from_end_to_end_are_the_line(law, weights):
    line, (angles, rates) = Chain(LENGTHS, weights=weights), random_instants(20)
    pads = Chain(LENGTHS, weights=weights, feet=tuple(Pad(link, 0, 1) for link in range(3)))
    z = np.random.default_rng(1).normal(size=(3, 20))
    at = law, angles, rates, z
    for own, known in zip(pads.sliding(*at, 0.1), line.sliding(*at, 0.1), strict=True):
        np.testing.assert_allclose(own, known, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(pads.forces(*at, 0.1), line.forces(*at, 0.1), rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(
        pads.contact.largest_forces(law), line.contact.largest_forces(law), rtol=1e-14
    )
    np.testing.assert_allclose(
        solve_balance(pads, law, angles, rates, 1e-3).z,
        solve_balance(line, law, angles, rates, 1e-3).z,
        rtol=1e-12,
        atol=1e-14,
    )


@pytest.mark.parametrize("law", LAWS, **names)
def test_two_halves_of_a_pad_are_the_whole(law):
    """At given velocities forces add up, however the pad is cut."""
    (angles, rates), z = random_instants(20), np.random.default_rng(1).normal(size=(3, 20))
    whole = Chain(LENGTHS, feet=tuple(Pad(link, 0.1, 0.9) for link in range(3)))
    cut = tuple(
        Pad(k, *ends, weight=LENGTHS[k] * (ends[1] - ends[0]) / 0.8)
        for k in range(3)
        for ends in ((0.1, 0.4), (0.4, 0.9))
    )
    for own, known in zip(
        Chain(LENGTHS, feet=cut).sliding(law, angles, rates, z, 0.1),
        whole.sliding(law, angles, rates, z, 0.1),
        strict=True,
    ):
        np.testing.assert_allclose(own, known, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("law", [law for law in LAWS if not isinstance(law, Viscous)], **names)
def test_a_short_pad_tends_to_a_foot_like_its_length_squared(law):
    (angles, rates), z = random_instants(20), np.random.default_rng(1).normal(size=(3, 20))
    foot = (
        Chain(LENGTHS, feet=tuple(Foot(link, 0.4) for link in range(3)))
        .sliding(law, angles, rates, z, 0.3)
        .force
    )
    errors = []
    for half in (0.2, 0.1, 0.05, 0.025):
        pads = Chain(LENGTHS, feet=tuple(Pad(link, 0.4 - half, 0.4 + half) for link in range(3)))
        errors.append(np.abs(pads.sliding(law, angles, rates, z, 0.3).force - foot).max())
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 2.0, atol=0.2)


@pytest.mark.parametrize("feet", STANDS.values(), ids=STANDS)
@pytest.mark.parametrize("law", [LAWS[1], LAWS[4]], **names)
def test_casadi_says_the_same_of_pads(law, feet):
    body, (angles, rates) = Chain(LENGTHS, feet=feet), random_instants(1)
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
        np.testing.assert_allclose(np.array(own), theirs, rtol=1e-11, atol=1e-13)


@pytest.mark.skipif(native_kernel() is None, reason="no C compiler")
@pytest.mark.parametrize("feet", STANDS.values(), ids=STANDS)
@pytest.mark.parametrize("law", LAWS[:3], **names)
def test_compiled_balances_and_slopes_on_pads_are_those_of_numpy(law, feet):
    body, (angles, rates) = Chain(LENGTHS, feet=feet), random_instants(60)
    assert native_kernel(body, body.law(law)) is not None
    (z, motion, slopes), (same_z, known, reference) = by_both(body, law, angles, rates, 1e-3)
    np.testing.assert_allclose(same_z, z, atol=1e-8)
    np.testing.assert_allclose(motion.power, known.power, atol=1e-9)
    np.testing.assert_allclose(motion.actuator_power, motion.power, atol=1e-9)
    np.testing.assert_allclose(slopes, reference, atol=1e-8 * np.abs(reference).max())


@pytest.mark.parametrize(
    ("pad", "sentence"),
    [
        (lambda: Pad(0, 0.2, 1.2), "must lie on its link"),
        (lambda: Pad(0, 0.6, 0.4), "must end behind where it begins"),
        (lambda: Pad(0, "tail", 0.4), "first must be a number, not 'tail'"),
        (lambda: Pad(0, angle=0.3), "may be turned"),
        (lambda: Foot(0, 0.9, extent=0.4), "must lie on its link"),
        (lambda: Foot(0, extent=-0.4), "from 0 \\(a point\\) to 1"),
        (lambda: Chain(feet=(Pad(0, offset=0.1), Pad(1), Pad(2))), "left and right"),
    ],
)
def test_pads_that_cannot_be_are_refused_in_a_sentence(pad, sentence):
    with pytest.raises(ProblemError, match=sentence):
        pad()


def test_files_hold_pads_and_symmetries_need_symmetric_ones():
    for feet in STANDS.values():
        problem = Problem("stands", body=Chain(LENGTHS, feet=feet))
        again = Problem.from_dict(problem.to_dict())
        assert again.body == problem.body
        assert again.hash == problem.hash
    assert "bilateral" in Chain(feet=(Pad(0, 0.0, 0.3), Foot(1), Pad(2, 0.7, 1.0))).symmetries
    assert "bilateral" not in Chain(feet=(Pad(0, 0.0, 0.3), Foot(1), Pad(2, 0.0, 0.3))).symmetries


def test_one_pad_is_enough_to_stand_on():
    angles, rates = random_instants(5)
    body = Chain(feet=(Pad(1, 0.1, 0.9, weight=1.0),))
    z = solve_balance(body, Friction(), angles, rates, 1e-6).require()
    velocity = body.velocity(body.posture(angles), rates, z.z)
    np.testing.assert_allclose([velocity.vs[1], velocity.vn[1], velocity.w[1]], 0.0, atol=1e-12)


def test_prints_of_pads_lie_where_they_press():
    body, (angles, _) = Chain(LENGTHS, feet=(Pad(0, 0.1, 0.6), Foot(1), Pad(2))), random_instants(4)
    (x0, x1), (y0, y1) = body.footprints(angles)
    np.testing.assert_allclose(np.hypot(x1 - x0, y1 - y0).T, [[0.15, 0.0, 0.25]] * 4, atol=1e-15)
    ends = np.stack(body.outline(angles))
    np.testing.assert_allclose([x1[2], y1[2]], ends[:, -1], atol=1e-14)
    assert footprints(Chain(), angles).size == 0
