"""What the numbers of feet mean: shares of weight beside each other, turned feet, offsets from
either end, laws backwards."""

import numpy as np
import pytest
from shared.instants import random_instants

from colloc import Chain, Foot, Friction, Pad, ProblemError, Wheel, solve_balance

LENGTHS = (0.3, 0.45, 0.25)
EASY_AHEAD = Friction(mu_t=1.0, mu_f=0.2, mu_b=0.9)
EASY_BACK = Friction(mu_t=1.0, mu_f=0.9, mu_b=0.2)
ISOTROPIC = Friction()


def rows(feet):
    return tuple(foot for link in range(3) for foot in feet(link))


def test_a_foot_without_a_weight_bears_what_the_others_of_its_link_leave_in_equal_parts():
    feet = (
        Foot(0, 0.1, weight=0.06),
        Foot(0, 0.5),
        Foot(0, 0.9),
        Foot(1),
        Foot(2, 0.2),
        Foot(2, 0.8, weight=0.05),
    )
    body = Chain(LENGTHS, feet=feet)
    assert [foot.weight for foot in body.feet] == pytest.approx([0.06, 0.12, 0.12, 0.45, 0.2, 0.05])


def test_feet_may_bear_all_of_a_link_only_if_each_says_what():
    with pytest.raises(ProblemError, match="the feet on link 0 bear all that it weighs"):
        Chain(LENGTHS, feet=(Foot(0, 0.1, weight=0.3), Foot(0, 0.9), Foot(1), Foot(2)))
    with pytest.raises(ProblemError, match=r"weights of the feet must add up to 1, not 0\.95"):
        Chain(LENGTHS, feet=(Foot(0, weight=0.25), Foot(1), Foot(2)))


def one_instant(body, law, motion):
    """Force on a straight body of joints at rest that moves so, along it and to its left."""
    still = np.zeros((2, 1))
    return body.sliding(law, still, still, np.array(motion, dtype=float)[:, None], 1e-9).force[
        :2, 0
    ]


@pytest.mark.parametrize("angle", [0.4, -0.4, 1.2])
def test_a_turned_wheel_rolls_along_its_own_direction(angle):
    """Left and right ones together go straight on: across them acts the sum of what each has across
    itself."""
    feet = rows(
        lambda link: [
            Wheel(link, angle=angle, rolling=0.1, sideways=1.0),
            Wheel(link, angle=-angle, rolling=0.1),
        ]
    )
    # a velocity straight on is cos(angle) along the wheel and sin(angle) across it, and friction
    # acts along these components
    c, s = np.cos(angle), np.sin(angle)
    assert one_instant(Chain(LENGTHS, feet=feet), ISOTROPIC, [1, 0, 0]) == pytest.approx(
        [-(0.1 * c**2 + s**2), 0.0]
    )
    assert one_instant(Chain(LENGTHS, feet=feet), ISOTROPIC, [0, 1, 0]) == pytest.approx(
        [0.0, -(0.1 * s**2 + c**2)]
    )


def test_forwards_of_a_foot_is_towards_the_head():
    ahead = Chain(LENGTHS, feet=rows(lambda link: [Foot(link, friction=EASY_AHEAD)]))
    back = Chain(LENGTHS, feet=rows(lambda link: [Foot(link, friction=EASY_BACK)]))
    assert one_instant(ahead, ISOTROPIC, [1, 0, 0])[0] == pytest.approx(-0.2)
    assert one_instant(ahead, ISOTROPIC, [-1, 0, 0])[0] == pytest.approx(0.9)
    assert one_instant(back, ISOTROPIC, [1, 0, 0])[0] == pytest.approx(-0.9)


def test_a_foot_turned_round_has_its_law_backwards():
    angles, rates = random_instants(10)
    turned = Chain(
        LENGTHS, feet=rows(lambda link: [Foot(link, 0.3, friction=EASY_AHEAD, angle=np.pi)])
    )
    back = Chain(LENGTHS, feet=rows(lambda link: [Foot(link, 0.3, friction=EASY_BACK)]))
    z = np.random.default_rng(2).normal(size=(3, 10))
    forces = [body.sliding(ISOTROPIC, angles, rates, z, 0.1).force for body in (turned, back)]
    np.testing.assert_allclose(*forces, rtol=0, atol=1e-12)


