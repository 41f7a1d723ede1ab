"""Feet, wheels, pads and axles: the lines and points that they tend to, and their directions; through the
whole search: certified, kept, drawn; and what feet cannot do yet is refused in a sentence."""

import json

import numpy as np
import pytest

import colloc
from colloc import Axle, Chain, Foot, Fourier, Friction, Pad, Problem, Viscous, Wheel, solve_balance
from colloc.bounds.motions import Domain
from colloc.bounds.optimality_gap import refusal
from colloc.commands.solve import summary_lines
from colloc.dynamics.control_problem import control_problem
from colloc.mechanics.native_kernel import native_kernel
from colloc.pictures.movie import frames
from colloc.results.motion import friction_arrows
from colloc.verification.replay import replay
from research.small_gaits import small_gait
from tests.mechanics.test_chain_mechanics import BODIES, LAWS, LENGTHS, each_law
from tests.shared.mechanics import numpy_instead, random_instants, wrench

AHEAD, BACK = Friction(mu_t=1.0, mu_f=0.2, mu_b=0.9), Friction(mu_t=1.0, mu_f=0.9, mu_b=0.2)
EQUAL, STILL = Friction(), np.zeros((2, 1))
WEIGHTS = (0.2, 0.5, 0.3)


TOES = [Wheel(0, 0.2, angle=s * 0.3, offset=s * 0.05) for s in (1, -1)]


def on_each(foot, **fields):
    """A chain with feet or pads alike on each link."""
    return Chain(LENGTHS, feet=tuple(foot(link) for link in range(3)), **fields)


def sliding_force(body, law, delta=0.3, seed=1):
    angles, rates = random_instants(20)
    z = np.random.default_rng(seed).normal(size=(3, 20))
    return body.sliding(law, angles, rates, z, delta).force


@each_law
def test_many_feet_and_none_are_a_line_to_second_order_in_their_distance(law):
    assert Chain(feet=0) == Chain(feet=()) == Chain()
    line = sliding_force(Chain(LENGTHS), law)
    errors = [np.abs(sliding_force(Chain(LENGTHS, feet=n), law) - line).max() for n in (5, 10, 20)]
    assert errors[1] < 0.3 * errors[0]
    assert errors[2] < 0.3 * errors[1] < 1e-3 * law.largest


