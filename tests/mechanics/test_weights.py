"""Links of different weights: friction follows the weight, and so does the centre of mass."""

import numpy as np
import pytest
from shared.instants import random_instants

from benchmarks.independent_replay import Crawler, played
from colloc import (
    Chain,
    Elliptic,
    Friction,
    Problem,
    ProblemError,
    load,
    replay,
    save,
    solve_balance,
)
from colloc.bounds.motions import Domain
from colloc.bounds.sampled import Budget, efficiency_bound
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.search.solve import solve
from research.guarantee.guaranteed import certify
from tests.shared.laws import coulomb

LENGTHS, WEIGHTS = (0.2, 0.5, 0.3), (0.5, 0.2, 0.3)
LAWS = [Friction(), Friction(mu_t=1.7, mu_f=1, mu_b=1.3), Elliptic(mu_t=2, mu_f=1, mu_b=1.5)]


def test_weights_in_proportion_to_the_lengths_are_no_weights_to_the_last_bit():
    angles, rates = random_instants(50)
    said, unsaid = (
        solve_balance(body, Friction(mu_t=2, mu_f=1, mu_b=3), angles, rates, 1e-4)
        for body in (Chain(weights=(1 / 3,) * 3), Chain())
    )
    np.testing.assert_array_equal(said.z, unsaid.z)


def test_a_nearly_weightless_head_neither_holds_nor_moves_the_body():
    angles, rates = random_instants(30)
    rates[0] = 0.0  # tail and middle are one stiff piece, which stays where it is
    light = Chain((0.3, 0.3, 0.4), weights=(0.5, 0.5 - 1e-9, 1e-9))
    solved = solve_balance(light, Friction(), angles, rates, 1e-6)
    np.testing.assert_allclose(solved.z, 0.0, atol=1e-6)