def reversed_feet(feet, law):
    """Of the body named from its other end: places and offsets from there, and laws backwards."""
    return tuple(
        Foot(
            2 - f.link, 1 - f.place, weight=f.weight, offset=-f.offset, friction=law, angle=f.angle
        )
        for f in feet
    )


def test_a_body_named_from_its_head_moves_alike_if_its_feet_have_their_laws_backwards():
    """Offsets change sides, and forwards is backwards: then power is the same at every instant,
    else it is not."""
    angles, rates = random_instants(20)
    feet = (Foot(0, 0.2, friction=EASY_AHEAD), Foot(2, 0.9, friction=EASY_AHEAD))
    even = (*feet, *(Foot(1, 0.3, offset=side * 0.08, friction=EASY_AHEAD) for side in (1, -1)))
    body = Chain(LENGTHS, feet=even)
    z = np.random.default_rng(3).normal(size=(3, 20))

    def power(body, angles, rates, z):
        return body.sliding(ISOTROPIC, angles, rates, z, 0.05).power[0]

    # from the head links turn by -angles, and its velocity is that of the head, as seen there
    phi = np.cumsum(np.concatenate([np.zeros((1, 20)), angles]), axis=0)
    spin = np.cumsum(np.concatenate([z[2:], rates]), axis=0)
    links = np.array(LENGTHS)[:, None] * np.exp(1j * phi)
    head = z[0] + 1j * z[1] + (1j * spin * links).sum(axis=0)
    seen = -head * np.exp(-1j * phi[-1])
    z_head = np.array([seen.real, seen.imag, spin[-1]])
    at_head = -angles[::-1], -rates[::-1], z_head
    same = power(Chain(LENGTHS[::-1], feet=reversed_feet(body.feet, EASY_BACK)), *at_head)
    other = power(Chain(LENGTHS[::-1], feet=reversed_feet(body.feet, EASY_AHEAD)), *at_head)
    np.testing.assert_allclose(same, power(body, angles, rates, z), rtol=1e-10)
    assert np.abs(other - same).max() > 0.05


def test_an_offset_is_to_the_left_seen_from_the_tail_and_to_the_right_seen_from_the_head():
    left = Foot(0, 0.2, offset=0.05)
    assert left.from_head(3) == Foot(2, 0.8, offset=-0.05)
    assert left.mirrored == Foot(0, 0.2, offset=-0.05)
    # a body that spins on the spot drags a foot to its left backwards
    body = Chain(LENGTHS, feet=(Foot(0, offset=0.05), Foot(0, offset=-0.05), Foot(1), Foot(2)))
    still = np.zeros((2, 1))
    slides = body.sliding(ISOTROPIC, still, still, np.array([[0.0], [0.0], [1.0]]), 1e-9)
    arms = np.hypot([0.15, 0.15, 0.525, 0.875], [0.05, 0.05, 0, 0])
    assert slides.force[2, 0] == pytest.approx(-np.array([0.15, 0.15, 0.45, 0.25]) @ arms)


def test_bodies_whose_feet_differ_from_both_ends_are_not_taken_for_symmetric():
    assert Chain(feet=(Foot(0, 0.1), Foot(1), Foot(2, 0.9))).symmetric
    for feet in (
        (Foot(0, 0.1), Foot(1), Foot(2, 0.8)),
        (Foot(0, 0.1), Foot(1, friction=EASY_AHEAD), Foot(2, 0.9, friction=Friction(mu_t=3))),
        (Pad(0, 0.0, 0.5), Pad(1), Pad(2, 0.4, 1.0)),
    ):
        assert not Chain(feet=feet).symmetric


def test_feet_with_their_own_law_balance_like_a_body_whose_law_it_is():
    angles, rates = random_instants(10)
    own = Chain(LENGTHS, feet=rows(lambda link: [Foot(link, friction=EASY_AHEAD)]))
    theirs = Chain(LENGTHS, feet=1)
    found = [
        solve_balance(body, law, angles, rates, 1e-2).require().z
        for body, law in ((own, ISOTROPIC), (theirs, EASY_AHEAD))
    ]
    np.testing.assert_allclose(*found, rtol=0, atol=1e-8)