@pytest.mark.parametrize("weights", [(), WEIGHTS], ids=["even", "weights"])
@each_law
def test_pads_from_end_to_end_are_the_line(law, weights):
    line, pads = Chain(LENGTHS, weights=weights), on_each(Pad, weights=weights)
    angles, rates = random_instants(20)
    at = law, angles, rates, np.random.default_rng(1).normal(size=(3, 20)), 0.1
    for own, known in zip(pads.sliding(*at), line.sliding(*at), strict=True):
        np.testing.assert_allclose(own, known, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(pads.forces(*at), line.forces(*at), rtol=1e-14, atol=1e-15)
    most = (body.contact.largest_forces(law) for body in (pads, line))
    np.testing.assert_allclose(*most, rtol=1e-14)
    own, known = (solve_balance(body, law, angles, rates, 1e-3).z for body in (pads, line))
    np.testing.assert_allclose(own, known, rtol=1e-12, atol=1e-14)


BENT = np.array([[[0.9, -0.4, 0.3], [0.2, -1.1, 1.4]], [[1.0, -0.5, 0.8], [-0.6, 1.2, 0.4]]])


def wheels_that_do_not_slip(body, angles, rates):
    """Tail velocity of one instant: no wheel moves across its rolling direction."""

    def across(z):
        column = np.array(z, dtype=float)[:, None]
        moves = body.velocity(body.posture(angles[:, None]), rates[:, None], column)
        return body.contact.velocities(moves).vn[:, 0]

    rest = across(np.zeros(3))
    return np.linalg.solve(np.transpose([across(unit) - rest for unit in np.eye(3)]), -rest)


def test_a_wheeled_snake_tends_to_its_nonholonomic_kinematics_like_rolling_over_sideways_friction():
    errors = []
    for ratio in (1e2, 1e3, 1e4):
        wheel = {"rolling": 0.02, "sideways": 0.02 * ratio}
        body = Chain(feet=tuple(Wheel(link, **wheel) for link in range(3)))
        z = solve_balance(body, EQUAL, *BENT, 1e-9).require().z
        known = [wheels_that_do_not_slip(body, *at) for at in BENT.transpose(2, 0, 1)]
        errors.append(np.abs(z - np.transpose(known)).max())
    np.testing.assert_allclose(np.log10(np.divide(errors[:-1], errors[1:])), 1.0, atol=0.1)
    assert errors[-1] < 2e-3


@pytest.mark.parametrize("angle", [0.4, -0.4, 1.2])
def test_turned_wheels_left_and_right_go_straight_on(angle):
    """Across them acts the sum of what each has across itself."""
    feet = (Wheel(k, angle=side * angle, rolling=0.1) for k in range(3) for side in (1, -1))
    body, c, s = Chain(LENGTHS, feet=tuple(feet)), np.cos(angle), np.sin(angle)
    ways = np.array([[[1.0], [0.0], [0.0]], [[0.0], [1.0], [0.0]]])
    ahead, aside = (body.sliding(EQUAL, STILL, STILL, z, 1e-9).force[:2, 0] for z in ways)
    np.testing.assert_allclose(ahead, [-(0.1 * c**2 + s**2), 0.0], atol=1e-8)
    np.testing.assert_allclose(aside, [0.0, -(0.1 * s**2 + c**2)], atol=1e-8)


def test_forwards_of_a_foot_is_towards_the_head_and_turned_round_its_law_is_backwards():
    ahead, back = (on_each(lambda k, law=law: Foot(k, 0.3, friction=law)) for law in (AHEAD, BACK))
    turned = on_each(lambda k: Foot(k, 0.3, friction=AHEAD, angle=np.pi))
    for body, speed, force in ((ahead, 1.0, -0.2), (ahead, -1.0, 0.9), (back, 1.0, -0.9)):
        z = np.array([[speed], [0.0], [0.0]])
        assert body.sliding(EQUAL, STILL, STILL, z, 1e-9).force[0, 0] == pytest.approx(force)
    np.testing.assert_allclose(sliding_force(turned, EQUAL), sliding_force(back, EQUAL), atol=1e-12)
    # and is that of the body where all feet have it
    both = (ahead, EQUAL), (on_each(lambda k: Foot(k, 0.3)), AHEAD)
    own, theirs = (solve_balance(*at, *random_instants(10), 1e-2).require().z for at in both)
    np.testing.assert_allclose(own, theirs, rtol=0, atol=1e-8)


def test_a_foot_turned_across_is_its_mirror_image_if_it_slides_alike_both_ways():
    """And not under a law of the body's, which may have a forward direction."""
    for law in (Friction(mu_t=1.0, mu_f=0.2, mu_b=0.2), AHEAD, None):
        feet = Foot(0, friction=law, angle=np.pi / 2), Foot(1), Foot(2)
        if law is None or not law.reversible:
            with pytest.raises(colloc.ProblemError, match="differ between left and right"):
                Chain(feet=feet)
        else:
            assert Chain(feet=feet).feet[0].angle == np.pi / 2


def test_a_wheel_has_one_of_two_laws_and_a_body_the_least_the_most_and_what_all_of_its_feet_have():
    assert Wheel(0, rolling=0.1).friction == Friction(mu_t=1.0, mu_f=0.1, mu_b=0.1)
    assert Wheel(0, rolling=0.1, axle=True).friction == Axle(rolling=0.1, sideways=1.0)
    assert (Wheel(0, axle=True).kind, Pad(0, friction=Wheel(0).friction).kind) == ("wheel", "pad")
    assert Foot(0, friction=Axle(rolling=1.0)).kind == "foot"
    feet = Foot(0), Wheel(1, rolling=0.1), Foot(2, friction=Viscous())
    for n, degree in ((2, 0.0), (3, None)):
        law = Chain((1 / n,) * n, feet=feet[:n]).law(Friction(mu_t=3.0))
        assert (law.smallest, law.largest, law.degree) == (0.1, 3.0, degree)
        assert (law.reversible, law.associated, law.regularised) == (True, False, True)


def test_an_offset_is_to_the_left_seen_from_the_tail_and_to_the_right_seen_from_the_head():
    left = Foot(0, 0.2, offset=0.05)
    assert left.from_head(3) == Foot(2, 0.8, offset=-0.05)
    assert left.mirrored == Foot(0, 0.2, offset=-0.05)
    # a body that spins on the spot drags a foot to its left backwards
    body = Chain(LENGTHS, feet=(Foot(0, offset=0.05), Foot(0, offset=-0.05), Foot(1), Foot(2)))
    slides = body.sliding(EQUAL, STILL, STILL, np.array([[0.0], [0.0], [1.0]]), 1e-9)
    arms = np.hypot([0.15, 0.15, 0.525, 0.875], [0.05, 0.05, 0, 0])
    assert slides.force[2, 0] == pytest.approx(-np.array([0.15, 0.15, 0.45, 0.25]) @ arms)


@pytest.mark.parametrize(
    ("feet", "link"),
    [((Foot(0, 0.0, 0.5), Foot(0, 1.0, 0.5)), 0), ((Pad(1, 0.1, 0.9, weight=1.0),), 1)],
)
def test_a_link_that_alone_stands_stays_where_it_is(feet, link):
    """Carried links are swung freely."""
    body, (angles, rates) = Chain(feet=feet), random_instants(10)
    z = solve_balance(body, EQUAL, angles, rates, 1e-6).require().z
    moves = body.velocity(body.posture(angles), rates, z)
    np.testing.assert_allclose([row[link] for row in moves], 0.0, atol=1e-12)


def test_feet_nearly_on_a_line_are_balanced_where_the_residual_must_rise_before_it_falls():
    bend, law = np.geomspace(1e-6, 0.1, 400), Friction(mu_t=1, mu_f=1, mu_b=3)
    at = Chain((0.5, 0.5), feet=2), law, np.stack([[*bend, *-bend]]), np.ones((1, 800)), 5e-6
    solved = solve_balance(*at).require()
    for k in range(0, 800, 40):
        net = wrench(*at[:2], at[2][:, k], at[3][:, k], solved.z[:, k], 5e-6)[0]
        np.testing.assert_allclose(net, 0.0, atol=3e-9)  # rounding of velocities, over delta
    assert (solve_balance(*at, method="direct").residual > 1e-9).any()
    with numpy_instead():
        solve_balance(*at[:2], *(a[:, ::20] for a in at[2:4]), 5e-6).require()


def test_laws_that_the_kernel_does_not_know_at_points_are_left_to_numpy():
    drag = on_each(lambda k: Foot(k, 0.4, friction=LAWS[4]) if k == 2 else Wheel(k))
    for body, law in ((Chain(feet=1), Viscous()), (drag, EQUAL)):
        assert native_kernel(body, body.law(law)) is None


def test_a_foot_without_a_weight_bears_what_the_others_of_its_link_leave_in_equal_parts():
    feet = (
        Foot(0, 0.1, weight=0.06), Foot(0, 0.5), Foot(0, 0.9), Foot(1), Foot(2, 0.2),
        Foot(2, 0.8, weight=0.05),
    )  # fmt: skip
    weights = [foot.weight for foot in Chain(LENGTHS, feet=feet).feet]
    assert weights == pytest.approx([0.06, 0.12, 0.12, 0.45, 0.2, 0.05])


def test_prints_of_pads_lie_where_they_press():
    body, (angles, _) = Chain(LENGTHS, feet=(Pad(0, 0.1, 0.6), Foot(1), Pad(2))), random_instants(4)
    (x0, x1), (y0, y1) = body.footprints(angles)
    np.testing.assert_allclose(np.hypot(x1 - x0, y1 - y0).T, [[0.15, 0.0, 0.25]] * 4, atol=1e-15)
    tail, hinge, *_, head = np.stack(body.joints(angles)).swapaxes(0, 1)
    np.testing.assert_allclose([x1[2], y1[2]], head, atol=1e-14)
    np.testing.assert_allclose([x0[0], y0[0]], 0.9 * tail + 0.1 * hinge, atol=1e-14)


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_files_hold_feet_weights_and_masses(body):
    law = Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5)
    problem = Problem("stands", body=body, friction=law, gait=colloc.Harmonic(2))
    again = Problem.from_dict(problem.to_dict())
    assert (again.body, again.hash, again.law) == (problem.body, problem.hash, problem.law)


