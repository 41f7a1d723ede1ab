"""Bodies on feet through the whole search: certified, kept, drawn; and what feet cannot do yet is
refused in a sentence."""

import json

import numpy as np
import pytest

import colloc
from colloc import Chain, Elliptic, Foot, Fourier, Friction, Polygon, Problem, ProblemError, Wheel
from colloc.bounds.motions import Domain
from colloc.bounds.optimality_gap import refusal
from colloc.commands.solve import summary_lines
from colloc.dynamics.control_problem import control_problem
from colloc.pictures.movie import frames
from colloc.results.motion import friction_arrows
from colloc.verification.replay import replay
from research.small_gaits import small_gait
from tests.shared.mechanics import random_instants

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
    """Wheels alone: the problem's friction acts nowhere. The search sees it in units of its own
    size."""
    wheels = Chain(feet=tuple(Wheel(link, rolling=0.02, sideways=1.0) for link in range(3)))
    laws = Friction(), Elliptic(mu_t=7, mu_f=8, mu_b=9)
    one, other = (Problem("wheels", body=wheels, friction=own) for own in laws)
    assert one.law == other.law
    scaled = control_problem(other)
    law = scaled.dynamics.law
    assert law == one.law.in_units_of(scaled.unit)
    assert 0.1 < law.smallest < 10
    assert Problem.from_dict(other.with_(friction=law).to_dict()).law == law
    angles, rates = random_instants(20)
    z, same, again = (
        colloc.solve_balance(wheels, own, angles, rates, 1e-3).z for own in (*laws, law)
    )
    np.testing.assert_array_equal(z, same)
    np.testing.assert_allclose(z, again, atol=1e-9)
    stated, resolved = (
        replay(wheels, law, KNOWN, 1e-2, tolerance=1e-4, instants=200)
        for law in (Friction(), one.law)
    )
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
    """Two feet hold while the third is swung: 1/min(mu), which no gait exceeds. More feet to a link
    are dragged along."""
    folded, straight = np.array([2.5, -2.5]), np.zeros(2)
    assert 1 - 1e-4 < small_gait(Chain(feet=1), Friction(), folded).efficiency <= 1
    assert 1 - 1e-3 < small_gait(Chain(feet=1), Friction(), straight).efficiency <= 1
    more = [small_gait(Chain(feet=n), Friction(), straight).efficiency for n in (2, 3)]
    np.testing.assert_allclose(more, [0.6585, 0.5], atol=2e-4)


def test_what_feet_cannot_do_yet_is_refused():
    body, friction = Chain(feet=1), Friction(mu_t=2, mu_f=1, mu_b=1)
    with pytest.raises(ProblemError, match="on feet no upper bound"):
        Domain(body, friction, 2.0)
    assert "on feet no upper bound" in refusal(Problem("bound", None, body, friction))
    assert refusal(Problem("bound", None, body)) == ""


def test_the_summary_says_for_how_much_of_the_period_each_foot_holds(on_feet, three_link, unsolved):
    """The outer feet hold in turns, for a good part of the period each; a body that lies has
    none."""
    shares = on_feet.share_held
    np.testing.assert_allclose(
        shares, frames(on_feet, 1001).holding[:, :-1].mean(axis=1), atol=3e-3
    )
    assert 0.25 < shares[[0, 2]].min() < shares[[0, 2]].max() < 0.5
    assert any("feet stick" in line for line in summary_lines(on_feet, None))
    # a foot holds where friction is less than 3 / sqrt(10) of the most it can be
    polygon = {"gait": Polygon(4, "bilateral"), "guess": PAPER}
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