@pytest.mark.parametrize("mu", [(1, 1, 3), (1, 3, 1), (3, 1, 2)], ids=str)
def test_the_largest_forces_are_reached_by_links_that_slide_along_or_across_themselves_or_turn_about_an_end(
    mu,
):
    """A straight body that slides as a whole, forwards, backwards and sideways; couples by a turn
    about a link's own end."""
    body, law, straight = Chain(LENGTHS, weights=WEIGHTS), coulomb(*mu), np.zeros((2, 3))
    most = body.contact.largest_forces(law).ravel()
    along, across, couples = np.split(most, 3)
    ways = np.array([[1.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    found = np.abs(body.forces(law, straight, straight, ways, 1e-9))
    np.testing.assert_allclose(found[:3, :2].max(axis=1), along)
    np.testing.assert_allclose(found[3:6, 2], across)
    np.testing.assert_allclose(along, max(mu[1:]) * np.array(WEIGHTS))
    # a link that turns about its middle pushes back alike on both halves: the couple is that of
    # half its weight a quarter away
    turn = np.array([[0.0], [-LENGTHS[0] / 2], [1.0]])
    spinning = body.forces(law, straight[:, :1], straight[:, :1], turn, 1e-9)
    assert abs(spinning[6, 0]) == pytest.approx(couples[0])
    angles, rates = random_instants(200)
    z = np.random.default_rng(1).normal(size=(3, 200))
    assert (np.abs(body.forces(law, angles, rates, z, 1e-9)) <= most[:, None] * (1 + 1e-12)).all()


def test_the_replay_is_that_of_a_program_of_its_own():
    gait = Fourier([0.2, -0.1], [[1.2], [0.3]], [[0.2], [1.0]])
    crawler = Crawler(LENGTHS, (1.7, 1.0, 1.3), WEIGHTS)
    theirs = played(crawler, lambda t: (gait.angles(t), gait.rates(t)), 1e-2, 1e-5)
    ours = replay(Chain(LENGTHS, weights=WEIGHTS), Friction(mu_t=1.7, mu_f=1, mu_b=1.3), gait, 1e-2)
    assert ours.work == pytest.approx(theirs.work, rel=1e-4)
    assert ours.distance == pytest.approx(theirs.distance, rel=1e-4)
    assert ours.rotation == pytest.approx(theirs.rotation, rel=1e-4)


def test_a_problem_with_weights_is_solved_certified_and_kept(tmp_path):
    problem = Problem(
        "heavy_ends", body=Chain(weights=(0.4, 0.2, 0.4)), gait=Harmonic(1, "bilateral")
    )
    found = solve(problem, 1)
    assert found.status == "solved"
    assert found.answer.program == "full"
    again = load(save(found, tmp_path / "heavy.h5"))
    assert again.problem.body == problem.body
    assert again.problem.hash == problem.hash
    assert "weights" not in Problem("plain").to_dict()["body"]
    # the bound 1/min(mu) holds for the centre of mass that the weights have
    assert found.efficiency < 1.0


def test_a_bound_knows_the_weights_or_refuses():
    heavy = Chain(weights=(0.4, 0.2, 0.4))
    budget = Budget(intervals=4, shapes=6, directions=12, rounds=2)
    plain, other = (efficiency_bound(body, Friction(), budget=budget) for body in (Chain(), heavy))
    assert abs(plain.sampled - other.sampled) > 1e-3
    numbers = np.array(other.coefficients)
    with pytest.raises(ProblemError, match="weights"):
        certify(Domain(heavy, Friction(), np.pi), other.potential_space(heavy), numbers, 0.6)


MASSES = (0.1, 0.3, 0.6)


def test_masses_that_are_the_weights_are_no_masses():
    said, unsaid = Chain(LENGTHS, weights=WEIGHTS, masses=WEIGHTS), Chain(LENGTHS, weights=WEIGHTS)
    assert said.largest_imbalance == unsaid.largest_imbalance == 0.0
    at = Friction(mu_t=2.0), *random_instants(30), 1e-4
    one, other = (body.motion(*at, body.solve(*at)) for body in (said, unsaid))
    for own, theirs in zip(one, other, strict=True):
        np.testing.assert_array_equal(own, theirs)


def test_a_body_with_masses_says_so_and_how_it_leans():
    body = Chain(masses=MASSES, inertias=(0.01, 0.0, 0.01))
    text = body.describe()
    assert not Chain(weights=(0.4, 0.4, 0.2)).symmetric
    assert not Chain(inertias=(0.01, 0.01, 0.02)).symmetric
    assert "of masses 0.1, 0.3, 0.6" in text
    assert "of moments of inertia 0.01, 0, 0.01" in text
    assert "beside the centre of mass" in text
    assert not body.symmetric
    angles = random_instants(20)[0]
    assert (body.imbalance(angles) <= body.largest_imbalance).all()
    assert body.imbalance(np.zeros((2, 1)))[0] == pytest.approx(0.5 / 3, rel=1e-12)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        *(({"lengths": (0.3, 0.3, 0.4 + off)}, "must add up to") for off in (1e-3, -1e-3, 1e-10)),
        *(({"weights": (0.5, 0.5, odd)}, r"body\.weights") for odd in (0.5, 0.0, "x", np.nan)),
        ({"weights": (1.0,)}, "one for each of the 3 links"),
        ({"weights": 3.0}, "sequence of numbers"),
        ({"masses": (0.5, 0.5)}, "one for each of the 3 links"),
        ({"masses": (0.5, 0.5, 0.5)}, "the body's mass 1"),
        ({"inertias": (0.1, -0.1, 0.1)}, "not negative"),
        ({"inertias": (0.1, 0.1)}, "one for each of the 3 links"),
    ],
)
def test_parts_that_cannot_be_are_refused_in_a_sentence(fields, said):
    with pytest.raises(ProblemError, match=said):
        Chain(**fields)
    assert Chain((0.1,) * 10).n_link == 10  # whose sum is 1 less a rounding