@pytest.mark.parametrize(
    ("feet", "symmetric"),
    [
        (2, True),
        ((Foot(0, 0.1), Foot(1), Foot(2, 0.9)), True),
        ((Foot(0, 0.1), Foot(1), Foot(2, 0.1)), False),
        ((Foot(0, 0.1), Foot(1, friction=AHEAD), Foot(2, 0.9, friction=EQUAL)), False),
        ((Wheel(0), Foot(1), Foot(2)), False),
        ((Pad(0, 0.0, 0.3), Foot(1), Pad(2, 0.7, 1.0)), True),
        ((Pad(0, 0.0, 0.3), Foot(1), Pad(2, 0.0, 0.3)), False),
        ((*TOES, Foot(1), *(foot.from_head(3) for foot in TOES)), True),
        (
            (*TOES, Foot(1), *(Wheel(2, 0.8, angle=s * 0.3, offset=s * 0.05) for s in (1, -1))),
            False,
        ),
    ],
)
def test_symmetries_need_symmetric_feet(feet, symmetric):
    body = Chain(feet=feet)
    assert body.symmetric == ("bilateral" in body.symmetries) == symmetric


DELTA = 1e-4


def on_axles(**wheel):
    return Chain(feet=tuple(Wheel(link, axle=True, **wheel) for link in range(3)))


@pytest.mark.parametrize("wheel", [{"rolling": 1e-7}, {"rolling": 1.0, "sideways": 1e7}], ids=str)
def test_wheels_that_roll_freely_or_hold_firmly_do_not_slip(wheel):
    """To rolling over sideways friction times delta, and not times the speed."""
    body = on_axles(**wheel)
    z = colloc.solve_balance(body, Friction(), *BENT, 1e-3).require().z
    known = [wheels_that_do_not_slip(body, *at) for at in BENT.transpose(2, 0, 1)]
    np.testing.assert_allclose(z, np.transpose(known), atol=1e-8)


@pytest.mark.slow
def test_it_is_solved_and_certified_and_motion_without_delta_says_the_same():
    problem = Problem(
        "axles", body=on_axles(rolling=0.3), gait=colloc.Harmonic(1, "bilateral"), delta=DELTA
    )
    found = colloc.solve(problem, starts=2)
    assert found.status == "solved", found.message
    assert found.dry().efficiency == pytest.approx([found.efficiency] * 2, rel=1.5e-3)
    # its mirror image goes as far
    image = colloc.evaluate(problem, colloc.Fourier.from_table(-found.gait.table))
    assert image.distance == pytest.approx(found.distance)


KNOWN = Fourier([-1.287, 1.287], [[0.687], [-0.687]], [[1.206], [1.206]])
"""A gait of three links on a foot each that a program of its own has found, whose efficiency there
is .676."""
PAPER = Fourier([0.0, 0.0], [[2.859], [-2.859]], [[1.302], [1.302]])
"""The paper's best gait on a line (problems/three_link.py)."""


@pytest.fixture(scope="module")
def on_feet(solved):
    return solved("three_link_feet")[0]


def test_three_links_on_a_foot_each_go_three_times_as_far_for_their_work_as_on_a_line(on_feet):
    assert on_feet.certificate.passed
    assert on_feet.certificate.efficiency > 0.77
    assert abs(on_feet.certificate.efficiency_at_zero_delta - on_feet.certificate.efficiency) < 1e-3
    # the feet press beneath the centre of mass in every shape
    assert "statics" not in [check.name for check in on_feet.certificate.checks]


def test_friction_of_a_foot_is_in_units_of_the_weight_whatever_the_problem_says():
    """Wheels alone: the problem's friction acts nowhere; the search's unit is their friction."""
    wheels = Chain(feet=tuple(Wheel(link, rolling=0.02, sideways=1.0) for link in range(3)))
    laws = Friction(), colloc.Elliptic(mu_t=7, mu_f=8, mu_b=9)
    one, other = (Problem("wheels", body=wheels, friction=own) for own in laws)
    assert one.law == other.law
    scaled = control_problem(other)
    law = scaled.dynamics.law
    assert law == one.law.in_units_of(scaled.unit)
    assert 0.1 < law.smallest < 10
    assert Problem.from_dict(other.with_(friction=law).to_dict()).law == law
    angles, rates = random_instants(20)
    z, same, again = (solve_balance(wheels, own, angles, rates, 1e-3).z for own in (*laws, law))
    np.testing.assert_array_equal(z, same)
    np.testing.assert_allclose(z, again, atol=1e-9)
    how = {"tolerance": 1e-4, "instants": 200}
    stated, resolved = (replay(wheels, law, KNOWN, 1e-2, **how) for law in (Friction(), one.law))
    assert stated.work == resolved.work


@pytest.mark.slow
def test_a_certificate_says_how_far_the_feet_press_beside_the_centre_of_mass(solved):
    worm = solved("inchworm")[0]
    statics = next(check for check in worm.certificate.checks if check.name == "statics")
    angles = worm.gait.angles(np.linspace(0, 1, 2001))
    assert statics.value == pytest.approx(worm.problem.body.imbalance(angles).max(), rel=1e-3)
    assert statics.value < worm.problem.body.largest_imbalance
    # every number, allowed ones too, is one of JSON
    json.dumps(worm.certificate.facts(), allow_nan=False)
    assert "beside the centre of mass" in worm.problem.body.describe()


def test_the_way_from_the_centre_of_mass_is_largest_where_all_links_pull_one_way():
    body = Chain((0.2, 0.3, 0.5), feet=(Foot(0, 0.3, 0.7), Foot(2, 0.9, 0.3)))
    assert body.imbalance(np.zeros((2, 1)))[0] == pytest.approx(abs(0.7 * 0.06 + 0.3 * 0.95 - 0.5))
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, (2, 20000))
    worst = body.imbalance(angles).max()
    assert 0.999 * body.largest_imbalance < worst <= body.largest_imbalance * (1 + 1e-12)
    assert Chain(feet=3).largest_imbalance < 1e-15


def test_a_gait_of_no_size_pays_no_more_than_the_least_friction_on_one_foot_a_link_only():
    """Two feet hold, the third swings: 1/min(mu), which no gait exceeds; more feet are dragged."""
    folded, straight = np.array([2.5, -2.5]), np.zeros(2)
    assert 1 - 1e-4 < small_gait(Chain(feet=1), Friction(), folded).efficiency <= 1
    assert 1 - 1e-3 < small_gait(Chain(feet=1), Friction(), straight).efficiency <= 1
    more = [small_gait(Chain(feet=n), Friction(), straight).efficiency for n in (2, 3)]
    np.testing.assert_allclose(more, [0.6585, 0.5], atol=2e-4)


def test_what_feet_cannot_do_yet_is_refused():
    body, friction = Chain(feet=1), Friction(mu_t=2, mu_f=1, mu_b=1)
    with pytest.raises(colloc.ProblemError, match="on feet no upper bound"):
        Domain(body, friction, 2.0)
    assert "on feet no upper bound" in refusal(Problem("bound", None, body, friction))
    assert refusal(Problem("bound", None, body)) == ""


def test_the_summary_says_for_how_much_of_the_period_each_foot_holds(on_feet, three_link, unsolved):
    """Outer feet hold in turns, for a good part of the period each; lying bodies have none."""
    shares = on_feet.share_held
    np.testing.assert_allclose(shares, frames(on_feet, 1001).holding[:, :-1].mean(1), atol=3e-3)
    assert 0.25 < shares[[0, 2]].min() < shares[[0, 2]].max() < 0.5
    assert any("feet stick" in line for line in summary_lines(on_feet, None))
    # a foot holds where friction is less than 3 / sqrt(10) of the most it can be
    polygon = {"gait": colloc.Polygon(4, "bilateral"), "guess": PAPER}
    relative = unsolved(Problem("p", body=on_feet.problem.body, delta=1e-3, **polygon))
    for found in (on_feet, relative):  # whose delta is at unit shape speed
        body, motion = found.problem.body, found.sample(np.linspace(0, 1, 300))
        at = found.problem.law, motion.angles, motion.rates, found.delta_per_period, motion.z
        weights = np.array([foot.weight for foot in body.standing_on])
        used = np.hypot(*friction_arrows(body, *at)[1]) / weights[:, None]
        assert used.max() > 3 / np.sqrt(10) > used.min()
        np.testing.assert_array_equal(found.holding(motion), used < 3 / np.sqrt(10))
    assert three_link.share_held.size == 0
    assert not any("feet stick" in line for line in summary_lines(three_link, None))
